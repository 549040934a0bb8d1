"""The meshes of the study of accelerators: each shows one way in which scenes differ.

A displaced ball (compact, evenly cut), the lecture's teapot (small, uneven), a soup of
random triangles (no order at all), a teapot in a stadium (one small detailed thing in
something huge) and a long street (walls along the axes). All but the teapot can be made
in any size; none holds a triangle without area.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.triangle_tables import TriangleSurfaces, triangles_of
from renderer.scene_file.meshes.ply_file import read_ply

Vector = tuple[float, float, float]

TEAPOT = Path(__file__).resolve().parents[2] / "scenes/appel-teapot/meshes/teapot.ply"
BALL_TRIANGLES = 5000  # of the ball in the stadium
SEED = 5
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])  # of a box
SIDES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)


class View(NamedTuple):
    """From where the camera and the light look at a mesh."""

    eye: Vector
    target: Vector
    up: Vector
    fov: float  # [degrees] across the wider side
    light: Vector


@dataclass(frozen=True, eq=False)
class StudyMesh:
    """A triangle mesh, and a view of it."""

    name: str
    vertices: NDArray[np.float32]  # (V, 3)
    faces: NDArray[np.int32]  # (F, 3)
    view: View

    @property
    def triangles(self) -> int:
        """How many there are."""
        return len(self.faces)


def triangle_surfaces(mesh: StudyMesh) -> TriangleSurfaces:
    """Return the mesh as accelerators are built over it; triangle k has the id k."""
    return surfaces_of(mesh.vertices, mesh.faces)


def surfaces_of(
    vertices: NDArray[np.float32], faces: NDArray[np.integer[Any]]
) -> TriangleSurfaces:
    """Return triangles of vertices (V, 3) and faces (F, 3); triangle k has the id k."""
    return triangles_of(vertices[faces])


# ----------------------------------------------------------------------- displaced ball


def displaced_icosphere(frequency: int) -> StudyMesh:
    """Return a ball with smooth bumps of 20 frequency^2 triangles.

    Each face of an icosahedron is cut into frequency^2 triangles; 2^k gives the
    20 * 4^k of repeated halving, and 128 the 327,680 of the project's trials.
    """
    corners, icosahedron = _icosahedron()
    steps = np.arange(frequency + 1)
    i, j = np.meshgrid(steps, steps, indexing="ij")
    i, j = i[i + j <= frequency], j[i + j <= frequency]
    weights = np.stack((frequency - i - j, i, j), axis=1) / frequency
    # the number of the vertex (i, j) of a face
    place = np.full((frequency + 1, frequency + 1), -1)
    place[i, j] = np.arange(len(i))
    a, b = np.nonzero(np.add.outer(steps[:-1], steps[:-1]) < frequency)
    upright = np.stack((place[a, b], place[a + 1, b], place[a, b + 1]), axis=1)
    inner = a + b < frequency - 1
    a, b = a[inner], b[inner]
    inverted = np.stack((place[a + 1, b], place[a + 1, b + 1], place[a, b + 1]), axis=1)
    cut = np.concatenate((upright, inverted))

    points, faces = [], []
    for number, face in enumerate(icosahedron):
        # The corners of a face in the order of their numbers: then two faces compute the
        # vertices of their common edge by the same sums, and the ball is closed.
        order = np.argsort(face)
        points.append(weights[:, order] @ corners[face])
        triangle = points[-1][place[[0, frequency, 0], [0, 0, frequency]]]
        inward = np.linalg.det(triangle) < 0.0
        faces.append((cut[:, ::-1] if inward else cut) + number * len(weights))
    p = np.concatenate(points)
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    return StudyMesh(
        "icosphere",
        _bumps(p),
        np.concatenate(faces).astype(np.int32),
        View((1.9, 1.3, 2.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 45.0, (-3.0, 4.0, 3.0)),
    )


def _icosahedron() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return 12 vertices and 20 faces."""
    g = (1.0 + 5.0**0.5) / 2.0
    flat = [(-1, g), (1, g), (-1, -g), (1, -g)]
    corners = np.array(
        [(x, y, 0) for x, y in flat]
        + [(0, x, y) for x, y in flat]
        + [(y, 0, x) for x, y in flat]
    )
    # faces are the triples of vertices at distance 2 from one another
    near = np.isclose(np.linalg.norm(corners[:, None] - corners[None], axis=2), 2.0)
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    return corners, np.array(faces)


def _bumps(p: NDArray[np.float64]) -> NDArray[np.float32]:
    """Move points of the unit sphere in and out by a sum of waves."""
    generator = np.random.default_rng(SEED)
    height = np.zeros(len(p))
    for octave in range(4):
        for _ in range(4):
            wave = generator.normal(size=3) * 2.0 * 2.0**octave
            phase = generator.uniform(0.0, 2.0 * np.pi)
            height += np.sin(p @ wave + phase) * 0.09 / 2.0**octave
    return (p * (1.0 + height)[:, None]).astype(np.float32)


# ------------------------------------------------------------------------- other meshes


def teapot(step: int = 1) -> StudyMesh:
    """Return the lecture's teapot: Newell's patches, 6320 triangles.

    Parameters
    ----------
    step
        Of the 11 x 11 points of each patch, every so many; 2 gives 1560 triangles.
    """
    data = read_ply(TEAPOT)
    vertices = np.ascontiguousarray(data.vertices, np.float32)
    faces: NDArray[Any] = data.faces
    if step > 1:
        k = np.arange(len(vertices)).reshape(-1, 11, 11)[:, ::step, ::step]
        a, b, c, d = k[:, :-1, :-1], k[:, :-1, 1:], k[:, 1:, 1:], k[:, 1:, :-1]
        faces = np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3)
        corners = vertices[faces].astype(np.float64)
        edges = corners[:, 1:] - corners[:, :1]
        faces = faces[np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) > 1e-9]
    return StudyMesh(
        "teapot",
        vertices,
        np.ascontiguousarray(faces, np.int32),
        # wide enough for the whole pot, spout and handle
        View((1.5, -8.0, 4.5), (0.2, 0.0, 1.3), (0.0, 0.0, 1.0), 45.0, (4.0, -6.0, 8.0)),
    )


def soup(count: int) -> StudyMesh:
    """Return `count` random triangles in a cube; the larger the number, the smaller."""
    generator = np.random.default_rng(count)
    corner = generator.uniform(-1.0, 1.0, (count, 1, 3))
    others = corner + generator.normal(size=(count, 2, 3)) * (3.0 / count**0.5)
    points = np.concatenate((corner, others), axis=1).astype(np.float32)
    return StudyMesh(
        "soup",
        points.reshape(-1, 3),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        View((1.5, 1.2, 3.5), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 45.0, (3.0, 4.0, 2.0)),
    )


def teapot_in_a_stadium(rings: int = 51, width: float = 1000.0) -> StudyMesh:
    """Return a ball of size 1 and a ground of two triangles of size `width`.

    The ball comes first and has 100 (rings - 1) triangles: 5000 by default.
    """
    around, half = 50, width / 2.0
    latitude = np.pi * np.arange(1, rings) / rings
    longitude = 2.0 * np.pi * np.arange(around) / around
    ring = np.stack((np.cos(longitude), np.sin(longitude)), axis=1)
    points = np.concatenate(
        [
            np.concatenate((np.sin(t) * ring, np.full((around, 1), np.cos(t))), axis=1)
            for t in latitude
        ]
        + [[(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]]
        + [[(-half, -half, -1.0), (half, -half, -1.0)]]
        + [[(half, half, -1.0), (-half, half, -1.0)]]
    )
    here = np.arange(around)
    after = (here + 1) % around
    north = len(latitude) * around
    last = north - around
    faces = [np.stack((np.full(around, north), here, after), axis=1)]
    for first in range(0, last, around):
        a, b = first + here, first + after
        c, d = b + around, a + around
        faces += [np.stack((a, d, c), axis=1), np.stack((a, c, b), axis=1)]
    faces.append(np.stack((np.full(around, north + 1), last + after, last + here), axis=1))
    ground = north + 2
    faces.append(ground + np.array([(0, 1, 2), (0, 2, 3)]))
    points[: north + 2] *= 0.5  # diameter 1
    points[north + 2 :, 2] = -0.5
    return StudyMesh(
        "stadium",
        points.astype(np.float32),
        np.concatenate(faces).astype(np.int32),
        View((1.2, -1.6, 0.9), (0.0, 0.0, -0.05), (0.0, 0.0, 1.0), 40.0, (3.0, -2.0, 5.0)),
    )


def street(boxes: int) -> StudyMesh:
    """Return two rows of houses: `boxes` boxes of 12 triangles, a ground of two."""
    generator = np.random.default_rng(boxes)
    house = np.arange(boxes)
    side = np.where(house % 2 == 0, -1.0, 1.0)
    low = np.stack((side * 3.0, np.zeros(boxes), (house // 2) * 2.0), axis=1)
    size = np.stack(
        (
            side * generator.uniform(1.5, 3.0, boxes),
            generator.uniform(2.0, 9.0, boxes),
            np.full(boxes, 2.0),  # wall to wall: faces that coincide
        ),
        axis=1,
    )
    cut = SIDES[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    points = low[:, None] + CORNERS * size[:, None]
    faces = (8 * house)[:, None, None] + cut
    length = float(low[-1, 2]) + 2.0
    ground = np.array([(x, 0.0, z) for x in (-8.0, 8.0) for z in (-4.0, length)])
    return StudyMesh(
        "street",
        np.concatenate((points.reshape(-1, 3), ground)).astype(np.float32),
        np.concatenate(
            (faces.reshape(-1, 3), 8 * boxes + np.array([(0, 1, 2), (1, 3, 2)]))
        ).astype(np.int32),
        View(
            # off the middle and not as high as wide, so that no hit lies on two planes
            (0.3, 2.6, -4.0),
            (0.0, 3.0, 20.0),
            (0.0, 1.0, 0.0),
            60.0,
            (0.0, 30.0, length / 2),
        ),
    )
