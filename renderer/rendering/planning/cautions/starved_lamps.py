"""Lamps that are asked too rarely, because each is asked as often as any other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.planning.cautions.caution import Caution
from renderer.scene.scene import Scene, primitive_bounds
from renderer.scene_file.description import PointLight, SpotLight

if TYPE_CHECKING:
    from renderer.rendering.planning.plan import Plan

LIMIT = 4.0  # standard deviation of a sample over the mean: 25 % error at 256 samples
POINTS = 512  # at which lamps are looked at


def starved_lamps(scene: Scene, plan: Plan) -> Iterator[Caution]:
    """Find scenes whose points get nearly all their light from few of many lamps.

    Point and spot lights alone: how much of an extended lamp a point sees is not known
    here. With n lamps that give f each, a uniform choice has a standard deviation of
    sqrt(n sum f^2 / (sum f)^2 - 1) of the mean; shadows would only add to it.
    """
    emitters = scene.description.emitters
    lamps = [e for e in emitters if isinstance(e, PointLight | SpotLight)]
    count = len(emitters) + sum(s.radiance is not None for s in scene.description.shapes)
    if plan.every_light or not plan.asks_lights or count < 2 or len(lamps) < count:
        return
    points = _points(scene)
    if not len(points):
        return
    light = np.stack([_irradiance(lamp, points) for lamp in lamps])
    total = light.sum(axis=0)
    lit = total > 0.0
    if not lit.any():
        return
    second = count * np.sum(light[:, lit] ** 2, axis=0) / total[lit] ** 2
    spread = float(np.median(np.sqrt(np.maximum(second - 1.0, 0.0))))
    if spread > LIMIT:
        yield Caution(
            f"one of {count} lamps is asked at a time, all equally often, and few of them "
            f"give most of the light: a sample varies by {spread:.2g} times its mean",
            "lamps-starved",
        )


def _points(scene: Scene) -> NDArray[np.float64]:
    """Return the middles of primitives, of all kinds, (n, 3)."""
    middles = [np.zeros((0, 3))]
    for kind, surfaces in scene.surfaces.items():
        count = scene.starts[kind][0]
        low, high = primitive_bounds(kind, surfaces)
        every = range(0, count, max(1, count // POINTS))
        middles.append((low.astype(np.float64) + high)[:, every].T / 2.0)
    return np.concatenate(middles)


def _irradiance(lamp: Any, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the intensity over the squared distance, 0 beyond the cone of a spot."""
    spot = isinstance(lamp, SpotLight)
    place = lamp.to_world[:3, 3] if spot else np.array(lamp.position)
    away = points - place
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    light = max(lamp.intensity) / distance**2
    if not spot:
        return np.asarray(light)
    axis = lamp.to_world[:3, 2] / np.linalg.norm(lamp.to_world[:3, 2])
    inside = away @ axis > np.cos(np.radians(lamp.cutoff_angle)) * distance
    return np.where(inside, light, 0.0)
