"""Mitsuba's side of a trace: its integrators in Python, over its own objects.

Mitsuba's `path` and `direct` cannot say what happens inside a path. This follows them call
by call [Jakob2022, src/integrators/path.cpp, direct.cpp] with the scene, sensor, BSDFs,
emitters and sampler of the `scalar_rgb` variant itself, and writes down what passes by; a
test holds its radiance against `mi.render`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Any

from mitsuba_ref.our_renderer.traced_path import (
    ENDED,
    WHITE,
    Bounce,
    SampledLight,
    Scattered,
    TracedPath,
    Vector,
    light_number,
)
from mitsuba_ref.reference.variant import load_mitsuba
from mitsuba_ref.replay.integrator_method import Method
from mitsuba_ref.replay.paths.mitsuba_path import (
    NumbersDrawn,
    PathState,
    film_place,
    vector,
)

NAME = "Mitsuba"


class MitsubaTracer:
    """Traces samples of single pixels of one scene.

    Parameters
    ----------
    scene
        A mitsuba.Scene whose shapes were not merged.
    spp
        Samples per pixel, which some samplers' patterns depend on.
    method
        From `read_method`.
    """

    def __init__(self, scene: Any, spp: int, method: Method) -> None:
        self._mi = load_mitsuba()
        self._scene = scene
        self._sensor = scene.sensors()[0]
        self._sensor.sampler().set_sample_count(spp)
        self.spp = int(self._sensor.sampler().sample_count())
        self.method = method
        self._shapes = list(scene.shapes())
        self._light_names = _light_names(scene)

    def trace(self, pixel: tuple[int, int], pixel_seed: int, sample: int) -> TracedPath:
        """Return one sample of the pixel (x, y) of the crop window.

        A sample of a pixel begins where the one before it left the sampler, so the earlier
        ones are traced too.
        """
        *_, path = islice(self.trace_all(pixel, pixel_seed), sample + 1)
        return path

    def trace_all(self, pixel: tuple[int, int], pixel_seed: int) -> Iterator[TracedPath]:
        """Yield all samples of the pixel (x, y) of the crop window."""
        sampler = self._sensor.sampler().fork()
        sampler.seed(pixel_seed)
        for _ in range(self.spp):
            yield self._trace(pixel, sampler)
            sampler.advance()

    def _camera_ray(self, pixel: tuple[int, int], numbers: NumbersDrawn) -> Any:
        mi, sensor = self._mi, self._sensor
        film = sensor.film()
        jitter = numbers.two("film")
        place = mi.Point2f(
            film_place(pixel[0], jitter.x, film.crop_size()[0], film.crop_offset()[0]),
            film_place(pixel[1], jitter.y, film.crop_size()[1], film.crop_offset()[1]),
        )
        aperture = mi.Point2f(0.5)
        if sensor.needs_aperture_sample():
            aperture = numbers.two("aperture")
        time = sensor.shutter_open()
        if sensor.shutter_open_time() > 0.0:
            time += numbers.one("time") * sensor.shutter_open_time()
        ray, _ = sensor.sample_ray_differential(time, 0.0, place, aperture)
        return mi.Ray3f(ray)

    def _trace(self, pixel: tuple[int, int], sampler: Any) -> TracedPath:
        numbers = NumbersDrawn(sampler)
        ray = self._camera_ray(pixel, numbers)
        drawn = numbers.take()
        bounces = tuple(self._bounces(self._begin(ray, numbers), numbers))
        media = self.method.media
        return TracedPath(NAME, drawn, vector(ray.o), vector(ray.d), bounces, media)

    def _begin(self, ray: Any, numbers: NumbersDrawn) -> PathState:
        """Return the state of a path at the camera."""
        state = PathState(self._mi, ray)
        state.active = self.method.max_depth > 0
        return state

    def _bounces(self, state: PathState, numbers: NumbersDrawn) -> Iterator[Bounce]:
        while state.active:
            yield self._bounce(state, numbers)

    def _length(self, start: Vector, at: Any) -> float:
        """Return the length of a segment that ends at an interaction."""
        return float(at.t)

    def _bounce(self, state: Any, numbers: NumbersDrawn) -> Bounce:
        start, before = vector(state.ray.o), state.result
        event, at = self._fly(state, numbers)
        if event == ENDED:
            state.active = False
            return Bounce(numbers=numbers.take(), radiance=vector(before), event=ENDED)
        arriving, weights = vector(state.throughput), state.weights
        hit = not event and bool(at.is_valid())
        position = vector(at.p) if hit or event else None
        if not event:
            self._arrive(state, at)
        emitted = vector(state.result - before)
        lights: tuple[SampledLight, ...] = ()
        scattered = None
        if hit or event:
            lights, scattered = self._scatter(state, at, numbers)
        state.active = scattered is not None and scattered.survived
        return Bounce(
            shape=self._shape_number(at) if hit else 0,
            face=int(at.prim_index) if hit and at.shape.is_mesh() else None,
            t=math.inf if position is None else self._length(start, at),
            position=position,
            throughput=arriving,
            emitted=emitted,
            numbers=numbers.take(),
            lights=lights,
            scattered=scattered,
            radiance=vector(state.result),
            normal=vector(at.sh_frame.n) if hit else None,
            event=event,
            weights=weights,
        )

    def _fly(self, state: Any, numbers: NumbersDrawn) -> tuple[str, Any]:
        """Return what ends a flight, empty at a surface and in the sky, and where."""
        return "", self._surface(state)

    def _surface(self, state: PathState) -> Any:
        """Intersect a ray outside of media; the camera may not see lamps."""
        scene, ray = self._scene, state.ray
        si = scene.ray_intersect(ray)
        hides = self.method.hide_emitters and state.depth == 0 and si.is_valid()
        if not hides or si.shape.emitter() is None:
            return si
        ray = si.spawn_ray(ray.d)
        behind = scene.integrator().skip_area_emitters(scene, ray, True, True)
        return behind.compute_surface_interaction(ray, int(self._mi.RayFlags.All), True)

    def _arrive(self, state: PathState, si: Any) -> None:
        """Add the emitted light of the hit, weighted against light samples."""
        mi, scene = self._mi, self._scene
        emitter = si.emitter(scene)
        if emitter is None or (self.method.hide_emitters and state.depth == 0):
            return
        light_pdf = None
        if state.depth > 0 and not state.delta:
            ds = mi.DirectionSample3f(scene, si, state.previous)
            light_pdf = scene.pdf_emitter_direction(state.previous, ds, True)
        state.arrive(emitter.eval(si, state.pdf > 0.0), light_pdf, self.method)

    def _scatter(
        self, state: Any, si: Any, numbers: NumbersDrawn
    ) -> tuple[tuple[SampledLight, ...], Scattered | None]:
        mi, method = self._mi, self.method
        if state.depth + 1 >= method.max_depth:
            return (), None
        bsdf, context = si.bsdf(), mi.BSDFContext()
        smooth = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        names = [light_number(k) for k in range(method.light_samples if smooth else 0)]
        points = [numbers.two(name) for name in names]  # drawn even without a light
        drawn = points if self._light_names else []
        lights = tuple(self._sample_light(state, si, bsdf, point) for point in drawn)
        if method.bsdf_samples == 0:
            return lights, None
        number, point = self._bsdf_numbers(numbers)
        chosen, weight = bsdf.sample(context, si, number, point, True)
        direction = si.to_world(chosen.wo)
        state.go_on(si, direction, chosen, weight)
        throughput = vector(state.throughput)
        survived = state.play_roulette(method.roulette_depth, numbers)
        if not any(throughput):
            return lights, None
        pdf = 0.0 if state.delta else state.pdf
        origin = vector(state.ray.o)
        return lights, Scattered(
            vector(direction), float(pdf), throughput, survived, origin
        )

    def _bsdf_numbers(self, numbers: NumbersDrawn) -> tuple[float, Any]:
        # `direct` draws both as arguments of one call, which the compiler evaluates from
        # the right; `path` draws the single number first.
        if self.method.point_first:
            point = numbers.two("bsdf")
            return numbers.one("bsdf"), point
        number = numbers.one("bsdf")
        return number, numbers.two("bsdf")

    def _sample_light(
        self, state: PathState, si: Any, bsdf: Any, point: Any
    ) -> SampledLight:
        mi, scene = self._mi, self._scene
        seen, weight = scene.sample_emitter_direction(si, point, True, True)
        sampled, unblocked = scene.sample_emitter_direction(si, point, False, True)
        wo = si.to_local(sampled.d)
        value, bsdf_pdf = bsdf.eval_pdf(mi.BSDFContext(), si, wo, True)
        mis = 1.0 if sampled.delta else self.method.light_weight(sampled.pdf, bsdf_pdf)
        carried = state.throughput * (value * unblocked * mis)
        if seen.pdf != 0.0:
            state.add(value * weight * mis)
        blocked = None
        if sampled.pdf != 0.0 and any(vector(carried)):
            blocked = not any(vector(weight))
        # what `sample_emitter_direction` sends towards the light
        origin = None if blocked is None else vector(si.spawn_ray_to(sampled.p).o)
        return self._sampled_light(sampled, unblocked, vector(carried), blocked, origin)

    def _sampled_light(
        self,
        sampled: Any,
        weight: Any,
        carried: Vector,
        blocked: bool | None,
        origin: Vector | None,
        passed: Vector = WHITE,
    ) -> SampledLight:
        far = self._mi.has_flag(sampled.emitter.flags(), self._mi.EmitterFlags.Infinite)
        return SampledLight(
            light=self._light_names.get(sampled.emitter, "?"),
            direction=vector(sampled.d),
            distance=math.inf if far else float(sampled.dist),
            pdf=0.0 if sampled.delta else float(sampled.pdf),
            weight=vector(weight),
            carried=carried,
            blocked=blocked,
            origin=origin,
            passed=passed,
        )

    def _shape_number(self, si: Any) -> int:
        """Return the place in the file, from 1, of the shape or the instance around it."""
        return 1 + self._shapes.index(si.instance if si.instance is not None else si.shape)


def _light_names(scene: Any) -> dict[Any, str]:
    """Name lights as `SampledLight.light` says."""
    names = {
        shape.emitter(): f"shape {number}"
        for number, shape in enumerate(scene.shapes(), start=1)
        if shape.is_emitter()
    }
    others = [emitter for emitter in scene.emitters() if emitter not in names]
    return names | {e: f"emitter {number}" for number, e in enumerate(others, start=1)}
