"""Points all over the surfaces of a scene, as many for equal areas."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.planning.cautions.flat_faces import Floats, flat_faces
from renderer.scene_file.description import Shape, Sphere

# of the two-dimensional sequence that goes on from the golden ratio
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])


class SurfacePoints(NamedTuple):
    """Points with the normals that their shapes' descriptions call front."""

    position: Floats  # (n, 3)
    normal: Floats  # (n, 3) unit
    owner: NDArray[np.int64]  # (n,) index of the shape


def surface_points(shapes: tuple[Shape, ...], count: int) -> SurfacePoints:
    """Return `count` points on the flat shapes and the spheres among some shapes."""
    faces = flat_faces(shapes)
    spheres = {k: shape for k, shape in enumerate(shapes) if isinstance(shape, Sphere)}
    radii = [float(np.linalg.norm(s.to_world[:3, 0])) for s in spheres.values()]
    reached = np.cumsum([*faces.area, *(4.0 * np.pi * r**2 for r in radii)])
    if not len(reached) or not 0.0 < reached[-1] < np.inf:
        return SurfacePoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64))
    chosen = np.searchsorted(reached, (np.arange(count) + 0.5) / count * reached[-1])
    u, v = (np.outer(_STEPS, np.arange(1, count + 1)) % 1.0)[:, :, None]
    flat = chosen < len(faces.area)
    position, normal = np.zeros((count, 3)), np.zeros((count, 3))
    face, root = chosen[flat], np.sqrt(u[flat])
    a, b, c = np.moveaxis(faces.corners[face], 1, 0)
    position[flat] = a + root * (1.0 - v[flat]) * (b - a) + root * v[flat] * (c - a)
    normal[flat] = faces.normal[face]
    z, turn = 1.0 - 2.0 * u[:, 0], 2.0 * np.pi * v[:, 0]
    across = np.sqrt(1.0 - z * z)
    on_ball = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    owner = np.append(faces.owner, np.array([*spheres], np.int64))[chosen]
    for (k, shape), radius in zip(spheres.items(), radii, strict=True):
        here = owner == k
        away = on_ball[here] @ shape.to_world[:3, :3].T
        position[here] = shape.to_world[:3, 3] + away
        normal[here] = away / radius * (-1.0 if shape.flip_normals else 1.0)
    return SurfacePoints(position, normal, owner)
