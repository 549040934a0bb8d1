"""Vector arithmetic with the fused multiply-adds of Mitsuba's wheels, on float32 scalars.

Which products are fused, and in which order sums are taken, was found by trying all on
thousands of hits: with these, positions, uv and normals are Mitsuba's bit for bit.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import vec3
from renderer.replay.rounding.arithmetic.fused import fused_multiply_add

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


@kernel
def fused_cross(a, b):
    """Return a x b, of each component the second product rounded first."""
    return vec3(
        fused_multiply_add(a.y, b.z, -(a.z * b.y)),
        fused_multiply_add(a.z, b.x, -(a.x * b.z)),
        fused_multiply_add(a.x, b.y, -(a.y * b.x)),
    )


@kernel
def fused_dot(a, b):
    """Return a . b, summed from the last component."""
    return fused_multiply_add(a.x, b.x, fused_multiply_add(a.y, b.y, a.z * b.z))


@kernel
def fused_affine(row, at, p):
    """Return row . p + at, summed from the translation on."""
    x = fused_multiply_add(row.x, p.x, at)
    return fused_multiply_add(row.z, p.z, fused_multiply_add(row.y, p.y, x))


@kernel
def times_point(rows, first, k, p):
    """Return the point p moved by the matrix in rows first .. first + 11 of column k."""
    return vec3(
        _row_times(rows, first, k, rows[first + 3, k], p),
        _row_times(rows, first + 4, k, rows[first + 7, k], p),
        _row_times(rows, first + 8, k, rows[first + 11, k], p),
    )


@kernel
def times_vector(rows, first, k, a):
    """Return the vector a turned by the same matrix; it knows no translation."""
    return vec3(
        _row_times(rows, first, k, -_ZERO, a),
        _row_times(rows, first + 4, k, -_ZERO, a),
        _row_times(rows, first + 8, k, -_ZERO, a),
    )


@kernel
def fused_times(x, y, z, a):
    """Return the matrix with the rows x, y, z times a, summed from the first column."""
    zero = -_ZERO  # the one that a product does not change
    return vec3(
        fused_affine(x, zero, a), fused_affine(y, zero, a), fused_affine(z, zero, a)
    )


@kernel
def _row_times(rows, row, k, at, p):
    return fused_affine(vec3(rows[row, k], rows[row + 1, k], rows[row + 2, k]), at, p)


@kernel
def fused_sum(a, s, b):
    """Return a s + b for vectors a, b and a number s."""
    return vec3(
        fused_multiply_add(a.x, s, b.x),
        fused_multiply_add(a.y, s, b.y),
        fused_multiply_add(a.z, s, b.z),
    )


@kernel
def unit(a):
    """Return a / |a|; the square is summed as four lanes are: x and z first."""
    return a * (_ONE / np.sqrt((a.x * a.x + a.z * a.z) + a.y * a.y))
