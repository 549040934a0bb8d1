"""A scene without noise: seconds and the distance to the truth in double precision.

Every structure must give the same picture, bit for bit; the offset of new rays, the method
and whose numbers are drawn may change its last digits.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.our_renderer.whole_picture import whole
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from renderer.errors import SceneError
from renderer.process.names import ACCELERATORS, RAY_OFFSETS, REPLAY
from renderer.rendering.accuracy import relative_error, relative_squares
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene.scene import Scene
from reports.speed_accuracy.contenders import (
    PEERS,
    Contender,
    Picture,
    Say,
    Settings,
    of_mitsuba,
    of_ours,
    parameters_of,
)
from reports.speed_accuracy.noisy import METHODS
from reports.speed_accuracy.record import OURS, NoiselessPicture, NoiselessScene
from reports.speed_accuracy.references import true_radiance

PIXELS = 1000  # that have a truth: it takes 1 to 15 ms for each
SLOW = 0.5  # [s] of a picture: who takes longer takes part in the first round alone
ROUNDS_OF_SLOW = 1
OFF = 0.01  # relative: a pixel that differs by more has met another surface, or none

# renderer, method, structure, ray offset, whose numbers
Way = tuple[str, str, str, str, str]


def has_noise(path: Path, deterministic: bool | None) -> bool:
    """Return whether a scene has noise: what its proof.toml says, or two pictures show."""
    if deterministic is not None:
        return not deterministic
    scene = renderer.load_file(path)
    first, second = (np.asarray(whole(renderer.render(scene, 1, seed))) for seed in (0, 1))
    return not np.array_equal(first, second)


def measure_noiseless(path: Path, settings: Settings, say: Say) -> NoiselessScene:
    """Render one scene in all ways, in turn.

    Raises
    ------
    SceneError
        If we cannot render it, or it has no truth.
    """
    parameters = parameters_of(path, settings, "demo")
    scene = renderer.load_file(path, **parameters)
    film = scene.description.camera.film
    height, width = film.crop_height, film.crop_width
    method = make_plan(scene).method
    pixels = some_pixels(height, width)
    truth = true_radiance(scene.description, pixels, say)
    unavailable: dict[str, str] = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        contenders: dict[Way, Contender] = {}
        pictures: dict[Way, Picture] = {}
        for way, contender in _ours(scene, settings):
            say(f"compiling {' '.join(way[1:])}")
            try:
                picture = contender(0, 1)[1]
            except SceneError as error:
                unavailable[" ".join(way)] = str(error)
                continue
            # another method may choose among lights at random
            if way[1] == method or np.array_equal(contender(1, 1)[1], picture):
                contenders[way], pictures[way] = contender, picture
        for variant in PEERS:
            name = f"mitsuba {variant}"
            say(f"starting {name}")
            stands_in = method == "whitted" and variant.startswith("scalar")
            way = (name, "whitted in Python" if stands_in else "", "", "", "")
            try:
                peer = stack.enter_context(
                    TimedMitsuba(
                        variant, path, parameters, settings.threads, stand_ins=stands_in
                    )
                )
                contender = of_mitsuba(peer, folder, None)
                pictures[way] = contender(0, 1)[1]
                contenders[way] = contender
            except MitsubaError as error:
                unavailable[name] = str(error)
        seconds: dict[Way, list[float]] = {way: [] for way in contenders}
        for turn in range(settings.seeds):
            say(f"round {turn + 1} of {settings.seeds}")
            for way, contender in contenders.items():
                if turn < ROUNDS_OF_SLOW or max(seconds[way]) < SLOW:
                    seconds[way].append(contender(turn, 1)[0])
    found = [
        NoiselessPicture(
            *way,
            seconds[way],
            *distance(picture[pixels[:, 0], pixels[:, 1]], truth),
        )
        for way, picture in pictures.items()
    ]
    return NoiselessScene(
        path.parent.name,
        width,
        height,
        len(pixels),
        found,
        different(pictures),
        unavailable,
    )


def some_pixels(height: int, width: int) -> NDArray[np.int64]:
    """Return rows and columns (n, 2) of `PIXELS` pixels at random, or of all."""
    count = min(PIXELS, height * width)
    chosen = np.random.default_rng(0).permutation(height * width)[:count]
    return np.stack(np.divmod(np.sort(chosen), width), axis=1)


def distance(found: NDArray[np.float64], truth: NDArray[np.float64]) -> tuple[float, int]:
    """Return the relative error (n, 3) as of noisy pictures, and how many pixels are off.

    What is not finite counts as off, and as an error of its whole value.
    """
    found = np.where(np.isfinite(found), found, 0.0)
    squares = relative_squares(found - truth, truth)
    return relative_error(found - truth, truth), int((squares > OFF**2).any(axis=1).sum())


def different(pictures: dict[Way, Picture]) -> list[str]:
    """Return the ways whose picture is another than that of the first alike.

    Alike are ways that differ in their structure alone.
    """
    first: dict[tuple[str, ...], Picture] = {}
    found = []
    for way, picture in pictures.items():
        alike = first.setdefault((*way[:2], *way[3:]), picture)
        if not np.array_equal(alike, picture):
            found.append(" ".join(way))
    return found


def _ours(scene: Scene, settings: Settings) -> Iterator[tuple[Way, Contender]]:
    """Yield every structure with every offset, every method, and the replay."""
    method = make_plan(scene).method
    for offset in RAY_OFFSETS:
        for structure in ACCELERATORS:
            ways = {"accel": structure, "ray_offset": offset}
            way = (OURS, method, structure, offset, "own")
            yield way, of_ours(scene, settings.threads, **ways)
    asked = scene.description.integrator.nested or scene.description.integrator
    for other in METHODS if asked.max_depth == 2 else ():
        if other != method:
            way = (OURS, other, "auto", RAY_OFFSETS[0], "own")
            yield way, of_ours(scene, settings.threads, integrator=other)
    way = (OURS, method, "auto", "mitsuba", "replayed")
    yield way, of_ours(scene, settings.threads, sampler=REPLAY)
