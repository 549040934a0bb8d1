"""Which of several lights is asked at a point: by what each can give there at most.

That is strength / max(d^2, r^2), times the largest cosines that any point of a ball of
radius r around the light can have at distance d, at the light and at the surface
[Estevez2018, section 5.3]. A sixteenth of the choices is uniform: what no bound knows makes
noise then, and no bias. The kernels put lights into trees where there are more than 64;
here all of them are looked at, always.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from renderer.scene_file.description import (
    ConstantLight,
    Cylinder,
    DirectionalLight,
    Mesh,
    PointLight,
    Sphere,
    SpotLight,
)
from renderer.simple.lights import Light
from renderer.simple.surfaces.surfaces import Surface
from renderer.simple.vectors import Vector, normalize

UNIFORM = 1.0 / 16.0
_LEAST_REACH = 0.01  # [rad]
_SQUARE = np.array([(-1, -1, 0), (1, -1, 0), (-1, 1, 0), (1, 1, 0)], float)


class Bounds(NamedTuple):
    """A ball that holds the light, and the cone that it shines into.

    It shines in full within the angle `spread` of the axis, then as the cosine of the angle
    from there, and not at all `reach` farther on [rad].
    """

    strength: float  # [W/sr], mean of RGB; at infinity the irradiance
    center: Vector = np.zeros(3)
    radius: float = 0.0
    axis: Vector = np.array((0.0, 0.0, 1.0))  # at infinity towards the light
    spread: float = math.pi
    reach: float = 0.0
    at_infinity: bool = False


def bounds_of(light: Light) -> Bounds:
    """Return what is known of a light before any point asks it."""
    match light:
        case PointLight():
            return Bounds(float(np.mean(light.intensity)), np.array(light.position))
        case SpotLight():
            center, axis = light.to_world[:3, 3], normalize(light.to_world[:3, 2])
            beam, cutoff = np.radians([light.beam_width, light.cutoff_angle])
            strength = float(np.mean(light.intensity))
            # a cosine reaches no farther than 90 degrees
            spread = max(beam, cutoff - math.pi / 2)
            return Bounds(strength, center, 0.0, axis, spread, cutoff - spread)
        case DirectionalLight():
            to_light = -normalize(np.array(light.direction))
            strength = float(np.mean(light.irradiance))
            return Bounds(strength, axis=to_light, spread=0.0, at_infinity=True)
        case ConstantLight():
            strength = math.pi * float(np.mean(light.radiance))
            return Bounds(strength, at_infinity=True)
        case Surface():
            return _of_surface(light)
    raise TypeError(f"no bounds for {light}")


def _of_surface(light: Surface) -> Bounds:
    """Return the bounds of a shape: in a ball around the middle of its box.

    Along the axis all of a flat shape is seen, and of a convex one a fourth on average.
    """
    shape, radiance = light.shape, float(np.mean(light.radiance))
    first, last = light.a[0], light.a[0]
    margin = 0.0 if isinstance(shape, Mesh) else float(np.linalg.norm(light.A[0, :, 0]))
    if isinstance(shape, Sphere | Cylinder):
        if isinstance(shape, Cylinder):
            last = first + light.A[0, :, 2]
        strength = radiance * light.area / 4
        points = np.array([first, last])
        return Bounds(strength, *_ball(points, margin), reach=math.pi / 2)
    if isinstance(shape, Mesh):
        points = np.concatenate(
            [light.a, light.a + light.A[:, :, 0], light.a + light.A[:, :, 1]]
        )
    else:  # a disk in its square
        points = first + _SQUARE @ light.A[0].T
    normals = light.inverse[:, 2] * (-1.0 if shape.flip_normals else 1.0)
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    sizes = light.face_areas * light.area / light.face_areas.sum()
    facing = sizes @ normals
    seen = float(np.linalg.norm(facing))
    strength = radiance * max(seen, light.area / 4)
    ball = _ball(points, 0.0)
    if seen < 0.01 * light.area:  # closed
        return Bounds(strength, *ball, reach=math.pi / 2)
    apart = float(np.linalg.norm(normals - facing / seen, axis=1).max())
    spread = 2 * math.asin(min(apart / 2, 1.0))
    return Bounds(strength, *ball, facing / seen, spread, math.pi / 2)


def _ball(points: Vector, margin: float) -> tuple[Vector, float]:
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    return center, float(np.linalg.norm(points - center, axis=1).max()) + margin


class LightChoice:
    """The lights of a scene."""

    def __init__(self, lights: list[Light]) -> None:
        self.bounds = [bounds_of(light) for light in lights]
        near = [b for b in self.bounds if not b.at_infinity]
        if near:  # at the very place of a light its importance stays finite
            lower = np.min([b.center - b.radius for b in near], axis=0)
            upper = np.max([b.center + b.radius for b in near], axis=0)
            least = max(1e-5 * float(np.linalg.norm(upper - lower)), 1e-18)
            self.bounds = [b._replace(radius=max(b.radius, least)) for b in self.bounds]

    def choose(self, p: Vector, n: Vector, number: float) -> int:
        """Return a light for a point with normal n, by a number in [0, 1)."""
        given = self._given(p, n)
        total, count = sum(given), len(given)
        if number < UNIFORM or total == 0:
            return int(number / (UNIFORM if total > 0 else 1.0) * count)
        number = (number - UNIFORM) / (1 - UNIFORM)
        chosen = np.searchsorted(np.cumsum(given), number * total, side="right")
        return min(int(chosen), max(k for k in range(count) if given[k] > 0))

    def probability(self, p: Vector, n: Vector, light: int) -> float:
        """Return the probability with which a light is chosen."""
        given = self._given(p, n)
        total, uniform = sum(given), 1 / len(given)
        if total == 0:
            return uniform
        return UNIFORM * uniform + (1 - UNIFORM) * given[light] / total

    def _given(self, p: Vector, n: Vector) -> list[float]:
        return [importance(bounds, p, n) for bounds in self.bounds]


def importance(bounds: Bounds, p: Vector, n: Vector) -> float:
    """Return what a light can give at most at a point p with normal n."""
    if bounds.at_infinity:
        off = _angle(float(bounds.axis @ n)) - bounds.spread
        return bounds.strength * max(math.cos(max(off, 0.0)), 0.0)
    to_light = bounds.center - p
    d2 = float(to_light @ to_light)
    ball = math.pi  # the half angle under which the ball is seen; from inside all
    if d2 > bounds.radius**2:
        ball = math.asin(bounds.radius / math.sqrt(d2))
    wi = normalize(to_light)
    at_light = _angle(-float(bounds.axis @ wi)) - bounds.spread - ball
    at_surface = _angle(float(n @ wi)) - ball
    if at_light >= max(bounds.reach, _LEAST_REACH):
        return 0.0
    cosines = math.cos(max(at_light, 0.0)) * max(math.cos(max(at_surface, 0.0)), 0.0)
    return bounds.strength * cosines / max(d2, bounds.radius**2)


def _angle(cosine: float) -> float:
    return math.acos(min(max(cosine, -1.0), 1.0))
