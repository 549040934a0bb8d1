"""Newell's teapot: 32 bicubic Bezier patches, and their triangles.

Martin Newell measured it in 1975; the numbers below are his, with the bottom that was
added later. z is up, the spout points along +x.

Most of it is round. Newell made a quarter of each circle with one cubic, whose inner
control points lie 0.56 r off the axes (0.5523 r would fit a circle best), so a round part
needs no more than its outline: the radius r, that offset, and z of four control points.
Handle and spout are given as one half (y <= 0), the other half is its mirror image.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# (radius, offset of the circle's inner control points, z), from top to bottom, but the
# bottom from its middle outwards. The knob's offset is 0.45 where 0.56 x 0.8 is 0.448.
ROUND_PARTS = {
    "rim": (
        (1.4, 0.784, 2.4), (1.3375, 0.749, 2.53125),
        (1.4375, 0.805, 2.53125), (1.5, 0.84, 2.4),
    ),
    "upper body": (
        (1.5, 0.84, 2.4), (1.75, 0.98, 1.875), (2.0, 1.12, 1.35), (2.0, 1.12, 0.9),
    ),
    "lower body": (
        (2.0, 1.12, 0.9), (2.0, 1.12, 0.45), (1.5, 0.84, 0.225), (1.5, 0.84, 0.15),
    ),
    "knob": (
        (0.0, 0.0, 3.15), (0.8, 0.45, 3.15), (0.0, 0.0, 2.85), (0.2, 0.112, 2.7),
    ),
    "lid": (
        (0.2, 0.112, 2.7), (0.4, 0.224, 2.55), (1.3, 0.728, 2.55), (1.3, 0.728, 2.4),
    ),
    "bottom": (
        (0.0, 0.0, 0.0), (1.425, 0.798, 0.0), (1.5, 0.84, 0.075), (1.5, 0.84, 0.15),
    ),
}  # fmt: skip

# 4 x 4 control points each, row after row; the rows run across, from y = 0 to y = 0.
HALF_PARTS = {
    "upper handle": (
        ((-1.6, 0, 2.025), (-1.6, -0.3, 2.025), (-1.5, -0.3, 2.25), (-1.5, 0, 2.25)),
        ((-2.3, 0, 2.025), (-2.3, -0.3, 2.025), (-2.5, -0.3, 2.25), (-2.5, 0, 2.25)),
        ((-2.7, 0, 2.025), (-2.7, -0.3, 2.025), (-3.0, -0.3, 2.25), (-3.0, 0, 2.25)),
        ((-2.7, 0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0, 1.8)),
    ),
    "lower handle": (
        ((-2.7, 0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0, 1.8)),
        ((-2.7, 0, 1.575), (-2.7, -0.3, 1.575), (-3.0, -0.3, 1.35), (-3.0, 0, 1.35)),
        ((-2.5, 0, 1.125), (-2.5, -0.3, 1.125), (-2.65, -0.3, 0.9375), (-2.65, 0, 0.9375)),
        ((-2.0, 0, 0.9), (-2.0, -0.3, 0.9), (-1.9, -0.3, 0.6), (-1.9, 0, 0.6)),
    ),
    "lower spout": (
        ((1.7, 0, 1.425), (1.7, -0.66, 1.425), (1.7, -0.66, 0.6), (1.7, 0, 0.6)),
        ((2.6, 0, 1.425), (2.6, -0.66, 1.425), (3.1, -0.66, 0.825), (3.1, 0, 0.825)),
        ((2.3, 0, 2.1), (2.3, -0.25, 2.1), (2.4, -0.25, 2.025), (2.4, 0, 2.025)),
        ((2.7, 0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0, 2.4)),
    ),
    "upper spout": (
        ((2.7, 0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0, 2.4)),
        (
            (2.8, 0, 2.475),
            (2.8, -0.25, 2.475),
            (3.525, -0.25, 2.49375),
            (3.525, 0, 2.49375),
        ),
        ((2.9, 0, 2.475), (2.9, -0.15, 2.475), (3.45, -0.15, 2.5125), (3.45, 0, 2.5125)),
        ((2.8, 0, 2.4), (2.8, -0.15, 2.4), (3.2, -0.15, 2.4), (3.2, 0, 2.4)),
    ),
}


def teapot_patches() -> NDArray[np.float64]:
    """Return the control points, (32, 4, 4, 3): [patch, along v, along u, xyz].

    The order of u and v is such that the cross product of the derivatives along u and v
    points out of the pot.
    """
    patches = []
    for name, profile in ROUND_PARTS.items():
        quarter = np.array(
            [[(r, 0, z), (r, -k, z), (k, -r, z), (0, -r, z)] for r, k, z in profile]
        )
        if name == "bottom":  # its outline runs the other way, outwards
            quarter = quarter[:, ::-1]
        for _ in range(4):
            patches.append(quarter)
            quarter = quarter @ np.array(
                [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
            )
    for rows in HALF_PARTS.values():
        half = np.array(rows, dtype=np.float64)
        patches += [half, half[:, ::-1] * (1.0, -1.0, 1.0)]
    return np.stack(patches)


def bernstein(t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the four cubic Bernstein polynomials and their derivatives at t (N, 4)."""
    s = 1.0 - t
    values = np.stack((s**3, 3 * s**2 * t, 3 * s * t**2, t**3), axis=-1)
    quadratic = np.stack((s**2, 2 * s * t, t**2), axis=-1)
    zero = np.zeros((*t.shape, 1))
    before = np.concatenate((zero, quadratic), axis=-1)
    after = np.concatenate((quadratic, zero), axis=-1)
    return values, 3.0 * (before - after)


def evaluate_patch(
    patch: NDArray[np.float64], parameters: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Evaluate one patch on the grid `parameters` x `parameters`.

    Parameters
    ----------
    patch
        (4, 4, 3) control points.
    parameters
        (N,) in [0, 1].

    Returns
    -------
    points, normals
        (N, N, 3), [v, u]; the normals are unit vectors from the analytic derivatives.
    """
    b, db = bernstein(parameters)

    def surface(
        along_v: NDArray[np.float64], along_u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.einsum("vi,uj,ijx->vux", along_v, along_u, patch)

    du, dv = surface(b, db), surface(db, b)
    normals = np.cross(du, dv)
    # At a pole one whole edge is a point and du is 0 there. Close to it du is about
    # v times the mixed derivative, which has the direction that du itself lost.
    at_pole = np.linalg.norm(du, axis=-1) < 1e-9
    normals[at_pole] = np.cross(surface(db, db), dv)[at_pole]
    return surface(b, b), normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def teapot_mesh(
    divisions: int = 10,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Cut each patch into `divisions` x `divisions` quads of two triangles.

    Returns
    -------
    vertices, normals
        (32 (divisions + 1)^2, 3).
    faces
        (F, 3), counter-clockwise seen from outside, less the triangles without area at
        the tips of knob and bottom. 10 divisions give 6400 - 80 = 6320.
    """
    n = divisions + 1
    parameters = np.linspace(0.0, 1.0, n)
    surfaces = [evaluate_patch(patch, parameters) for patch in teapot_patches()]
    vertices = np.concatenate([points.reshape(-1, 3) for points, _ in surfaces])
    normals = np.concatenate([normal.reshape(-1, 3) for _, normal in surfaces])

    corner = np.arange(n * n).reshape(n, n)
    a, b = corner[:-1, :-1], corner[:-1, 1:]  # u runs to the right, v down
    d, c = corner[1:, :-1], corner[1:, 1:]
    quads = np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3)
    faces = np.concatenate([quads + k * n * n for k in range(len(surfaces))])
    e1, e2 = (vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2))
    return vertices, normals, faces[np.linalg.norm(np.cross(e1, e2), axis=1) > 1e-12]
