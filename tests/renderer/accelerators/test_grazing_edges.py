"""Rays that graze the edges of a closed mesh from inside find it: no gaps between faces."""

from __future__ import annotations

import numpy as np
from kernel_probes import accelerator, closest, directions, triangles, unit


def octasphere(splits: int) -> np.ndarray:
    """Return the faces of a sphere-like convex mesh, (n, 3, 3), turned outward."""
    x, y, z = np.eye(3)
    faces = [(a * x, b * y, c * z) for a in (1, -1) for b in (1, -1) for c in (1, -1)]
    for _ in range(splits):
        halves = [(a, b, c, unit(a + b), unit(b + c), unit(c + a)) for a, b, c in faces]
        faces = [
            face
            for a, b, c, ab, bc, ca in halves
            for face in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ]
    mesh = np.array(faces)
    inward = np.linalg.det(mesh) < 0.0
    mesh[inward] = mesh[inward][:, [0, 2, 1]]
    return mesh


def test_rays_that_graze_an_edge_from_inside_find_no_gap():
    """In single precision u and v of a grazing ray are off by any amount.

    The rays start inside, aim at points of edges and make 1e-4 to 0.1 rad with the sphere.
    Each must meet something. Faces decided in double precision, each for itself, lose one
    in a thousand.
    """
    mesh = octasphere(3)  # 512 faces
    rng = np.random.default_rng(5)
    count = 40_000
    face, side = rng.integers(0, len(mesh), count), rng.integers(0, 3, count)
    a, b = mesh[face, side], mesh[face, (side + 1) % 3]
    target = a + (b - a) * rng.random((count, 1))
    up = unit(target)
    along = unit(np.cross(up, directions(count, rng)))
    direction = unit(along + up * 10.0 ** rng.uniform(-4.0, -1.0, (count, 1)))
    origin = target - direction * rng.uniform(0.002, 0.2, (count, 1))
    origin, direction = np.float32(origin), np.float32(direction)
    normal = unit(np.cross(mesh[:, 1] - mesh[:, 0], mesh[:, 2] - mesh[:, 0]))
    height = np.sum(normal * mesh[:, 0], axis=1)
    inside = (origin.astype(np.float64) @ normal.T - height).max(axis=1) < -1e-5
    assert inside.sum() > 2000  # the others start outside of this polyhedron
    found = closest(
        accelerator("triangles", triangles(mesh), "brute"),
        origin[inside],
        direction[inside],
    )
    assert (found.prim >= 0).all()
