"""The slab: the space between two parallel planes, and what is left of a ray in it.

A convex volume is an intersection of slabs [Kay1986]: a ray's interval [enter, leave] is
cut by one after the other, and the ray meets the volume if something is left. Vectors are
of scalars (one ray) or lanes (16 rays).
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, select
from renderer.plugins.shapes.extents import ROUNDING

# A Python literal would make scalars float64.
ONE = np.float32(1.0)
ZERO = np.float32(0.0)
# A displacement by 1 along each axis is this far (rounded up) in any direction.
DIAGONAL = np.float32(1.7320509)


@kernel
def ray_interval(origin, direction, t_max):
    """Return (enter, leave, margin) of rays before any slab: 0, t_max, and a width.

    Volumes are tested as if larger by `margin` along each axis, for the rounding of the
    test and of the hits of what is inside. A ray that has no answer (NaN, infinity,
    direction 0, or coordinates whose sum overflows) has an empty interval, which no slab
    fills again: 0 * inf is NaN, and `clip_to_slab` keeps NaN.
    """
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    size = fabs(direction.x) + fabs(direction.y) + fabs(direction.z)
    sound = (size > ZERO) & (size < np.float32(np.inf))
    return far * ZERO, select(sound, t_max, -ONE), far * ROUNDING


@kernel
def clip_to_slab(t0, t1, enter, leave):
    """Return the part of [enter, leave] between the distances t0 and t1 of two planes.

    A ray in one of the planes gives 0 * inf = NaN. Each distance is compared with the
    running bound before the two are compared with each other, and NaN loses: such a ray
    is inside.
    """
    early0 = select(t0 > enter, t0, enter)
    early1 = select(t1 > enter, t1, enter)
    late0 = select(t0 < leave, t0, leave)
    late1 = select(t1 < leave, t1, leave)
    return (
        select(early0 < early1, early0, early1),
        select(late0 > late1, late0, late1),
    )
