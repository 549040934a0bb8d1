"""One scene from file to result: render in both, compare, and say what was done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.command.scene_result import describe_scene
from mitsuba_ref.command.verdict_of_error import (
    NotCompared,
    bad_request,
    stopped_by,
    with_the_other_side,
)
from mitsuba_ref.ladder.aovs import INDICES
from mitsuba_ref.ladder.evidence import Evidence, compare, compare_listed_aov
from mitsuba_ref.ladder.one_noisy_picture import compare_filtered
from mitsuba_ref.ladder.pictures_by_seed import climb_scene, reference_seed
from mitsuba_ref.ladder.preconditions import count_non_finite, find_obstacle
from mitsuba_ref.ladder.rungs_of_convergence import convergence_rungs
from mitsuba_ref.our_renderer.picture import RenderOurs, cautions_about, read_scene
from mitsuba_ref.records.options import Options, scene_name, scene_request, shown_path
from mitsuba_ref.records.proof_file import NO_PROOF, USUAL_LIMITS, Proof, read_proof
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import SceneResult, Seconds
from mitsuba_ref.records.verdicts import COMPARED
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.edited_scene import BOX_INSTEAD
from mitsuba_ref.reference.plugins.hair import has_hair
from mitsuba_ref.reference.plugins.known_faults import TURNED, has_biased_lamps, wrong_by
from mitsuba_ref.reference.plugins.volpathmis import faults_of
from mitsuba_ref.reference.render import Reference
from mitsuba_ref.replay.replay_scene import replay_all
from mitsuba_ref.speed.speed_against_accuracy import measure_ladder
from renderer.errors import NotAllowed, NotReplayable, SceneError

Array = NDArray[np.float32]

REFERENCE_SEEDS = 4
"""Mitsuba pictures of a noisy scene: six pairs for the noise floor."""

FILTERED_SEEDS = 3
"""Mitsuba pictures with the scene's own filter, where that is not the box."""


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

    A scene that cannot be compared gets a verdict that says why, and a sentence from each
    side that refused it; this function raises nothing but `KeyboardInterrupt`.

    Parameters
    ----------
    path
        Mitsuba 3 XML; a proof.toml in its folder is used.
    options
        Sizes, seeds and threads.
    render_ours
        Our renderer (`our_renderer.picture.render_ours`, or what a test puts there).
    references
        Where Mitsuba's pictures come from.
    progress
        Called with a name of each stage.
    """
    blank = SceneResult(name=scene_name(path), path=shown_path(path), verdict="broken")
    stage = "reading proof.toml"

    def note(now: str) -> None:
        nonlocal stage
        stage = now
        progress(now)

    request: RenderRequest | None = None
    try:
        proof = read_proof(path)
        blank = replace(
            blank,
            title=proof.title,
            shows=proof.shows,
            deterministic=bool(proof.deterministic),
        )
        request = scene_request(path, proof, options)
        blank = replace(blank, cautions=cautions_about(request))
        return _validate(blank, proof, request, options, render_ours, references, note)
    except Exception as error:  # a bug on our side must not end the other scenes
        if request is None and isinstance(error, SceneError):
            return _without_pictures(blank, bad_request(error))
        stopped = stopped_by(error, stage)
        harmless = not isinstance(error, NotAllowed)
    if request is not None and stopped.verdict == "refused-by-us" and harmless:
        note("Mitsuba, after our refusal")
        stopped = with_the_other_side(stopped, request, references)
    return _without_pictures(blank, stopped)


def _without_pictures(blank: SceneResult, stopped: NotCompared) -> Validated:
    return Validated(replace(blank, verdict=stopped.verdict, reasons=stopped.reasons))


def _validate(
    blank: SceneResult,
    proof: Proof,
    request: RenderRequest,
    options: Options,
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None],
) -> Validated:
    if options.checks == "replay":
        return _only_replays(
            blank, proof, request, options, render_ours, references, progress
        )
    progress("our renderer")
    ours = render_ours(request)
    our_aovs = render_ours(replace(request, kind="aovs", spp=None))
    first_hits = replace(request, kind="aovs", spp=None, seed=0)

    def compared(
        request: RenderRequest,
    ) -> tuple[Evidence, list[Reference], Reference, bool]:
        pictures, deterministic = _reference_pictures(
            request, ours.files, proof.deterministic, references, progress
        )
        progress("Mitsuba, AOVs")
        aovs = references.get(first_hits, ours.files)
        progress("comparing")
        found = compare(
            ours.pixels,
            [picture.pixels for picture in pictures],
            our_aovs.arrays,
            aovs.arrays,
            deterministic=deterministic,
            rmse_factor=proof.rmse_factor,
        )
        # Not by the pictures: indices, since Mitsuba merges meshes for them, and normals of
        # bump maps, which are turned for the first hits alone.
        left_out = INDICES + (("sh_normal",) if TURNED in aovs.changes else ())
        for name, kind in ours.listed.items():
            if found.verdict in COMPARED and kind not in left_out:
                theirs = [picture.arrays.get(name) for picture in pictures]
                metric = compare_listed_aov(ours.arrays[name], theirs, name)
                found = found.with_metric(name, metric)
        return found, pictures, aovs, deterministic

    found, pictures, aovs, deterministic = compared(request)
    if found.verdict == "fail" and has_biased_lamps(read_scene(request)):
        request = replace(request, unsampled_lamps=True)
        found, pictures, aovs, deterministic = compared(request)
    if found.verdict == "fail" and (faults := faults_of(read_scene(request))):
        request = replace(request, volpath_since=faults)
        found, pictures, aovs, deterministic = compared(request)
    if found.verdict == "fail" and has_hair(read_scene(request)):
        request = replace(request, last_lobe=True)
        found, pictures, aovs, deterministic = compared(request)
    boxed = BOX_INSTEAD in pictures[0].changes
    if boxed and not deterministic and found.verdict in COMPARED:
        progress("with the scene's own filter")
        found = _with_own_filter(found, request, render_ours, references)
    progress("replay")
    wanted = options.checks != "statistics" and found.verdict in COMPARED
    replays, shown, refusal = replay_all(
        request,
        options.replay if wanted else (),
        render_ours,
        references,
        proof.replay,
        options.causes,
        options.time_limit,
    )
    found = replace(found, replays=replays, fault=wrong_by(pictures[0].changes))
    ladder = None
    if options.ladder and not deterministic and found.verdict in COMPARED:
        ladder = measure_ladder(request, pictures, render_ours, references, progress)
    shown |= {
        "ours": ours.pixels,
        "reference": pictures[0].pixels,
        "reference_other_seed": pictures[1].pixels,
    }
    if options.seeds > 1 and found.verdict in COMPARED:
        further = convergence_rungs(
            scene_request(Path(request.path), proof, _small(options)),
            ours.files,
            render_ours,
            references,
            progress,
            deterministic=deterministic,
        )
        found, arrays = climb_scene(
            found,
            request,
            options.seeds,
            (ours, our_aovs),
            (pictures, aovs),
            render_ours,
            references,
            progress,
            deterministic=deterministic,
            further=further if options.convergence else (),
        )
        shown |= arrays
    blank = replace(
        blank,
        deterministic=deterministic,
        ladder=ladder,
        settings=_replay_settings(proof, refusal),
    )
    result = describe_scene(blank, request, options, proof, ours, pictures[0], found)
    return Validated(result, shown)


def _reference_pictures(
    request: RenderRequest,
    files: Sequence[str],
    deterministic: bool | None,
    references: ReferenceCache,
    progress: Callable[[str], None],
) -> tuple[list[Reference], bool]:
    """Return Mitsuba's pictures with several seeds, and whether they are without noise."""
    pictures: list[Reference] = []
    for index in range(REFERENCE_SEEDS):
        if index == 2 and deterministic is None:
            deterministic = np.array_equal(pictures[0].pixels, pictures[1].pixels)
        if index == 2 and deterministic:
            break  # the second seed has shown that there is no noise
        progress(f"Mitsuba, seed {index + 1}")
        seeded = replace(request, seed=reference_seed(index))
        pictures.append(references.get(seeded, files))
    return pictures, bool(deterministic)


def _small(options: Options) -> Options:
    return replace(options, size="test", spp=None)


def _replay_settings(proof: Proof, refusal: str) -> dict[str, str]:
    """Return what the report says about the replays: why none, why with wider limits."""
    if refusal:
        return {"replay": refusal}
    limits = proof.replay
    usual = limits in (USUAL_LIMITS, NO_PROOF.replay)
    return {} if usual else {"replay_limits": limits.reason}


def _only_replays(
    blank: SceneResult,
    proof: Proof,
    request: RenderRequest,
    options: Options,
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None],
) -> Validated:
    """Compare by replay only: the same random numbers on both sides.

    Raises
    ------
    NotReplayable
        If the scene's integrator draws in an order that cannot be followed.
    """
    progress("replay")
    replays, pictures, refusal = replay_all(
        request,
        options.replay,
        render_ours,
        references,
        proof.replay,
        options.causes,
        options.time_limit,
    )
    if refusal:
        raise NotReplayable(refusal)
    height, width = (*pictures["replay_ours"].shape, 0, 0)[:2]
    finite = count_non_finite([pictures["replay_ours"]], [pictures["replay_reference"]])
    found = Evidence(finite, replays=replays, fault=wrong_by(replays[-1].changes))
    result = replace(
        blank,
        width=width,
        height=height,
        spp=replays[-1].spp,
        seed=request.seed,
        settings=_replay_settings(proof, ""),
        seconds=Seconds(
            ours=replays[-1].seconds_ours, reference=replays[-1].seconds_reference
        ),
    )
    return Validated(found.recorded(result), pictures)


def _with_own_filter(
    found: Evidence,
    request: RenderRequest,
    render_ours: RenderOurs,
    references: ReferenceCache,
) -> Evidence:
    """Compare with the scene's own filter: no other number depends on its weights."""
    own = replace(request, box_filter=False)
    ours = render_ours(own)
    pictures = [
        references.get(replace(own, seed=reference_seed(index)), ours.files).pixels
        for index in range(FILTERED_SEEDS)
    ]
    obstacle = find_obstacle([ours.pixels], pictures)
    if obstacle:
        found = replace(found, finite=count_non_finite([ours.pixels], pictures))
    metric = obstacle or compare_filtered(ours.pixels, pictures)
    return found.with_metric("rmse_with_filter", metric)
