"""The page of one benchmark, benchmark.html."""

from __future__ import annotations

from reports.look.template import fill
from reports.speed.compile_times import CompileTimes
from reports.speed.record import Benchmark
from reports.speed.section import build_benchmark_section


def benchmark_page(benchmark: Benchmark, compiled: CompileTimes | None = None) -> str:
    """Return the whole page as HTML; what compiles is shown if it was timed."""
    section = build_benchmark_section(benchmark)
    return fill("speed/benchmark.html", section=section, compiled=compiled)
