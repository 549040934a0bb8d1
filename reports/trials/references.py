"""References that pictures are compared with, kept in the cache: they take long to make.

The name of an entry is a hash of all that decides its content, so no entry is ever out of
date; a damaged one is made again.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.reference import edited_scene
from mitsuba_ref.reference.variant import drjit_version
from mitsuba_ref.speed import timed_mitsuba
from renderer.mitsuba_version import installed_version
from renderer.process.cache_folder import cache_folder
from renderer.rendering.accuracy import relative_error
from renderer.scene_file import SceneDescription
from renderer.scene_file.objects.films import round_sample_count
from reports.trials import truth
from reports.trials.contenders import Picture
from reports.trials.timed_renderers import LONG, Contender, Show

PARTS = 8  # pictures whose mean it is: their scatter tells its own error
SEED = 1_000_000  # far from those of the pictures that are judged

# What decides Mitsuba's pictures and the truth, in addition to the scene's files.
THEIRS = (timed_mitsuba, edited_scene)
OURS = ("simple", "scene", "scene_file", "plugins")  # folders of the renderer
_PACKAGE = Path(str(renderer.__file__)).parent


class LongPicture(NamedTuple):
    """The mean of many samples."""

    picture: Picture
    error: float  # its own relMSE, estimated
    origin: str


def long_picture(
    judge: str,
    contender: Contender,
    samples: int,
    made_from: Iterable[Any] | None,
    show: Show,
) -> LongPicture:
    """Return the mean of `PARTS` pictures of about `samples` samples in all.

    Parameters
    ----------
    judge, contender
        Name and renderer of the pictures.
    samples
        Rounded up to what the sampler's pattern allows.
    made_from
        What else decides the pictures; None keeps nothing.
    show
        Called with what is being done.
    """
    spp = math.ceil(samples / PARTS)
    taken = PARTS * round_sample_count(LONG, spp)
    origin = f"{taken} samples of {judge}, in {PARTS} pictures"

    def render() -> NDArray[np.float64]:
        parts = []
        for index in range(PARTS):
            show(f"reference, {origin}: picture {index + 1}")
            parts.append(contender(SEED + index, spp)[1])
        return np.stack(parts)

    if made_from is None:
        parts = render()
    else:
        by = (installed_version(), drjit_version(), *map(_source, THEIRS))
        parts = kept((origin, SEED, *by, *made_from), render)
    error = relative_error(parts.std(axis=0, ddof=1) / math.sqrt(PARTS), parts.mean(axis=0))
    return LongPicture(parts.mean(axis=0), error**2, origin)


def true_radiance(
    description: SceneDescription, pixels: NDArray[np.int64], show: Show
) -> NDArray[np.float64]:
    """Return `truth.true_pixels`, kept.

    Raises
    ------
    SceneError
        If there is no truth of this scene.
    """
    sources = [
        path for folder in OURS for path in sorted((_PACKAGE / folder).rglob("*.py"))
    ]
    film = description.camera.film
    size = (film.width, film.height, pixels.tolist())
    made_from = (_source(truth), *sources, *map(Path, description.files), size)
    return kept(made_from, lambda: truth.true_pixels(description, pixels, show))


def kept(
    made_from: Iterable[Any], make: Callable[[], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return an array that was made before, or make and keep it.

    Parameters
    ----------
    made_from
        What decides its content: the bytes of files (each a `Path`) and plain values.
    make
        Makes it.
    """
    digest = hashlib.sha256()
    for one in made_from:
        # of a path the name counts alone: a clone elsewhere finds the same entry
        value, content = (
            (one.name, one.read_bytes()) if isinstance(one, Path) else (one, b"")
        )
        digest.update(json.dumps(value, sort_keys=True).encode() + b"\0" + content)
    path = cache_folder("speed_accuracy") / f"{digest.hexdigest()[:32]}.npy"
    try:
        return np.asarray(np.load(path, allow_pickle=False), np.float64)
    except Exception:  # missing, or damaged in any way: it is made again
        pass
    array = make()
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    with suppress(OSError):  # the array is right, kept or not
        write_atomically(path, stream.getvalue())
    return array


def _source(module: ModuleType) -> Path:
    return Path(str(module.__file__))
