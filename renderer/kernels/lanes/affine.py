"""Affine maps of rays, points and normals, for one instance or for 16 in lanes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import dot, vec3


class Affine(NamedTuple):
    """The rows of a matrix, and a translation; scalars or lanes."""

    x: Any
    y: Any
    z: Any
    at: Any


@kernel
def affine_at(numbers, k):
    """Return map k of rows of `Placements` as scalars."""
    n = np.int64(12) * k
    return Affine(
        vec3(numbers[n], numbers[n + 1], numbers[n + 2]),
        vec3(numbers[n + 3], numbers[n + 4], numbers[n + 5]),
        vec3(numbers[n + 6], numbers[n + 7], numbers[n + 8]),
        vec3(numbers[n + 9], numbers[n + 10], numbers[n + 11]),
    )


@kernel
def _three(numbers, n, mask):
    return vec3(
        gather_row(numbers, 0, n, mask),
        gather_row(numbers, 0, n + 1, mask),
        gather_row(numbers, 0, n + 2, mask),
    )


@kernel
def affine_of(numbers, k, mask):
    """Return the maps of 16 instances as lanes; zeros outside of the mask."""
    n = k * 12
    return Affine(
        _three(numbers, n, mask),
        _three(numbers, n + 3, mask),
        _three(numbers, n + 6, mask),
        _three(numbers, n + 9, mask),
    )


@kernel
def times(m, a):
    """Return the matrix of m times the vector a."""
    return vec3(dot(m.x, a), dot(m.y, a), dot(m.z, a))


@kernel
def transposed_times(m, a):
    """Return the transposed matrix of m times the vector a."""
    return m.x * a.x + m.y * a.y + m.z * a.z


@kernel
def absolute(a):
    """Return the absolute components of a vector."""
    return vec3(fabs(a.x), fabs(a.y), fabs(a.z))


@kernel
def absolute_times(m, a):
    """Return what bounds the rounding of m a: the absolute matrix times absolute a."""
    b = absolute(a)
    return vec3(
        dot(absolute(m.x), b),
        dot(absolute(m.y), b),
        dot(absolute(m.z), b),
    )
