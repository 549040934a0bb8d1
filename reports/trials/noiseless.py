"""A scene without noise: seconds and the distance to the truth in double precision.

Every structure must give the same picture, bit for bit; the offset of new rays, the method
and the replay of Mitsuba's random numbers may change its last digits.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
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
from reports.trials.contenders import OURS, Picture, of_ours
from reports.trials.references import true_radiance
from reports.trials.timed_renderers import (
    METHODS,
    VARIANTS,
    Contender,
    Settings,
    Show,
    of_mitsuba,
)

PIXELS = 1000  # that have a truth: it takes 1 to 15 ms for each
SLOW = 0.5  # [s] of a picture: what takes longer takes part in the first round alone
OFF = 0.01  # relative: a pixel that differs by more has met another surface, or none


@dataclass
class Noiseless:
    """What was measured on one scene.

    A family are our contenders that differ in their structure alone; a peer is one of its
    own.
    """

    pixels: int  # with a truth
    picture: Picture  # by the usual structure
    distances: dict[str, tuple[float, int]]  # by family, see `distance`
    seconds: dict[str, list[float]]  # by contender
    different: list[str]  # contenders whose picture is not that of their family
    unavailable: dict[str, str]  # contenders, and why


def has_noise(path: Path, deterministic: bool | None, **parameters: str) -> bool:
    """Return whether a scene has noise: what its proof.toml says, or two pictures show."""
    if deterministic is not None:
        return not deterministic
    scene = renderer.load_file(path, **parameters)
    first, second = (np.asarray(whole(renderer.render(scene, 1, seed))) for seed in (0, 1))
    return not np.array_equal(first, second)


def measure_noiseless(
    path: Path, parameters: dict[str, str], settings: Settings, folder: Path, show: Show
) -> Noiseless:
    """Render one scene in all ways, in turn.

    Raises
    ------
    SceneError
        If we cannot render it, or it has no truth.
    """
    scene = renderer.load_file(path, **parameters)
    film = scene.description.camera.film
    method = make_plan(scene).method
    pixels = some_pixels(film.crop_height, film.crop_width)
    truth = true_radiance(scene.description, pixels, show)
    contenders: dict[str, Contender] = {}
    pictures: dict[str, Picture] = {}
    unavailable: dict[str, str] = {}
    with ExitStack() as stack:
        for name, contender in _ours(scene, method, settings.threads):
            show(f"compiling {name}")
            try:
                picture = contender(0, 1)[1]
            except SceneError as error:
                unavailable[name] = str(error)
                continue
            # another method may choose among lights at random
            usual = name.startswith(f"{OURS} {method},")
            if usual or np.array_equal(contender(1, 1)[1], picture):
                contenders[name], pictures[name] = contender, picture
        for variant in VARIANTS:
            stands_in = method == "whitted" and variant.startswith("scalar")
            name = f"mitsuba {variant}" + ", whitted in Python" * stands_in
            show(f"starting {name}")
            try:
                peer = stack.enter_context(
                    TimedMitsuba(
                        variant, path, parameters, settings.threads, stand_ins=stands_in
                    )
                )
                contender = of_mitsuba(peer, folder, None)
                pictures[name] = contender(0, 1)[1]
                contenders[name] = contender
            except MitsubaError as error:
                unavailable[name] = str(error)
        seconds: dict[str, list[float]] = {name: [] for name in contenders}
        for turn in range(settings.seeds):
            show(f"round {turn + 1} of {settings.seeds}")
            for name, contender in contenders.items():
                if turn == 0 or max(seconds[name]) < SLOW:
                    seconds[name].append(contender(turn, 1)[0])
    families: dict[str, Picture] = {}
    for name, picture in pictures.items():
        families.setdefault(family_of(name), picture)
    distances = {
        name: distance(picture[pixels[:, 0], pixels[:, 1]], truth)
        for name, picture in families.items()
    }
    return Noiseless(
        len(pixels),
        next(iter(pictures.values())),
        distances,
        seconds,
        different(pictures, families),
        unavailable,
    )


def some_pixels(height: int, width: int) -> NDArray[np.int64]:
    """Return rows and columns (n, 2) of `PIXELS` pixels at random, or of all."""
    count = min(PIXELS, height * width)
    chosen = np.random.default_rng(0).permutation(height * width)[:count]
    return np.stack(np.divmod(np.sort(chosen), width), axis=1)


def distance(found: NDArray[np.float64], truth: NDArray[np.float64]) -> tuple[float, int]:
    """Return the relative error (n, 3) as of noisy pictures, and how many pixels are off.

    A value that is not finite counts as off, and as an error of its whole value.
    """
    found = np.where(np.isfinite(found), found, 0.0)
    squares = relative_squares(found - truth, truth)
    return relative_error(found - truth, truth), int((squares > OFF**2).any(axis=1).sum())


def family_of(name: str) -> str:
    """Return the name of one of ours without its last word, the structure."""
    return name.rpartition(", ")[0] if name.startswith(OURS) else name


def different(pictures: dict[str, Picture], families: dict[str, Picture]) -> list[str]:
    """Return the contenders whose picture differs from that of their family."""
    return [
        name
        for name, picture in pictures.items()
        if not np.array_equal(families[family_of(name)], picture)
    ]


def _ours(scene: Scene, method: str, threads: int) -> Iterator[tuple[str, Contender]]:
    """Yield every structure with every offset, every method, and the replay."""
    for offset in RAY_OFFSETS:
        for structure in ACCELERATORS:
            ways = {"accel": structure, "ray_offset": offset}
            name = f"{OURS} {method}, offset {offset}, {structure}"
            yield name, of_ours(scene, threads, **ways)
    integrator = scene.description.integrator.nested or scene.description.integrator
    for other in METHODS if integrator.max_depth == 2 else ():
        if other != method:
            name = f"{OURS} {other}, offset {RAY_OFFSETS[0]}, auto"
            yield name, of_ours(scene, threads, integrator=other)
    yield f"{OURS} {method}, replay, auto", of_ours(scene, threads, sampler=REPLAY)
