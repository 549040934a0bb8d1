"""The record of one scene's comparison, for the report."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace

from mitsuba_ref.ladder.evidence import Evidence
from mitsuba_ref.metrics import distances
from mitsuba_ref.our_renderer.picture import OurPicture
from mitsuba_ref.records.options import Options
from mitsuba_ref.records.proof_file import Proof
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import SceneResult, Seconds
from mitsuba_ref.reference.edited_scene import BOX_INSTEAD
from mitsuba_ref.reference.render import Reference


def describe_scene(
    blank: SceneResult,
    request: RenderRequest,
    options: Options,
    proof: Proof,
    ours: OurPicture,
    reference: Reference,
    found: Evidence,
) -> SceneResult:
    """Fill in the request, what ran on each side, the times, and the results.

    Parameters
    ----------
    blank
        With the scene's name, path, title and whether it is deterministic.
    request, options, proof
        The settings of the comparison.
    ours, reference
        What each renderer did; of Mitsuba's pictures the one that is shown.
    found
        The evidence.
    """
    # A picture of another shape gets its verdict all the same.
    height, width = (*ours.pixels.shape, 0, 0)[:2]
    result = replace(
        blank,
        integrator=ours.integrator,
        reference_integrator=reference.integrator,
        reference_note=_note(reference),
        method=ours.method,
        explain=ours.explain,
        width=width,
        height=height,
        spp=ours.spp,
        seed=request.seed,
        seconds=Seconds(
            ours=ours.seconds,
            ours_compile=ours.compile_seconds,
            reference=reference.seconds,
            reference_threads=reference.threads,
            ours_threads=ours.threads or request.threads,
        ),
        commands=_commands(blank.path, request, options, reference),
        settings=blank.settings | _settings(proof, request, reference, found),
    )
    return found.recorded(result)


def _note(reference: Reference) -> str:
    note = reference.note + " Changed on ours: rays start as far off a surface as Mitsuba's"
    note += f"; {BOX_INSTEAD}." if BOX_INSTEAD in reference.changes else "."
    if reference.integrator == "whitted":
        note += (
            " Mitsuba has no Whitted integrator: the recursion is this harness's, in "
            "Python; intersections, BSDFs and emitters are Mitsuba's."
        )
    return note


def _commands(
    path: str, request: RenderRequest, options: Options, reference: Reference
) -> dict[str, str]:
    """Return a shell command for each side."""
    ours = ["python", "-m", "renderer", path, "--seed", str(request.seed)]
    ours += ["--spp", str(request.spp)] if request.spp else []
    ours += ["--ray-offset", "mitsuba", *_definitions(request.parameters)]
    both = ["python", "-m", "mitsuba_ref", path, "--size", options.size]
    both += ["--seed", str(request.seed)]
    both += ["--spp", str(options.spp)] if options.spp else []
    both += _definitions(options.parameters)
    remark = "  # with the file's own filter; the comparison took the box"
    return {
        "ours": shlex.join(ours) + (remark if BOX_INSTEAD in reference.changes else ""),
        "reference": shlex.join(both),
    }


def _definitions(parameters: Mapping[str, str]) -> list[str]:
    return [word for item in parameters.items() for word in ("-D", "=".join(item))]


def _filter(request: RenderRequest, found: Evidence) -> str:
    if not request.box_filter:
        return "as in the scene file"
    own = "; the file's own for RMSE with filter"
    return "box on both sides" + (own if "rmse_with_filter" in found.metrics else "")


def _settings(
    proof: Proof, request: RenderRequest, reference: Reference, found: Evidence
) -> dict[str, str]:
    cached = "; rendered in an earlier run, from the cache" if reference.from_cache else ""
    return distances.SETTINGS | {
        "filter": _filter(request, found),
        "tolerance_reason": proof.reason,
        "ray_offset": "Mitsuba's rule on both sides",
        "reference_spp": str(reference.spp),
        "reference_seconds": f"{reference.threads} workers{cached}",
        "aovs": "one ray through each pixel's centre on both sides",
    }
