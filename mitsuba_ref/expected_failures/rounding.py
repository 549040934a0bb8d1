"""Textbook formulas in single precision, where they lose what they should find.

The renderer has none of these formulas; they are written here in NumPy's float32, as a
first version would be, and measured against float64.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
RAYS = 16_384


def _directions(rng: np.random.Generator, n: int = RAYS) -> NDArray[np.float64]:
    v = rng.standard_normal((n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.sum(a * b, axis=1, dtype=np.float32)


def small_triangles_lost(edge: float = 1e-4, least: float = 1e-8) -> float:
    """Return the share of triangles that |determinant| > `least` loses [Moeller1997].

    Triangles with edges of about `edge`, each with a ray through its middle. The
    determinant is edge^2 times a sine and a cosine: at 1e-4 it is never above 1e-8,
    whatever the ray, though every ray hits.
    """
    rng = np.random.default_rng(1)
    e1, e2 = (np.float32(edge) * _directions(rng).astype(np.float32) for _ in range(2))
    direction = _directions(rng).astype(np.float32)
    to_origin = (e1 + e2) / np.float32(3) - np.float32(edge) * direction
    p = np.cross(direction, e2).astype(np.float32)
    determinant = _dot(e1, p)
    u = _dot(to_origin, p) / determinant
    q = np.cross(to_origin, e1).astype(np.float32)
    v = _dot(direction, q) / determinant
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    return float(1 - np.mean((inside & (np.abs(determinant) > least))[inside]))


def rays_at_a_sphere(distance: float) -> tuple[Floats, Floats, NDArray[np.float64]]:
    """Return origins and directions that meet the unit sphere, and where, in float64.

    Of the float32 rays themselves; they start `distance` away and pass within 0.9.
    """
    rng = np.random.default_rng(2)
    away = _directions(rng)
    across = np.cross(away, _directions(rng))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    target = 0.9 * np.sqrt(rng.random((RAYS, 1))) * across
    origin = (target + distance * away).astype(np.float32)
    direction = (target - origin).astype(np.float32)
    direction /= np.sqrt(_dot(direction, direction))[:, None]
    return origin, direction, _first_root(origin, direction)


def far_spheres_wrong(distance: float = 1e4) -> float:
    """Return the share of rays at a unit sphere that b^2 - 4 a c gets wrong [Haines2019].

    Missed, or hit more than a tenth of the radius from the true place. All rays meet the
    sphere.
    """
    origin, direction, truth = rays_at_a_sphere(distance)
    a, b = _dot(direction, direction), np.float32(2) * _dot(origin, direction)
    c = _dot(origin, origin) - np.float32(1)
    discriminant = b * b - np.float32(4) * a * c
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(discriminant)) / (np.float32(2) * a)
    return float(1 - np.mean(np.abs(t - truth) < 0.1))


def _first_root(origin: Floats, direction: Floats) -> NDArray[np.float64]:
    """Return where the very same rays enter the unit sphere, in float64."""
    o, d = origin.astype(np.float64), direction.astype(np.float64)
    a, b = np.sum(d * d, axis=1), -np.sum(o * d, axis=1)
    nearest = o + d * (b / a)[:, None]
    with np.errstate(invalid="ignore"):  # from 10^6 on rounding moves rays past the sphere
        root = np.sqrt(a * (1 - np.sum(nearest * nearest, axis=1)))
    return np.asarray((b - root) / a)


def single_precision_sum(count: int = 10_000_000) -> float:
    """Return what `count` times 0.1 add up to in float32, as a share of the true sum."""
    tenths = np.full(count, 0.1, np.float32)
    return float(np.add.accumulate(tenths, dtype=np.float32)[-1]) / (0.1 * count)
