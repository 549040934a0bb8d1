"""One scene in both renderers, ready to write down single paths with the same numbers."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from mitsuba_ref.ours import edit_description
from mitsuba_ref.path_comparison import (
    TOLERANCE,
    compare_paths,
    difference_sentence,
    first_difference,
)
from mitsuba_ref.request import RenderRequest
from mitsuba_ref.variant import VARIANT
from mitsuba_ref.variant_process import VariantProcess
from renderer.errors import SceneError
from renderer.integrators.step_by_step import StepByStep
from renderer.plan import make_plan
from renderer.rendering import Rendering
from renderer.scene import build_scene
from renderer.scene_file import read_file
from renderer.traced_path import TracedPath, path_from_json

METHODS = ("path", "direct")

Pixel = tuple[int, int]


class TracedPair:
    """Both renderers with one scene; a context manager.

    Mitsuba runs in a process of its own, which it may end without ending this one.

    Parameters
    ----------
    request
        The scene, its parameters, seed and samples per pixel. The rest of it is set as for
        a replay: box filter, Mitsuba's random numbers.

    Raises
    ------
    SceneError
        For a scene that we cannot render or replay, and for another integrator than
        `METHODS`.
    MitsubaError
        When Mitsuba refuses the scene, ends, or does not answer.
    """

    def __init__(self, request: RenderRequest) -> None:
        description = read_file(Path(request.path), **request.parameters)
        description = edit_description(description, box_filter=True, first_hits=False)
        method, film = description.integrator.name, description.camera.film
        if method not in METHODS:
            known = " and ".join(METHODS)
            raise SceneError(f"{request.path}: a trace follows {known}, not {method}")
        scene = build_scene(description)
        plan = make_plan(scene, sampler="mitsuba", spp=request.spp, ray_offset="mitsuba")
        self.size = (film.crop_width, film.crop_height)
        self.spp = plan.spp
        self._request, self._scene, self._plan = request, scene, plan
        self._ours: StepByStep | None = None
        self._mitsuba: VariantProcess | None = None

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
        SceneError
            For a pixel outside of the picture or a sample that it does not have.
        MitsubaError
            When Mitsuba refuses the scene, ends, or does not answer.
        """
        (x, y), (width, height) = pixel, self.size
        if not (0 <= x < width and 0 <= y < height):
            raise SceneError(
                f"pixel {x},{y} is outside: the picture has {width} x {height} pixels, "
                f"0,0 to {width - 1},{height - 1}"
            )
        if not 0 <= sample < self.spp:
            raise SceneError(
                f"sample {sample}: a pixel has {self.spp} samples, 0 to {self.spp - 1}"
            )
        return self.trace_ours(pixel, sample), self.trace_mitsuba(pixel, sample)

    def trace_ours(self, pixel: Pixel, sample: int) -> TracedPath:
        """Return our path alone; see `trace`."""
        if self._ours is None:
            rendering = Rendering(
                self._scene,
                self._plan,
                accel="auto",
                seed=self._request.seed,
                threads=1,
                measured_camera=self._request.camera,
            )
            self._ours = StepByStep(rendering)
        return self._ours.trace(pixel, sample)

    def trace_mitsuba(self, pixel: Pixel, sample: int) -> TracedPath:
        """Return Mitsuba's path alone; see `trace`."""
        if self._mitsuba is None:
            request = self._request
            job = {
                "path": request.path,
                "parameters": request.parameters,
                "spp": request.spp,
                "seed": request.seed,
            }
            self._mitsuba = VariantProcess("mitsuba_ref.trace_mitsuba", VARIANT, job)
        return path_from_json(self._mitsuba.ask({"pixel": pixel, "sample": sample}))

    def cause(self, pixel: Pixel, tolerance: float = TOLERANCE) -> str:
        """Return a sentence on the first of a pixel's samples whose paths part.

        Empty if all agree. Parameters and errors are those of `trace`.
        """
        for sample in range(self.spp):
            ours, reference = self.trace(pixel, sample)
            quantities = compare_paths(ours, reference)
            if first_difference(quantities, tolerance) is not None:
                names = (ours.renderer, reference.renderer)
                sentence = difference_sentence(quantities, names, tolerance)
                return f"Sample {sample}. {sentence}"
        return ""
