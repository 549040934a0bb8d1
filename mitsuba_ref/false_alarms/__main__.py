"""`python -m mitsuba_ref.false_alarms`: measure, print tables, write the record."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from mitsuba_ref.false_alarms.alarm_counts import (
    OFTEN,
    FalseAlarms,
    exceeds,
)
from mitsuba_ref.false_alarms.binomial import Rate
from mitsuba_ref.false_alarms.measure import measure, measure_convergence_alarms
from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import write_json
from mitsuba_ref.records.request import FEWEST_SEEDS

RECORD = Path("reports/out/data/false_alarms.json")
"""For scripts; the page is drawn from `python -m reports false-alarms`."""


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
        **machine.circumstances("mitsuba_ref.false_alarms", words),
        "pairs": given.pairs,
        "comparisons": measured,
    }
    write_json(content, given.out)
    output.print(f"wrote {given.out}", markup=False, soft_wrap=True)
    return int(any(exceeds(comparison) for comparison in measured))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mitsuba_ref.false_alarms",
        allow_abbrev=False,
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
        help="default: %(default)s",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
