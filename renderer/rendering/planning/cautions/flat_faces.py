"""All that is flat in a scene as triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import Disk, Mesh, Rectangle, Shape
from renderer.scene_file.transforms import mirrors

Floats = NDArray[np.float64]

_TURNS = 2.0 * np.pi * np.arange(24) / 24
_POLYGON = np.stack([np.cos(_TURNS), np.sin(_TURNS), 0 * _TURNS, 0 * _TURNS + 1], axis=1)
_FAN = np.array([[0, k, k + 1] for k in range(1, len(_POLYGON) - 1)])
_SQUARE = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]], float)
_HALVES = np.array([[0, 1, 2], [0, 2, 3]])
_BARYCENTRIC = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


class Faces(NamedTuple):
    """Triangles that have an area; a disk is a polygon of 24 corners."""

    corners: Floats  # (n, 3, 3)
    normal: Floats  # (n, 3) unit, on the side that the shape's description calls front
    turn: Floats  # (n,) -1 where the normal is opposite to (b - a) x (c - a)
    area: Floats  # (n,)
    place: Floats  # (n, 3, 2) of each corner in the texture; of a disk, local x and y
    owner: NDArray[np.int64]  # (n,) index of the shape


def flat_faces(shapes: tuple[Shape, ...]) -> Faces:
    """Return the rectangles, disks and meshes among some shapes."""
    corners, place, owner = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 2))], []
    front = np.ones(len(shapes))
    for index, shape in enumerate(shapes):
        if isinstance(shape, Rectangle | Disk):
            outline, faces = (
                (_SQUARE, _HALVES) if isinstance(shape, Rectangle) else (_POLYGON, _FAN)
            )
            corners.append((outline @ shape.to_world.T)[:, :3][faces])
            place.append(outline[:, :2][faces])
            front[index] = -1.0 if mirrors(shape.to_world) != shape.flip_normals else 1.0
        elif isinstance(shape, Mesh):
            faces = shape.faces
            corners.append(shape.vertices[faces].astype(np.float64))
            place.append(
                np.broadcast_to(_BARYCENTRIC, (len(faces), 3, 2))
                if shape.uvs is None
                else shape.uvs[faces].astype(np.float64)
            )
            front[index] = -1.0 if shape.flip_normals else 1.0
        else:
            continue
        owner += [index] * len(faces)
    every, of = np.concatenate(corners), np.array(owner, np.int64)
    normal = np.cross(every[:, 1] - every[:, 0], every[:, 2] - every[:, 0])
    length = np.linalg.norm(normal, axis=1)
    kept = (length > 0.0) & np.isfinite(length)
    normal = normal[kept] / length[kept, None] * front[of[kept], None]
    return Faces(
        every[kept],
        normal,
        front[of[kept]],
        length[kept] / 2.0,
        np.concatenate(place)[kept],
        of[kept],
    )
