"""`python -m mitsuba_ref.mutations`: print the mutation matrix and write matrix.json."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from mitsuba_ref.mutations.defects.catalogue import named
from mitsuba_ref.mutations.from_syntax import enumerate_mutants, sample
from mitsuba_ref.mutations.matrix import Row, read_matrix_rows, try_all, write_matrix
from mitsuba_ref.mutations.resumed import Matrix
from mitsuba_ref.mutations.rungs import CLIMB, Rung
from mitsuba_ref.mutations.syntax_trial import (
    Outcome,
    scenes_by_kernel,
    summary,
    try_sample,
)
from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import RecordError, write_json
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker

WHOLE = Path("reports/out/data")
"""Where the page "proof" looks."""

A_PART = Path("reports/out")
"""For a few mutations: they must not replace the whole matrix on the page."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run mutations; return 0 if each is seen, or not, as it should be, else 1."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(given)
    console = Console(stderr=True)
    if options.from_syntax:
        return _try_syntax(options, given, console)
    try:
        mutations = named(options.only)
        before = read_matrix_rows(options.resume) if options.resume else ()
    except (KeyError, OSError, RecordError) as error:
        named_in = f"{options.resume}: " if isinstance(error, RecordError) else ""
        said = error.args[0] if isinstance(error, KeyError) else error
        console.print(f"{named_in}{said}", markup=False, soft_wrap=True)
        return 2
    path = (options.out or (A_PART if options.only else WHOLE)) / "matrix.json"
    circumstances = machine.circumstances("mitsuba_ref.mutations", given)
    done = Matrix(before, str(circumstances["commit"]), mutations)

    def write() -> None:
        circumstances["machine"] = machine.describe_machine()  # busy so far, or not
        write_matrix(done.rows, circumstances, path)

    def keep(row: Row) -> None:
        console.print(_line(row), markup=False, soft_wrap=True)
        # each mutant is a copy of the work tree of its hour, not of that of the start
        done.add(row, machine.current_commit())
        write()  # an interrupt loses nothing

    with MitsubaWorker() as worker:
        references = ReferenceCache(worker.render)
        for part in done.to_try():
            try_all(part, references, keep, options.jobs, done.of_this_commit)
    write()
    output = Console() if sys.stdout.isatty() else Console(width=150)
    output.print(_table(done.rows))
    output.print(f"wrote {path}", markup=False, soft_wrap=True)
    return 0 if all(row.as_expected for row in done.rows) else 1


def _try_syntax(options: argparse.Namespace, given: list[str], console: Console) -> int:
    """Try a sample of the mutants made by machine; return 1 if one survives, else 0."""
    enumerated = enumerate_mutants()
    scenes = scenes_by_kernel()
    chosen = sample(enumerated, options.from_syntax, options.seed, scenes.keys())
    done: list[Outcome] = []
    path = (options.out or A_PART) / "syntax.json"

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


def _line(row: Row) -> str:
    found = f"caught by {row.caught_by}" if row.caught_by else "not seen"
    blind = f"; blind: {listed(row.blind)}" if row.blind else ""
    broken = f"; broken: {listed(row.broken)}" if row.broken else ""
    mark = "" if row.as_expected else "NOT AS EXPECTED "
    return f"{mark}{row.mutation} on {row.scene}: {found}{blind}{broken}"


def _table(rows: Sequence[Row]) -> Table:
    table = Table(title="Mutation matrix", title_justify="left", box=SIMPLE_HEAD)
    for column in ("mutation", "scene", "caught by"):
        table.add_column(column, overflow="fold")
    for column in ("spp", "s", "s compile"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("also", overflow="fold")
    table.add_column("ladder breaks at", overflow="fold")
    table.add_column("blind", overflow="fold")
    for row in rows:
        caught = [rung for rung in row.rungs if rung.caught]
        first = caught[0] if caught else None
        table.add_row(
            row.mutation,
            row.scene,
            ("" if row.as_expected else "! ") + (first.name if first else "-"),
            _samples(first) if first else "",
            f"{first.seconds:.1f}" if first else "",
            f"{row.compile_seconds:.0f}",
            listed([rung.name for rung in caught[1:]]),
            lowest_broken(row),
            listed(row.blind),
        )
    return table


def _samples(rung: Rung) -> str:
    many = f" x {rung.seeds}" if rung.seeds > 1 else ""
    return f"{rung.spp or ''}{many}"


def lowest_broken(row: Row) -> str:
    """Return the lowest rung of the ladder of tests that breaks, and what it took."""
    for rung in row.rungs:
        if rung.caught and rung.name.startswith(CLIMB):
            name = rung.name.removeprefix(CLIMB)
            return f"{name}, {_samples(rung)} spp, {rung.seconds:.1f} s"
    return "-"


def listed(names: Sequence[str]) -> str:
    """Return the names; those of the ladder of tests together, last."""
    others = [name for name in names if not name.startswith(CLIMB)]
    climbed = [name.removeprefix(CLIMB) for name in names if name.startswith(CLIMB)]
    if climbed:
        others.append(f"ladder ({', '.join(climbed)})")
    return ", ".join(others)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mitsuba_ref.mutations",
        allow_abbrev=False,
        description="Build known defects into copies of our renderer and say which rung of "
        "which check sees them. Exit status: 0 every harmful one is seen and no neutral "
        "one, 1 not so, 2 the command line was wrong.",
    )
    add = parser.add_argument
    add("--only", nargs="+", default=[], metavar="NAME", help="default: all of them")
    add(
        "--out",
        type=Path,
        metavar="DIR",
        help=f"where matrix.json goes (default: {WHOLE}, where `make proof` finds it; with "
        f"--only {A_PART})",
    )
    add(
        "--resume",
        type=Path,
        metavar="FILE",
        help="go on from that matrix.json: what it has not comes first, then what it has "
        "of another commit, which stays in the matrix until then",
    )
    add(
        "--jobs",
        type=int,
        choices=range(1, 9),
        default=1,
        metavar="N",
        help="mutants at a time (default: %(default)s)",
    )
    add(
        "--from-syntax",
        type=int,
        default=0,
        metavar="N",
        help="try N mutants made by machine from the syntax of the kernels instead",
    )
    add("--seed", type=int, default=0, metavar="S", help="which N (default: %(default)s)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
