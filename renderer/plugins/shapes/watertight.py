"""Near the edges of a triangle: decided so that no ray passes between two triangles.

The plane method (`flat.meet_plane`) rounds the edges of each triangle for themselves, so
that a ray may be outside of both neighbours of an edge. It decides alone where u, v and w
are larger than its rounding. Nearer to an edge the vertices decide [Woop2013]. Each vertex
is seen from the ray, in double precision: two components of (vertex - origin) x direction,
in whose plane the ray is the point 0. The sign of a.x b.y - a.y b.x says on which side of
the edge from a to b that is.

No ray is lost in a closed mesh whose triangles share vertices bit by bit:

- What is rounded before the signs hangs on the ray and one vertex alone. So all triangles
  of a vertex see it at the same rounded point: the mesh of these points is closed as well,
  and one of its triangles covers the point 0.
- The sign of the difference of two rounded products is that of the exact ones, or 0, since
  rounding never turns around an order. A triangle is hit unless two of its three signs
  differ; so 0 counts as inside on both sides of an edge, and can only add a hit.
- Where the plane method decides, the vertices would say the same: their rounding is 2^26
  times smaller than what the bound of its own has to spare.

Not included are rays that start nearer to the mesh than rounding, triangles 2^30 times
smaller than their distance, and meshes of about 1e-16, where the bound leaves float32.
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

# By how much u, v and w of `flat.meet_plane`, times its scale, may be off: 14 units of
# 2^-24 times |d| Q sqrt(|s|^2 + Q^2), where s leads from the origin to the corner and
# Q^2 = |edge1|^2 + |edge2|^2. From the steps, to first order [Higham2002, section 3.1]: s
# and the edges are rounded once, each component of s x d three times, a product with it
# four times more. So U = edge2 . (s x d) has 7 |edge2| . A(s, d), where A(a, b) has the
# components |a_j b_k| + |a_k b_j|; likewise V. S = n . d has 6 A(edge1, edge2) . |d|, and
# W = S - (U + V) all of these, |U| and |V|. Of three vectors |a| . A(b, c) is at most
# 2 / sqrt(3) times the product of their lengths.
_OFF = (14.0 * 2.0**-24) ** 2
# A wider bound takes fewer steps: sums of absolute components, with triangle inequalities.
_WIDE = np.float32(15.0 * 2.0**-24)


class _Seen(NamedTuple):
    """A vertex as it is seen along the ray, in double precision."""

    x: Any
    y: Any
    depth: Any  # along the ray, times the direction's largest component


@kernel
def edge_margin(triangle, origin, direction):
    """Return a number that is never less than the bound of `in_doubt`, times the scale."""
    o, d = origin, direction
    along = _WIDE * (fabs(d.x) + fabs(d.y) + fabs(d.z))
    away = fabs(o.x) + fabs(o.y) + fabs(o.z)
    return along * (away * triangle.size + triangle.slack)


@kernel
def in_doubt(triangle, origin, direction, depth):
    """Return where rounding may decide on which side of an edge a ray passes.

    `depth` is the least of u, v and w, times the scale.
    """
    s, d = in_double(triangle.corner) - in_double(origin), in_double(direction)
    edge1, edge2 = in_double(triangle.edge1), in_double(triangle.edge2)
    square = dot(edge1, edge1) + dot(edge2, edge2)
    near = to_double(depth)
    return near * near < dot(d, d) * square * (dot(s, s) + square) * _OFF


@kernel
def meet_by_vertices(triangle, origin, direction, doubtful, otherwise):
    """Return a `PlaneHit` decided by the signs at the three edges, where `doubtful`.

    Its scale is 1 for a hit and 0 for none. t is the mean of the vertices' distances,
    weighted by the areas behind the signs, so that it is between them.
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
    area = dot(n, n) + 0.0 * whole  # of each ray; 0: what is left of it is rounding
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
    """Return a vertex, given relative to the origin: (vertex x d) without the axis.

    The other components are multiplied by 0 and 1, which is exact.
    """
    m = cross(vertex, d)
    return _Seen(
        m.y * axis.x + m.z * axis.y + m.x * axis.z,
        m.z * axis.x + m.x * axis.y + m.y * axis.z,
        dot(vertex, axis),
    )
