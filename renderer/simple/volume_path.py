"""Path tracing through homogeneous media, one ray at a time.

A flight ends at the surface, or at a collision before it. The distance t of a collision has
the density s exp(-s t), where s is the sigma_t of a colour chosen at random. The weight is
each colour's value over the mean of the three densities. A phase function takes the place
of the BSDF. A shadow ray is attenuated by exp(-sigma_t distance) in each medium on its way.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from renderer.scene_file.description import Null
from renderer.scene_file.media_description import HenyeyGreenstein
from renderer.simple.bsdfs import BsdfSample, Lobe
from renderer.simple.camera import Ray, Vector, orthonormal_basis
from renderer.simple.lights import power_heuristic, sample_light
from renderer.simple.materials import Material
from renderer.simple.scene import (
    BLOCKS_PER_BOUNCE,
    EPSILON,
    Draw,
    Scene,
    closest_hit,
    emission,
)
from renderer.simple.shapes import Hit

FLIGHT = BLOCKS_PER_BOUNCE // 2  # first block of a flight's numbers within a bounce


def volpath_radiance(scene: Scene, ray: Ray, draw: Draw) -> Vector:
    """Return an estimate of the radiance that arrives along a ray."""
    p, d, near, far = ray
    medium, event = scene.medium, p  # `event`: position of the last scattering
    radiance, throughput, eta, depth = np.zeros(3), np.ones(3), 1.0, 0
    share = 1.0 / max(len(scene.lights), 1)
    came_by: BsdfSample | None = None
    for step in itertools.count():
        block = 1 + BLOCKS_PER_BOUNCE * step
        hit = closest_hit(scene, p, d, near, far)
        end = math.inf if hit is None else hit.t
        flight = math.inf
        if medium is not None:
            u, colour, _, _ = draw(block + FLIGHT)
            rate = sigma_t(medium)[int(3.0 * colour)]
            flight = -math.log(1.0 - u) / rate if rate else math.inf
            throughput = throughput * _weight(medium, min(flight, end), flight < end)
        collides = flight < end
        if not collides:
            radiance += throughput * emission(scene, event, d, hit, came_by, share)
        if not throughput.any() or (hit is None and not collides):
            return radiance
        straight = (
            not collides and hit is not None and isinstance(hit.surface.shape.bsdf, Null)
        )
        if not straight and depth + 1 == scene.max_depth:
            return radiance
        x = p + flight * d if collides or hit is None else hit.x
        scatterer = Scatterer(medium, d, hit, collides)
        if scene.lights and not straight:
            *place, which = draw(block + 1)
            light = scene.lights[int(which * len(scene.lights))]
            direct = _light_of(scene, x, scatterer, light, place, share, medium, hit)
            radiance += throughput * direct / share

        u, v, choice, roulette = draw(block)
        chosen = scatterer.sample((u, v, choice))
        throughput, eta = throughput * chosen.weight, eta * chosen.eta
        if not throughput.any():
            return radiance
        if step + 1 >= scene.rr_depth:
            survival = min(throughput.max() * eta**2, 0.95)
            if roulette >= survival:
                return radiance
            throughput = throughput / survival
        if not straight:
            came_by, event, depth = chosen, x, depth + 1
        if not collides and hit is not None:
            medium = behind(hit, chosen.wi, medium)
        p, d, near, far = x, chosen.wi, 0.0, math.inf
    raise AssertionError("a path ends by itself")


class Scatterer:
    """The scattering function at a point: a BSDF, or the phase function of a medium."""

    def __init__(self, medium: Any, d: Vector, hit: Hit | None, collides: bool) -> None:
        self.material = None if collides or hit is None else Material(hit)
        phase = None if medium is None else medium.phase
        self.g = phase.g if isinstance(phase, HenyeyGreenstein) else 0.0
        self.d = d

    def eval_pdf(self, wi: Vector) -> tuple[Any, float]:
        """Return f cos or the phase function, and the density of `sample`."""
        if self.material is not None:
            return self.material.eval_pdf(wi)
        g = self.g
        squared = 1.0 + g * g - 2.0 * g * float(self.d @ wi)
        pdf = (1.0 - g * g) / (4.0 * math.pi * squared**1.5)
        return np.full(3, pdf), pdf

    def sample(self, numbers: Any) -> BsdfSample:
        """Sample the next direction of the path."""
        if self.material is not None:
            return self.material.sample(numbers)
        x, y, _ = numbers
        g, c = self.g, 2.0 * x - 1.0
        # c is the cosine for g = 0; this formula does not divide by g
        cosine = c + g * (1.5 + 0.5 * c * c) + g * g * c + 0.5 * g**3 * (c * c - 1.0)
        cosine /= (1.0 + g * c) ** 2
        sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
        (s, t), phi = orthonormal_basis(self.d), 2.0 * math.pi * y
        across = s * math.cos(phi) + t * math.sin(phi)
        wi = self.d * cosine + across * sine
        return BsdfSample(wi, np.ones(3), self.eval_pdf(wi)[1], 1.0, Lobe.SMOOTH)


def sigma_t(medium: Any) -> Vector:
    """Return the extinction coefficient of a homogeneous medium [1/length]."""
    return np.array(medium.sigma_t.rgb) * medium.scale


def passed_by(medium: Any, distance: float) -> Vector:
    """Return exp(-sigma_t distance); 1 for sigma_t 0 at any distance."""
    return np.array([math.exp(-s * distance) if s else 1.0 for s in sigma_t(medium)])


def _weight(medium: Any, distance: float, collides: bool) -> Vector:
    """Return a flight's transmittance over its density."""
    passed = passed_by(medium, distance)
    if not collides:
        return passed / passed.mean() if passed.any() else passed
    density = (passed * sigma_t(medium)).mean()
    weight: Vector = passed * sigma_t(medium) * np.array(medium.albedo.rgb) / density
    return weight


def behind(hit: Hit, d: Vector, medium: Any) -> Any:
    """Return the medium behind a surface; a surface that is no boundary keeps `medium`."""
    shape = hit.surface.shape
    if shape.interior is None and shape.exterior is None:
        return medium
    return shape.exterior if d @ hit.geometric_normal > 0.0 else shape.interior


def _light_of(
    scene: Scene,
    x: Vector,
    scatterer: Scatterer,
    light: Any,
    place: Sequence[float],
    share: float,
    medium: Any,
    hit: Hit | None,
) -> Vector:
    """Return the scattered light of one light sample: f L / pdf V T."""
    sample = sample_light(light, x, *place)
    f, pdf = scatterer.eval_pdf(sample.wi)
    if not (f * sample.radiance).any():
        return np.zeros(3)
    if scatterer.material is not None and hit is not None:
        medium = behind(hit, sample.wi, medium)
    weight = power_heuristic(sample.pdf * share, pdf) if sample.pdf > 0 else 1.0
    passed = transmittance(scene, x, sample.wi, sample.distance, medium)
    return f * sample.radiance * weight * passed


def transmittance(scene: Scene, p: Vector, d: Vector, distance: float, medium: Any) -> Any:
    """Return the transmittance from p up to a distance; `null` surfaces do not block."""
    passed = np.ones(3)
    rest = distance * (1.0 - EPSILON)
    while True:
        hit = closest_hit(scene, p, d, 0.0, rest)
        length = rest if hit is None else hit.t
        if medium is not None:
            passed = passed * passed_by(medium, length)
        if hit is None:
            return passed
        if not isinstance(hit.surface.shape.bsdf, Null):
            return np.zeros(3)
        medium = behind(hit, d, medium)
        p, rest = hit.x, rest - length
