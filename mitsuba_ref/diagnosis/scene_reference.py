"""The reference of a scene file, and what the scene looks like with a mistake."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

import renderer
from mitsuba_ref.diagnosis.image_mistakes import Floats, Prediction
from mitsuba_ref.diagnosis.scene_mistakes import (
    AlgorithmMistake,
    algorithm_mistakes,
    render_algorithm_mistake,
    render_reading_mistakes,
)
from mitsuba_ref.ladder.pictures_by_seed import reference_seed
from mitsuba_ref.missing_packages import NEEDS, is_installed
from mitsuba_ref.our_renderer.picture import Array, render_ours
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.errors import SceneError
from renderer.scene.placed_groups import shape_numbers
from renderer.scene_file import read_file_with
from renderer.scene_file.description import SceneDescription

SEEDS = 4  # pictures of the reference
SAMPLES_OF_A_MISTAKE = 32
MISTAKE_SEED = 4321

Show = Callable[[str], None]


class SceneReference:
    """The reference of a scene file, rendered when it is first needed, and once.

    Parameters
    ----------
    path, parameters, spp, by, quick, show
        As in `renderer_compare`, where `by` is `reference`.

    Raises
    ------
    SceneError
        If the scene or the program that renders it cannot be used.
    """

    # what files may say, and a render does not: how they were read, and their integers
    notes: tuple[str, ...] = ()
    levels = 0

    def __init__(
        self,
        path: Path,
        parameters: Mapping[str, str] | None = None,
        spp: int | None = None,
        by: Literal["mitsuba", "ours"] = "mitsuba",
        quick: bool = True,
        show: Show = lambda stage: None,
    ) -> None:
        if by == "mitsuba" and not is_installed("mitsuba"):
            raise SceneError(f"Mitsuba {NEEDS}; or render the reference by ours")
        self.path, self.parameters = path, dict(parameters or {})
        self.spp, self.by, self.quick, self.show = spp, by, quick, show
        self.scene: SceneDescription = read_file_with(path, self.parameters)
        self._predictions: dict[str, list[Prediction]] = {}

    @cached_property
    def pixels(self) -> list[Floats]:
        """Pictures with several seeds."""
        seeds = [reference_seed(k) for k in range(SEEDS)]
        found = []
        if self.by == "ours":
            loaded = renderer.load_file(self.path, **self.parameters)
            for k, seed in enumerate(seeds, 1):
                self.show(f"reference {k} of {SEEDS}, by lightproof")
                image = renderer.render(loaded, self.spp, seed)
                found.append(np.asarray(image, np.float64))
            return found
        with MitsubaWorker() as worker:
            cache = ReferenceCache(worker.render)
            for k, seed in enumerate(seeds, 1):
                self.show(f"reference {k} of {SEEDS}, by Mitsuba")
                request = self._request(spp=self.spp, seed=seed)
                picture = cache.get(request, self.scene.files)
                found.append(picture.pixels.astype(np.float64))
        return found

    @cached_property
    def aovs(self) -> dict[str, Array]:
        """Depth, normals and shapes at the centres of pixels."""
        self.show("rendering depth, normals and shapes")
        return render_ours(self._request(kind="aovs")).arrays

    @property
    def shapes(self) -> dict[int, str]:
        """Names of shapes by their index, which counts the shapes in the file from 1."""
        numbers = shape_numbers(self.scene).tolist()
        named = {
            number: shape.id or f"number {number}"
            for shape, number in zip(self.scene.shapes, numbers, strict=False)
        }
        places = [instance.place + 1 for instance in self.scene.instances]
        return named | {place: f"number {place} (instance)" for place in places}

    @property
    def sources(self) -> list[Callable[[], list[Prediction]]]:
        """Predictions that have to be rendered, fast ones first; each is kept."""
        mistakes = [] if self.quick else algorithm_mistakes(self.scene)
        return [
            partial(self._kept, "read", self._read_wrongly),
            *(partial(self._kept, m.name, partial(self._made, m)) for m in mistakes),
        ]

    def _kept(
        self, name: str, make: Callable[[], Iterator[Prediction]]
    ) -> list[Prediction]:
        if name not in self._predictions:
            self._predictions[name] = list(make())
        return self._predictions[name]

    def _read_wrongly(self) -> Iterator[Prediction]:
        self.show("rendering the scene with mistakes of reading")
        yield from render_reading_mistakes(self.scene, SAMPLES_OF_A_MISTAKE, MISTAKE_SEED)

    def _made(self, mistake: AlgorithmMistake) -> Iterator[Prediction]:
        self.show(f"rendering with a mistake: {mistake.name}")
        request = self._request(spp=SAMPLES_OF_A_MISTAKE, seed=MISTAKE_SEED)
        found = render_algorithm_mistake(mistake, request)
        if found is not None:
            yield found

    def _request(self, **given: Any) -> RenderRequest:
        return RenderRequest(str(self.path), self.parameters, **given)
