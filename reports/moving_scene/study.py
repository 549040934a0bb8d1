"""Moving scenes: refit the tree that is there, or build a new one for every frame.

`python -m reports.moving_scene` prints, for three motions of a ring of triangles, what both
cost per frame and what rays then cost in either tree. The same rays go through both, their
hits are compared before anything is timed, and the two take turns.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import primitive_group
from renderer.accelerators.bvh import Bvh, build_bvh
from renderer.accelerators.bvh_build import build_tree
from renderer.accelerators.bvh_refit import leaf_order, refit_bounds, refit_bvh
from renderer.accelerators.bvh_tree import BvhTree, bvh_cost
from renderer.accelerators.dispatch import closest_hit
from renderer.accelerators.extents import Extents, extents_of
from renderer.accelerators.tally import BOXES, NODES, PRIMITIVES, make_tally
from renderer.batch import Workspace, make_workspace
from renderer.jit import entry_kernel
from renderer.stages.intersect import reset_hits
from reports.moving_scene.meshes import MOTIONS, Corners, ring, surfaces_of

# Seconds after which two turns are enough: what takes so long is not disturbed by much.
ENOUGH = 0.3

Record = dict[str, Any]


class Trial(NamedTuple):
    """How a frame is measured."""

    work: Workspace  # the rays and their hits
    rays: int
    turns: int
    seed: int


@entry_kernel
def _trace(accel: Any, rays: Any, hits: Any, count: int, tally: Any) -> None:
    reset_hits(hits, 0, count)
    closest_hit(accel, rays, hits, 0, count, False, tally)


def measure_moving_scene(quick: bool = True) -> Record:
    """Return the study at the size of the page's quick or full run."""
    if quick:
        return study_moving_scene(around=128, frames=5, rays=4096)
    return study_moving_scene(around=512, frames=17, rays=16384)


def study_moving_scene(
    around: int = 256, frames: int = 9, rays: int = 4096, turns: int = 9, seed: int = 0
) -> Record:
    """Measure every frame of every motion.

    Parameters
    ----------
    around
        Steps around the ring, even, at least 6; it has around^2 triangles.
    frames
        At least 2; the first is at rest, and the tree built there is what is refitted.
    rays
        Incoherent rays that each frame is traced with.
    turns
        Most repeats of each time; the best is kept.
    seed
        Of the rays.

    Returns
    -------
    dict
        What JSON can hold: `triangles`, `rays`, `turns`, `seed`, `cores` (a build uses all,
        the rest is one thread), and `motions`, a list of `name`, `about` and `frames`: a
        list with, for each frame,

        - `progress`: 0 at rest, 1 at the end;
        - `shared_ms`: new boxes, and triangles gathered into leaf order: both ways need it;
        - `rebuild_ms`: building a tree over the new boxes;
        - `refit_ms`: fitting the first frame's tree to them;
        - `rebuilt`, `refitted`: of either tree `ns_per_ray`, `sah_cost`, and the means
          per ray of `nodes`, `box_tests` and `primitive_tests`.

    Raises
    ------
    AssertionError
        If the hits of the two trees differ.
    """
    rest = ring(around)
    work = make_workspace(ray_capacity=rays, shadow_capacity=16, channels=3, depths=1)
    trial = Trial(work, rays, turns, seed)
    surfaces = surfaces_of(rest)
    first = build_bvh(
        extents_of("triangles", surfaces, np.arange(len(rest))),
        lambda order: primitive_group("triangles", surfaces, order),
    )
    _measure_frame(first, rest, trial)  # compiles
    return {
        "triangles": len(rest),
        "rays": rays,
        "turns": turns,
        "seed": seed,
        "cores": os.cpu_count() or 1,
        "motions": [
            {
                "name": motion.name,
                "about": motion.about,
                "frames": [
                    {
                        "progress": float(progress),
                        **_measure_frame(first, motion.move(rest, float(progress)), trial),
                    }
                    for progress in np.linspace(0.0, 1.0, frames)
                ],
            }
            for motion in MOTIONS
        ],
    }


def _measure_frame(first: Bvh, corners: Corners, trial: Trial) -> Record:
    """Return one frame's record, without its progress."""
    surfaces = surfaces_of(corners)
    columns, order = np.arange(len(corners)), leaf_order(first)

    def group(chosen: NDArray[np.int64]) -> Any:
        return primitive_group("triangles", surfaces, chosen)

    def shared() -> Extents:
        group(order)
        return extents_of("triangles", surfaces, columns)

    extents = shared()
    shared_ms, rebuild_ms, refit_ms = (
        1e3 * seconds
        for seconds in _best_seconds(
            trial.turns,
            shared,
            lambda: build_tree(extents.lower, extents.upper),
            lambda: refit_bounds(first.child, first.count, order, extents),
        )
    )
    trees = {
        "rebuilt": build_bvh(extents, group),
        "refitted": refit_bvh(first, extents, group),
    }
    _aim(trial, corners)
    return {
        "shared_ms": shared_ms,
        "rebuild_ms": rebuild_ms,
        "refit_ms": refit_ms,
        **_measure_trees(trees, trial),
    }


def _aim(trial: Trial, corners: Corners) -> None:
    """Write rays from anywhere in the box of all triangles to anywhere."""
    work, rays = trial.work, trial.rays
    generator = np.random.default_rng(trial.seed)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    direction = generator.normal(size=(3, rays))
    work.rays.origin[:, :rays] = generator.uniform(low, high, (rays, 3)).T
    work.rays.direction[:, :rays] = direction / np.linalg.norm(direction, axis=0)


def _measure_trees(trees: dict[str, Bvh], trial: Trial) -> dict[str, Record]:
    """Compare the hits in all trees, then time them in turn; return a record of each."""
    work, rays, hits = trial.work, trial.rays, trial.work.hits
    found, records = [], {}
    for name, tree in trees.items():
        tally = make_tally(rays)
        _trace(tree, work.rays, hits, rays, tally)
        found.append(np.stack((hits.t, hits.u, hits.v, hits.prim.view(np.float32))))
        nodes, boxes, primitives = (
            float(tally[row, :rays].mean()) for row in (NODES, BOXES, PRIMITIVES)
        )
        order = leaf_order(tree).astype(np.int32)
        records[name] = {
            "sah_cost": bvh_cost(BvhTree(tree.bounds, tree.child, tree.count, order)),
            "nodes": nodes,
            "box_tests": boxes,
            "primitive_tests": primitives,
        }
    one, other = (table[:, :rays].view(np.int32) for table in found)
    hit = one[3] >= 0
    if not (
        np.array_equal(one[3], other[3]) and np.array_equal(one[:, hit], other[:, hit])
    ):
        raise AssertionError("the refitted tree gives other hits; nothing was timed")

    def tracing(tree: Bvh) -> Callable[[], None]:
        return lambda: _trace(tree, work.rays, hits, rays, None)

    runs = [tracing(tree) for tree in trees.values()]
    times = _best_seconds(trial.turns, *runs)
    for record, seconds in zip(records.values(), times, strict=True):
        record["ns_per_ray"] = 1e9 * seconds / rays
    return records


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
    parser.add_argument("--around", type=int, default=256, help="its square is triangles")
    parser.add_argument("--frames", type=int, default=9, help="of each motion")
    parser.add_argument("--rays", type=int, default=4096, help="of each frame")
    given = parser.parse_args(arguments)
    study = study_moving_scene(given.around, given.frames, given.rays)
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
