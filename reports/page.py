"""Draws the pages from their records; needs no network, ever."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mitsuba_ref.records.results import Results
from mitsuba_ref.records.verdicts import CURRENT, VERDICTS
from mitsuba_ref.replay.replay_scene import TOLERANCE
from reports import formatting, heat_map, pictures, scene_tables
from reports.accelerators_record import AcceleratorStudy
from reports.accelerators_section import build_accelerators_section
from reports.benchmark_record import Benchmark
from reports.benchmark_section import build_benchmark_section
from reports.further_studies import FURTHER_STUDIES
from reports.proof_record import ProofRecord
from reports.proof_section import build_proof_section
from reports.proof_sentences import detectable, headlines, percent
from reports.results import worst_first
from reports.sections import build_sections


def results_page(
    results: Results,
    folder: Path,
    benchmark: Benchmark | None = None,
    accelerators: AcceleratorStudy | None = None,
    proof: ProofRecord | None = None,
) -> str:
    """Return the whole page as HTML: summary, how to read it, every scene.

    Parameters
    ----------
    results
        What was measured.
    folder
        Where results.json is; its pictures are named from there.
    benchmark
        Shown in a few words, with a link to benchmark.html.
    accelerators
        Likewise, with a link to accelerators.html.
    proof
        Likewise, with a link to proof.html.

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
        accelerators=accelerators,
        proof=None if proof is None else headlines(proof),
        proof_faults=[] if proof is None else proof.faults,
    )


def benchmark_page(benchmark: Benchmark) -> str:
    """Return the page of one benchmark as HTML."""
    return _draw("benchmark.html", section=build_benchmark_section(benchmark))


def accelerators_page(study: AcceleratorStudy) -> str:
    """Return the page of one study of accelerators as HTML."""
    further = [
        {
            "anchor": key,
            "title": one.title,
            "content": Markup(one.section(study.further[key])),
        }
        for key, one in FURTHER_STUDIES.items()
        if key in study.further
    ]
    return _draw(
        "accelerators.html",
        section=build_accelerators_section(study),
        shown_kinds=scene_tables.SHOWN,
        further=further,
    )


def proof_page(record: ProofRecord, folder: Path) -> str:
    """Return the page of the proof as HTML; its pictures are named from `folder`.

    Raises
    ------
    ReportError
        If a picture is missing or unusable.
    """
    return _draw("proof.html", section=build_proof_section(record, folder))


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
        percent=percent,
        detectable=detectable,
    )
    environment.globals["divergent_from"] = TOLERANCE
    environment.globals["work_ramp"] = heat_map.ramp_css()
    environment.globals["verdict_signs"] = formatting.VERDICT_SIGNS
    environment.globals["verdict_styles"] = formatting.VERDICT_STYLES
    environment.globals["verdict_facts"] = {name: VERDICTS[name] for name in CURRENT}
    environment.globals["ramp_colours"] = ", ".join(
        "rgb({:.0f} {:.0f} {:.0f})".format(*colour) for colour in pictures.DIVERGING
    )
    return environment.get_template(template).render(**context)
