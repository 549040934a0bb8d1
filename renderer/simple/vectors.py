"""Vectors, and maps from the unit square to disks, triangles and directions.

A vector is a NumPy array of three numbers; `a @ b` is the dot product. The maps keep areas:
random points that fill the square evenly fill what they are mapped to evenly.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def normalize(v: Vector) -> Vector:
    """Return v / |v|."""
    return v / math.sqrt(v @ v)


def mix(a: Any, b: Any, t: float) -> Any:
    """Return a at t = 0, b at t = 1."""
    return (1.0 - t) * a + t * b


def orthonormal_basis(n: Vector) -> tuple[Vector, Vector]:
    """Return s, t that make a right-handed frame with the unit vector n [Duff2017]."""
    x, y, z = n
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    s = np.array([1.0 + sign * x * x * a, sign * b, -sign * x])
    return s, np.array([b, sign + y * y * a, -y])


def square_to_disk(x: float, y: float) -> tuple[float, float]:
    """Map [0, 1)^2 to the unit disk, squares around the centre to circles [Shirley1997]."""
    a, b = 2.0 * x - 1.0, 2.0 * y - 1.0
    if abs(a) >= abs(b):
        radius, angle = a, math.pi / 4 * (b / a if a else 0.0)
    else:
        radius, angle = b, math.pi / 2 - math.pi / 4 * (a / b)
    return radius * math.cos(angle), radius * math.sin(angle)


def square_to_triangle(x: float, y: float) -> tuple[float, float]:
    """Map [0, 1)^2 to the triangle (0, 0), (1, 0), (0, 1)."""
    root = math.sqrt(1.0 - x)
    return 1.0 - root, root * y


def square_to_sphere(x: float, y: float) -> tuple[float, float, float]:
    """Map [0, 1)^2 to the unit sphere: slices of equal height have equal areas."""
    z = 1.0 - 2.0 * y
    r = math.sqrt(1.0 - z * z)
    return r * math.cos(2 * math.pi * x), r * math.sin(2 * math.pi * x), z


def square_to_cosine_hemisphere(x: float, y: float) -> Vector:
    """Map [0, 1)^2 to the upper half sphere with density cos / pi: the disk, lifted."""
    p, q = square_to_disk(x, y)
    return np.array([p, q, math.sqrt(max(1.0 - p * p - q * q, 0.0))])
