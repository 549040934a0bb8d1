"""`python -m mitsuba_ref.mutations --from-syntax N`: try mutants made by machine.

The mutations of the catalogue are a study, `python -m reports mutations`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.mutations.from_syntax import enumerate_mutants, sample
from mitsuba_ref.mutations.syntax_trial import (
    Outcome,
    scenes_by_kernel,
    summary,
    try_sample,
)
from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import write_json
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker


def main(arguments: Sequence[str] | None = None) -> int:
    """Try a sample of the mutants; return 1 if one survives, else 0."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(given)
    console, path = Console(stderr=True), options.out / "syntax.json"
    enumerated = enumerate_mutants()
    scenes = scenes_by_kernel()
    chosen = sample(enumerated, options.from_syntax, options.seed, scenes.keys())
    done: list[Outcome] = []

    def keep(outcome: Outcome) -> None:
        done.append(outcome)
        by = f" by {outcome.killed_by}" if outcome.killed_by else ""
        line = f"{len(done)} of {len(chosen)}: {outcome.verdict}{by}: {outcome.mutant}"
        console.print(f"{line} ({outcome.does})", markup=False, soft_wrap=True)
        circumstances = machine.circumstances("mitsuba_ref.mutations", given)
        record = {"schema": 1, **circumstances, "enumerated": len(enumerated)}
        write_json(record | {"seed": options.seed, "outcomes": done}, path)

    with MitsubaWorker() as worker:
        references = ReferenceCache(worker.render)
        try_sample(chosen, scenes, references, keep, options.jobs)
    for line in summary(done):
        Console().print(line, markup=False, soft_wrap=True)
    console.print(f"wrote {path}", markup=False, soft_wrap=True)
    return int(any(outcome.verdict == "survived" for outcome in done))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mitsuba_ref.mutations",
        allow_abbrev=False,
        description="Change the syntax of kernels of our renderer at random places, one "
        "at a time, and say which check sees it. Exit status: 0 each that changes a "
        "picture is seen, 1 not so, 2 the command line was wrong.",
    )
    add = parser.add_argument
    add("--from-syntax", type=int, required=True, metavar="N", help="how many mutants")
    add("--seed", type=int, default=0, metavar="S", help="which (default: %(default)s)")
    add(
        "--out",
        type=Path,
        default=Path("reports/out"),
        metavar="DIR",
        help="where syntax.json goes (default: %(default)s)",
    )
    add(
        "--jobs",
        type=int,
        choices=range(1, 9),
        default=1,
        metavar="N",
        help="mutants at a time (default: %(default)s)",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
