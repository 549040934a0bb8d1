"""The state of one path that is traced over Mitsuba's objects, rounded as Mitsuba does."""

from __future__ import annotations

from typing import Any

import drjit
import numpy as np

from mitsuba_ref.our_renderer.traced_path import Numbers, Vector, Weights
from mitsuba_ref.replay.integrator_method import Method


class NumbersDrawn:
    """A Mitsuba sampler that keeps what it has drawn, by name."""

    def __init__(self, sampler: Any) -> None:
        self._sampler = sampler
        self._drawn: Numbers = {}

    def one(self, name: str) -> float:
        """Draw one number."""
        self._drawn[name] = value = float(self._sampler.next_1d())
        return value

    def two(self, name: str) -> Any:
        """Draw a point of the unit square."""
        point = self._sampler.next_2d()
        self._drawn[f"{name} x"] = float(point.x)
        self._drawn[f"{name} y"] = float(point.y)
        return point

    def skip(self, name: str) -> None:
        """Draw as a masked lane does: of some samplers, the dimension alone."""
        self._sampler.next_1d(False)
        self._drawn[f"skipped {name}"] = 0.0

    def take(self) -> Numbers:
        """Return what was drawn since the last time."""
        drawn, self._drawn = self._drawn, {}
        return drawn


class PathState:
    """What a path carries from bounce to bounce."""

    def __init__(self, mi: Any, ray: Any) -> None:
        self.ray = ray
        self.throughput = mi.Color3f(1.0)
        self.result = mi.Color3f(0.0)
        self.eta = np.float32(1.0)
        self.depth = 0
        self.active = True
        # the camera counts as a mirror: its ray has the full weight, without MIS
        self.previous: Any = None
        self.pdf = 1.0
        self.delta = True
        self._mi = mi

    @property
    def weights(self) -> Weights:
        """What a trace shows besides the throughput."""
        return {}

    def add(self, radiance: Any) -> None:
        """Add to the pixel what arrives at the path's end."""
        self.result = drjit.fma(self.throughput, radiance, self.result)

    def arrive(self, radiance: Any, light_pdf: float | None, method: Method) -> None:
        """Add emitted light; `light_pdf` is None where no light sample could find it."""
        weight = 1.0 if light_pdf is None else method.bsdf_weight(self.pdf, light_pdf)
        self.add(radiance * weight)

    def go_on(self, si: Any, direction: Any, chosen: Any, weight: Any) -> None:
        """Leave a surface point in the direction that its BSDF chose."""
        self.ray = si.spawn_ray(direction)
        self.throughput = self.throughput * weight
        self.eta = self.eta * np.float32(chosen.eta)
        self.previous = si
        self.pdf = chosen.pdf
        self.delta = self._mi.has_flag(chosen.sampled_type, self._mi.BSDFFlags.Delta)
        self.depth += 1

    def play_roulette(self, roulette_depth: int | None, numbers: NumbersDrawn) -> bool:
        """Play Russian roulette; the number is drawn even where it does not count."""
        if roulette_depth is None:
            return True
        largest = np.float32(max(vector(self.throughput)))
        survival = min(largest * self.eta * self.eta, np.float32(0.95))
        number = numbers.one("roulette")
        if self.depth < roulette_depth:
            return True
        if survival > 0.0:
            self.throughput = self.throughput * float(np.float32(1.0) / survival)
        self.active = bool(number < survival)
        return self.active


def film_place(pixel: int, jitter: float, size: int, offset: int) -> float:
    """Return a place in [0, 1] along one axis of the crop window."""
    scale = np.float32(1.0) / np.float32(size)
    start = np.float32(-offset) * scale
    place = np.float32(pixel + offset) + np.float32(jitter)
    # one rounding for product and sum, as of a fused multiply-add
    return float(np.float32(float(place) * float(scale) + float(start)))


def vector(value: Any) -> Vector:
    """Return a Mitsuba vector or colour as three numbers."""
    x, y, z = (float(component) for component in value)
    return x, y, z
