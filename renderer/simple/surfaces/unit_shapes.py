"""The five unit shapes: implicit surfaces g(x') = 0, their bounds, and points on them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from renderer.scene_file.description import Cylinder, Disk, Mesh, Rectangle, Sphere
from renderer.simple.vectors import Vector
from renderer.simple.warps import square_to_disk, square_to_sphere, square_to_triangle


class UnitShape(NamedTuple):
    """A shape in coordinates of its own; x, y, z are those of a point with g = 0."""

    roots: Callable[[Vector, Vector], Vector]  # p', d' (n, 3) -> t (n, roots), NaN if none
    contains: Callable[..., Any]  # x, y, z -> whether the shape reaches there
    gradient: Callable[..., tuple[float, float, float]]  # of g at x, y, z
    uv: Callable[..., tuple[float, float]]  # place of x, y, z on textures
    point: Callable[..., tuple[float, float, float]]  # [0, 1)^2 -> x, y, z, keeping areas


def plane(p: Vector, d: Vector) -> Vector:
    """Return t with g(p + t d) = 0 for g(x) = z."""
    return -p[:, 2:] / d[:, 2:]


def quadric(*axes: float) -> Callable[[Vector, Vector], Vector]:
    """Return what finds both t with g(p + t d) = 0 for g(x) = sum of axes x^2 - 1."""

    def roots(p: Vector, d: Vector) -> Vector:
        a, b, c = d**2 @ axes, (p * d) @ axes, p**2 @ axes - 1.0
        root = np.sqrt(b * b - a * c)
        return np.stack([(-b - root) / a, (-b + root) / a], axis=1)

    return roots


def upwards(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the gradient of g(x) = z."""
    return 0.0, 0.0, 1.0


def turn(x: float, y: float) -> float:
    """Return the angle of (x, y) as a fraction of a turn, in [0, 1)."""
    return math.atan2(y, x) / (2.0 * math.pi) % 1.0


UNIT_SHAPES: dict[type, UnitShape] = {
    Mesh: UnitShape(  # each of its triangles: (0, 0), (1, 0), (0, 1)
        plane,
        lambda x, y, z: (x >= 0) & (y >= 0) & (x + y <= 1),
        upwards,
        lambda x, y, z: (x, y),
        lambda u, v: (*square_to_triangle(u, v), 0.0),
    ),
    Rectangle: UnitShape(
        plane,
        lambda x, y, z: (abs(x) <= 1) & (abs(y) <= 1),
        upwards,
        lambda x, y, z: ((x + 1) / 2, (y + 1) / 2),
        lambda u, v: (2 * u - 1, 2 * v - 1, 0.0),
    ),
    Disk: UnitShape(
        plane,
        lambda x, y, z: x**2 + y**2 <= 1,
        upwards,
        lambda x, y, z: (math.hypot(x, y), turn(x, y)),
        lambda u, v: (*square_to_disk(u, v), 0.0),
    ),
    Sphere: UnitShape(
        quadric(1.0, 1.0, 1.0),
        lambda x, y, z: np.isfinite(x),
        lambda x, y, z: (x, y, z),
        lambda x, y, z: (turn(x, y), math.acos(min(max(z, -1.0), 1.0)) / math.pi),
        square_to_sphere,
    ),
    Cylinder: UnitShape(
        quadric(1.0, 1.0, 0.0),
        lambda x, y, z: (z >= 0) & (z <= 1),
        lambda x, y, z: (x, y, 0.0),
        lambda x, y, z: (turn(x, y), z),
        lambda u, v: (math.cos(2 * math.pi * v), math.sin(2 * math.pi * v), u),
    ),
}
