"""Speed against accuracy: what every method, sampler and renderer gets for its seconds.

A scene with noise: all contenders render in turn, a picture of each seed at each number of
samples, after their image means agreed. `at` is the number of samples per pixel. What a
contender is worth is 1 / (relative MSE x seconds); the ratio of two is how many times as
fast one reaches the same error. A scene without noise: see `reports.trials.noiseless`.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import renderer
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.statistics.equal_error import log_ratio_error, relative_mse_of, worth
from renderer.process.names import SAMPLERS
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene_file import read_file
from renderer.scene_file.objects.films import round_sample_count
from reports.bench.intervals import around, mean_interval
from reports.bench.rows import Row
from reports.bench.study import Bench, Study
from reports.bench.timing import Interval, median_interval
from reports.errors import ReportError
from reports.look.pictures import exposure_stops, tone_mapped
from reports.pages.speed_accuracy_page import verdict
from reports.trials.architecture_scenes import ARCHITECTURE, architecture_scene
from reports.trials.contenders import OURS, Picture
from reports.trials.large_meshes import LARGE, written
from reports.trials.noiseless import has_noise, measure_noiseless
from reports.trials.references import long_picture
from reports.trials.scene_files import scene_content, scene_file, scene_names
from reports.trials.timed_renderers import (
    JUDGES,
    OTHERS,
    VARIANTS,
    Settings,
    means_apart,
    mitsuba_renderers,
    other_renderers,
    our_renderers,
)

DIGITS = 4
Errors = dict[str, list[list[float]]]  # of a contender, at each number of samples, by seed


def cases() -> list[str]:
    """Return the folders of scenes/ and the generated scenes."""
    return [*scene_names(), *LARGE, *ARCHITECTURE]


def settings_of(bench: Bench) -> Settings:
    """Return how much is measured.

    Raises
    ------
    ReportError
        For an option that is not what it should be.
    """
    quick: dict[str, Any] = {"reference": 256} if bench.quick else {}
    given: dict[str, Any] = {}
    for name, word in bench.options.items():
        words = word.split(",")
        if name == "samplers":
            if unknown := set(words) - set(SAMPLERS):
                possible = ", ".join(SAMPLERS)
                raise ReportError(f"samplers: {min(unknown)!r} is none of {possible}")
            given[name] = tuple(words)
            continue
        least = 2 if name in ("seeds", "threads") else 1
        if not all(one.isdecimal() and int(one) >= least for one in words):
            raise ReportError(f"{name}: expected {least} or more, found {word!r}")
        numbers = sorted({int(one) for one in words})
        given[name] = numbers if name == "spp" else numbers[-1]
    return Settings(**{**quick, **given})


@contextmanager
def opened_scene(case: str) -> Iterator[Path]:
    """Give the file of a case: a folder of scenes/, a generated scene, or a path."""
    if case in LARGE:
        with written([case]) as (path,):
            yield path
        return
    yield architecture_scene(case) if case in ARCHITECTURE else scene_file(case)


def parameters_of(path: Path, side: int) -> dict[str, str]:
    """Return the width and height at which the longer side has so many pixels.

    A crop window keeps the size of its file.
    """
    film = read_file(path).camera.film
    cropped = (film.crop_width, film.crop_height) != (film.width, film.height)
    if cropped or "$width" not in path.read_text(encoding="utf-8", errors="replace"):
        return {}
    factor = side / max(film.width, film.height)
    width, height = (max(1, round(factor * n)) for n in (film.width, film.height))
    return {"width": str(width), "height": str(height)}


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the rows of one scene."""
    settings = settings_of(bench)
    with opened_scene(case) as path, tempfile.TemporaryDirectory() as folder:
        parameters = parameters_of(path, settings.side)
        if has_noise(path, read_proof(path).deterministic, **parameters):
            yield from noisy(case, path, parameters, settings, Path(folder), bench)
        else:
            yield from noiseless(case, path, parameters, settings, Path(folder), bench)


def noisy(
    case: str,
    path: Path,
    parameters: dict[str, str],
    settings: Settings,
    folder: Path,
    bench: Bench,
) -> Iterator[Row]:
    """Yield seconds and relative MSE of all contenders.

    Raises
    ------
    ReportError
        If the image mean of one of ours differs by more than noise: then nothing is timed
        (a peer is left out). If a picture has values that are not finite.
    """
    scene = renderer.load_file(path, **parameters)
    with ExitStack() as stack:
        contenders = our_renderers(scene, settings, bench.show)
        # any peer would do as a judge; without one ours is, which says nothing of bias
        judging = f"{OURS} {make_plan(scene).method}"
        unavailable: dict[str, str] = {}
        for variant in VARIANTS:
            bench.show(f"starting mitsuba {variant}")
            found, absent = mitsuba_renderers(
                stack, variant, path, parameters, settings, folder
            )
            unavailable |= absent
            contenders |= found
            judging = f"mitsuba {variant}" if found else judging
        for program in OTHERS:
            bench.show(f"starting {program}")
            found, absent = other_renderers(stack, program, scene, settings, folder)
            unavailable |= absent
            contenders |= found
        judge, long = (f"{judging}, {sampler}" for sampler in JUDGES)
        bench.show(f"image means of {len(contenders)} contenders")
        for name, why in means_apart(contenders, judge).items():
            if name.startswith(OURS):
                raise ReportError(f"{why}; nothing was timed")
            del contenders[name]
            unavailable[name] = why
        # of few samples, Mitsuba's is 0.4 % off in textured-room
        long = long if long in contenders else judge
        yield from (
            Row(case=case, contender=name, quantity="unavailable", value=why)
            for name, why in unavailable.items()
        )
        reference = long_picture(
            long,
            contenders[long],
            settings.reference,
            # of ours, which all kernels decide, nothing is kept
            None
            if judging.startswith(OURS)
            else (*map(Path, scene.description.files), parameters),
            bench.show,
        )
        yield from _facts(case, reference.picture, settings, bench)
        yield Row(case=case, quantity="reference", value=reference.origin)
        error = _short(reference.error)
        yield Row(case=case, quantity="relative MSE of the reference", value=error)
        default = f"{OURS} {make_plan(scene).method}, {make_plan(scene).sampler.name}"
        yield Row(case=case, quantity="default of ours", value=default)
        errors: Errors = {name: [[] for _ in settings.spp] for name in contenders}
        seconds: Errors = {name: [[] for _ in settings.spp] for name in contenders}
        for number, spp in enumerate(settings.spp):
            for seed in range(settings.seeds):
                bench.show(f"{spp} samples, seed {seed + 1} of {settings.seeds}")
                for name, contender in contenders.items():
                    time, picture = contender(seed, spp)
                    error = _error(name, seed, picture, reference.picture)
                    seconds[name][number].append(time)
                    errors[name][number].append(error)
    yield from rows_of(case, settings.spp, errors, seconds)


def rows_of(
    case: str, counts: Sequence[int], errors: Errors, seconds: Errors
) -> Iterator[Row]:
    """Yield error and seconds of each contender, and its ratio to the best peer.

    Parameters
    ----------
    counts
        Requested samples per pixel; `at` is what the sampler makes of them.
    errors, seconds
        By contender, number of samples, and seed.
    """
    for name in errors:
        sampler = name.rpartition(", ")[2]
        for number, spp in enumerate(counts):
            at = float(round_sample_count(sampler, spp) if sampler in SAMPLERS else spp)
            e, s = errors[name][number], seconds[name][number]
            one: dict[str, Any] = {"case": case, "contender": name, "at": at}
            mean, time = statistics.fmean(e), statistics.median(s)
            ends = _ends(mean_interval(e))
            yield Row(quantity="relative MSE", value=_short(mean), interval=ends, **one)
            ends = _ends(median_interval(s))
            yield Row(quantity="seconds", value=_short(time), interval=ends, **one)
    peers = [name for name in errors if not name.startswith(OURS)]
    worths = {name: worth(errors[name][-1], seconds[name][-1]) for name in errors}
    best = max(peers, key=lambda name: worths[name], default=None)
    if best is None:
        return
    products = {
        name: [a * b for a, b in zip(errors[name][-1], seconds[name][-1], strict=True)]
        for name in errors
    }
    for name in errors:
        value = worths[name] / worths[best]
        scatter = log_ratio_error(products[name], products[best])
        interval = around(value, scatter, len(products[name]) - 1)
        yield Row(
            case=case,
            contender=name,
            quantity="times as fast",
            value=_short(value),
            interval=_ends(interval),
        )


def noiseless(
    case: str,
    path: Path,
    parameters: dict[str, str],
    settings: Settings,
    folder: Path,
    bench: Bench,
) -> Iterator[Row]:
    """Yield seconds, error and pixels off of all contenders, compared with the truth."""
    found = measure_noiseless(path, parameters, settings, folder, bench.show)
    yield from _facts(case, found.picture, settings, bench)
    yield Row(case=case, quantity="pixels with a truth", value=found.pixels)
    for name, why in found.unavailable.items():
        yield Row(case=case, contender=name, quantity="unavailable", value=why)
    for name in found.different:
        why = "its picture is not that of the other structures"
        yield Row(case=case, contender=name, quantity="fault", value=why)
    for name, times in found.seconds.items():
        time, ends = _short(statistics.median(times)), _ends((min(times), max(times)))
        yield Row(case=case, contender=name, quantity="seconds", value=time, interval=ends)
    for name, (error, off) in found.distances.items():
        one: dict[str, Any] = {"case": case, "contender": name}
        yield Row(quantity="error", value=_short(error), **one)
        yield Row(quantity="pixels off", value=off, **one)


def _facts(case: str, picture: Picture, settings: Settings, bench: Bench) -> Iterator[Row]:
    height, width = picture.shape[:2]
    yield Row(case=case, quantity="size", value=f"{width} x {height}")
    yield Row(case=case, quantity="seeds", value=settings.seeds)
    shown = picture.astype(np.float32)
    yield bench.picture(case, "reference", tone_mapped(shown, exposure_stops(shown)))


def _error(name: str, seed: int, picture: Picture, reference: Picture) -> float:
    try:
        found = relative_mse_of(picture, reference)
    except ValueError as error:
        raise ReportError(f"{name}, seed {seed}: {error}") from error
    if found == 0.0:
        raise ReportError(f"{name}, seed {seed}: there is no noise to be measured")
    return found


def _short(value: float) -> float:
    """Return the digits that the noise leaves; the kept file is half as large."""
    return float(f"{value:.{DIGITS}g}")


def _ends(interval: Interval) -> Interval:
    return _short(interval[0]), _short(interval[1])


STUDY = Study(
    title="Speed against accuracy",
    sentence="How many times as fast does each renderer, method and sampler reach the same "
    "error?",
    minutes=60,
    quick_minutes=15,
    cases=cases,
    inputs=lambda case, options: scene_content(case),
    quick_cases=("cornell-box", "textured-room", "caustic", "appel-teapot"),
    any_case=True,
    axis="samples per pixel",
    headlines=("faults",),
    options={
        "spp": "samples per pixel, such as 4,16,64",
        "seeds": "pictures of each contender at each number of samples, 2 or more",
        "reference": "samples of the reference, or a few more",
        "threads": "workers of each renderer, 2 or more",
        "side": "pixels of the longer side of a picture",
        "samplers": "ours, such as independent,sobol",
    },
    measure=measure,
    verdict=verdict,
    page="reports.pages.speed_accuracy_page:speed_accuracy_page",
)
