"""A verdict on any picture, as a function: `renderer_compare`.

`lightproof compare` and the pytest fixture `assert_same_picture` call it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.diagnosis.diagnose import LIKELY, Diagnosis, Explanation, diagnose
from mitsuba_ref.diagnosis.difference import (
    FALSE_ALARMS,
    SMALLEST,
    Difference,
    local_brightness,
)
from mitsuba_ref.diagnosis.image_mistakes import Evidence, Floats, Prediction
from mitsuba_ref.diagnosis.picture_files import as_integers, read_picture
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
from renderer.scene_file import read_file_with
from renderer.scene_file.description import SceneDescription

SEEDS = 4  # pictures of the reference
UNKNOWN_LAG = 6  # [pixels] diameter of the widest usual filter, of Lanczos
SAMPLES_OF_A_MISTAKE = 32
MOST_NAMED = 3  # mistakes in the sentences
BLIND = (
    "From one picture the noise is estimated from neighbouring pixels: a bias that changes "
    "its sign from pixel to pixel, or that is in a few pixels alone, is not seen. Four or "
    "more pictures with other seeds on both sides show it"
)

Picture = str | os.PathLike[str] | NDArray[Any]
Show = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Comparison:
    """A verdict on a picture.

    Parameters
    ----------
    diagnosis
        The tests, and the mistakes that explain the difference, the likeliest first.
    evidence
        The mean of the pictures and of the references, and AOVs of the scene.
    lag
        As in `difference.compare`.
    notes
        How the pictures were read, and how far the verdict can be trusted.
    """

    diagnosis: Diagnosis
    evidence: Evidence
    lag: int
    notes: tuple[str, ...] = ()

    @property
    def difference(self) -> Difference:
        """What the tests say."""
        return self.diagnosis.difference

    @property
    def differs(self) -> bool:
        """Whether the picture differs from the reference by more than noise."""
        return self.difference.differs

    @property
    def named(self) -> list[Explanation]:
        """The likeliest mistakes, each name once; none if no known one explains half."""
        first: dict[str, Explanation] = {}
        for one in self.diagnosis.explanations:
            if one.share >= LIKELY:
                first.setdefault(one.prediction.name, one)
        return list(first.values())[:MOST_NAMED]

    def sentences(self) -> list[str]:
        """Return the verdict in words, most important first."""
        found = self.difference
        if not found.differs:
            lines = [
                "The pictures do not differ by more than noise.",
                f"A bias of {100 * found.detectable:.2g} % of the mean would have been "
                "seen with a probability of 99 %.",
            ]
        else:
            lines = [
                f"The pictures differ by more than noise (p = {found.p_value:.2g}): by "
                f"{100 * found.size:.3g} % of the local brightness, and in the mean by "
                f"{100 * found.mean_bias:+.3g} %."
            ]
            for rank, one in enumerate(self.named, 1):
                left = "nothing is left" if one.whole else "a difference is left"
                lines.append(
                    f"{rank}. {one.prediction.name}: {one.prediction.sentence} It explains "
                    f"{100 * one.share:.3g} % of the difference; {left}."
                )
                if rank == 1:
                    lines.append(f"   {one.prediction.advice}")
            if not self.named:
                tried = len(self.diagnosis.tried)
                lines.append(f"None of {tried} known mistakes explains half of it.")
        rate = f"{FALSE_ALARMS:g}"
        lines.append(f"Equal pictures are called different in {rate} of all cases.")
        return [*lines, *(f"Note: {note}." for note in self.notes)]

    def record(self) -> dict[str, Any]:
        """Return the verdict as plain values, for programs."""
        found = self.difference
        return {
            "differs": found.differs,
            "p_value": found.p_value,
            "size": found.size,
            "mean_bias": found.mean_bias,
            "detectable": found.detectable,
            "mistakes": [
                {
                    "name": one.prediction.name,
                    "sentence": one.prediction.sentence,
                    "advice": one.prediction.advice,
                    "share": one.share,
                    "whole": one.whole,
                }
                for one in self.diagnosis.explanations[:5]
            ],
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class _Pictures:
    """Pictures of one side, and how they were read."""

    pixels: list[Floats]
    names: list[str]
    notes: tuple[str, ...] = ()
    levels: int = 0  # of integers, see `PictureFile`


@dataclass(frozen=True)
class _SceneRequest:
    """A scene whose reference is rendered."""

    path: Path
    parameters: Mapping[str, str] = field(default_factory=dict)
    spp: int | None = None
    by: Literal["mitsuba", "ours"] = "mitsuba"
    quick: bool = False

    def request(self, **given: Any) -> RenderRequest:
        """Return what a renderer takes."""
        return RenderRequest(str(self.path), dict(self.parameters), **given)


def renderer_compare(
    pictures: Picture | Sequence[Picture],
    references: Picture | Sequence[Picture] | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    parameters: Mapping[str, str] | None = None,
    spp: int | None = None,
    reference: Literal["mitsuba", "ours"] = "mitsuba",
    quick: bool = True,
    show: Show = lambda stage: None,
) -> Comparison:
    """Say whether pictures differ from references by more than noise, and by what mistake.

    Parameters
    ----------
    pictures
        One picture, or several of other seeds: files (.exr .npy .hdr .pfm .png), or arrays
        (H, W, 3), linear sRGB.
    references
        The same of the right program.
    scene
        A Mitsuba 3 scene file, instead of `references`: four pictures of it are rendered
        and cached, and mistakes in reading it and in the algorithm are tried too.
    parameters
        Replace `<default>` values of the scene, such as ``{"width": "128"}``.
    spp
        Samples of each reference picture; None: those of the scene.
    reference
        The program that renders the scene.
    quick
        Try no mistake for which our renderer must be compiled, some 10 s each.
    show
        Called with what is being done.

    Returns
    -------
    Comparison
        `.differs`, `.named`, `.sentences()`, `.record()`.

    Raises
    ------
    SceneError
        In one line: a file that cannot be read, pictures of other sizes, values that are
        not finite, a scene that is refused, a program that is not installed.
    MitsubaError
        If Mitsuba refuses the scene or crashes.
    """
    if (references is None) == (scene is None):
        raise SceneError("give references or a scene, and not both")
    ours = _read(_listed(pictures))
    if scene is None:
        theirs = _read(_listed(references))
        _check_sizes(ours, theirs.pixels[0].shape, f"the reference {theirs.names[0]}")
        lag, notes = UNKNOWN_LAG, theirs.notes
        aovs: dict[str, Array] = {}
        shapes: dict[int, str] = {}
        slower: list[Callable[[], Iterator[Prediction]]] = []
    else:
        given = _SceneRequest(Path(scene), parameters or {}, spp, reference, quick)
        if reference == "mitsuba" and not is_installed("mitsuba"):
            raise SceneError(f"Mitsuba {NEEDS}; or render the reference by ours")
        described = read_file_with(given.path, dict(given.parameters))
        _check_film(ours, described, given.path)
        lag = max(1, math.ceil(2.0 * described.camera.film.rfilter.radius - 1e-6))
        _check_large_enough(ours, lag)
        theirs, notes = _Pictures(_rendered(given, described, show), ["the reference"]), ()
        aovs, shapes = _seen(given, described, show)
        slower = _slower(given, described, show)
    _check_large_enough(ours, lag)
    show("comparing")
    pixels = theirs.pixels
    if ours.levels and not theirs.levels:
        pixels = [as_integers(one, ours.levels) for one in pixels]
    mean = np.mean(pixels, axis=0)
    evidence = Evidence(
        np.mean(ours.pixels, axis=0), mean, local_brightness(mean, lag), aovs, shapes
    )
    diagnosis = diagnose(evidence, pixels, lag, slower, ours.pixels)
    trust = (BLIND,) if min(len(ours.pixels), len(pixels)) < SEEDS else ()
    return Comparison(diagnosis, evidence, lag, (*ours.notes, *notes, *trust))


def _listed(pictures: Any) -> list[Picture]:
    """Return a list, also of one picture."""
    if isinstance(pictures, (str, os.PathLike)):
        return [pictures]
    if isinstance(pictures, np.ndarray) and pictures.ndim < 4:
        return [pictures]
    return list(pictures)


def _read(pictures: Sequence[Picture]) -> _Pictures:
    """Read pictures and check that all have one size."""
    if not pictures:
        raise SceneError("there is no picture")
    pixels, names, notes, levels = [], [], [], 0
    for number, one in enumerate(pictures, 1):
        if isinstance(one, (str, os.PathLike)):
            read = read_picture(Path(one))
            names.append(str(one))
            pixels.append(read.pixels)
            notes += [read.note] if read.note else []
            levels = max(levels, read.levels)
        else:
            names.append(f"array {number}")
            pixels.append(_array(one, names[-1]))
    for name, values in zip(names, pixels, strict=True):
        if values.shape != pixels[0].shape:
            raise SceneError(
                f"{name} has {_size(values.shape)} pixels, {names[0]} "
                f"{_size(pixels[0].shape)}; equal sizes are needed"
            )
        if not (finite := np.isfinite(values).all(axis=2)).all():
            y, x = np.argwhere(~finite)[0]
            raise SceneError(
                f"{name}: {np.sum(~finite)} pixels are NaN or infinite, the first at "
                f"x = {x}, y = {y}; only finite ones can be compared"
            )
    return _Pictures(pixels, names, tuple(notes), levels)


def _array(values: Any, name: str) -> Floats:
    """Return an array as a picture (H, W, 3); grey ones are repeated."""
    try:
        found: Floats = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        found = np.empty(())
    if found.ndim == 2:
        found = np.repeat(found[..., None], 3, axis=2)
    if found.ndim != 3 or found.shape[2] not in (1, 3, 4) or 0 in found.shape:
        kind = getattr(values, "shape", type(values).__name__)
        raise SceneError(f"{name}: expected an array (H, W, 3) of numbers, found {kind}")
    if found.shape[2] == 1:
        return np.repeat(found, 3, axis=2)
    return found[..., :3]


def _size(shape: Sequence[int]) -> str:
    return f"{shape[1]} x {shape[0]}"


def _check_sizes(ours: _Pictures, shape: Sequence[int], what: str) -> None:
    found = ours.pixels[0].shape
    if tuple(found[:2]) != tuple(shape[:2]):
        raise SceneError(
            f"{ours.names[0]} has {_size(found)} pixels, {what} {_size(shape)}; equal "
            "sizes are needed"
        )


def _check_film(ours: _Pictures, scene: SceneDescription, path: Path) -> None:
    """Compare the size of pictures with the film's, before anything is rendered."""
    film = scene.camera.film
    crop = (film.crop_height, film.crop_width)
    found = ours.pixels[0].shape[:2]
    if found == (film.height, film.width) != crop:
        raise SceneError(
            f"{ours.names[0]} has {_size(found)} pixels, the whole film of {path}; the "
            f"scene's crop window has {_size(crop)}: write this part of the picture"
        )
    _check_sizes(ours, crop, f"the film of {path}")


def _check_large_enough(ours: _Pictures, lag: int) -> None:
    shape, smallest = ours.pixels[0].shape, max(SMALLEST, 4 * lag)
    if min(shape[:2]) < smallest:
        raise SceneError(
            f"{ours.names[0]} has {_size(shape)} pixels; in pictures of fewer than "
            f"{smallest} x {smallest} noise cannot be told from a difference"
        )


def _rendered(given: _SceneRequest, scene: SceneDescription, show: Show) -> list[Floats]:
    """Render the reference with several seeds."""
    seeds = [reference_seed(k) for k in range(SEEDS)]
    found = []
    if given.by == "ours":
        loaded = renderer.load_file(given.path, **dict(given.parameters))
        for k, seed in enumerate(seeds, 1):
            show(f"reference {k} of {SEEDS}, by lightproof")
            image = renderer.render(loaded, given.spp, seed)
            found.append(np.asarray(image, np.float64))
        return found
    with MitsubaWorker() as worker:
        cache = ReferenceCache(worker.render)
        for k, seed in enumerate(seeds, 1):
            show(f"reference {k} of {SEEDS}, by Mitsuba")
            request = given.request(spp=given.spp, seed=seed)
            found.append(cache.get(request, scene.files).pixels.astype(np.float64))
    return found


def _seen(
    given: _SceneRequest, scene: SceneDescription, show: Show
) -> tuple[dict[str, Array], dict[int, str]]:
    """Return the AOVs at the centres of pixels, and the names of shapes by their index."""
    show("rendering depth, normals and shapes")
    names = {k: shape.id or f"number {k + 1}" for k, shape in enumerate(scene.every_shape)}
    return render_ours(given.request(kind="aovs")).arrays, names


def _slower(
    given: _SceneRequest, scene: SceneDescription, show: Show
) -> list[Callable[[], Iterator[Prediction]]]:
    """Return the sources of predictions that have to be rendered."""
    seed, spp = 4321, SAMPLES_OF_A_MISTAKE

    def read_wrongly() -> Iterator[Prediction]:
        show("rendering the scene with mistakes of reading")
        yield from render_reading_mistakes(scene, spp, seed)

    def algorithm(
        mistake: AlgorithmMistake, number: int, count: int
    ) -> Iterator[Prediction]:
        show(f"rendering with a mistake: {mistake.name}, {number} of {count}")
        found = render_algorithm_mistake(mistake, given.request(spp=spp, seed=seed))
        if found is not None:
            yield found

    mistakes = [] if given.quick else algorithm_mistakes(scene)
    return [
        read_wrongly,
        *(
            partial(algorithm, mistake, number, len(mistakes))
            for number, mistake in enumerate(mistakes, 1)
        ),
    ]
