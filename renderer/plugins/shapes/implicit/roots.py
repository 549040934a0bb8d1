"""The first root of g along a ray, without missed or false roots.

[Mitchell1990]: an interval of t on which g cannot be 0 is left out. An interval on which
the derivative cannot be 0 has at most one root, and has it if g changes its sign. Any other
is halved. Two bounds show that g cannot be 0: its values on the interval, and the value in
the middle plus slopes times half the width, which is much tighter near a root. Intervals
are visited from the near end on, so the first root found is the first.

How far this holds. For g in double precision along the ray as it is given, every interval
is rounded outwards (`intervals`), so no root is missed. What is still undecided when an
interval is 2^-42 of the ray's length wide counts as a root: there |g| is within rounding of
0, which is a surface that the ray touches. It may in truth be missed by some 1e-13. Where
g is unbounded even there, it is a pole and no root.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel, never_inline
from renderer.kernels.lanes.local import local_f64
from renderer.plugins.shapes.implicit.intervals import Interval, along_line

_NARROWEST = 2.0**-42  # of the ray's ends
_STACK = 64  # halvings, as many as there is room for; _NARROWEST needs 42
_STEPS = 64  # of Newton's method, or bisections, which gain a bit each
_ROUNDING = 1.0 + 2.0**-50


@kernel
def _has_zero(a):
    return a.low <= 0.0 and a.high >= 0.0


@kernel
def _around_middle(value, slope, half):
    """Return the values that g can have within `half` of a point."""
    reach = max(abs(slope.low), abs(slope.high)) * half * _ROUNDING if half > 0.0 else 0.0
    return Interval(
        (value.low - reach) - abs(value.low - reach) * 2.0**-50,
        (value.high + reach) + abs(value.high + reach) * 2.0**-50,
    )


@kernel
def _sign(a):
    """Return 1 or -1 where all of an interval has that sign, else 0."""
    if a.low > 0.0:
        return 1
    return -1 if a.high < 0.0 else 0


@kernel
def _refined(program, origin, direction, near, far, increasing):
    """Return the root between near and far, where g is monotone: Newton, kept inside."""
    t = 0.5 * (near + far)
    steps = 0
    while steps < _STEPS:
        steps += 1
        value, slope = along_line(program, origin, direction, Interval(t, t))
        if _has_zero(value):
            break
        if (value.low > 0.0) == increasing:
            far = t
        else:
            near = t
        new = t - (value.low + value.high) / (slope.low + slope.high)
        if not (near < new < far):
            new = 0.5 * (near + far)
        if new == t or not (near < new < far):
            break
        t = new
    return t, steps


@kernel
def first_root(program, origin, direction, near, far):
    """Return the smallest t in [near, far] with g = 0, and how often g was evaluated.

    t is infinite if g has no root. `origin` and `direction` are double precision.
    """
    never_inline()
    ends = local_f64(64)
    depth = 0
    narrowest = _NARROWEST * max(abs(near), abs(far))
    count = 0
    while near <= far:
        value, slope = along_line(program, origin, direction, Interval(near, far))
        count += 1
        middle, half = 0.5 * (near + far), 0.5 * (far - near)
        if _has_zero(value):
            here, _ = along_line(program, origin, direction, Interval(middle, middle))
            count += 1
            if not _has_zero(slope):
                at_near, _ = along_line(program, origin, direction, Interval(near, near))
                at_far, _ = along_line(program, origin, direction, Interval(far, far))
                count += 2
                if _sign(at_near) * _sign(at_far) <= 0:
                    increasing = slope.low > 0.0
                    t, steps = _refined(program, origin, direction, near, far, increasing)
                    return t, count + steps
            elif _has_zero(_around_middle(here, slope, half)):
                if half > narrowest and depth < _STACK:
                    ends[depth] = far
                    depth += 1
                    far = middle
                    continue
                if value.high - value.low < np.inf:
                    return middle, count
        if depth == 0:
            break
        depth -= 1
        near, far = far, ends[depth]
    return np.inf, count
