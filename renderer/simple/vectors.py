"""Vectors: NumPy arrays of three numbers; `a @ b` is the dot product."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def normalize(v: Vector) -> Vector:
    """Return v / |v|."""
    return v / math.sqrt(v @ v)


def orthonormal_basis(n: Vector) -> tuple[Vector, Vector]:
    """Return s, t that make a right-handed frame with the unit vector n [Duff2017]."""
    x, y, z = n
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    s = np.array([1.0 + sign * x * x * a, sign * b, -sign * x])
    return s, np.array([b, sign + y * y * a, -y])
