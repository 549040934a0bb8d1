"""Rays through large meshes, ours and Embree's in turn, after their hits were compared.

The tree is the one that `auto` takes for them. Embree is asked by `embreex`, on one thread,
and by Mitsuba's llvm variant, on as many as ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from reports.accelerator_study.scene_study import study_scene
from reports.accelerator_study.settings import FULL
from reports.accelerator_trials.contenders import NAIVE
from reports.accelerator_trials.meshes import displaced_icosphere, teapot
from reports.beside_peers.record import RayTimes
from reports.errors import ReportError
from reports.trials.large_meshes import FREQUENCY

OURS = "wide"
KINDS = ("camera", "shadow", "diffuse")
MESHES = (teapot, lambda: displaced_icosphere(FREQUENCY))
PIXELS = 768  # a side


def time_rays(
    threads: list[int],
    rounds: int,
    progress: Callable[[str], None],
    pixels: int = PIXELS,
) -> tuple[RayTimes, ...]:
    """Time the rays of each mesh, kind and number of threads.

    Raises
    ------
    ReportError
        If ours finds other hits than brute force: then there is no record.
    """
    settings = replace(FULL, pixels=pixels, rounds=rounds, build_rounds=1)
    times: list[RayTimes] = []
    for make in MESHES:
        mesh = make()
        record, contenders = study_scene(
            mesh, settings, threads, progress, (NAIVE, OURS), KINDS
        )
        tree = next(one for one in contenders if one.name == OURS)
        if tree.fault:
            raise ReportError(f"{mesh.name}: {tree.fault}")
        mine = next(one for one in record["structures"] if one["name"] == OURS)
        for kind in KINDS:
            work = mine["work"][kind]
            for count in map(str, threads):
                found = {OURS: tuple(mine["nanoseconds"][kind][count])}
                for peer in record["peers"]:
                    if count in peer["nanoseconds"].get(kind, {}):
                        found[peer["name"]] = tuple(peer["nanoseconds"][kind][count])
                times.append(
                    RayTimes(
                        mesh.name,
                        mesh.triangles,
                        kind,
                        int(count),
                        record["rays"][kind],
                        work["boxes"] + work["primitives"],
                        found,
                        {p["name"]: p["fault"] for p in record["peers"] if p["fault"]},
                    )
                )
    return tuple(times)
