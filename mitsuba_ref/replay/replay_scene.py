"""Both renderers draw the same random numbers: their pictures must agree path by path.

There is no noise between them, so any difference is rounding or a defect. Rounding may
send a path to the other side of an edge; the few pixels where that happened are counted,
named and left out of the RMSE.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer.picture import RenderOurs, read_scene
from mitsuba_ref.records.proof_file import USUAL_LIMITS, ReplayLimits
from mitsuba_ref.records.request import TIME_LIMIT, RenderRequest
from mitsuba_ref.records.results import ReplayResult
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.replay.beyond_limits import causes_of, look_at_causes
from mitsuba_ref.replay.edge_causes import first_hit_causes
from mitsuba_ref.replay.paths.traced_pair import is_traceable
from mitsuba_ref.replay.replay_comparison import compare_replay
from renderer.errors import NotReplayable
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import Plan
from renderer.replay.replay_mode import Replayed
from renderer.scene.scene import build_scene
from renderer.scene_file.description import SceneDescription

Array = NDArray[np.float32]


def replay_scene(
    request: RenderRequest,
    spp: int,
    render_ours: RenderOurs,
    references: ReferenceCache,
    limits: ReplayLimits = USUAL_LIMITS,
    causes: int = 0,
    time_limit: float = TIME_LIMIT,
) -> tuple[ReplayResult, Array, Array]:
    """Render a scene on both sides with Mitsuba's random numbers, and compare.

    Parameters
    ----------
    request
        The scene, its parameters, seed and threads; rendered with the box filter, since
        any other spreads a divergent path over its neighbours.
    spp
        Samples per pixel.
    render_ours, references
        The two renderers.
    limits
        What is allowed.
    causes
        Of so many divergent pixels, the worst first, say where their paths part.
    time_limit
        Seconds for one answer of Mitsuba to a trace.

    Returns
    -------
    The result and both pictures, (H, W, 3).
    """
    request = replace(request.with_spp(spp), box_filter=True, replay=True)
    description = read_scene(request)
    plan = _refuse_early(description, request)
    reference = references.get(request, description.files)
    entries = reference.arrays.get("camera")
    camera = None if entries is None else tuple(float(entry) for entry in entries)
    request = replace(request, camera=camera)
    ours = render_ours(request)
    pictures = ours.pixels, reference.pixels
    result = compare_replay(*pictures, limits)
    if limits.traced and result.verdict == "fail" and is_traceable(description):
        result = look_at_causes(result, *pictures, request, limits, time_limit)
    if causes and result.listed:
        few = result.listed[:causes]
        if is_traceable(description):
            told = causes_of(few, *pictures, request, time_limit)
        else:
            told = first_hit_causes(few, request, plan.name, render_ours)
        result = replace(result, listed=told + result.listed[causes:])
    result = replace(
        result,
        spp=ours.spp,
        seed=request.seed,
        seconds_ours=ours.seconds,
        seconds_reference=reference.seconds,
        changes=reference.changes,
    )
    return result, *pictures


def _refuse_early(description: SceneDescription, request: RenderRequest) -> Plan:
    """Raise NotReplayable before Mitsuba renders a request that makes it hang."""
    scene = build_scene(description)
    plan = make_plan(scene, sampler="mitsuba", spp=request.spp)
    Replayed(None).sampling(scene, plan, request.seed)
    return plan


def replay_all(
    request: RenderRequest,
    samples: Sequence[int],
    render_ours: RenderOurs,
    references: ReferenceCache,
    limits: ReplayLimits = USUAL_LIMITS,
    causes: int = 0,
    time_limit: float = TIME_LIMIT,
) -> tuple[tuple[ReplayResult, ...], dict[str, Array], str]:
    """Replay a scene with several numbers of samples.

    Parameters
    ----------
    request, render_ours, references, limits, causes, time_limit
        As for `replay_scene`.
    samples
        Numbers of samples per pixel, rising.

    Returns
    -------
    The results; the pictures of the last one by name; why the scene cannot be replayed, or
    an empty string.
    """
    results: list[ReplayResult] = []
    pictures: dict[str, Array] = {}
    try:
        for spp in samples:
            result, ours, reference = replay_scene(
                request, spp, render_ours, references, limits, causes, time_limit
            )
            results.append(result)
            pictures = {"replay_ours": ours, "replay_reference": reference}
    except NotReplayable as refusal:
        return (), {}, str(refusal)
    return tuple(results), pictures, ""
