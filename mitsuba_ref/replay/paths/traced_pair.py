"""One scene in both renderers, ready to write down single paths with the same numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Self

import msgspec

from mitsuba_ref.our_renderer.picture import (
    edit_description,
    read_scene,
)
from mitsuba_ref.our_renderer.ray_perturbation import Moved
from mitsuba_ref.our_renderer.step_by_step import StepByStep
from mitsuba_ref.our_renderer.steps_in_media import StepsInMedia
from mitsuba_ref.our_renderer.traced_path import TracedPath
from mitsuba_ref.records.request import TIME_LIMIT, RenderRequest
from mitsuba_ref.reference.variant import VARIANT
from mitsuba_ref.reference.variant_process import VariantProcess
from mitsuba_ref.replay.paths.coincident_surface import ShapesAlone
from mitsuba_ref.replay.paths.path_comparison import (
    TOLERANCE,
    compare_paths,
    difference_sentence,
    first_difference,
)
from mitsuba_ref.replay.paths.path_from_reference_rays import LedPath, cause_of
from renderer.errors import SceneError
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import Scene, build_scene
from renderer.scene_file.description import SceneDescription

METHODS = ("path", "direct", "volpath")  # volpathmis is a way to weight volpath

Pixel = tuple[int, int]


def is_traceable(description: SceneDescription) -> bool:
    """Tell whether the paths of a scene's colours are written down bounce by bounce."""
    return _to_trace(description, None)[1].name in METHODS


def _to_trace(description: SceneDescription, spp: int | None) -> tuple[Scene, Plan]:
    """Return a scene with its colours alone, and the plan of its trace."""
    description = edit_description(
        description, box_filter=True, first_hits=False, colors_alone=True
    )
    scene = build_scene(description)
    return scene, make_plan(scene, sampler="mitsuba", spp=spp, ray_offset="mitsuba")


class NotTraceable(SceneError):
    """A trace of an unsupported integrator, pixel or sample was requested."""


class TracedPair:
    """Both renderers with one scene; a context manager.

    Mitsuba runs in a separate process: if it crashes, this process goes on.

    Parameters
    ----------
    request
        The scene, its parameters, seed and samples per pixel. The rest of it is set as for
        a replay: box filter, Mitsuba's random numbers, and the entries of its camera
        matrix, which are read from Mitsuba if the request does not have them.
    time_limit
        Seconds for one answer of Mitsuba, its start included.

    Raises
    ------
    SceneError
        For a scene that we cannot render or replay.
    NotTraceable
        For another integrator than `METHODS`.
    MitsubaError
        When Mitsuba refuses the scene, ends, or does not answer.
    """

    def __init__(self, request: RenderRequest, time_limit: float = TIME_LIMIT) -> None:
        scene, plan = _to_trace(read_scene(request), request.spp)
        film = scene.description.camera.film
        if plan.name not in METHODS:
            raise NotTraceable(
                f"{request.path}: a trace follows {', '.join(METHODS)} and volpathmis with "
                f"one sample at a point, not {plan.name}"
            )
        self.size = (film.crop_width, film.crop_height)
        self.spp = plan.spp
        self._request, self._scene, self._plan = request, scene, plan
        self._time_limit = time_limit
        self._ours: StepByStep | None = None
        self._mitsuba: VariantProcess | None = None
        self._shapes: ShapesAlone | None = None

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """End Mitsuba's process."""
        if self._mitsuba is not None:
            self._mitsuba.close()

    def trace(self, pixel: Pixel, sample: int) -> tuple[TracedPath, TracedPath]:
        """Return our path and Mitsuba's.

        Parameters
        ----------
        pixel
            (x, y) of the picture: of the crop window, from 0 at the top left.
        sample
            From 0.

        Raises
        ------
        NotTraceable
            For a pixel outside of the picture or a sample that it does not have.
        MitsubaError
            When Mitsuba refuses the scene, ends, or does not answer.
        """
        (x, y), (width, height) = pixel, self.size
        if not (0 <= x < width and 0 <= y < height):
            raise NotTraceable(
                f"pixel {x},{y} is outside: the picture has {width} x {height} pixels, "
                f"0,0 to {width - 1},{height - 1}"
            )
        if not 0 <= sample < self.spp:
            raise NotTraceable(
                f"sample {sample}: a pixel has {self.spp} samples, 0 to {self.spp - 1}"
            )
        return self.trace_ours(pixel, sample), self.trace_mitsuba(pixel, sample)

    def trace_ours(self, pixel: Pixel, sample: int) -> TracedPath:
        """Return our path alone; see `trace`."""
        return self._our_steps().trace(pixel, sample)

    def trace_mitsuba(self, pixel: Pixel, sample: int) -> TracedPath:
        """Return Mitsuba's path alone; see `trace`."""
        answer = self._mitsuba_process().ask({"pixel": pixel, "sample": sample})
        return msgspec.convert(answer, TracedPath)

    def trace_all(self, pixel: Pixel) -> list[tuple[TracedPath, TracedPath]]:
        """Return our path and Mitsuba's of each sample; see `trace`."""
        answer = self._mitsuba_process().ask({"pixel": pixel, "sample": None})
        theirs = msgspec.convert(answer["paths"], list[TracedPath])
        ours = (self.trace_ours(pixel, sample) for sample in range(self.spp))
        return list(zip(ours, theirs, strict=True))

    @property
    def camera(self) -> tuple[float, ...]:
        """What of Mitsuba's camera matrix our camera rays are rounded by."""
        if self._request.camera is not None:
            return self._request.camera
        return tuple(self._mitsuba_process().loaded["camera"])

    def _our_steps(self) -> StepByStep:
        if self._ours is None:
            options = RenderOptions(
                seed=self._request.seed, threads=1, measured_camera=self.camera
            )
            steps_of = StepsInMedia if self._plan.kind.media else StepByStep
            self._ours = steps_of(RenderJob(self._scene, self._plan, options))
        return self._ours

    def _mitsuba_process(self) -> VariantProcess:
        if self._mitsuba is None:
            request = self._request
            job = {
                "path": request.path,
                "parameters": request.parameters,
                "spp": request.spp,
                "seed": request.seed,
                "plugins": request.plugins,
                "densities": self._plan.mis_densities,
            }
            self._mitsuba = VariantProcess(
                "mitsuba_ref.replay.paths.mitsuba_trace_process",
                VARIANT,
                job,
                self._time_limit,
            )
        return self._mitsuba

    def led(self, pixel: Pixel, sample: int, reference: TracedPath) -> LedPath:
        """Return our path of a sample led along Mitsuba's; see `trace`."""

        def trace_led(moves: Sequence[Moved | None]) -> Iterator[TracedPath]:
            return self._our_steps().trace_led(pixel, sample, reference, moves)

        if self._shapes is None:
            self._shapes = ShapesAlone(self._scene.description)
        return LedPath(reference, trace_led, self._shapes.hit)

    def cause(self, pixel: Pixel, tolerance: float = TOLERANCE) -> str:
        """Return a sentence on the first of a pixel's samples whose paths part.

        Empty if all agree. Parameters and errors are those of `trace`.
        """
        for sample in range(self.spp):
            ours, reference = self.trace(pixel, sample)
            quantities = compare_paths(ours, reference)
            first = first_difference(quantities, tolerance)
            if first is not None:
                names = (ours.renderer, reference.renderer)
                found = self.led(pixel, sample, reference).examine()
                sentence = difference_sentence(
                    quantities, names, tolerance, cause_of(found, quantities[first])
                )
                return f"Sample {sample}. {sentence}"
        return ""
