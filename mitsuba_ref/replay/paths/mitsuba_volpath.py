"""Mitsuba's `volpath` in Python, over its own objects, with all that a path meets.

It follows [Jakob2022, src/integrators/volpath.cpp] call by call, as `mitsuba_trace` does
`path`. A bounce is a flight with all of its null collisions, and what happens at its end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import drjit
import numpy as np

from mitsuba_ref.our_renderer.traced_path import (
    BLACK,
    COLLISION,
    ENDED,
    PHASE,
    Bounce,
    SampledLight,
    Scattered,
    light_number,
)
from mitsuba_ref.replay.paths.mitsuba_path import NumbersDrawn, PathState, vector
from mitsuba_ref.replay.paths.mitsuba_trace import MitsubaTracer

_MOST_SURVIVAL = np.float32(0.95)


class _PathInMedia(PathState):
    """What a path carries; `delta`: light that it finds was not sampled before."""

    def __init__(self, mi: Any, ray: Any, medium: Any, number: float) -> None:
        super().__init__(mi, ray)
        self.medium = medium
        self.channel = min(int(np.float32(number) * np.float32(3.0)), 2)

    def multiply(self, factor: Any) -> None:
        """Multiply the throughput by a colour."""
        self.throughput = self.throughput * factor


class VolpathTracer(MitsubaTracer):
    """Traces samples of single pixels of a scene with `volpath`."""

    def _bounces(self, ray: Any, numbers: NumbersDrawn) -> Iterator[Bounce]:
        medium, number = self._sensor.get_medium(), numbers.one("colour")
        state = _PathInMedia(self._mi, ray, medium, number)
        while state.active:
            yield self._flight(state, numbers)

    def _flight(self, state: _PathInMedia, numbers: NumbersDrawn) -> Bounce:
        start, before = vector(state.ray.o), state.result
        event, at = self._fly(state, numbers)
        hidden = self.method.hide_emitters and state.depth == 0
        if event == ENDED or (hidden and not event and not at.is_valid()):
            state.active = False
            here = vector(state.result)
            drawn = numbers.take()
            return Bounce(
                0, None, 0.0, None, BLACK, BLACK, drawn, (), None, here, event=ENDED
            )
        arriving, hit = vector(state.throughput), not event and bool(at.is_valid())
        position = vector(at.p) if hit or event else None
        lights: tuple[SampledLight, ...] = ()
        scattered, emitted = None, BLACK
        if event:
            lights, scattered = self._scatter_in_medium(state, at, numbers)
        else:
            self._arrive(state, at)
            emitted = vector(state.result - before)
            if hit:
                lights, scattered = self._scatter(state, at, numbers)
        state.active = scattered is not None
        return Bounce(
            shape=self._shape_number(at) if hit else 0,
            face=int(at.prim_index) if hit and at.shape.is_mesh() else None,
            t=math.inf if position is None else math.dist(start, position),
            position=position,
            throughput=arriving,
            emitted=emitted,
            numbers=numbers.take(),
            lights=lights,
            scattered=scattered,
            radiance=vector(state.result),
            normal=vector(at.sh_frame.n) if hit else None,
            event=event,
        )

    def _fly(self, state: _PathInMedia, numbers: NumbersDrawn) -> tuple[str, Any]:
        """Return `COLLISION`, `ENDED` or, at a surface and in the sky, an empty text.

        And the interaction there; None where the path has ended.
        """
        method, si, count = self.method, None, 0
        while True:
            count += 1
            if not any(vector(state.throughput)):
                return ENDED, None
            largest = np.float32(max(vector(state.throughput)))
            survival = float(min(largest * (state.eta * state.eta), _MOST_SURVIVAL))
            number = numbers.one(f"roulette {count}")
            if state.depth > (method.roulette_depth or 0):
                if not number < survival:
                    return ENDED, None
                state.multiply(_inverse(survival))
            if state.depth >= method.max_depth:
                return ENDED, None
            if state.medium is None:
                return "", self._surface(state)
            ray, drawn = state.ray, numbers.one(f"flight {count}")
            mei = state.medium.sample_interaction(ray, drawn, state.channel, True)
            if state.medium.is_homogeneous() and mei.is_valid():
                ray.maxt = mei.t
            if si is None:
                si = self._hit(ray)
            if si.t < mei.t:
                mei.t = math.inf
            spectral = state.medium.has_spectral_extinction()
            if spectral:
                passed, pdf = state.medium.transmittance_eval_pdf(mei, si, True)
                state.multiply(passed * _inverse_or_zero(pdf[state.channel]))
            if not mei.is_valid():
                numbers.skip(f"collision {count}")
                return "", si
            share = drjit.mean(mei.sigma_n / mei.combined_extinction)
            if numbers.one(f"collision {count}") < share:
                if spectral:
                    state.multiply(mei.sigma_n * _inverse(share))
                ray.o, si.t = mei.p, si.t - mei.t
                continue
            state.depth += 1
            if state.depth >= method.max_depth:
                return ENDED, None
            if spectral:
                real = drjit.mean(mei.sigma_t / mei.combined_extinction)
                state.multiply(mei.sigma_s * _inverse(real))
            else:
                state.multiply(mei.sigma_s / mei.sigma_t)
            state.previous = mei
            return COLLISION, mei

    def _hit(self, ray: Any) -> Any:
        return self._scene.ray_intersect(ray, int(self._mi.RayFlags.All), False)

    def _surface(self, state: _PathInMedia) -> Any:
        """Intersect a ray outside of media; the camera may not see lamps."""
        si = self._hit(state.ray)
        hides = self.method.hide_emitters and state.depth == 0 and si.is_valid()
        if not hides or si.shape.emitter() is None:
            return si
        ray, scene, flags = si.spawn_ray(state.ray.d), self._scene, self._mi.RayFlags
        behind = scene.integrator().skip_area_emitters(scene, ray, True, True)
        return behind.compute_surface_interaction(ray, int(flags.All), True)

    def _scatter_in_medium(
        self, state: _PathInMedia, mei: Any, numbers: NumbersDrawn
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
        state.multiply(weight)
        return lights, self._scattered(state, wo) if pdf > 0.0 else None

    def _scatter(
        self, state: Any, si: Any, numbers: NumbersDrawn
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
        state.multiply(weight)
        state.eta = state.eta * np.float32(chosen.eta)
        state.ray = si.spawn_ray(wo)
        if not straight:
            state.depth += 1
            state.previous, state.pdf = si, chosen.pdf
            state.delta |= mi.has_flag(kind, flags.Delta)
        state.delta &= not mi.has_flag(kind, flags.Smooth)
        if si.is_medium_transition():
            state.medium = si.target_medium(state.ray.d)
        return lights, self._scattered(state, wo, straight)

    def _scattered(
        self, state: _PathInMedia, direction: Any, straight: bool = False
    ) -> Scattered | None:
        throughput = vector(state.throughput)
        if not any(throughput):
            return None
        pdf = 0.0 if state.delta else float(state.pdf)
        origin = vector(state.ray.o)
        return Scattered(vector(direction), pdf, throughput, True, origin, straight)

    def _sampled(
        self, state: _PathInMedia, at: Any, eval_pdf: Any, numbers: NumbersDrawn
    ) -> tuple[SampledLight, ...]:
        """Sample a light at a surface or a collision, and add what arrives."""
        mi, scene, point = self._mi, self._scene, numbers.two(light_number(0))
        if not self._light_names:
            return ()
        sampled, radiance = scene.sample_emitter_direction(at, point, False, True)
        passed = mi.Color3f(0.0)
        origin = None
        if sampled.pdf != 0.0:
            ray, medium = at.spawn_ray_to(sampled.p), state.medium
            origin = vector(ray.o)
            if isinstance(at, mi.SurfaceInteraction3f) and at.is_medium_transition():
                medium = at.target_medium(ray.d)
            passed = self._passed(ray, medium, state.channel, sampled.dist, numbers)
        else:
            radiance = mi.Color3f(0.0)
        value, pdf = eval_pdf(sampled.d)
        pdf = 0.0 if sampled.delta else pdf
        value = value * self.method.light_weight(sampled.pdf, pdf)
        state.result = state.result + state.throughput * value * (passed * radiance)
        carried = vector(state.throughput * value * radiance)
        far = mi.has_flag(sampled.emitter.flags(), mi.EmitterFlags.Infinite)
        light = SampledLight(
            light=self._light_names.get(sampled.emitter, "?"),
            direction=vector(sampled.d),
            distance=math.inf if far else float(sampled.dist),
            pdf=0.0 if sampled.delta else float(sampled.pdf),
            weight=vector(radiance),
            carried=carried,
            blocked=not any(vector(passed)) if any(carried) else None,
            origin=origin,
            passed=vector(passed),
        )
        return (light,)

    def _passed(
        self, ray: Any, medium: Any, channel: int, length: float, numbers: NumbersDrawn
    ) -> Any:
        """Return what of a light sample passes media and surfaces, by ratio tracking."""
        passed, si, count = self._mi.Color3f(1.0), None, 0
        whole, gone = np.float32(ray.maxt), np.float32(0.0)
        while True:
            rest = whole - gone
            ray.maxt = float(rest)
            if not rest > 0.0:
                return passed
            collided = False
            if medium is not None:
                count += 1
                drawn = numbers.one(f"shadow {count}")
                mei = medium.sample_interaction(ray, drawn, channel, True)
                if medium.is_homogeneous() and mei.is_valid():
                    ray.maxt = min(mei.t, float(rest))
                si = self._hit(ray) if si is None else si
                if si.t < mei.t:
                    mei.t = math.inf
                spectral, sigma = medium.has_spectral_extinction(), mei.combined_extinction
                if spectral:
                    t = min(float(rest), mei.t, si.t) - mei.mint
                    left = drjit.exp(-t * sigma)
                    ends = si.t < mei.t or mei.t > rest
                    pdf = left if ends else left * sigma
                    passed = passed * (left * _inverse_or_zero(pdf[channel]))
                if mei.t > rest:
                    gone = np.float32(length) if mei.is_valid() else gone
                    mei.t = math.inf
                collided = bool(mei.is_valid())
                if collided:
                    gone = gone + np.float32(mei.t)
                    ray.o, si.t = mei.p, si.t - mei.t
                    ratio = mei.sigma_n if spectral else mei.sigma_n / sigma
                    passed = passed * ratio
            elif si is None:
                si = self._hit(ray)
            if not collided:
                gone = gone + np.float32(si.t)
                if not si.is_valid():
                    return passed
                passed = passed * si.bsdf().eval_null_transmission(si, True)
                crossed, ray = si, si.spawn_ray(ray.d)
                si = None
                if crossed.is_medium_transition():
                    medium = crossed.target_medium(ray.d)
            if not any(vector(passed)):
                return passed


def _inverse(x: float) -> float:
    """Return 1 / x in single precision."""
    return float(np.float32(1.0) / np.float32(x))


def _inverse_or_zero(x: float) -> float:
    """Return 1 / x, and 0 where x is not positive."""
    return _inverse(x) if x > 0.0 else 0.0
