"""How often the ladder of tests alarms when nothing is wrong.

Renders a small scene with thousands of seeds and climbs the whole ladder on pairs of sets
of pictures, Mitsuba against Mitsuba, where every alarm is false, and ours against Mitsuba.
Within a comparison each picture is used once, so the pairs are independent trials. The
rungs without noise are not random and are left out.

Alarms at the claimed rate are rare, so 200 pairs can show that it is not far exceeded and
not much more. The share of p-values below 5 % tells more about the calibration.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from mitsuba_ref import machine
from mitsuba_ref.ladder_of_tests import FALSE_ALARMS, FEWEST_SEEDS, climb
from mitsuba_ref.noisy_rungs import exponent
from mitsuba_ref.results import Rung, finite_or_null, write_atomically
from mitsuba_ref.scene_convergence import FIRST_SEEDS
from mitsuba_ref.seeds import FIRST_REFERENCE_SEED
from mitsuba_ref.statistics.binomial import Rate, rate
from mitsuba_ref.statistics.convergence import MOST_SEEDS, Render, measure_convergence
from mitsuba_ref.unchanged_scene import by_mitsuba, by_ours

Pictures = NDArray[np.float32]

OFTEN = 0.05  # a p-value that is frequent enough to be counted in 200 pairs
WHOLE = "whole ladder"

RECORD = Path("reports/out/data/false_alarms.json")
"""Where the page "proof" looks."""


@dataclass(frozen=True)
class RungAlarms:
    """One rung, or the whole ladder, over all pairs."""

    name: str
    alarms: Rate
    claimed: float | None
    below_often: Rate | None  # p-values of at most `OFTEN`
    detectable_bias: float | None  # median over the pairs
    detectable: str


@dataclass(frozen=True)
class FalseAlarms:
    """One comparison of a scene with itself."""

    scene: str
    comparison: str
    width: int
    height: int
    spp: int
    seeds: int  # pictures of each side in a pair
    rungs: tuple[RungAlarms, ...]


def count_alarms(
    first: Sequence[Pictures],
    second: Sequence[Pictures],
    alpha: float = FALSE_ALARMS,
    further: Sequence[Sequence[Callable[[], Rung]]] | None = None,
) -> tuple[RungAlarms, ...]:
    """Climb to the top for each pair; return how often each rung was broken.

    Parameters
    ----------
    first, second
        For each pair a set of pictures, (K, H, W, 3); no picture twice.
    alpha
        Claimed for each rung.
    further
        For each pair what makes the rungs above the others.
    """
    climbs = [
        climb(list(a), list(b), alpha=alpha, to_the_top=True, further=more)
        for a, b, more in zip(first, second, further or [()] * len(first), strict=True)
    ]
    found = [_count(rungs) for rungs in zip(*climbs, strict=True)]
    broken = sum(any(not rung.passed for rung in rungs) for rungs in climbs)
    claims = [rung.claimed for rung in found if rung.claimed is not None]
    whole = RungAlarms(WHOLE, rate(broken, len(climbs)), sum(claims), None, None, "")
    return (*found, whole)


def _count(rungs: Sequence[Rung]) -> RungAlarms:
    """Count over the same rung of all pairs."""
    p = [rung.p_value for rung in rungs if rung.p_value is not None]
    bias = [rung.detectable_bias for rung in rungs if rung.detectable_bias is not None]
    return RungAlarms(
        name=rungs[0].name,
        alarms=rate(sum(not rung.passed for rung in rungs), len(rungs)),
        claimed=rungs[0].false_alarm_rate,
        below_often=rate(sum(value <= OFTEN for value in p), len(p)) if p else None,
        detectable_bias=float(np.median(bias)) if bias else None,
        detectable=rungs[0].detectable,
    )


def measure(
    path: Path,
    pairs: int,
    size: int,
    spp: int,
    seeds: int,
    progress: Callable[[str], None] = lambda stage: None,
    *,
    convergence: bool = True,
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
        Samples per pixel, but of the convergence.
    seeds
        Pictures of each side in a pair.
    progress
        Told what is being done.
    convergence
        Also how fast the noise falls, of the side that is named first.
    """
    parameters = {"width": str(size), "height": str(size), "spp": str(spp)}
    name, half = path.resolve().parent.name, pairs * seeds
    total, done = 3 * half, 0

    def series(render: Render, first: int, count: int) -> Pictures:
        nonlocal done
        pictures = []
        for seed in range(first, first + count):
            pictures.append(render(spp, seed))
            done += 1
            progress(f"{name}: picture {done} of {total}")
        return np.stack(pictures)

    theirs = series(by_mitsuba(path, parameters), FIRST_REFERENCE_SEED, 2 * half)
    ours = series(by_ours(path, parameters), 0, half)
    sets = theirs.reshape(2, pairs, seeds, *theirs.shape[1:])
    our_sets = ours.reshape(pairs, seeds, *ours.shape[1:])
    measured = []
    for comparison, a, b, side, by_side in (
        ("Mitsuba against Mitsuba", sets[0], sets[1], "Mitsuba", by_mitsuba),
        ("ours against Mitsuba", our_sets, sets[0], "ours", by_ours),
    ):
        progress(f"{name}: {comparison}")
        further = None
        if convergence:
            render = by_side(path, parameters, independent=True)
            further = [
                _convergence(side, render, trial, progress) for trial in range(pairs)
            ]
        rungs = count_alarms(list(a), list(b), further=further)
        measured.append(FalseAlarms(name, comparison, size, size, spp, seeds, rungs))
    return measured[0], measured[1]


def _convergence(
    side: str, render: Render, trial: int, progress: Callable[[str], None]
) -> list[Callable[[], Rung]]:
    """Return the rung of one trial, which renders pictures that no other trial has."""
    start = FIRST_SEEDS[side] + trial * MOST_SEEDS

    def rung() -> Rung:
        progress(f"convergence, {side}, pair {trial + 1}")
        return exponent(
            measure_convergence(lambda spp, seed: render(spp, start + seed)), side
        )

    return [rung]


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


def exceeds(measured: FalseAlarms) -> bool:
    """Return whether the whole ladder surely alarms more often than it claims."""
    whole = measured.rungs[-1]
    return whole.claimed is not None and whole.alarms.low > whole.claimed


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
