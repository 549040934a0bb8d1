"""How often the ladder of tests alarms when nothing is wrong.

Renders a small scene with thousands of seeds and climbs the whole ladder on pairs of sets
of pictures, Mitsuba against Mitsuba, where every alarm is false, and ours against Mitsuba.
Within a comparison each picture is used once, so the pairs are independent trials. The
rungs without noise are not random and are left out. With `--convergence` the two rungs
that the option adds are measured too, as a separate comparison.

Alarms at the claimed rate are rare, so 200 pairs can show that it is not far exceeded and
not much more. The share of p-values below 5 % tells more about the calibration. The exit
status judges the sum over a comparison's rungs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from mitsuba_ref.false_alarms.alarm_counts import (
    FalseAlarms,
    Pictures,
    count_alarms,
    count_broken,
)
from mitsuba_ref.false_alarms.renders_by_seed import by_mitsuba, by_ours
from mitsuba_ref.ladder.pictures_by_seed import reference_seed
from mitsuba_ref.ladder.rungs_of_convergence import convergence_seed
from mitsuba_ref.ladder.rungs_with_noise import exponent
from mitsuba_ref.records.results import Rung
from mitsuba_ref.statistics.convergence import (
    MOST_PICTURES,
    SAMPLES,
    Render,
    measure_convergence,
)

EITHER = "either side"


def measure(
    path: Path,
    pairs: int,
    size: int,
    spp: int,
    seeds: int,
    progress: Callable[[str], None] = lambda stage: None,
) -> tuple[FalseAlarms, FalseAlarms]:
    """Compare a scene with itself: Mitsuba with Mitsuba, then ours with Mitsuba.

    Parameters
    ----------
    path
        Mitsuba 3 XML with the parameters width, height and spp.
    pairs
        Trials.
    size
        Pixels a side.
    spp
        Samples per pixel.
    seeds
        Pictures of each side in a pair.
    progress
        Told what is being done.
    """
    parameters = {"width": str(size), "height": str(size), "spp": str(spp)}
    name, half = path.resolve().parent.name, pairs * seeds
    total, done = 3 * half, 0

    def series(render: Render, its_seeds: Iterable[int]) -> Pictures:
        nonlocal done
        pictures = []
        for seed in its_seeds:
            pictures.append(render(spp, seed))
            done += 1
            progress(f"{name}: picture {done} of {total}")
        return np.stack(pictures)

    theirs = series(by_mitsuba(path, parameters), map(reference_seed, range(2 * half)))
    ours = series(by_ours(path, parameters), range(half))
    sets = theirs.reshape(2, pairs, seeds, *theirs.shape[1:])
    our_sets = ours.reshape(pairs, seeds, *ours.shape[1:])
    measured = []
    for comparison, a, b in (
        ("Mitsuba against Mitsuba", sets[0], sets[1]),
        ("ours against Mitsuba", our_sets, sets[0]),
    ):
        progress(f"{name}: {comparison}")
        rungs = count_alarms(list(a), list(b))
        measured.append(FalseAlarms(comparison, rungs))
    return measured[0], measured[1]


def measure_convergence_alarms(
    path: Path,
    trials: int,
    size: int,
    progress: Callable[[str], None] = lambda stage: None,
) -> FalseAlarms:
    """Measure how often the rungs of convergence, one for each renderer, are broken."""
    parameters = {"width": str(size), "height": str(size), "spp": str(SAMPLES[-1])}
    name = path.resolve().parent.name
    renderers = {
        "ours": by_ours(path, parameters, independent=True),
        "Mitsuba": by_mitsuba(path, parameters, independent=True),
    }
    climbs = []
    for trial in range(trials):
        progress(f"{name}: convergence {trial + 1} of {trials}")
        climbs.append(
            [convergence_rung(side, render, trial) for side, render in renderers.items()]
        )
    falls = f"how fast the noise falls, from {SAMPLES[0]} sample on"
    comparison = f"{falls} (more pairs where needed)"
    return FalseAlarms(comparison, count_broken(climbs, EITHER))


def convergence_rung(side: str, render: Render, trial: int) -> Rung:
    """Return the rung of "ours" or "Mitsuba", from pictures that no other trial has."""
    first = trial * MOST_PICTURES
    return exponent(
        measure_convergence(
            lambda spp, index: render(spp, convergence_seed(side, first + index))
        ),
        side,
    )
