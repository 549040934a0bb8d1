"""How often the ladder of tests alarms when nothing is wrong.

Renders a small scene with thousands of seeds and climbs the whole ladder on pairs of sets
of pictures, Mitsuba against Mitsuba, where every alarm is false, and ours against Mitsuba.
Within a comparison each picture is used once, so the pairs are independent trials. The
rungs without noise are not random and are left out. With `--convergence` the two rungs
that are asked for by that option are measured too, as a comparison of their own.

Alarms at the claimed rate are rare, so 200 pairs can show that it is not far exceeded and
not much more. The share of p-values below 5 % tells more about the calibration. The exit
status judges the sum over a comparison's rungs.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from mitsuba_ref import machine
from mitsuba_ref.alarm_counts import (
    OFTEN,
    FalseAlarms,
    Pictures,
    count_alarms,
    count_broken,
    exceeds,
)
from mitsuba_ref.ladder_of_tests import FEWEST_SEEDS
from mitsuba_ref.many_seeds import by_mitsuba, by_ours
from mitsuba_ref.noisy_rungs import exponent
from mitsuba_ref.results import Rung, finite_or_null, write_atomically
from mitsuba_ref.scene_convergence import convergence_seed
from mitsuba_ref.seeds import reference_seed
from mitsuba_ref.statistics.binomial import Rate
from mitsuba_ref.statistics.convergence import (
    FEWEST_PAIRS,
    MOST_PICTURES,
    SAMPLES,
    Render,
    measure_convergence,
)

EITHER = "either side"

RECORD = Path("reports/out/data/false_alarms.json")
"""Where the page "proof" looks."""


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
        measured.append(FalseAlarms(name, comparison, size, size, spp, seeds, rungs))
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
    return FalseAlarms(
        name,
        f"how fast the noise falls, from {SAMPLES[0]} sample on (more pairs where needed)",
        size,
        size,
        SAMPLES[-1],
        2 * FEWEST_PAIRS,
        count_broken(climbs, EITHER),
    )


def convergence_rung(side: str, render: Render, trial: int) -> Rung:
    """Return the rung of "ours" or "Mitsuba", from pictures that no other trial has."""
    first = trial * MOST_PICTURES
    return exponent(
        measure_convergence(
            lambda spp, index: render(spp, convergence_seed(side, first + index))
        ),
        side,
    )


def print_alarms(measured: FalseAlarms, output: Console) -> None:
    """Print one comparison as a table."""
    title = (
        f"{measured.scene}, {measured.comparison}: {measured.width} x {measured.height}, "
        f"{measured.spp} samples, {measured.seeds} pictures a side"
    )
    table = Table(title=title, title_justify="left")
    for column in ("rung", "alarms", "rate [95 % interval]", "claimed", f"p <= {OFTEN}"):
        table.add_column(column, justify="left" if column == "rung" else "right")
    table.add_column("bias seen")
    for rung in measured.rungs:
        alarms = rung.alarms
        table.add_row(
            rung.name,
            f"{alarms.count} of {alarms.trials}",
            _shown(alarms),
            "none" if rung.claimed is None else f"{rung.claimed:.2%}",
            "" if rung.below_often is None else _shown(rung.below_often),
            "" if rung.detectable_bias is None else f"{rung.detectable_bias:.3g}",
        )
    output.print(table)


def _shown(found: Rate) -> str:
    return f"{found.value:.1%} [{found.low:.1%}, {found.high:.1%}]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print tables, write JSON; return 1 if the ladder alarms too often."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    measured: list[FalseAlarms] = []
    with Console(stderr=True).status("") as status:
        for scene in given.scene or ["cornell-box", "grey-furnace"]:
            path = given.scenes / scene / "scene.xml"
            measured += measure(
                path, given.pairs, given.size, given.spp, given.seeds, status.update
            )
            if given.convergence:
                measured.append(
                    measure_convergence_alarms(path, given.pairs, given.size, status.update)
                )
    output = Console() if sys.stdout.isatty() else Console(width=120)
    for comparison in measured:
        print_alarms(comparison, output)
    content = {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["python", "-m", "mitsuba_ref.false_alarms", *words]),
        "machine": machine.describe_machine(),
        "versions": machine.installed_versions(),
        "commit": machine.current_commit(),
        "pairs": given.pairs,
        "comparisons": [asdict(comparison) for comparison in measured],
    }
    write_atomically(
        given.out,
        (json.dumps(finite_or_null(content), indent=1, allow_nan=False) + "\n").encode(),
    )
    output.print(f"wrote {given.out}", markup=False, soft_wrap=True)
    return int(any(exceeds(comparison) for comparison in measured))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mitsuba_ref.false_alarms",
        description="Climb the ladder of tests on pairs of an unchanged scene and count "
        "how often it alarms. Exit status 1 if more often than it claims.",
    )
    add = parser.add_argument
    add("--pairs", type=int, default=200, help="trials (default: %(default)s)")
    add(
        "--scene",
        action="append",
        metavar="NAME",
        help="a folder of scenes/; may be given again (default: cornell-box, grey-furnace)",
    )
    add("--size", type=int, default=32, help="pixels a side (default: %(default)s)")
    add("--spp", type=int, default=16, help="samples per pixel (default: %(default)s)")
    add("--seeds", type=int, default=FEWEST_SEEDS, help="pictures (default: %(default)s)")
    add(
        "--convergence",
        action="store_true",
        help="also how fast the noise falls, which takes an hour for the Cornell box",
    )
    add("--scenes", type=Path, default=Path("scenes"), help="the folder of scenes")
    add(
        "--out",
        type=Path,
        default=RECORD,
        metavar="FILE",
        help="default: %(default)s, where `make proof` finds it",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
