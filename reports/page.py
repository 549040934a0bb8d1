"""Draws index.html and benchmark.html from their records; needs no network, ever."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from mitsuba_ref.results import Results
from reports import formatting, pictures
from reports.benchmark_record import Benchmark
from reports.benchmark_section import build_benchmark_section
from reports.results import worst_first
from reports.sections import build_sections


def results_page(results: Results, folder: Path, benchmark: Benchmark | None = None) -> str:
    """Return the whole page as HTML: summary, how to read it, every scene.

    Parameters
    ----------
    results
        What was measured.
    folder
        Where results.json is; its pictures are named from there.
    benchmark
        Shown in a few words, with a link to benchmark.html.

    Raises
    ------
    ReportError
        If a picture is missing or unusable.
    """
    return _draw(
        "index.html",
        results=results,
        verdicts=[scene.verdict for scene in results.scenes],
        sections=build_sections(worst_first(results), folder),
        benchmark=None if benchmark is None else build_benchmark_section(benchmark),
    )


def benchmark_page(benchmark: Benchmark) -> str:
    """Return the page of one benchmark as HTML."""
    return _draw("benchmark.html", section=build_benchmark_section(benchmark))


def _draw(template: str, **context: Any) -> str:
    environment = Environment(
        loader=PackageLoader("reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        number=formatting.number,
        seconds=formatting.seconds,
        judgement=formatting.judgement,
        metric_name=formatting.metric_name,
    )
    environment.globals["verdict_signs"] = formatting.VERDICT_SIGNS
    environment.globals["ramp_colours"] = ", ".join(
        "rgb({:.0f} {:.0f} {:.0f})".format(*colour) for colour in pictures.DIVERGING
    )
    return environment.get_template(template).render(**context)
