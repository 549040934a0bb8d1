"""The page of one benchmark, benchmark.html."""

from __future__ import annotations

from reports.page.template import fill
from reports.speed.record import Benchmark
from reports.speed.section import build_benchmark_section


def benchmark_page(benchmark: Benchmark) -> str:
    """Return the whole page as HTML."""
    return fill("benchmark.html", section=build_benchmark_section(benchmark))
