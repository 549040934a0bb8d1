"""Densities on the unit square that depend on two parameters: values, sampling, inversion.

A density is bilinear between the numbers of a table, and linear between the tables of
neighbouring parameters, as its integrals are [Dupuy2018]. A number is warped to a row by
the integral over all columns, another one to a place along it; both integrals are quadratic
in a patch of four numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    any_of,
    maximum,
    minimum,
    select,
    splat_i32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.plugins.bsdfs.parameters import entry_of

SIZES = 2  # numbers in front of each table: of its rows and of its columns
_NEAR_0, _NEAR_1 = np.float32(2.0**-24), np.float32(1.0 - 2.0**-24)


class Slices(NamedTuple):
    """The four tables around a pair of parameters, of which the first varies slowest."""

    first: Any  # i32
    to_next_a: Any  # i32, from one table to the next; 0 if there is one alone
    to_next_b: Any
    a: Any  # weight of the next table
    b: Any


class Density(NamedTuple):
    """Tables of `renderer.plugins.bsdfs.measured_file.Density`."""

    values: Any  # with `SIZES` in front
    rows: Any
    columns: Any


class Patch(NamedTuple):
    """A place within four numbers of a table, all of them i32 but the last two."""

    height: Any  # of the table
    width: Any
    row: Any
    column: Any
    y: Any  # in [0, 1]
    x: Any


@kernel
def _mix(a, b, t):
    return b * t + (a - a * t)


@kernel
def _halved(below, low, middle, high):
    """Return the half of an interval that has the first entry which is not below."""
    return select(below, middle + 1, low), select(below, high, middle)


@kernel
def _interval(axis, value):
    """Return the number of entries, the entry before a value, and the weight of the next.

    The axis has its count in front, as a table of one row.
    """
    count = to_i32(entry_of(axis, splat_i32(1)))
    low, high = splat_i32(1), count - 1
    while any_of(low < high):
        middle = (low + high) >> 1
        below = entry_of(axis, middle + SIZES) < value
        low, high = _halved(below, low, middle, high)
    before = entry_of(axis, low - 1 + SIZES)
    after = entry_of(axis, maximum(minimum(low, count - 1), 0) + SIZES)
    weight = minimum(maximum((value - before) / (after - before), 0.0), 1.0)
    return count, low - 1, weight


@kernel
def slices_at(axis_a, axis_b, a, b):
    """Return the tables around two parameters; beyond the first or last it is that one."""
    count_a, before_a, weight_a = _interval(axis_a, a)
    count_b, before_b, weight_b = _interval(axis_b, b)
    return Slices(
        before_a * count_b + before_b,
        select(count_a > 1, count_b, 0),
        select(count_b > 1, splat_i32(1), 0),
        weight_a,
        weight_b,
    )


@kernel
def _entry(table, slices, size, i):
    """Return entry i of a table between the four, which have `size` entries each."""
    if slices is None:
        return entry_of(table, i)
    i = i + slices.first * size
    to_a, to_b = slices.to_next_a * size, slices.to_next_b * size
    a, b = 1.0 - slices.a, 1.0 - slices.b
    before = entry_of(table, i) * a + entry_of(table, i + to_a) * slices.a
    i = i + to_b
    after = entry_of(table, i) * a + entry_of(table, i + to_a) * slices.a
    return before * b + after * slices.b


@kernel
def _sizes(table):
    """Return the numbers of rows and columns."""
    return to_i32(entry_of(table, splat_i32(0))), to_i32(entry_of(table, splat_i32(1)))


@kernel
def _along(position, count):
    """Return the patch along an axis of so many entries, and the place within it."""
    scaled = minimum(maximum(position, 0.0), 1.0) * to_f32(count - 1)
    before = maximum(minimum(to_i32(scaled), count - 2), 0)
    return before, scaled - to_f32(before)


@kernel
def _patch(table, x, y):
    height, width = _sizes(table)
    column, along_x = _along(x, width)
    row, along_y = _along(y, height)
    return Patch(height, width, row, column, along_y, along_x)


@kernel
def _edges(table, slices, patch, planes, plane):
    """Return the values at the left and right edge of a patch, at the height of y."""
    area = patch.height * patch.width
    at = SIZES + plane * area + patch.row * patch.width + patch.column
    size, above = planes * area, at + patch.width
    left = _mix(
        _entry(table, slices, size, at), _entry(table, slices, size, above), patch.y
    )
    at, above = at + 1, above + 1
    right = _mix(
        _entry(table, slices, size, at), _entry(table, slices, size, above), patch.y
    )
    return left, right


@kernel
def eval_image(table, slices, x, y, planes, plane):
    """Return one of the planes of an image at a place in [0, 1]^2.

    `slices` is None for an image without parameters.
    """
    patch = _patch(table, x, y)
    left, right = _edges(table, slices, patch, planes, plane)
    return _mix(left, right, patch.x)


@kernel
def _up_to(density, slices, patch, column):
    """Return the integral along a row, between two of the table, up to a column's end."""
    size = patch.height * (patch.width - 1)
    at = patch.row * (patch.width - 1) + maximum(column, 0)
    lower = _entry(density.columns, slices, size, at)
    upper = _entry(density.columns, slices, size, at + patch.width - 1)
    return lower, upper, select(column < 0, 0.0, _mix(lower, upper, patch.y))


@kernel
def _rows_up_to(density, slices, patch, row):
    """Return the integral over all rows up to the end of a patch's."""
    integral = _entry(density.rows, slices, patch.height - 1, maximum(row, 0))
    return select(row < 0, 0.0, integral)


@kernel
def _sample_segment(integral, count, first, last):
    """Return where the integral of a linear density has a value, in [0, 1].

    The density goes from `first` to `last` along one of `count` patches.
    """
    doubled = 2.0 * integral * to_f32(count)
    root = sqrt(maximum(first * first + doubled * (last - first), 0.0))
    return minimum(doubled / maximum(first + root, np.float32(1e-30)), 1.0)


@kernel
def _integral_of_segment(place, count, first, last):
    """Return the inverse of `_sample_segment`."""
    return place * _mix(first, last, 0.5 * place) / to_f32(count)


@kernel
def sample_density(density, slices, x, y):
    """Return the place in [0, 1]^2 that two numbers are warped to, and its density."""
    height, width = _sizes(density.values)
    x, y = (
        minimum(maximum(x, _NEAR_0), _NEAR_1),
        minimum(maximum(y, _NEAR_0), _NEAR_1),
    )
    low, high = splat_i32(0), height - 2
    while any_of(low < high):
        middle = (low + high) >> 1
        below = _entry(density.rows, slices, height - 1, middle) < y
        low, high = _halved(below, low, middle, high)
    patch = Patch(height, width, low, low, y, x)  # only its row counts here
    y = y - _rows_up_to(density, slices, patch, low - 1)
    first, last, _ = _up_to(density, slices, patch, width - 2)
    y = _sample_segment(y, height - 1, first, last)
    x = x * _mix(first, last, y)

    row = low
    patch = Patch(height, width, row, row, y, x)  # its column is searched
    low, high = splat_i32(0), width - 2
    while any_of(low < high):
        middle = (low + high) >> 1
        _, _, integral = _up_to(density, slices, patch, middle)
        low, high = _halved(integral < x, low, middle, high)
    _, _, before = _up_to(density, slices, patch, low - 1)
    patch = Patch(height, width, row, low, y, x)
    left, right = _edges(density.values, slices, patch, 1, 0)
    x = _sample_segment(x - before, width - 1, left, right)
    return (
        (to_f32(low) + x) / to_f32(width - 1),
        (to_f32(row) + y) / to_f32(height - 1),
        _mix(left, right, x),
    )


@kernel
def invert_density(density, slices, x, y):
    """Return the two numbers that `sample_density` warps to a place, and its density."""
    patch = _patch(density.values, x, y)
    left, right = _edges(density.values, slices, patch, 1, 0)
    _, _, before = _up_to(density, slices, patch, patch.column - 1)
    first, last, whole = _up_to(density, slices, patch, patch.width - 2)
    along = before + _integral_of_segment(patch.x, patch.width - 1, left, right)
    up = _rows_up_to(density, slices, patch, patch.row - 1)
    up = up + _integral_of_segment(patch.y, patch.height - 1, first, last)
    return along / whole, up, _mix(left, right, patch.x)
