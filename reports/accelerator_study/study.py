"""The whole study of accelerators, from compilation to accelerators.json.

Hits are compared before anything is timed; what fails is not timed and says so.
"""

from __future__ import annotations

import gc
import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import write_atomically
from renderer.accelerators.choice import RayCounts, choose_structure
from reports.accelerator_study.further_studies import FURTHER_STUDIES
from reports.accelerator_study.growth_study import study_growth
from reports.accelerator_study.lecture_figure import lecture_figure
from reports.accelerator_study.record import SCHEMA
from reports.accelerator_study.scene_study import study_scene
from reports.accelerator_study.settings import (
    QUICK,
    StudySettings,
    all_threads,
    thread_counts,
)
from reports.accelerator_study.work_maps import work_maps
from reports.accelerator_trials.contenders import NAIVE, Contender
from reports.accelerator_trials.meshes import StudyMesh, triangle_surfaces
from reports.accelerator_trials.rays import RAY_KINDS
from reports.accelerator_trials.warm_structures import warm_side_by_side

MAPPED = ("teapot", "stadium")  # the scenes whose work per pixel is shown
# Rays that a picture may need: a glance (one sample of a megapixel) and a good picture.
WORKLOADS = (1_000_000, 100_000_000)

Progress = Callable[[str], None]


def write_study(
    target: Path, settings: StudySettings, command: str, progress: Progress
) -> None:
    """Measure and write accelerators.json."""
    measured = measure(settings, progress)
    measured["command"] = command
    write_atomically(target, json.dumps(measured, indent=1).encode())


def measure(settings: StudySettings, progress: Progress) -> dict[str, Any]:
    """Do the whole study; return accelerators.json."""
    progress("compiling the kernels of all structures")
    warm_side_by_side()
    scenes, maps, figure = [], [], None
    for number, make in enumerate(settings.scenes):
        mesh = make()
        # the first scene is also the one for parallel scaling
        threads = thread_counts() if number == 0 else sorted({1, all_threads()})
        scene, contenders = study_scene(mesh, settings, threads, progress)
        scene["auto"] = {str(rays): _auto(mesh, rays) for rays in WORKLOADS}
        scenes.append(scene)
        if mesh.name in MAPPED:
            maps.append(work_maps(mesh, contenders, settings, progress))
        if mesh.name == "teapot":
            figure = lecture_figure(mesh, contenders, settings, progress)
        _forget(contenders)
    growth = study_growth(settings, progress)
    further = {}
    for key, study in FURTHER_STUDIES.items():
        progress(study.title)
        further[key] = study.measure(settings is QUICK)
    return {
        "schema": SCHEMA,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": machine.current_commit(),
        "machine": machine.describe_machine(),
        "versions": machine.installed_versions(),
        "size": settings.name,
        "threads": all_threads(),
        "rounds": settings.rounds,
        "naive": NAIVE,
        "kinds": [
            {"name": name, "title": kind.title, "about": kind.about}
            for name, kind in RAY_KINDS.items()
        ],
        "scenes": scenes,
        "figure": figure,
        "maps": maps,
        "growth": growth,
        "further": further,
    }


def _auto(mesh: StudyMesh, rays: int) -> str:
    """Return what `--accel auto` takes for a mesh from which so many rays are expected."""
    counts = RayCounts(0.2 * rays, 0.8 * rays)
    surfaces = triangle_surfaces(mesh)
    return choose_structure("triangles", surfaces, mesh.triangles, "auto", counts).name


def _forget(contenders: list[Contender]) -> None:
    """Give the memory of the structures back before the next scene."""
    for one in contenders:
        one.accel = None
    gc.collect()
