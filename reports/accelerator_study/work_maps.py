"""Work per pixel: what each camera ray cost a structure, as a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.records import batch as tally
from reports.accelerator_study.settings import StudySettings
from reports.accelerator_trials.contenders import NAIVE, Contender, Progress
from reports.accelerator_trials.meshes import BALL_TRIANGLES, StudyMesh
from reports.accelerator_trials.rays import camera_rays, flat, pixel_order
from reports.accelerator_trials.tracing import make_query, tallied


def work_maps(
    mesh: StudyMesh,
    contenders: list[Contender],
    settings: StudySettings,
    progress: Progress,
) -> dict[str, Any]:
    """Count for each pixel what its ray cost, one ray at a time.

    The work is the nodes or cells that a ray visits and the primitives that it is tested
    with. Brute force is left out: its work is the same everywhere.
    """
    width, height = settings.map_width, settings.map_height
    query = make_query("camera", camera_rays(mesh.view, width, height))
    order = pixel_order(width, height)
    maps = []
    for one in contenders:
        if one.fault or one.name == NAIVE:
            continue
        progress(f"{mesh.name}: work per pixel, {one.name}")
        counts = tallied(one.accel, query, query.batches, coherent=False)
        work = np.zeros(width * height, np.int64)
        work[order] = counts[tally.NODES] + counts[tally.PRIMITIVES]
        on_ball = _on_ball(flat(query.hits.prim, query.rays), mesh)
        tests = counts[tally.PRIMITIVES][on_ball]
        maps.append(
            {
                "name": one.name,
                "mean": float(work.mean()),
                "ball_tests": float(tests.mean()) if tests.size else None,
                "work": work.reshape(height, width).tolist(),
            }
        )
    return {"scene": mesh.name, "width": width, "height": height, "maps": maps}


def _on_ball(prim: NDArray[np.int32], mesh: StudyMesh) -> NDArray[np.bool_]:
    """Return which rays hit the ball in the stadium; none in any other mesh."""
    hit: NDArray[np.bool_] = (prim >= 0) & (prim < BALL_TRIANGLES)
    return hit & (mesh.name == "stadium")
