"""Watertight test near the edges of a triangle: no ray passes between two triangles.

The plane method (`flat.meet_plane`) rounds the edges of each triangle independently, so a
ray may be outside of both triangles that share an edge. Its result is used where u, v and w
exceed its rounding error. Nearer to an edge the vertices decide [Woop2013]. Each vertex is
projected along the ray in double precision: two components of (vertex - origin) x
direction. The ray is the origin of this plane. The sign of a.x b.y - a.y b.x tells on which
side of the edge from a to b the ray passes.

No ray is lost in a closed mesh whose triangles share vertices bit by bit:

- Everything that is rounded before the signs depends on the ray and one vertex alone. So
  all triangles that share a vertex project it to the same rounded point. The mesh of
  projected points is closed as well, and one of its triangles covers the origin.
- The sign of the difference of two rounded products is the exact sign or 0, since rounding
  is monotone. A triangle is hit unless two of its three signs differ. So 0 counts as inside
  on both sides of an edge, and can only add a hit.
- Where the plane method decides, the vertices would decide the same: their rounding error
  is 2^26 times smaller than the margin in the bound of the plane method.

The proof excludes rays that start nearer to the mesh than rounding, triangles 2^30 times
smaller than their distance, and meshes of size about 1e-16, where the bound underflows.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    fabs,
    maximum,
    minimum,
    select,
    to_double,
    to_single,
)
from renderer.kernels.lanes.vectors import cross, dot, vec3
from renderer.plugins.shapes.flat import ONE, ZERO, PlaneHit, in_double

# Bound of the error of u, v and w of `flat.meet_plane`, times its scale: 14 units of 2^-24
# times |d| Q sqrt(|s|^2 + Q^2). s leads from the origin to the corner, and
# Q^2 = |edge1|^2 + |edge2|^2. To first order [Higham2002, section 3.1], s and the edges are
# rounded once, each component of s x d three times, and a product with it four times more.
# So U = edge2 . (s x d) has the error 7 |edge2| . A(s, d), where A(a, b) has the components
# |a_j b_k| + |a_k b_j|; likewise V. S = n . d has 6 A(edge1, edge2) . |d|, and
# W = S - (U + V) has all of these, |U| and |V|. For three vectors |a| . A(b, c) is at most
# 2 / sqrt(3) times the product of their lengths.
_OFF = (14.0 * 2.0**-24) ** 2
# A larger bound that is cheaper: sums of absolute components, with triangle inequalities.
_WIDE = np.float32(15.0 * 2.0**-24)


class _Seen(NamedTuple):
    """A vertex projected along the ray, in double precision."""

    x: Any
    y: Any
    depth: Any  # position along the ray, times the direction's largest component


@kernel
def edge_margin(triangle, origin, direction):
    """Return an upper bound of the error margin of `in_doubt`, times the scale."""
    o, d = origin, direction
    along = _WIDE * (fabs(d.x) + fabs(d.y) + fabs(d.z))
    away = fabs(o.x) + fabs(o.y) + fabs(o.z)
    return along * (away * triangle.size + triangle.slack)


@kernel
def in_doubt(triangle, origin, direction, depth):
    """Return the mask where rounding may decide on which side of an edge a ray passes.

    `depth` is the minimum of u, v and w, times the scale.
    """
    s, d = in_double(triangle.corner) - in_double(origin), in_double(direction)
    edge1, edge2 = in_double(triangle.edge1), in_double(triangle.edge2)
    square = dot(edge1, edge1) + dot(edge2, edge2)
    near = to_double(depth)
    return near * near < dot(d, d) * square * (dot(s, s) + square) * _OFF


@kernel
def meet_by_vertices(triangle, origin, direction, doubtful, otherwise):
    """Return a `PlaneHit` decided by the signs at the three edges, where `doubtful`.

    Its scale is 1 for a hit and 0 for a miss. t is the mean of the vertices' distances,
    weighted by the signed areas, so it lies between them.
    """
    d, start = in_double(direction), in_double(origin)
    axis = _largest(d)
    p = _seen(in_double(triangle.corner) - start, d, axis)
    q = _seen(in_double(triangle.second) - start, d, axis)
    r = _seen(in_double(triangle.third) - start, d, axis)
    of_b = r.x * p.y - r.y * p.x
    of_c = p.x * q.y - p.y * q.x
    of_a = q.x * r.y - q.y * r.x
    least = minimum(minimum(of_a, of_b), of_c)
    most = maximum(maximum(of_a, of_b), of_c)
    whole = of_a + of_b + of_c
    n = in_double(triangle.normal)
    area = dot(n, n) + 0.0 * whole  # in lanes of the rays; 0: the triangle is degenerate
    hit = ((least >= 0.0) | (most <= 0.0)) & (area > 0.0)
    t = (of_a * p.depth + of_b * q.depth + of_c * r.depth) / (whole * dot(d, axis))
    u, v = to_single(of_b / whole), to_single(of_c / whole)
    return PlaneHit(
        select(doubtful & hit, ONE, select(doubtful, ZERO, otherwise.scale)),
        select(doubtful, to_single(t), otherwise.t),
        select(doubtful, u, otherwise.u),
        select(doubtful, minimum(v, ONE - u), otherwise.v),
    )


@kernel
def _largest(d):
    """Return the unit vector along the axis of the largest component."""
    x, y, z = fabs(d.x), fabs(d.y), fabs(d.z)
    zero = x * 0.0
    one = zero + 1.0
    along_x = select((x >= y) & (x >= z), one, zero)
    along_y = select(y >= z, one, zero) * (one - along_x)
    return vec3(along_x, along_y, one - along_x - along_y)


@kernel
def _seen(vertex, d, axis):
    """Project a vertex, given relative to the origin: (vertex x d) without `axis`.

    The components are selected by products with 0 and 1, which are exact.
    """
    m = cross(vertex, d)
    return _Seen(
        m.y * axis.x + m.z * axis.y + m.x * axis.z,
        m.z * axis.x + m.x * axis.y + m.y * axis.z,
        dot(vertex, axis),
    )
