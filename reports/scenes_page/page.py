"""The page of all scenes, index.html: summary, how to read it, every scene."""

from __future__ import annotations

from pathlib import Path

from mitsuba_ref.records.results import Results
from reports.accelerator_study.record import AcceleratorStudy
from reports.look.template import fill
from reports.pages.speed_accuracy_page import efficiencies, noisy_scenes
from reports.proof_page.record import ProofRecord
from reports.proof_page.sentences import headlines
from reports.records.results import worst_first
from reports.scenes_page.sections import build_sections
from reports.speed_accuracy.record import SpeedAccuracy
from reports.speed_accuracy.summary import efficiencies


def results_page(
    results: Results,
    folder: Path,
    benchmark: str = "",
    accelerators: AcceleratorStudy | None = None,
    proof: ProofRecord | None = None,
    curves: SpeedAccuracy | None = None,
    soak: str = "",
    *,
    limits: bool = False,
    needs: bool = False,
    history: bool = False,
) -> str:
    """Return the whole page as HTML.

    Parameters
    ----------
    results
        What was measured.
    folder
        Where results.json is; its pictures are named from there.
    benchmark
        Verdict of the study, shown with a link to benchmark.html.
    accelerators
        Likewise, with a link to accelerators.html.
    proof
        Likewise, with a link to proof.html.
    curves
        Rows of the study speed-accuracy; likewise, with a link to speed_accuracy.html.
    soak
        Likewise, with a link to soak.html.
    limits, needs, history
        Whether there is a limits.html, a needs.html, a history.html to be named.

    Raises
    ------
    ReportError
        If a picture is missing or unusable.
    """
    return fill(
        "scenes/index.html",
        results=results,
        verdicts=[scene.verdict for scene in results.scenes],
        sections=build_sections(worst_first(results), folder),
        benchmark=benchmark,
        accelerators=accelerators,
        proof=None if proof is None else headlines(proof),
        proof_faults=[] if proof is None else proof.faults,
        limits=limits,
        curves=curves and curves.newest,
        efficiency=next(iter(efficiencies(noisy_scenes(curves))), None) if curves else None,
        soak=soak,
        needs=needs,
        history=history,
    )
