"""Which triangles a ray meets whatever the rounding of the test, and which it may miss.

The test (`renderer.plugins.shapes.flat.meet_plane`) is in float32: unit roundoff
u = 2^-24, no fused multiply-add. With the corner c, the edges e1 and e2, the normal
n = e1 x e2 and s = c - o it takes U = e2 . (s x d), V = -e1 . (s x d), S = n . d,
W = S - (U + V) and T = n . s, turns all signs by that of S, and reports a hit where none of
them is negative. U = 0 is the line of one edge, seen along the ray, which passes it at a
distance of U / (|d| times the edge's length in that projection).

The error of each, to first order [Higham2002, section 3.1], where A(a, b) has the
components |a_j b_k| + |a_k b_j|:

- s and the edges are rounded once from exact differences: u of each component;
- s x d: u from s, one product, one difference: 3 u A(s, d);
- e2 . (s x d): u from e2, one product, two sums: 4 u more. In all 7 u |e2| . A(s, d), for
  V with e1;
- n, from rounded edges in double precision and rounded: 3 u A(e1, e2). S adds a product and
  two sums: 6 u A(e1, e2) . |d|. T has the u of s as well: 7 u A(e1, e2) . |s|;
- W: the errors of U, V and S, and u (|U| + |V|) of their sum. The last difference rounds,
  but keeps its sign.

Grazing rays are decided again in double precision, with less error than that. So a ray
whose U, V, W, S and T are all larger than their bounds *is* a hit, and one with one of them
below the negative bound is none. The bounds hang on mesh and ray: as a distance from the
edge that of U is about 1e-6 of how far away the edge is where it is seen from the side,
more where it is seen from its end, and it does not grow with the size of coordinates.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import entry_kernel, kernel
from reports.trials.soaking.closed_meshes import ClosedMesh

# of float32; terms of second order and the double precision here are far below 2^-16
UNIT = 2.0**-24 * (1.0 + 2.0**-16)
NOWHERE = -np.inf  # no triangle is near the line of the ray
SMALLEST = 1e-300  # so that nothing is divided by 0

Floats = NDArray[np.float64]


@functools.cache
def _triangles(mesh: ClosedMesh) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return corner, both edges and centre (3, n), and the square of the radius around it.

    Twice that of the ball that holds a triangle: the line of a ray that comes no nearer
    than this meets it for certain not, however it is rounded.
    """
    p = mesh.vertices[mesh.faces].astype(float)  # (F, 3 vertices, 3)
    centre = p.mean(axis=1)
    square = 4.0 * ((p - centre[:, None]) ** 2).sum(axis=2).max(axis=1)
    rows = (p[:, 0], p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], centre)
    corner, edge1, edge2, centre = (np.ascontiguousarray(a.T) for a in rows)
    return corner, edge1, edge2, centre, square


def certainty(mesh: ClosedMesh, origin: Floats, direction: Floats) -> Floats:
    """Return for each ray how certainly it meets the triangle that it meets best.

    Parameters
    ----------
    mesh
        Its vertices are exact.
    origin, direction
        (n, 3), exact: the float32 numbers that were traced.

    Returns
    -------
    ndarray
        (n,) the least of U, V, W, S and T over its bound, of the triangle where that is
        largest. Above 1: a triangle is met, however it is rounded; -1 to 1: rounding
        decides; below: none can be met.
    """
    result = np.empty(len(origin))
    best_certainty(*_triangles(mesh), origin, direction, result)
    return result


@entry_kernel
def best_certainty(corner, edge1, edge2, centre, square, origin, direction, result):  # type: ignore[no-untyped-def]
    """Fill `result`; the test that most triangles fail comes first, and is cheap."""
    for i in range(len(result)):
        ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        inverse = 1.0 / (dx * dx + dy * dy + dz * dz)
        best = NOWHERE
        for k in range(len(square)):
            x, y, z = centre[0, k] - ox, centre[1, k] - oy, centre[2, k] - oz
            along = x * dx + y * dy + z * dz
            if x * x + y * y + z * z - along * along * inverse > square[k]:
                continue
            s = (corner[0, k] - ox, corner[1, k] - oy, corner[2, k] - oz)
            e1 = (edge1[0, k], edge1[1, k], edge1[2, k])
            e2 = (edge2[0, k], edge2[1, k], edge2[2, k])
            best = max(best, _certainty(s, e1, e2, (dx, dy, dz)))
        result[i] = best


@kernel
def _certainty(s, e1, e2, d):  # type: ignore[no-untyped-def]
    r, a = _cross(s, d), _cross_of_sizes(s, d)
    n, b = _cross(e1, e2), _cross_of_sizes(e1, e2)
    u, v = _dot(e2, r), -_dot(e1, r)
    slope, t = _dot(n, d), _dot(n, s)
    w = slope - (u + v)
    u_error, v_error = 7.0 * UNIT * _sizes(e2, a), 7.0 * UNIT * _sizes(e1, a)
    slope_error, t_error = 6.0 * UNIT * _sizes(d, b), 7.0 * UNIT * _sizes(s, b)
    w_error = u_error + v_error + slope_error + UNIT * (abs(u) + abs(v))
    u, v, w = u / u_error, v / v_error, w / w_error
    slope, t = slope / slope_error, t / t_error
    # where rounding may turn the sign of the slope, all signs may turn
    front = min(min(min(u, v), min(w, t)), slope)
    back = min(min(min(-u, -v), min(-w, -t)), -slope)
    return max(front, back)


@kernel
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _sizes(a, b):  # type: ignore[no-untyped-def]
    """Return |a| . b of a vector b that has no negative component."""
    return abs(a[0]) * b[0] + abs(a[1]) * b[1] + abs(a[2]) * b[2] + SMALLEST


@kernel
def _cross(a, b):  # type: ignore[no-untyped-def]
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def _cross_of_sizes(a, b):  # type: ignore[no-untyped-def]
    return (
        abs(a[1] * b[2]) + abs(a[2] * b[1]),
        abs(a[2] * b[0]) + abs(a[0] * b[2]),
        abs(a[0] * b[1]) + abs(a[1] * b[0]),
    )
