"""`python -m reports.limits`: measure every row of the atlas, draw the page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.records.json_files import write_atomically
from reports.commands.pages import DEFAULT_OUT, INTERRUPTED, PART, WRONG_USE, draw
from reports.errors import ReportError
from reports.limits.atlas import ATLAS
from reports.limits.measure import measure_atlas
from reports.limits.page import gives_way, limits_page
from reports.limits.record import FILE, Limits, MeasuredRow, read_limits, write_limits
from reports.limits.row import Row

ALARM = 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or read what was measured, and draw limits.html; return the exit status.

    Rows that are chosen are printed: the record and the page are of the whole atlas. Those
    that are quick have a record and a page of their own, which replace neither.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    stem = Path(FILE).stem
    if given.quick or (given.source is not None and given.source.stem.endswith(PART)):
        stem += PART
    target, page = given.out / "data" / f"{stem}.json", given.out / f"{stem}.html"
    console = Console(stderr=True)
    try:
        limits = _limits(given, words)
        if not given.only:
            content = limits_page(limits)  # what cannot be drawn must not replace what can
            write_limits(target, limits)
            write_atomically(page, content.encode())
            results = target.parent / "results.json"
            if target.name == FILE and results.exists():
                draw(results, given.out)  # links to this page now
    except KeyboardInterrupt:
        console.print("reports.limits: interrupted, nothing was written")
        return INTERRUPTED
    except ReportError as error:
        console.print(f"reports.limits: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    lines = [f"{row.name}: {row.verdict} {row.error}".rstrip() for row in limits.alarms]
    if given.only:
        lines = [_line(row) for row in limits.rows]
    else:
        lines.append(f"The atlas: {page}")
    for line in lines:
        Console().print(line, markup=False, soft_wrap=True)
    return ALARM if limits.alarms else 0


def _limits(given: argparse.Namespace, words: Sequence[str]) -> Limits:
    if given.source is not None:
        if given.only or given.quick:
            raise ReportError("--from draws what was measured: not with --only or --quick")
        return read_limits(given.source)
    rows = [row for row in _chosen(given.only) if not (given.quick and row.slow)]
    with shown_stages() as show:
        return measure_atlas(rows, words, show)


def _line(measured: MeasuredRow) -> str:
    """Return what was measured of a row, in one line."""
    if measured.error:
        return f"{measured.name}: {measured.verdict} {measured.error}"
    (row,) = (one for one in ATLAS if one.name == measured.name)
    curve = ", ".join(f"{x:g}: {_shown(y)}" for x, y in measured.curve)
    return (
        f"{row.name}: {measured.verdict}; tolerance {row.tolerance:g}, gives way "
        f"{gives_way(row, measured)}; {curve}"
    )


def _shown(value: float | None) -> str:
    return "no number" if value is None else f"{value:.3g}"


def _chosen(names: Sequence[str] | None) -> Sequence[Row]:
    """Return the rows of these names, or of all.

    Raises
    ------
    ReportError
        If there is no row of a name.
    """
    if not names:
        return ATLAS
    rows = {row.name: row for row in ATLAS}
    for name in names:
        if name not in rows:
            raise ReportError(f"row {name!r} is unknown; there are: {', '.join(rows)}")
    return [row for row in ATLAS if row.name in names]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.limits",
        allow_abbrev=False,
        description="Measure where methods fail, both sides of every boundary, and draw "
        "the page.",
        epilog=f"Exit status: 0 every row is as the atlas says, {ALARM} one is not or "
        f"could not be measured, {WRONG_USE} the command line or the file is wrong.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the page goes")
    add("--from", dest="source", type=Path, metavar="LIMITS.json", help="draw only")
    add("--quick", action="store_true", help=f"leave out the slow rows; in a *{PART} page")
    add("--only", nargs="+", metavar="ROW", help="measure these, write nothing")
    return parser
