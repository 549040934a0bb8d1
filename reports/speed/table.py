"""A benchmark as text: ratios, seconds, versions, machine."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mitsuba_ref.records.other_programs import busy_sentence
from reports.look import formatting
from reports.records.circumstances import Circumstances
from reports.speed.compile_times import CompileTimes
from reports.speed.record import Benchmark
from reports.speed.section import build_benchmark_section


def output() -> Console:
    """Return standard output; in a pipe rich would assume 80 columns and cut numbers."""
    return Console() if sys.stdout.isatty() else Console(width=120)


def print_benchmark(record: Benchmark, console: Console) -> None:
    """Print seconds and ratios of all renderers, the starts and the targets."""
    section = build_benchmark_section(record)
    title = (
        f"{record.scene.get('name', '')}, {record.width} x {record.height} pixels, "
        f"{record.spp} samples, {record.workers} workers each"
    )
    table = Table(title=escape(title), title_justify="left")
    table.add_column("renderer", no_wrap=True)
    for name in ("median", "range", "times ours", "range", "Mpaths/s", "Mrays/s"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in section.rows:
        if row.seconds is None:
            continue
        ratio = ("1", "")
        if row.ratio is not None:
            low, high = formatting.number(row.ratio.low), formatting.number(row.ratio.high)
            ratio = (formatting.number(row.ratio.median), f"{low} to {high}")
        seconds = row.seconds
        table.add_row(
            escape(row.name),
            formatting.seconds(seconds.median),
            f"{formatting.seconds(seconds.low)} to {formatting.seconds(seconds.high)}",
            *ratio,
            formatting.number(row.million_paths_per_second),
            formatting.number(row.million_rays_per_second),
        )
    console.print(table)
    for row in section.rows:
        if row.seconds is None:
            _line(console, f"{row.name}: not available: {row.unavailable}")
    for target in section.targets:
        met = {True: "reached", False: "NOT reached", None: "not measured"}[target.met]
        _line(console, f"{target.what}: {target.measured}, {target.wanted} wanted: {met}")
    print_circumstances(record, console)


def print_compile_times(record: CompileTimes, console: Console) -> None:
    """Print what each scene's first picture took, and the sum."""
    title = "processor seconds of first pictures, in one process, cache empty at first"
    table = Table(title=title, title_justify="left", show_footer=True)
    number = formatting.number
    table.add_column("scene", footer="all")
    table.add_column("seconds", footer=number(record.seconds), justify="right")
    table.add_column("formerly", footer=number(record.former), justify="right")
    for one in record.scenes:
        table.add_row(escape(one.scene), number(one.seconds), number(one.former))
    console.print(table)
    print_circumstances(record, console)


def print_circumstances(record: Circumstances, console: Console) -> None:
    """Print machine, versions, commit, time and command; first if it was busy."""
    if sentence := busy_sentence(record.machine):
        console.print(sentence, style="bold yellow", markup=False, soft_wrap=True)
    machine = ", ".join(f"{key} {value}" for key, value in record.machine.items())
    versions = ", ".join(f"{name} {found}" for name, found in record.versions.items())
    _line(console, f"machine: {machine}")
    _line(console, f"versions: {versions}")
    _line(console, f"commit {record.commit}, {record.created}, {record.command}")


def _line(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)
