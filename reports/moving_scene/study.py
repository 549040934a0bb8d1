"""Moving scenes: refit the tree that is there, or build a new one for every frame.

`python -m reports.moving_scene` prints, for three motions of a dented ball, what both cost
per frame and what rays then cost in either tree. The same rays go through both, their hits
are compared before anything is timed, and the two take turns.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import primitive_group
from renderer.accelerators.bvh.bvh import Bvh, build_bvh
from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.bvh.bvh_refit import leaf_order, refit_bounds, refit_bvh
from renderer.accelerators.bvh.bvh_tree import BvhTree, bvh_cost
from renderer.kernels.records.batch import NODES
from renderer.plugins.shapes.extents import extents_of
from reports.accelerator_trials.meshes import (
    StudyMesh,
    displaced_icosphere,
    triangle_surfaces,
)
from reports.accelerator_trials.rays import random_rays
from reports.accelerator_trials.tracing import Query, answers, make_query, tallied, trace
from reports.moving_scene.motions import MOTIONS

# Seconds after which two turns are enough: what takes so long is not disturbed by much.
ENOUGH = 0.3

Record = dict[str, Any]


def measure_moving_scene(quick: bool = True) -> Record:
    """Return the study at the size of the page's quick or full run."""
    if quick:
        return study_moving_scene(frequency=29, frames=3, rays=4096)
    return study_moving_scene(frequency=114, frames=17, rays=16384)


def study_moving_scene(
    frequency: int = 57, frames: int = 9, rays: int = 4096, turns: int = 9
) -> Record:
    """Measure every frame of every motion.

    Parameters
    ----------
    frequency
        The ball has 20 frequency^2 triangles.
    frames
        At least 2; the first is at rest, and the tree built there is what is refitted.
    rays
        Incoherent rays that each frame is traced with.
    turns
        Most repeats of each time; the best is kept.

    Returns
    -------
    dict
        What JSON can hold: `triangles`, `rays`, `turns`, `cores` (a build uses all, the
        rest is one thread), and `motions`, a list of `name`, `about` and `frames`: a list
        with, for each frame,

        - `progress`: 0 at rest, 1 at the end;
        - `rebuild_ms`: building a tree over the new boxes;
        - `refit_ms`: fitting the first frame's tree to them;
        - `rebuilt`, `refitted`: of either tree `ns_per_ray`, `sah_cost`, and the mean
          `nodes` per ray.

    Raises
    ------
    AssertionError
        If the hits of the two trees differ.
    """
    rest = MOTIONS[0].at(displaced_icosphere(frequency), 0.0)
    first = built(rest)
    _measure_frame(first, rest, rays, turns)  # compiles
    return {
        "triangles": rest.triangles,
        "rays": rays,
        "turns": turns,
        "cores": os.cpu_count() or 1,
        "motions": [
            {
                "name": motion.name,
                "about": motion.about,
                "frames": [
                    {
                        "progress": float(progress),
                        **_measure_frame(
                            first, motion.at(rest, float(progress)), rays, turns
                        ),
                    }
                    for progress in np.linspace(0.0, 1.0, frames)
                ],
            }
            for motion in MOTIONS
        ],
    }


def group_of(mesh: StudyMesh) -> Callable[[NDArray[np.int64]], Any]:
    """Return what gives the mesh's triangles in the order of a tree's leaves."""
    surfaces = triangle_surfaces(mesh)
    return lambda chosen: primitive_group("triangles", surfaces, chosen)


def built(mesh: StudyMesh) -> Bvh:
    """Return a tree over the mesh as it is."""
    columns = np.arange(mesh.triangles)
    extents = extents_of("triangles", triangle_surfaces(mesh), columns)
    return build_bvh(extents, group_of(mesh))


def _measure_frame(first: Bvh, mesh: StudyMesh, rays: int, turns: int) -> Record:
    """Return one frame's record, without its progress."""
    columns, order = np.arange(mesh.triangles), leaf_order(first)
    extents = extents_of("triangles", triangle_surfaces(mesh), columns)
    rebuild, refit = _best_seconds(
        turns,
        lambda: build_tree(extents.lower, extents.upper),
        lambda: refit_bounds(first.child, first.count, order, extents),
    )
    trees = {
        "rebuilt": built(mesh),
        "refitted": refit_bvh(first, extents, group_of(mesh)),
    }
    query = make_query("random", random_rays(mesh, rays))
    return {
        "rebuild_ms": 1e3 * rebuild,
        "refit_ms": 1e3 * refit,
        **_measure_trees(trees, query, turns),
    }


def _measure_trees(trees: dict[str, Bvh], query: Query, turns: int) -> dict[str, Record]:
    """Compare the hits in both trees, then time them in turn; return a record of each."""
    one, other = (answers(tree, query, query.batches) for tree in trees.values())
    if one.differing(other):
        raise AssertionError("the refitted tree gives other hits; nothing was timed")

    def tracing(tree: Bvh) -> Callable[[], float]:
        return lambda: trace(tree, query, query.batches)

    times = _best_seconds(turns, *map(tracing, trees.values()))
    return {
        name: {
            "ns_per_ray": 1e9 * seconds / query.rays.rays,
            "sah_cost": _cost(tree),
            "nodes": float(tallied(tree, query, query.batches)[NODES].mean()),
        }
        for (name, tree), seconds in zip(trees.items(), times, strict=True)
    }


def _cost(tree: Bvh) -> float:
    order = leaf_order(tree).astype(np.int32)
    return bvh_cost(BvhTree(tree.bounds, tree.child, tree.count, order))


def _best_seconds(turns: int, *actions: Callable[[], Any]) -> list[float]:
    """Return the least time of each action; all take a turn before any has its next."""
    best = [np.inf] * len(actions)
    end = time.perf_counter() + ENOUGH
    for turn in range(turns):
        if turn >= 2 and time.perf_counter() > end:
            break
        for k, action in enumerate(actions):
            start = time.perf_counter()
            action()
            best[k] = min(best[k], time.perf_counter() - start)
    return best


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--frequency", type=int, default=57, help="20 N^2 triangles")
    parser.add_argument("--frames", type=int, default=9, help="of each motion")
    parser.add_argument("--rays", type=int, default=4096, help="of each frame")
    given = parser.parse_args(arguments)
    study = study_moving_scene(given.frequency, given.frames, given.rays)
    write = sys.stdout.write
    write(f"{study['triangles']} triangles, {study['rays']} incoherent rays a frame\n")
    write("                 ms              rebuilt                   refitted\n")
    write(
        "motion   at   rebuild  refit     ns/ray    SAH  nodes      ns/ray    SAH  nodes\n"
    )
    for motion in study["motions"]:
        for frame in motion["frames"]:
            write(f"{motion['name']:6s} {frame['progress']:4.2f}")
            write(f"   {frame['rebuild_ms']:7.1f} {frame['refit_ms']:6.2f}")
            for tree in (frame["rebuilt"], frame["refitted"]):
                write(f"   {tree['ns_per_ray']:8.0f} {tree['sah_cost']:6.1f}")
                write(f" {tree['nodes']:6.1f}")
            write("\n")
    return 0
