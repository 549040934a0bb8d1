"""Mitsuba's `volpath` and `volpathmis` in Python, over its own objects.

It follows [Jakob2022, src/integrators/volpath.cpp, volpathmis.cpp] call by call, as
`mitsuba_trace` does `path`. A bounce is a flight with all of its null collisions, and what
happens at its end. The two integrators differ in what a path carries (`path_in_media`).
"""

from __future__ import annotations

import math
from typing import Any

import drjit
import numpy as np

from mitsuba_ref.our_renderer.traced_path import (
    COLLISION,
    ENDED,
    PHASE,
    SampledLight,
    Scattered,
    Vector,
    light_number,
)
from mitsuba_ref.replay.paths.mitsuba_path import NumbersDrawn, vector
from mitsuba_ref.replay.paths.mitsuba_trace import MitsubaTracer
from mitsuba_ref.replay.paths.path_in_media import PathInMedia, PathOfBothWays

_MOST_SURVIVAL = np.float32(0.95)


class VolpathTracer(MitsubaTracer):
    """Traces samples of single pixels of a scene with `volpath` or `volpathmis`."""

    def _begin(self, ray: Any, numbers: NumbersDrawn) -> PathInMedia:
        medium, number = self._sensor.get_medium(), numbers.one("colour")
        if self.method.densities:
            return PathOfBothWays(self._mi, ray, medium, number, self.method.densities)
        return PathInMedia(self._mi, ray, medium, number)

    def _length(self, start: Vector, at: Any) -> float:
        """Return the length of a segment, of all flights in it."""
        return math.dist(start, vector(at.p))

    def _fly(self, state: PathInMedia, numbers: NumbersDrawn) -> tuple[str, Any]:
        event, at = self._flight(state, numbers)
        hidden = self.method.hide_emitters and state.depth == 0
        if hidden and not event and not at.is_valid():
            return ENDED, None
        return event, at

    def _flight(self, state: PathInMedia, numbers: NumbersDrawn) -> tuple[str, Any]:
        """Return what ends a flight, before hidden lights are left out."""
        method, si, count = self.method, None, 0
        mis, null = method.densities > 0, False
        while True:
            count += 1
            if not mis and not any(state.worth):
                return ENDED, None
            largest = np.float32(max(state.worth))
            survival = float(min(largest * (state.eta * state.eta), _MOST_SURVIVAL))
            number = numbers.one(f"roulette {count}")
            if state.depth > (method.roulette_depth or 0) and not (mis and null):
                if not number < survival:
                    return ENDED, None
                state.raise_throughput(survival)
            if state.depth >= method.max_depth or not any(state.worth):
                return ENDED, None
            if state.medium is None:
                return "", self._surface(state)
            ray, drawn = state.ray, numbers.one(f"flight {count}")
            mei = state.medium.sample_interaction(ray, drawn, state.channel, True)
            if state.medium.is_homogeneous() and mei.is_valid():
                ray.maxt = mei.t
            if si is None:
                si = self._scene.ray_intersect(ray)
            if si.t < mei.t:
                mei.t = math.inf
            spectral = state.medium.has_spectral_extinction()
            if spectral:
                passed, pdf = state.medium.transmittance_eval_pdf(mei, si, True)
                state.after_flight(passed, pdf)
            if not mei.is_valid():
                if not mis:
                    numbers.skip(f"collision {count}")
                return "", si
            share = drjit.mean(mei.sigma_n / mei.combined_extinction)
            null = numbers.one(f"collision {count}") < share
            if null:
                state.after_null_collision(mei, share, spectral)
                ray.o, si.t = mei.p, si.t - mei.t
                continue
            state.depth += 1
            if state.depth >= method.max_depth:
                return ENDED, None
            state.after_collision(mei, share, spectral)
            state.previous = mei
            return COLLISION, mei

    def _scatter(
        self, state: PathInMedia, at: Any, numbers: NumbersDrawn
    ) -> tuple[tuple[SampledLight, ...], Scattered | None]:
        if isinstance(at, self._mi.MediumInteraction3f):
            return self._scatter_in_medium(state, at, numbers)
        return self._scatter_at_surface(state, at, numbers)

    def _scatter_in_medium(
        self, state: PathInMedia, mei: Any, numbers: NumbersDrawn
    ) -> tuple[tuple[SampledLight, ...], Scattered | None]:
        context = self._mi.PhaseFunctionContext(None)
        phase = mei.medium.phase_function()
        state.delta = not mei.medium.use_emitter_sampling()
        lights: tuple[SampledLight, ...] = ()
        if not state.delta:

            def eval_pdf(wi: Any) -> tuple[Any, float]:
                return phase.eval_pdf(context, mei, wi, True)  # type: ignore[no-any-return]

            lights = self._sampled(state, mei, eval_pdf, numbers)
        point = numbers.two(PHASE)
        wo, weight, pdf = phase.sample(context, mei, numbers.one(PHASE), point, True)
        state.ray = mei.spawn_ray(wo)
        state.pdf = pdf
        state.after_scattering(weight, pdf)
        # `volpathmis` finds out after one more number that nothing is left
        goes_on = self.method.densities or (pdf > 0.0 and any(state.worth))
        return lights, self._scattered(state, wo) if goes_on else None

    def _scatter_at_surface(
        self, state: PathInMedia, si: Any, numbers: NumbersDrawn
    ) -> tuple[tuple[SampledLight, ...], Scattered | None]:
        mi, bsdf, context = self._mi, si.bsdf(), self._mi.BSDFContext()
        lights: tuple[SampledLight, ...] = ()
        smooth = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        if smooth and state.depth + 1 < self.method.max_depth:

            def eval_pdf(wi: Any) -> tuple[Any, float]:
                wo = si.to_local(wi)
                return bsdf.eval(context, si, wo, True), bsdf.pdf(context, si, wo, True)

            lights = self._sampled(state, si, eval_pdf, numbers)
        point = numbers.two("bsdf")
        chosen, weight = bsdf.sample(context, si, numbers.one("bsdf"), point, True)
        kind, flags = chosen.sampled_type, mi.BSDFFlags
        straight = mi.has_flag(kind, flags.Null)
        wo = si.to_world(chosen.wo)
        state.after_scattering(weight, chosen.pdf, straight)
        state.eta = state.eta * np.float32(chosen.eta)
        state.ray = si.spawn_ray(wo)
        if not straight:
            state.depth += 1
            state.previous, state.pdf = si, chosen.pdf
            state.delta |= mi.has_flag(kind, flags.Delta)
        state.delta &= not mi.has_flag(kind, flags.Smooth)
        if si.is_medium_transition():
            state.medium = si.target_medium(state.ray.d)
        goes_on = chosen.pdf > 0.0 if self.method.densities else any(state.worth)
        return lights, self._scattered(state, wo, straight) if goes_on else None

    def _scattered(
        self, state: PathInMedia, direction: Any, straight: bool = False
    ) -> Scattered:
        return Scattered(
            vector(direction),
            0.0 if state.delta else float(state.pdf),
            vector(state.throughput),
            True,
            vector(state.ray.o),
            straight,
            state.weights,
        )

    def _sampled(
        self, state: PathInMedia, at: Any, eval_pdf: Any, numbers: NumbersDrawn
    ) -> tuple[SampledLight, ...]:
        """Sample a light at a surface or a collision, and add what arrives."""
        mi, scene, point = self._mi, self._scene, numbers.two(light_number(0))
        if not self._light_names:
            return ()
        sampled, radiance = scene.sample_emitter_direction(at, point, False, True)
        shadow, origin = state.shadow_ray(sampled.pdf), None
        if sampled.pdf != 0.0:
            shadow.ray = at.spawn_ray_to(sampled.p)
            origin = vector(shadow.ray.o)
            if isinstance(at, mi.SurfaceInteraction3f) and at.is_medium_transition():
                shadow.medium = at.target_medium(shadow.ray.d)
            self._attenuate(shadow, sampled.dist, numbers)
        else:
            radiance = mi.Color3f(0.0)
        value, pdf = eval_pdf(sampled.d)
        pdf = 0.0 if sampled.delta else pdf
        carried, passed = state.light(shadow, value, pdf, sampled.pdf, radiance)
        state.result = state.result + carried * passed
        carried, passed = vector(carried), vector(passed)
        blocked = not any(passed) if any(carried) else None
        return (self._sampled_light(sampled, radiance, carried, blocked, origin, passed),)

    def _attenuate(self, shadow: PathInMedia, length: float, numbers: NumbersDrawn) -> None:
        """Let a shadow ray pass media and surfaces, by ratio tracking."""
        si, count = None, 0
        whole, gone = np.float32(shadow.ray.maxt), np.float32(0.0)
        while shadow.passes:
            ray, medium, rest = shadow.ray, shadow.medium, whole - gone
            ray.maxt = float(rest)
            if not rest > 0.0:
                return
            collided = False
            if medium is not None:
                count += 1
                drawn = numbers.one(f"shadow {count}")
                mei = medium.sample_interaction(ray, drawn, shadow.channel, True)
                if medium.is_homogeneous() and mei.is_valid():
                    ray.maxt = min(mei.t, float(rest))
                si = self._scene.ray_intersect(ray) if si is None else si
                if si.t < mei.t:
                    mei.t = math.inf
                spectral, sigma = medium.has_spectral_extinction(), mei.combined_extinction
                if spectral:
                    t = min(float(rest), mei.t, si.t) - mei.mint
                    left = drjit.exp(-t * sigma)
                    ends = si.t < mei.t or mei.t > rest
                    shadow.after_flight(left, left if ends else left * sigma)
                if mei.t > rest:
                    gone = np.float32(length) if mei.is_valid() else gone
                    mei.t = math.inf
                collided = bool(mei.is_valid())
                if collided:
                    gone = gone + np.float32(mei.t)
                    ray.o, si.t = mei.p, si.t - mei.t
                    shadow.after_ratio(mei, spectral)
            elif si is None:
                si = self._scene.ray_intersect(ray)
            if not collided:
                gone = gone + np.float32(si.t)
                if not si.is_valid():
                    return
                left = si.bsdf().eval_null_transmission(si, True)
                shadow.after_flight(left, self._mi.Color3f(1.0))
                crossed, shadow.ray = si, si.spawn_ray(ray.d)
                si = None
                if crossed.is_medium_transition():
                    shadow.medium = crossed.target_medium(ray.d)
