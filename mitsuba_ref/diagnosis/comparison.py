"""A verdict on any picture, as a function: `renderer_compare`.

`lightproof compare` and the pytest fixture `assert_same_picture` call it.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.diagnosis.diagnose import Diagnosis, diagnose
from mitsuba_ref.diagnosis.difference import (
    FOR_TILES,
    SMALLEST,
    brightness_for_neighbours,
    compare,
    set_aside,
)
from mitsuba_ref.diagnosis.image_mistakes import (
    Evidence,
    Floats,
    Prediction,
    as_integers,
)
from mitsuba_ref.diagnosis.picture_files import WANTED, read_picture
from mitsuba_ref.diagnosis.scene_reference import SceneReference, Show
from mitsuba_ref.diagnosis.verdict import Comparison
from mitsuba_ref.our_renderer.picture import Array
from renderer.errors import SceneError
from renderer.scene_file.description import Film

WIDEST = 3.0  # [pixels] radius of the widest usual filter, of Lanczos
BLIND = (
    "From one picture the noise is estimated from neighbouring pixels. A bias that changes "
    "its sign from pixel to pixel, or that is in a few pixels alone, is not seen. Four or "
    "more pictures on both sides show one that is in a single tile of 8 x 8 pixels"
)
SEEN_IN_TILES = (
    "A bias that changes its sign within a tile of 8 x 8 pixels, or that is in a few "
    "pixels of it, is not seen"
)

Picture = str | os.PathLike[str] | NDArray[Any]


@dataclass(frozen=True)
class _Pictures:
    """Pictures of one side, and how they were read."""

    pixels: list[Floats]
    names: list[str]
    notes: tuple[str, ...] = ()
    levels: int = 0  # of integers, see `PictureFile`
    # what only a scene tells
    aovs: Mapping[str, Array] = field(default_factory=dict)
    shapes: Mapping[int, str] = field(default_factory=dict)
    sources: Sequence[Callable[[], list[Prediction]]] = ()


def renderer_compare(
    pictures: Picture | Sequence[Picture],
    references: Picture | Sequence[Picture] | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    parameters: Mapping[str, str] | None = None,
    spp: int | None = None,
    reference: Literal["mitsuba", "ours"] = "mitsuba",
    quick: bool = True,
    filter_radius: float | None = None,
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
    filter_radius
        Radius [pixels] of the reconstruction filter of all pictures: 0.5 for a box. None:
        that of the scene, else 3, the widest that is usual. The smaller it is, the smaller
        are the differences that are seen.
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
    if filter_radius is not None and not 0.0 < filter_radius < math.inf:
        raise SceneError(f"filter_radius: expected more than 0, found {filter_radius}")
    ours = _read(_listed(pictures))
    if scene is not None:
        path = Path(scene)
        known = SceneReference(path, parameters, spp, reference, quick, show)
        return _compared_with_scene(ours, known, filter_radius or 0.0)
    theirs = _read(_listed(references))
    _check_sizes(ours, theirs.pixels[0].shape, f"the reference {theirs.names[0]}")
    return _judged(ours, theirs, filter_radius or WIDEST, show)


def compare_with_scene(
    pictures: Picture | Sequence[Picture], reference: SceneReference
) -> Comparison:
    """Compare as `renderer_compare` does, with a reference that serves several times."""
    return _compared_with_scene(_read(_listed(pictures)), reference)


def _compared_with_scene(
    ours: _Pictures, reference: SceneReference, filter_radius: float = 0.0
) -> Comparison:
    film = reference.scene.camera.film
    _check_film(ours, film, reference.path)
    radius = max(filter_radius, film.rfilter.radius)
    return _judged(ours, reference, radius, reference.show)


def _judged(
    ours: _Pictures, theirs: _Pictures | SceneReference, filter_radius: float, show: Show
) -> Comparison:
    lag = max(1, math.ceil(2.0 * filter_radius - 1e-6))
    _check_large_enough(ours, lag)
    own, pixels = ours.pixels, theirs.pixels
    for number, one in enumerate(pixels, 1):
        _check_values(one, f"reference {number}")
    show("comparing")
    as_kept = pixels
    if levels := min(filter(None, (ours.levels, theirs.levels)), default=0):
        own, as_kept = ([as_integers(p, levels) for p in side] for side in (own, pixels))
    difference = compare(own, as_kept, lag)
    aside, used = set_aside(pixels)
    mine, mean = np.mean(own, axis=0), np.mean(used, axis=0)
    scale = brightness_for_neighbours(mine, mean, lag, aside)
    evidence = Evidence(mine, mean, scale, aside=aside, levels=levels)
    diagnosis = Diagnosis(difference)
    if difference.differs:
        evidence = replace(evidence, aovs=theirs.aovs, shapes=theirs.shapes)
        diagnosis = diagnose(difference, evidence, lag, theirs.sources)
    several = min(len(own), len(pixels)) >= FOR_TILES
    notes = *ours.notes, *theirs.notes, SEEN_IN_TILES if several else BLIND
    return Comparison(diagnosis, evidence, tuple(dict.fromkeys(notes)))


def _listed(pictures: Any) -> list[Picture]:
    """Return a list, also of one picture."""
    if isinstance(pictures, (str, os.PathLike)):
        return [pictures]
    if isinstance(pictures, (list, tuple, Iterator)):
        return list(pictures)
    pixels = np.asarray(pictures)
    return list(pixels) if pixels.ndim == 4 else [pixels]


def _read(pictures: Sequence[Picture]) -> _Pictures:
    """Read pictures and check that they can be compared."""
    if not pictures:
        raise SceneError("there is no picture")
    pixels, names, notes, levels = [], [], [], []
    for number, one in enumerate(pictures, 1):
        if isinstance(one, (str, os.PathLike)):
            read = read_picture(Path(one))
            names.append(str(one))
            pixels.append(read.pixels)
            notes += [read.note] if read.note else []
            levels += [read.levels] if read.levels else []
        else:
            names.append(f"array {number}")
            pixels.append(_array(one, names[-1]))
    for name, values in zip(names, pixels, strict=True):
        if values.shape != pixels[0].shape:
            raise SceneError(
                f"{name} has {_size(values.shape)} pixels, {names[0]} "
                f"{_size(pixels[0].shape)}; equal sizes are needed"
            )
        _check_values(values, name)
    for (name, one), (other, two) in itertools.combinations(
        zip(names, pixels, strict=True), 2
    ):
        if np.array_equal(one, two) and np.ptp(one) > 0.0:
            raise SceneError(
                f"{name} and {other} are the same picture; several of a side need "
                "different seeds"
            )
    return _Pictures(pixels, names, tuple(notes), min(levels, default=0))


def _check_values(values: Floats, name: str) -> None:
    """Refuse values that no picture has."""
    good = (np.abs(values) <= np.finfo(np.float32).max).all(axis=2)
    if not good.all():
        y, x = np.argwhere(~good)[0]
        raise SceneError(
            f"{name}: NaN, infinite or above the largest float32 in {np.sum(~good)} of "
            f"{good.size} pixels, the first at x = {x}, y = {y}; only finite values can be "
            "compared"
        )


def _array(values: Any, name: str) -> Floats:
    """Return an array as a picture (H, W, 3); grey ones are repeated."""
    try:
        found: Floats = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        found = np.empty(())
    if getattr(values, "dtype", np.dtype(float)).kind in "iubc":
        raise SceneError(f"{name} holds {values.dtype}; {WANTED}")
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


def _check_sizes(ours: _Pictures, shape: Sequence[int], what: str, hint: str = "") -> None:
    found = ours.pixels[0].shape
    if tuple(found[:2]) != tuple(shape[:2]):
        raise SceneError(
            f"{ours.names[0]} has {_size(found)} pixels, {what} {_size(shape)}; equal "
            "sizes are needed" + hint
        )


def _check_film(ours: _Pictures, film: Film, path: Path) -> None:
    """Compare the size of pictures with the film's, before anything is rendered."""
    crop = (film.crop_height, film.crop_width)
    found = ours.pixels[0].shape[:2]
    if found == (film.height, film.width) != crop:
        raise SceneError(
            f"{ours.names[0]} has {_size(found)} pixels, the whole film of {path}; the "
            f"scene's crop window has {_size(crop)}: write this part of the picture"
        )
    hint = "; -D name=value replaces a <default> of the scene, such as its width"
    _check_sizes(ours, crop, f"the film of {path}", hint)


def _check_large_enough(ours: _Pictures, lag: int) -> None:
    shape, smallest = ours.pixels[0].shape, max(SMALLEST, 4 * lag)
    if min(shape[:2]) < smallest:
        raise SceneError(
            f"{ours.names[0]} has {_size(shape)} pixels; in pictures of fewer than "
            f"{smallest} x {smallest} noise cannot be told from a difference"
        )
