"""Bounding volumes and their ray tests: sphere, box, slabs of any orientation.

The primitives in a volume are tested only against rays that hit the volume. The sphere has
the fastest test (one root and no division) but is mostly too large. The axis-aligned box is
six numbers and often too large. A slab is the space between two parallel planes, and a
convex volume is an intersection of slabs [Kay1986]: each slab clips the ray's interval
[enter, leave], and the ray hits the volume if the interval is not empty. Three slabs along
the object's own axes are an oriented box; slabs of fixed orientations are a k-DOP
[Klosowski1998].

Tests enlarge volumes by a margin, for the rounding of the test and of the hits of the
contents. Vectors are of scalars (one ray) or lanes (16 rays). `volume_fits.py` fits volumes
to points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import entry_kernel, interface, kernel
from renderer.kernels.lanes.functions import fabs, first_lanes, select, splat_i32, sqrt
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import column, dot, load3
from renderer.plugins.shapes.extents import ROUNDING

# Not literals, which would make scalars float64.
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)
# Length of a displacement by 1 along each axis, rounded up.
DIAGONAL = np.float32(1.7320509)


class BoundingSphere(NamedTuple):
    """All points within a distance of a centre."""

    center: NDArray[np.float32]  # (3, 1)
    radius: NDArray[np.float32]  # (1,)


class Aabb(NamedTuple):
    """Axis-aligned bounding box: two opposite corners."""

    lower: NDArray[np.float32]  # (3,)
    upper: NDArray[np.float32]  # (3,)


class Slabs(NamedTuple):
    """All x with lower <= normal . x <= upper for each of s slabs."""

    normal: NDArray[np.float32]  # (3, s) not always of unit length
    lower: NDArray[np.float32]  # (s,)
    upper: NDArray[np.float32]  # (s,)
    spread: NDArray[np.float32]  # (s,) |n_x| + |n_y| + |n_z|: scales the margin


@interface
def hits_volume(volume, origin, direction, t_max):
    """Return whether rays with unit directions hit a volume at 0 <= t <= t_max."""


@kernel
def _ray_interval(origin, direction, t_max):
    """Return (enter, leave, margin) of rays before any slab: 0, t_max, and a length.

    An invalid ray (NaN, infinity, direction 0, or coordinates whose sum overflows) has an
    empty interval. Slabs keep it empty, as 0 * inf is NaN and `_clip_to_slab` keeps NaN.
    """
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    size = fabs(direction.x) + fabs(direction.y) + fabs(direction.z)
    sound = (size > _ZERO) & (size < np.float32(np.inf))
    return far * _ZERO, select(sound, t_max, -_ONE), far * ROUNDING


@kernel
def _clip_to_slab(t0, t1, enter, leave):
    """Return the part of [enter, leave] between the distances t0 and t1 of two planes.

    A ray in one of the planes gives 0 * inf = NaN. Each distance is first compared with the
    running bound, and NaN loses each comparison. So such a ray counts as inside.
    """
    early0 = select(t0 > enter, t0, enter)
    early1 = select(t1 > enter, t1, enter)
    late0 = select(t0 < leave, t0, leave)
    late1 = select(t1 < leave, t1, leave)
    enter = select(early0 < early1, early0, early1)
    return enter, select(late0 > late1, late0, late1)


@hits_volume.by(BoundingSphere)
@kernel
def _hits_sphere(sphere, origin, direction, t_max):
    """Test a sphere.

    The distance of the line from the centre is computed from the difference vector, not
    from b^2 - a c, which cancels for a distant ray [Haines2019].
    """
    enter, leave, margin = _ray_interval(origin, direction, t_max)
    radius = sphere.radius[0] + margin * DIAGONAL
    to_center = column(sphere.center, 0) - origin
    along = dot(to_center, direction)
    across = to_center - direction * along
    gap = radius * radius - dot(across, across)
    half_chord = sqrt(select(gap > _ZERO, gap, gap * _ZERO))
    return (gap >= _ZERO) & (along + half_chord >= enter) & (along - half_chord <= leave)


@hits_volume.by(Aabb)
@kernel
def _hits_aabb(box, origin, direction, t_max):
    """Test an axis-aligned box: three slabs, without products except with 1 / d."""
    enter, leave, margin = _ray_interval(origin, direction, t_max)
    x, y, z = _ONE / direction.x, _ONE / direction.y, _ONE / direction.z
    x0 = (box.lower[0] - margin - origin.x) * x
    x1 = (box.upper[0] + margin - origin.x) * x
    y0 = (box.lower[1] - margin - origin.y) * y
    y1 = (box.upper[1] + margin - origin.y) * y
    z0 = (box.lower[2] - margin - origin.z) * z
    z1 = (box.upper[2] + margin - origin.z) * z
    enter, leave = _clip_to_slab(x0, x1, enter, leave)
    enter, leave = _clip_to_slab(y0, y1, enter, leave)
    enter, leave = _clip_to_slab(z0, z1, enter, leave)
    return enter <= leave


@hits_volume.by(Slabs)
@kernel
def _hits_slabs(slabs, origin, direction, t_max):
    """Test an intersection of slabs.

    In a hierarchy of k-DOPs the two inner products and the division are done once per ray,
    since all volumes have the same normals [Kay1986]. Here they are part of the test.
    """
    enter, leave, margin = _ray_interval(origin, direction, t_max)
    for k in range(slabs.normal.shape[1]):
        normal = column(slabs.normal, k)
        start = dot(normal, origin)
        inverse = _ONE / dot(normal, direction)
        wide = margin * slabs.spread[k]
        t0 = (slabs.lower[k] - wide - start) * inverse
        t1 = (slabs.upper[k] + wide - start) * inverse
        enter, leave = _clip_to_slab(t0, t1, enter, leave)
    return enter <= leave


@entry_kernel
def which_hit(volume, origin, direction, t_max, count, found):
    """Set `found` (n,) to 1 for those of the first `count` rays that hit a volume, else 0.

    Origins and directions are (3, n); all arrays are padded by 16 rays.
    """
    for i in range(0, count, 16):
        t = load_row(t_max, 0, i)
        hit = hits_volume(volume, load3(origin, i), load3(direction, i), t)
        hit = hit & first_lanes(count - i)
        store_row(found, 0, i, select(hit, splat_i32(1), splat_i32(0)))
