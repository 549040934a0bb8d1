"""Interval arithmetic: bounds of a function and its derivative along a line.

Interval arithmetic [Moore1966]: for all operands in their intervals, the result lies in
the result's interval. All numbers are double precision. The rounding mode cannot be set,
so each result is widened by more than its rounding error. An unbounded result (a quotient
by an interval that contains 0) has infinite ends.

Derivatives follow by the chain rule. At a kink of the function (abs, min, max, the square
root at 0), the interval contains all slopes on both sides.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel, never_inline
from renderer.kernels.lanes.vectors import local_f64
from renderer.scene_file.objects.expressions import (
    ADD,
    COS,
    DIVIDE,
    EXP,
    MIN,
    MULTIPLY,
    NEGATE,
    POWER,
    SIN,
    SQRT,
    SUBTRACT,
    X,
    Y,
    Z,
)

_ULP = 2.0**-52
_TINY = 1e-300  # widens 0 and subnormal numbers
_LARGEST = 1.7976931348623157e308
_INFINITY = np.inf
_HALF_PI = 0.5 * np.pi
_TWO_PI = 2.0 * np.pi
_MOST_TURNS = 1e6  # for larger angles sines are [-1, 1]: their maxima are not known exactly


class Interval(NamedTuple):
    """All numbers in [low, high]."""

    low: Any
    high: Any


class Steps(NamedTuple):
    """One program of `scene_file.objects.expressions`, as a range of shared arrays."""

    operations: Any
    operands: Any
    first: Any
    end: Any


@kernel
def _down(x):
    """Return a number below any that rounds to x."""
    if x >= _LARGEST:
        return _LARGEST  # it may have overflowed
    return x - (abs(x) * _ULP + _TINY)


@kernel
def _up(x):
    if x <= -_LARGEST:
        return -_LARGEST
    return x + (abs(x) * _ULP + _TINY)


@kernel
def _widened(low, high, ulps):
    """Return [low, high], widened by `ulps` units in the last place."""
    if low >= _LARGEST:
        low = _LARGEST
    elif low > -_INFINITY:
        low -= abs(low) * (ulps * _ULP) + _TINY
    if high <= -_LARGEST:
        high = -_LARGEST
    elif high < _INFINITY:
        high += abs(high) * (ulps * _ULP) + _TINY
    return Interval(low, high)


@kernel
def _times(a, b):
    """Return a b, where 0 times infinity is 0."""
    product = a * b
    return product if product == product else 0.0


@kernel
def add(a, b):
    """Return a + b."""
    return Interval(_down(a.low + b.low), _up(a.high + b.high))


@kernel
def _negated(a):
    return Interval(-a.high, -a.low)


@kernel
def multiply(a, b):
    """Return a b."""
    p, q = _times(a.low, b.low), _times(a.low, b.high)
    r, s = _times(a.high, b.low), _times(a.high, b.high)
    return Interval(_down(min(min(p, q), min(r, s))), _up(max(max(p, q), max(r, s))))


@kernel
def _whole():
    return Interval(-_INFINITY, _INFINITY)


@kernel
def reciprocal(a):
    """Return 1 / a; unbounded if a contains 0."""
    if a.low <= 0.0 and a.high >= 0.0:
        return _whole()
    return Interval(_down(1.0 / a.high), _up(1.0 / a.low))


@kernel
def _whole_power(x, n):
    power = 1.0
    for _ in range(n):
        power *= x
    return power


@kernel
def power(a, n):
    """Return a^n for an integer n >= 0."""
    low, high = _whole_power(a.low, n), _whole_power(a.high, n)
    if n % 2 == 0:
        low, high = min(low, high), max(low, high)
        if n > 0 and a.low < 0.0 < a.high:
            low = 0.0
            return Interval(low, _widened(low, high, float(n)).high)
    wide = _widened(low, high, float(n))
    return Interval(max(wide.low, 0.0), wide.high) if n % 2 == 0 else wide


@kernel
def _wave(a, low, high, peak):
    """Return the range over a of a wave of period 2 pi.

    `low` and `high` are its values at the ends of a. It is 1 at `peak`, and -1 half a
    period later.
    """
    if not (a.high - a.low < _TWO_PI and abs(a.low) + abs(a.high) < _MOST_TURNS):
        return Interval(-1.0, 1.0)
    slack = 1e-14 * (1.0 + abs(a.low) + abs(a.high))
    wide = _widened(min(low, high), max(low, high), 8.0)
    top = peak + _TWO_PI * np.ceil((a.low - slack - peak) / _TWO_PI)
    bottom = peak + np.pi
    bottom += _TWO_PI * np.ceil((a.low - slack - bottom) / _TWO_PI)
    return Interval(
        -1.0 if bottom <= a.high + slack else max(wide.low, -1.0),
        1.0 if top <= a.high + slack else min(wide.high, 1.0),
    )


@kernel
def sine(a):
    """Return sin a."""
    if not (abs(a.low) + abs(a.high) < _MOST_TURNS):
        return Interval(-1.0, 1.0)
    return _wave(a, np.sin(a.low), np.sin(a.high), _HALF_PI)


@kernel
def cosine(a):
    """Return cos a."""
    if not (abs(a.low) + abs(a.high) < _MOST_TURNS):
        return Interval(-1.0, 1.0)
    return _wave(a, np.cos(a.low), np.cos(a.high), 0.0)


@kernel
def square_root(a):
    """Return sqrt a, with 0 for negative numbers."""
    wide = _widened(np.sqrt(max(a.low, 0.0)), np.sqrt(max(a.high, 0.0)), 2.0)
    return Interval(max(wide.low, 0.0), wide.high)


@kernel
def exponential(a):
    """Return exp a."""
    wide = _widened(np.exp(a.low), np.exp(a.high), 8.0)
    return Interval(max(wide.low, 0.0), wide.high)


@kernel
def _largest(a):
    return max(abs(a.low), abs(a.high))


@kernel
def _hull(a, b):
    return Interval(min(a.low, b.low), max(a.high, b.high))


@kernel
def _unary(operation, n, a, da):
    """Return the value and the derivative of a unary operation."""
    if operation == NEGATE:
        return _negated(a), _negated(da)
    if operation == POWER:
        if n == 0:
            return Interval(1.0, 1.0), Interval(0.0, 0.0)
        slope = multiply(Interval(float(n), float(n)), power(a, n - 1))
        return power(a, n), multiply(slope, da)
    if operation == SIN:
        return sine(a), multiply(cosine(a), da)
    if operation == COS:
        return cosine(a), multiply(_negated(sine(a)), da)
    if operation == EXP:
        value = exponential(a)
        return value, multiply(value, da)
    if operation == SQRT:
        value = square_root(a)
        if a.high < 0.0:
            return value, Interval(0.0, 0.0)
        if a.low <= 0.0:
            return value, multiply(Interval(0.0, _INFINITY), da)
        return value, multiply(reciprocal(add(value, value)), da)
    # absolute value
    if a.low >= 0.0:
        return a, da
    if a.high <= 0.0:
        return _negated(a), _negated(da)
    steep = _largest(da)
    return Interval(0.0, _largest(a)), Interval(-steep, steep)


@kernel
def _lesser(a, da, b, db):
    value = Interval(min(a.low, b.low), min(a.high, b.high))
    if a.high < b.low:
        return value, da
    if b.high < a.low:
        return value, db
    return value, _hull(da, db)


@kernel
def _binary(operation, a, da, b, db):
    """Return the value and the derivative of a binary operation."""
    if operation == ADD:
        return add(a, b), add(da, db)
    if operation == SUBTRACT:
        return add(a, _negated(b)), add(da, _negated(db))
    if operation == MULTIPLY:
        return multiply(a, b), add(multiply(da, b), multiply(a, db))
    if operation == DIVIDE:
        if b.low <= 0.0 and b.high >= 0.0:
            return _whole(), _whole()
        inverse = reciprocal(b)
        quotient = multiply(a, inverse)
        return quotient, multiply(add(da, _negated(multiply(quotient, db))), inverse)
    if operation == MIN:
        return _lesser(a, da, b, db)
    value, slope = _lesser(_negated(a), _negated(da), _negated(b), _negated(db))
    return _negated(value), _negated(slope)


@kernel
def _coordinate(origin, direction, t):
    along = multiply(Interval(direction, direction), t)
    return add(Interval(origin, origin), along)


@kernel
def along_line(program, origin, direction, t):
    """Return g(origin + t direction) and its derivative by t, for all t in an interval.

    Parameters
    ----------
    program
        The program, a `Steps`.
    origin, direction
        Ray in double precision.
    t
        Interval.
    """
    never_inline()
    stack = local_f64(256)  # up to 64 entries: low and high of value and derivative
    operands, top = program.operands, -4
    for k in range(program.first, program.end):
        operation = program.operations[k]
        if operation <= Z:
            value, slope = Interval(operands[k], operands[k]), Interval(0.0, 0.0)
            if operation == X:
                value = _coordinate(origin.x, direction.x, t)
                slope = Interval(direction.x, direction.x)
            elif operation == Y:
                value = _coordinate(origin.y, direction.y, t)
                slope = Interval(direction.y, direction.y)
            elif operation == Z:
                value = _coordinate(origin.z, direction.z, t)
                slope = Interval(direction.z, direction.z)
            top += 4
        elif operation < ADD:
            a = Interval(stack[top], stack[top + 1])
            da = Interval(stack[top + 2], stack[top + 3])
            value, slope = _unary(operation, int(operands[k]), a, da)
        else:
            b = Interval(stack[top], stack[top + 1])
            db = Interval(stack[top + 2], stack[top + 3])
            top -= 4
            a = Interval(stack[top], stack[top + 1])
            da = Interval(stack[top + 2], stack[top + 3])
            value, slope = _binary(operation, a, da, b, db)
        stack[top], stack[top + 1] = value.low, value.high
        stack[top + 2], stack[top + 3] = slope.low, slope.high
    return Interval(stack[0], stack[1]), Interval(stack[2], stack[3])
