"""Constants of the old commands, until they are studies."""

from __future__ import annotations

from pathlib import Path

from mitsuba_ref.records.json_files import write_atomically
from reports.records.measured import newest
from reports.speed.compile_times import read_compile_times
from reports.speed.page import benchmark_page
from reports.speed.record import read_benchmark

DEFAULT_OUT = Path("reports/out")
ACCELERATORS = "accelerators.json"
BENCHMARK = "benchmark.json"
COMPILE_TIMES = "compile_times.json"
NEEDS = "needs.json"
PART = "-part"  # in the names of record and page that hold not everything
WRONG_USE, INTERRUPTED = 2, 130  # exit statuses of every command


def draw(source: Path, out: Path) -> int:
    """Do nothing: `python -m reports` draws index.html."""
    return 0


def draw_benchmark(out: Path) -> Path | None:
    """Draw benchmark.html in `out` from the records in its `data`; return its path."""
    timings, compiled = (newest(out / "data" / name) for name in (BENCHMARK, COMPILE_TIMES))
    if not timings.exists():
        return None
    times = read_compile_times(compiled) if compiled.exists() else None
    page = out / "benchmark.html"
    write_atomically(page, benchmark_page(read_benchmark(timings), times).encode())
    return page
