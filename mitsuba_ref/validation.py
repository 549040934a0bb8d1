"""One scene from file to result: render in both, compare, and say what was done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref import metrics
from mitsuba_ref.cache import ReferenceCache
from mitsuba_ref.comparison import Comparison, compare
from mitsuba_ref.errors import MitsubaError
from mitsuba_ref.ladder import measure_ladder
from mitsuba_ref.machine import usable_cores
from mitsuba_ref.ours import OurPicture, RenderOurs
from mitsuba_ref.proof_file import Proof, read_proof
from mitsuba_ref.reference import Reference
from mitsuba_ref.request import RenderRequest
from mitsuba_ref.results import SceneResult, Seconds
from mitsuba_ref.variant import MIN_THREADS
from renderer.errors import SceneError

Array = NDArray[np.float32]

REFERENCE_SEEDS = 4
"""Mitsuba pictures of a noisy scene: six pairs for the noise floor."""

# Far from any seed that a user gives: the same seed on both sides proves nothing.
FIRST_REFERENCE_SEED = 1_000_003


@dataclass(frozen=True)
class Options:
    """What the command line says for all scenes."""

    size: Literal["demo", "test"] = "demo"
    spp: int | None = None
    seed: int = 0
    threads: int | None = None
    parameters: dict[str, str] = field(default_factory=dict)
    ladder: bool = False

    @property
    def workers(self) -> int:
        """Threads of both renderers; Mitsuba needs two."""
        return max(MIN_THREADS, self.threads or usable_cores())


@dataclass(frozen=True, eq=False)
class Validated:
    """A scene's result, and the pictures that belong to it."""

    result: SceneResult
    pictures: dict[str, Array] = field(default_factory=dict)


def validate_scene(
    path: Path,
    options: Options,
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None] = lambda stage: None,
) -> Validated:
    """Render a scene in both renderers and compare.

    A scene that either renderer refuses gets the verdict "error" and the sentence; this
    function raises nothing but `KeyboardInterrupt`.

    Parameters
    ----------
    path
        Mitsuba 3 XML; a proof.toml beside it is used.
    options
        Sizes, seeds and threads.
    render_ours
        Our renderer (`mitsuba_ref.ours.render_ours`, or what a test puts there).
    references
        Where Mitsuba's pictures come from.
    progress
        Told what is being done.
    """
    blank = SceneResult(name=scene_name(path), path=shown_path(path), verdict="error")
    try:
        proof = read_proof(path)
        blank = replace(
            blank, title=proof.title, shows=proof.shows, deterministic=proof.deterministic
        )
        request = scene_request(path, proof, options)
        return _validate(blank, proof, request, options, render_ours, references, progress)
    except (SceneError, MitsubaError) as error:
        sentence = str(error)
    except Exception as error:  # a bug on our side must not end the other scenes
        sentence = f"unexpected {type(error).__name__}: {error}"
    return Validated(replace(blank, reasons=(" ".join(sentence.split()),)))


def _validate(
    blank: SceneResult,
    proof: Proof,
    request: RenderRequest,
    options: Options,
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None],
) -> Validated:
    progress("our renderer")
    ours = render_ours(request)
    our_aovs = render_ours(replace(request, kind="aovs", spp=None))
    seeds = 2 if proof.deterministic else REFERENCE_SEEDS
    pictures = []
    for index in range(seeds):
        progress(f"Mitsuba, seed {index + 1} of {seeds}")
        seeded = replace(request, seed=FIRST_REFERENCE_SEED + index)
        pictures.append(references.get(seeded, ours.files))
    progress("Mitsuba, AOVs")
    aovs = references.get(replace(request, kind="aovs", spp=None, seed=0), ours.files)
    progress("comparing")
    comparison = compare(
        ours.pixels,
        [picture.pixels for picture in pictures],
        our_aovs.arrays,
        aovs.arrays,
        deterministic=proof.deterministic,
        rmse_factor=proof.rmse_factor,
    )
    ladder = None
    if options.ladder and not proof.deterministic and comparison.finite.passed:
        ladder = measure_ladder(
            request, ours, pictures[0], render_ours, references, progress=progress
        )
    result = replace(
        _describe(blank, request, options, proof, ours, pictures[0], comparison),
        ladder=ladder,
    )
    shown = {
        "ours": ours.pixels,
        "reference": pictures[0].pixels,
        "reference_other_seed": pictures[1].pixels,
    }
    return Validated(result, shown)


def scene_request(path: Path, proof: Proof, options: Options) -> RenderRequest:
    """Return what both renderers are asked for.

    Noisy scenes are rendered with the box filter on both sides: other filters share
    samples between pixels, and then neither the floor nor a test of the mean is valid.
    """
    size = proof.size(options.size)
    parameters = dict(size.parameters) if size else {}
    spp = options.spp or (size.spp if size else None)
    if size and spp:
        parameters["spp"] = str(spp)
    return RenderRequest(
        path=str(path.resolve()),
        parameters=parameters | options.parameters,
        spp=spp,
        seed=options.seed,
        threads=options.workers,
        box_filter=not proof.deterministic,
    )


def scene_name(path: Path) -> str:
    """Return the folder's name for `NAME/scene.xml`, else the file's."""
    return path.resolve().parent.name if path.name == "scene.xml" else path.stem


def shown_path(path: Path) -> str:
    """Return the path as seen from here where possible: reports travel."""
    resolved, here = path.resolve(), Path.cwd().resolve()
    inside = resolved.is_relative_to(here)
    return (
        resolved.relative_to(here).as_posix()
        if inside
        else f"{resolved.parent.name}/{path.name}"
    )


def _describe(
    blank: SceneResult,
    request: RenderRequest,
    options: Options,
    proof: Proof,
    ours: OurPicture,
    reference: Reference,
    comparison: Comparison,
) -> SceneResult:
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
        "tolerance": f"{proof.rmse_factor:g} times the noise floor: {proof.reason}"
        if not proof.deterministic
        else "relative RMSE 1e-4 off edges",
        "reference_spp": str(reference.spp),
        "reference_seconds": f"{reference.threads} workers{cached}",
        "aovs": "one ray through each pixel's centre on both sides",
    }
