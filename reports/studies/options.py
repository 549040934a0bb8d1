"""What options of the command change: the speed to the same error.

All contenders render the same scene with the same number of samples. The error of one of
n pictures is its relMSE from the mean of its contender's pictures, times n / (n - 1); all
errors are relative to the mean of all pictures. Processor time of one thread; compiling is
not counted. Where a few bright samples make most of the error, n pictures are too few for
it; the variance of the median pixel shows what most pixels gain.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.statistics.equal_error import geometric_mean, log_ratio_error, worth
from renderer.errors import SceneError
from renderer.rendering.accuracy import relative_error
from renderer.rendering.planning.make_plan import make_plan
from reports.bench.intervals import around
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, Study
from reports.bench.timing import Interval, take_turns
from reports.look.formatting import number
from reports.studies.speed_accuracy import opened_scene, parameters_of
from reports.trials.architecture_scenes import ARCHITECTURE
from reports.trials.scene_files import scene_names

SIDE = 256  # pixels of the longer side
LEAST = 1e-6  # relMSE of a contender, below which a scene is left out
SPEED = "speed to the same error, relative to the defaults"
MEDIAN = "the same for the median pixel"
DEFAULT = "defaults"

Pictures = Sequence[NDArray[np.float64]]


def options_of(method: str) -> dict[str, dict[str, Any]]:
    """Return what to try for a scene that `method` renders by default."""
    return {
        DEFAULT: {},
        "--sampler sobol": {"sampler": "sobol"},
        "--light-choice uniform": {"light_choice": "uniform"},
        "--integrator NAME": {"integrator": method},
    }


def squared_errors(pictures: Mapping[str, Pictures]) -> dict[str, list[float]]:
    """Return the relMSE of each picture (H, W, 3) by contender; two or more of each."""
    common = np.mean([np.mean(each, axis=0) for each in pictures.values()], axis=0)
    found = {}
    for name, each in pictures.items():
        mean, more = np.mean(each, axis=0), len(each) / (len(each) - 1)
        found[name] = [relative_error(one - mean, common) ** 2 * more for one in each]
    return found


def speed(
    errors: Mapping[str, list[float]], seconds: Mapping[str, list[float]], name: str
) -> tuple[float, Interval]:
    """Return how many times as fast an option is as the defaults, with an interval."""
    found = worth(errors[name], seconds[name]) / worth(errors[DEFAULT], seconds[DEFAULT])
    own, default = (np.multiply(errors[k], seconds[k]).tolist() for k in (name, DEFAULT))
    return found, around(found, log_ratio_error(own, default), len(own) - 1)


def median_variance(pictures: Pictures) -> float:
    """Return the median over values of pixels of their variance."""
    return float(np.median(np.var(pictures, axis=0, ddof=1)))


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the speed with each option."""
    seeds, spp = bench.whole("seeds", 3 if bench.quick else 6, 2), bench.whole("spp", 16)
    pictures: dict[str, list[NDArray[np.float64]]] = {}
    with opened_scene(case) as path:
        scene = renderer.load_file(path, **parameters_of(path, SIDE))

    def render(name: str, options: dict[str, Any], seed: int) -> float:
        begin = time.process_time()
        image = renderer.render(scene, spp, seed, threads=1, **options)
        seconds = time.process_time() - begin
        pictures.setdefault(name, []).append(np.asarray(image.pixels, np.float64))
        return seconds

    try:
        contenders = options_of(make_plan(scene).method)
        for options in contenders.values():
            renderer.render(scene, spp, threads=1, **options)
    except SceneError as error:
        yield Row(case=case, quantity="left out", value=str(error))
        return
    turns = {name: partial(render, name, chosen) for name, chosen in contenders.items()}
    seconds = take_turns(turns, seeds, show=bench.show)
    errors = squared_errors(pictures)
    if min(map(np.mean, errors.values())) < LEAST:
        yield Row(case=case, quantity="left out", value="hardly any noise")
        return
    row = partial(Row, case=case, unit="times")
    for name in list(contenders)[1:]:
        value, interval = speed(errors, seconds, name)
        yield row(quantity=SPEED, contender=name, value=value, interval=interval)
        costs = {
            k: median_variance(pictures[k]) * float(np.mean(seconds[k]))
            for k in (DEFAULT, name)
        }
        if min(costs.values()) > 0.0:  # 0 if more than half of the picture has no noise
            yield row(quantity=MEDIAN, contender=name, value=costs[DEFAULT] / costs[name])


def _means(table: Table) -> str:
    means = {
        name: geometric_mean(
            [float(row.value or 0.0) for row in table.where(contender=name)]
        )
        for name in table.distinct("contender")
    }
    return ", ".join(f"{number(mean)} with {name}" for name, mean in means.items())


def verdict(table: Table) -> str:
    """Say how fast each option is in the geometric mean of the scenes."""
    whole, median = (_means(table.where(quantity=q)) for q in (SPEED, MEDIAN))
    if not whole:
        return ""
    more = f" For the median pixel: {median}." if median else ""
    return f"To the same error, times as fast as the defaults: {whole}.{more}"


STUDY = Study(
    title="What options change",
    sentence="How many times as fast does an option reach the same error as the defaults: "
    "another sampler, lights chosen as in Mitsuba (without panes and lamps in fog), the "
    "integrator as in Mitsuba (without dim paths and the sky by place)?",
    advice="Above 1 an option is faster than the defaults: take it. `--explain` says what "
    "the defaults are in your scene, and `--case my_scene.xml` measures it.",
    minutes=11,
    quick_minutes=1,
    cases=lambda: [*ARCHITECTURE, *scene_names()],
    quick_cases=("emitters", "cornell-box"),
    any_case=True,
    options={"spp": "samples per pixel (16)", "seeds": "pictures of each (6)"},
    measure=measure,
    verdict=verdict,
)
