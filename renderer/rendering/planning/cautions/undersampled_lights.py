"""Lamps that are asked too rarely, because each is asked as often as any other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.planning.cautions.flat_faces import Floats
from renderer.rendering.planning.cautions.surface_points import (
    SurfacePoints,
    surface_points,
)
from renderer.rendering.planning.plan import Plan
from renderer.scene.materials import kind_of, sides
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    Disk,
    Mesh,
    PointLight,
    Rectangle,
    Shape,
    Sphere,
    SpotLight,
    TwoSided,
)

LIMIT = 4.0  # standard deviation of a sample over the mean: 25 % error at 256 samples
NEARLY_ALL = 0.9  # of the lit area
POINTS = 1024  # at which lamps are looked at
_KNOWN = Disk, Mesh, Rectangle, Sphere


def undersampled_lights(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find scenes nearly all of whose area gets its light from few of many lamps.

    With n lamps that give f each, a uniform choice has a standard deviation of
    sqrt(n sum f^2 / (sum f)^2 - 1) of the mean. A choice by what lamps can give has nearly
    none: it is not looked at. Shadows are not looked at, nor what of the
    area is in view: where a shadow falls the value is another, larger or smaller. Of
    extended lamps and of other shapes than flat ones and spheres nothing is known here:
    a scene that has any gets no caution.
    """
    emitters = scene.description.emitters
    lamps = [e for e in emitters if isinstance(e, PointLight | SpotLight)]
    count = len(emitters) + sum(s.radiance is not None for s in scene.description.shapes)
    uniform = plan.asks_lights and not plan.every_light and not plan.by_importance
    if not uniform or count < 2 or len(lamps) < count:
        return
    shapes = tuple(s for s in scene.description.every_shape if _asks_lamps(s))
    if scene.description.groups or not all(isinstance(s, _KNOWN) for s in shapes):
        return
    points = surface_points(shapes, POINTS)
    both = np.array([_is_lit_from_behind(s.bsdf) for s in shapes], bool)[points.owner]
    light = np.stack([_irradiance(lamp, points, both) for lamp in lamps])
    total = light.sum(axis=0)
    lit = total > 0.0
    if not lit.any():
        return
    second = count * np.sum(light[:, lit] ** 2, axis=0) / total[lit] ** 2
    spread = np.sqrt(np.maximum(second - 1.0, 0.0))
    if np.mean(spread > LIMIT) > NEARLY_ALL:
        yield (
            f"one of {count} lamps is asked at a time, all equally often, and few of them "
            f"give most of the light: a sample varies by {np.median(spread):.2g} times its "
            "mean, shadows aside"
        )


def _asks_lamps(shape: Shape) -> bool:
    """Return whether there is more to a shape than mirrors and glass."""
    return any(side is not None and kind_of(side).smooth for side in sides(shape.bsdf))


def _is_lit_from_behind(bsdf: Any) -> bool:
    return isinstance(bsdf, TwoSided) or bool(kind_of(bsdf).transmits)


def _irradiance(lamp: Any, points: SurfacePoints, both: NDArray[np.bool_]) -> Floats:
    """Return what an unshadowed lamp gives, 0 beyond the cone of a spot.

    And behind the points, but where both sides are lit.
    """
    spot = isinstance(lamp, SpotLight)
    away = points.position - (lamp.to_world[:3, 3] if spot else np.array(lamp.position))
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    cosine = -np.einsum("ij,ij->i", points.normal, away) / distance
    cosine = np.where(both, np.abs(cosine), np.maximum(cosine, 0.0))
    light = np.asarray(max(lamp.intensity) * cosine / distance**2)
    if not spot:
        return light
    axis = lamp.to_world[:3, 2] / np.linalg.norm(lamp.to_world[:3, 2])
    inside = away @ axis > np.cos(np.radians(lamp.cutoff_angle)) * distance
    return np.where(inside, light, 0.0)
