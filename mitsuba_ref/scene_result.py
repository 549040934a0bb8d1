"""Everything that was done to one scene, written down for the report."""

from __future__ import annotations

from dataclasses import replace

from mitsuba_ref import metrics
from mitsuba_ref.comparison import Comparison
from mitsuba_ref.options import Options
from mitsuba_ref.ours import OurPicture
from mitsuba_ref.proof_file import Proof
from mitsuba_ref.reference import Reference
from mitsuba_ref.request import RenderRequest
from mitsuba_ref.results import SceneResult, Seconds


def describe_scene(
    blank: SceneResult,
    request: RenderRequest,
    options: Options,
    proof: Proof,
    ours: OurPicture,
    reference: Reference,
    comparison: Comparison,
) -> SceneResult:
    """Fill in what was asked, what ran on each side, how long, and what came out.

    Parameters
    ----------
    blank
        With the scene's name, path, title and whether it is deterministic.
    request, options, proof
        What was asked for.
    ours, reference
        What each renderer did; of Mitsuba's pictures the one that is shown.
    comparison
        The numbers and the verdict.
    """
    height, width = ours.pixels.shape[:2]
    return replace(
        blank,
        integrator=ours.integrator,
        reference_integrator=reference.integrator,
        reference_note=reference.note + _whitted_note(reference),
        method=ours.method,
        explain=ours.explain,
        width=width,
        height=height,
        spp=ours.spp,
        seed=request.seed,
        verdict=comparison.verdict,
        reasons=comparison.reasons,
        finite=comparison.finite,
        metrics=comparison.metrics,
        aovs=comparison.aovs,
        seconds=Seconds(
            ours=ours.seconds,
            ours_compile=ours.compile_seconds,
            reference=reference.seconds,
            reference_threads=reference.threads,
            ours_threads=ours.threads or request.threads,
        ),
        commands=_commands(blank.path, request, options),
        settings=_settings(proof, request, reference),
    )


def _whitted_note(reference: Reference) -> str:
    if reference.integrator != "whitted":
        return ""
    return (
        " Mitsuba has no Whitted integrator: the recursion is this harness's, in Python; "
        "intersections, BSDFs and emitters are Mitsuba's."
    )


def _commands(path: str, request: RenderRequest, options: Options) -> dict[str, str]:
    sets = "".join(f" -D {name}={value}" for name, value in request.parameters.items())
    spp = f" --spp {request.spp}" if request.spp else ""
    own = "".join(f" -D {name}={value}" for name, value in options.parameters.items())
    return {
        "ours": f"python -m renderer {path}{spp} --seed {request.seed}{sets}",
        "reference": (
            f"python -m mitsuba_ref {path} --size {options.size} --seed {request.seed}"
            f"{f' --spp {options.spp}' if options.spp else ''}{own}"
        ),
    }


def _settings(proof: Proof, request: RenderRequest, reference: Reference) -> dict[str, str]:
    cached = "; rendered in an earlier run, from the cache" if reference.from_cache else ""
    return metrics.SETTINGS | {
        "filter": "box on both sides" if request.box_filter else "as in the scene file",
        "tolerance_reason": proof.reason,
        "ray_offset": "Mitsuba's rule on both sides",
        "reference_spp": str(reference.spp),
        "reference_seconds": f"{reference.threads} workers{cached}",
        "aovs": "one ray through each pixel's centre on both sides",
    }
