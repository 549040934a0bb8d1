"""Spheres and cylinders far away: the textbook quadratic, and a form that keeps digits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.expected_failures.rounding import far_spheres_wrong, rays_at_a_sphere
from renderer.plugins.shapes.cylinder import CylinderSurfaces
from renderer.plugins.shapes.sphere import SphereSurfaces
from reports.limits.our_hits import nearest_hits
from reports.limits.row import Row
from reports.limits.vectors import dot, single, unit

FAR_OFF = 0.1  # radii from the true place that count as wrong
RAYS = 4096
HALF_HEIGHT = 1e9  # of the cylinders: the ends are beyond all rays


def _naive_quadratic(
    origin: NDArray[np.float32], direction: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return where rays meet the unit sphere by the textbook; NaN is a miss."""
    a, b = dot(direction, direction), np.float32(2) * dot(origin, direction)
    c = dot(origin, origin) - np.float32(1)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (-b - np.sqrt(b * b - np.float32(4) * a * c)) / (np.float32(2) * a)
        )


def picture() -> NDArray[np.uint8]:
    """Return a ball lit from the camera, at four distances, by the textbook's quadratic."""
    side = 120
    x, y = (
        grid.ravel() for grid in np.mgrid[-1.2 : 1.2 : 1j * side, -1.2 : 1.2 : 1j * side]
    )
    shown = []
    for distance in (1e2, 1e3, 3e3, 1e4):
        # along no axis, so that no component is free of rounding
        right, up = np.array([0.8, 0.0, -0.6]), np.array([-0.36, 0.8, -0.48])
        eye = np.cross(right, up) * distance
        target = y[:, None] * right - x[:, None] * up
        origin = single(np.broadcast_to(eye, target.shape))
        direction = single(unit(target - eye))
        t = _naive_quadratic(origin, direction)
        hit = origin.astype(float) + t[:, None] * direction.astype(float)
        cosine = np.clip(hit @ eye / distance, 0.0, 1.0)
        grey = np.where(np.isnan(t), 25.0, 60.0 + 180.0 * np.nan_to_num(cosine))
        shown.append(grey.reshape(side, side).astype(np.uint8))
    return np.repeat(np.concatenate(shown, axis=1)[..., None], 3, axis=2)


def _sphere(distance: float) -> float:
    origin, direction, truth = rays_at_a_sphere(distance)
    surfaces = SphereSurfaces(
        0, 1, np.zeros((3, 1), np.float32), np.ones(1, np.float32), _frame()
    )
    t, prim = nearest_hits("spheres", surfaces, origin, direction)
    return float(1.0 - np.mean((prim >= 0) & (np.abs(t - truth) < FAR_OFF)))


def _frame() -> NDArray[np.float32]:
    return np.ascontiguousarray(np.eye(3, dtype=np.float32).reshape(9, 1))


# -------------------------------------------------------------------------- cylinders


def _rays_at_a_cylinder(
    distance: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float64]]:
    """Return rays that pass within 0.9 of the z axis, and where they meet radius 1."""
    rng = np.random.default_rng(4)
    turn = rng.uniform(0.0, 2.0 * np.pi, RAYS)
    x, y = np.cos(turn), np.sin(turn)
    # at most 45 degrees off level: near the axis any form is ill conditioned
    away = unit(np.stack((x, y, rng.uniform(-1.0, 1.0, RAYS)), axis=1))
    across = np.stack((-y, x, np.zeros(RAYS)), axis=1)
    origin = single(0.9 * rng.uniform(-1.0, 1.0, (RAYS, 1)) * across + distance * away)
    direction = single(unit(single(-away)))
    o, d = origin.astype(np.float64), direction.astype(np.float64)
    o[:, 2] = d[:, 2] = 0.0
    a, b = dot(d, d), -dot(o, d)
    nearest = o + d * (b / a)[:, None]
    with np.errstate(invalid="ignore"):  # from 10^6 on rounding moves rays past it
        root = np.sqrt(a * (1.0 - dot(nearest, nearest)))
    return origin, direction, (b - root) / a


def _naive_cylinder(distance: float) -> float:
    origin, direction, truth = _rays_at_a_cylinder(distance)
    ox, oy, dx, dy = origin[:, 0], origin[:, 1], direction[:, 0], direction[:, 1]
    a, b = dx * dx + dy * dy, np.float32(2) * (ox * dx + oy * dy)
    c = ox * ox + oy * oy - np.float32(1)
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(b * b - np.float32(4) * a * c)) / (np.float32(2) * a)
    return float(1.0 - np.mean(np.abs(t - truth) < FAR_OFF))


def _cylinder(distance: float) -> float:
    origin, direction, truth = _rays_at_a_cylinder(distance)
    surfaces = CylinderSurfaces(
        0,
        1,
        single([[0.0], [0.0], [-HALF_HEIGHT]]),
        np.ones(1, np.float32),
        single([2.0 * HALF_HEIGHT]),
        _frame(),
    )
    t, prim = nearest_hits("cylinders", surfaces, origin, direction)
    return float(1.0 - np.mean((prim >= 0) & (np.abs(t - truth) < FAR_OFF)))


_DISTANCES = (1e1, 1e2, 3e2, 1e3, 3e3, 1e4, 1e5, 1e6, 1e7)
_CANCELS = "b^2 and 4 a c grow with the square of the distance; their difference, which is \
some radii wide, falls below the last place of either."
_FLOAT32 = (
    "What is left is float32 itself: at 10^7 its numbers are 1 apart, as is a radius."
)

ROWS = (
    Row(
        name="sphere-naive-distance",
        method="Sphere, textbook quadratic",
        stress="distance over radius",
        measure=far_spheres_wrong,
        quantity="error",
        unit="of rays missed or a tenth of the radius off",
        strengths=_DISTANCES,
        tolerance=0.01,
        holds_at=1e2,
        fails_at=1e3,
        why=_CANCELS,
        instead="Measure the line's distance to the centre first, then take the second "
        "root by Vieta's formula: the next row.",
        source="[Haines2019]; register of expected failures, far spheres",
        picture=picture,
        caption="A ball lit from the camera, seen from 10^2, 10^3, 3000 and 10^4 radii.",
    ),
    Row(
        name="sphere-stable-distance",
        method="Sphere, as this renderer meets it",
        stress="distance over radius",
        measure=_sphere,
        quantity="error",
        unit="of rays missed or a tenth of the radius off",
        strengths=_DISTANCES,
        tolerance=0.01,
        holds_at=1e5,
        fails_at=3e6,
        why=_FLOAT32,
        instead="Move the scene nearer to the camera, or scale the sphere up.",
        source="[Haines2019]; measured here",
    ),
    Row(
        name="cylinder-naive-distance",
        method="Cylinder, textbook quadratic",
        stress="distance over radius",
        measure=_naive_cylinder,
        quantity="error",
        unit="of rays missed or a tenth of the radius off",
        strengths=_DISTANCES,
        tolerance=0.01,
        holds_at=1e2,
        fails_at=1e3,
        why=_CANCELS,
        instead="The same remedy, across the axis: the next row.",
        source="measured here",
    ),
    Row(
        name="cylinder-stable-distance",
        method="Cylinder, as this renderer meets it",
        stress="distance over radius",
        measure=_cylinder,
        quantity="error",
        unit="of rays missed or a tenth of the radius off",
        strengths=_DISTANCES,
        tolerance=0.01,
        holds_at=1e5,
        fails_at=3e6,
        why=_FLOAT32,
        instead="Move the scene nearer to the camera, or scale the cylinder up.",
        source="measured here",
    ),
)
