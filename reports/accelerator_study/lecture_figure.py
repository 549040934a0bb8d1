"""The lecture's own figure: 1920 x 1080 rays x 6320 triangles, each ray with each triangle.

The naive way is measured on tiles that lie evenly over the picture, and scaled; so is any
structure that cannot do the whole picture in the time it is given.
"""

from __future__ import annotations

from typing import Any

from renderer.kernels.records import batch as tally
from reports.accelerator_study.settings import StudySettings, all_threads
from reports.accelerator_trials.contenders import Contender, Progress, affordable
from reports.accelerator_trials.meshes import StudyMesh
from reports.accelerator_trials.rays import camera_rays
from reports.accelerator_trials.tracing import make_query, spread, tallied, trace

WIDTH, HEIGHT = 1920, 1080
TURNS = 3


def lecture_figure(
    mesh: StudyMesh,
    contenders: list[Contender],
    settings: StudySettings,
    progress: Progress,
) -> dict[str, Any]:
    """Measure one camera ray for each pixel; return the entry of accelerators.json."""
    query = make_query("camera", camera_rays(mesh.view, WIDTH, HEIGHT))
    rows = []
    for one in contenders:
        if one.fault:
            continue
        progress(f"the lecture's figure: {one.name}")
        share = affordable(one.accel, query, settings.lecture_seconds / TURNS)
        nanoseconds = {}
        for threads in sorted({1, all_threads()}):
            part = spread(len(query.rays.count), len(share) * threads)
            spent = min(trace(one.accel, query, part, threads) for _ in range(TURNS))
            nanoseconds[str(threads)] = spent * 1e9 / int(query.rays.count[part].sum())
        some = affordable(one.accel, query, settings.seconds)
        # each ray on its own: a packet's tests would count for all of its 16 rays
        work = tallied(one.accel, query, some, coherent=False)
        rows.append(
            {
                "name": one.name,
                "rays": int(query.rays.count[share].sum()),
                "nanoseconds": nanoseconds,
                "tests": float(work[tally.PRIMITIVES].mean()),
            }
        )
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "triangles": mesh.triangles,
        "rows": rows,
    }
