"""Where a ray is inside of a structure of cells, and which rays it is not made for.

Cells hold primitives by boxes that are grown by `Extents.pad`, which covers the rounding of
rays that start within `Extents.reach`. Rays from farther away test every primitive.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs

_INFINITY = np.float32(np.inf)


@kernel
def starts_beyond(reach, origin):
    """Return whether a ray starts so far away that its rounding may exceed the pad.

    A ray from infinity or NaN does not: it hits nothing, whatever it tests.
    """
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    return reach < far < _INFINITY


@kernel
def interval_in_box(bounds, origin, inverse, t_max):
    """Return (enter, leave) of a ray in a box, within 0 to t_max.

    There is no such part unless enter <= leave. 0 * inf = NaN, of an axis-parallel ray in a
    face of the box, counts as inside.
    """
    enter, leave = _within(
        bounds[0], bounds[3], origin.x, inverse.x, np.float32(0.0), t_max
    )
    enter, leave = _within(bounds[1], bounds[4], origin.y, inverse.y, enter, leave)
    return _within(bounds[2], bounds[5], origin.z, inverse.z, enter, leave)


@kernel
def _within(low, high, start, inverse, enter, leave):
    """Return the part of an interval between two planes."""
    a = (low - start) * inverse
    b = (high - start) * inverse
    if inverse < 0.0:
        a, b = b, a
    return (a if a > enter else enter), (b if b < leave else leave)


@kernel
def is_finite_ray(origin, direction):
    """Return whether no component is NaN or infinite; of one ray or 16."""
    zero = np.float32(0.0)
    nothing = (origin.x + origin.y + origin.z) * zero
    return nothing + (direction.x + direction.y + direction.z) * zero == zero
