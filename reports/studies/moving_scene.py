"""Moving scenes: fit the tree of the first frame to the new boxes, or build a new one.

The same rays go through both trees, their hits are compared before anything is timed, and
the two take turns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import primitive_group
from renderer.accelerators.bvh.bvh import build_bvh
from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.bvh.bvh_refit import leaf_order, refit_bounds, refit_bvh
from renderer.accelerators.bvh.bvh_tree import BvhTree, bvh_cost
from renderer.kernels.records.batch import NODES
from renderer.plugins.shapes.extents import extents_of
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.bench.timing import take_turns
from reports.look.formatting import number
from reports.trials.meshes import (
    StudyMesh,
    displaced_icosphere,
    triangle_surfaces,
)
from reports.trials.rays import random_rays
from reports.trials.tracing import answers, make_query, tallied, trace

Corners = NDArray[np.float64]  # (n, 3 corners, 3)
ENOUGH = 0.3  # [s] of turns
RAY = "time of a ray"


def wave(corners: Corners, progress: float) -> Corners:
    """Let two waves pass along x, 0.15 high, and come to rest where they began."""
    lift = 0.15 * np.sin(2.0 * np.pi * (corners[..., 0] - 2.0 * progress))
    lift -= 0.15 * np.sin(2.0 * np.pi * corners[..., 0])
    return corners + lift[..., None] * np.array([0.0, 0.0, 1.0])


def twist(corners: Corners, progress: float) -> Corners:
    """Turn about the x axis by up to two turns per unit of x."""
    angle = 4.0 * np.pi * progress * corners[..., 0]
    x, y, z = np.moveaxis(corners, -1, 0)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack((x, cosine * y - sine * z, sine * y + cosine * z), axis=-1)


def mixing(corners: Corners, progress: float) -> Corners:
    """Fly straight to the place of another triangle, where all have arrived at the end."""
    places = corners.mean(axis=1)
    goal = places[np.random.default_rng(0).permutation(len(places))]
    return corners + progress * (goal - places)[:, None]


MOTIONS = {
    "waves that pass along a ball": wave,
    "a ball wrung by two turns per radius": twist,
    "triangles that fly to each other's places": mixing,
}


def moved(rest: StudyMesh, motion: Callable[..., Corners], progress: float) -> StudyMesh:
    """Return the mesh on its way, 0 to 1; each triangle gets corners of its own."""
    corners = motion(rest.vertices[rest.faces].astype(np.float64), progress)
    vertices = np.ascontiguousarray(corners.reshape(-1, 3), np.float32)
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return replace(rest, vertices=vertices, faces=faces)


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield, frame by frame, the milliseconds of both ways and what rays then cost."""
    frequency, frames, rays = (29, 3, 4096) if bench.quick else (114, 17, 16384)
    rest = moved(displaced_icosphere(frequency), wave, 0.0)
    for at in np.linspace(0.0, 1.0, frames):
        bench.show(f"frame at {100 * at:.0f} %")
        mesh = moved(rest, MOTIONS[case], float(at))
        for contender, quantity, unit, value in measure_frame(rest, mesh, rays):
            yield Row(
                case=case,
                contender=contender,
                quantity=quantity,
                unit=unit,
                at=100.0 * float(at),
                value=value,
            )


def measure_frame(
    rest: StudyMesh, mesh: StudyMesh, rays: int
) -> Iterator[tuple[str, str, str, float]]:
    """Yield (contender, quantity, unit, value) of one frame.

    Raises
    ------
    ValueError
        If the hits of the two trees differ.
    """

    def group(chosen: NDArray[np.int64]) -> Any:
        return primitive_group("triangles", triangle_surfaces(mesh), chosen)

    def extents(of: StudyMesh) -> Any:
        return extents_of("triangles", triangle_surfaces(of), np.arange(of.triangles))

    def build(_: int) -> None:
        build_tree(new.lower, new.upper)

    def refit(_: int) -> None:
        refit_bounds(first.child, first.count, order, new)

    new = extents(mesh)
    first = build_bvh(extents(rest), group)
    order = leaf_order(first)
    build(0)  # compiles
    refit(0)
    times = take_turns({"rebuilt": build, "refitted": refit}, 9, enough=ENOUGH)
    trees = {"rebuilt": build_bvh(new, group), "refitted": refit_bvh(first, new, group)}
    query = make_query("random", random_rays(mesh, rays))
    one, other = (answers(tree, query, query.batches) for tree in trees.values())
    if one.differing(other):
        raise ValueError("the refitted tree gives other hits; nothing was timed")
    traced = take_turns(
        {name: _tracing(tree, query) for name, tree in trees.items()}, 9, enough=ENOUGH
    )
    for name, tree in trees.items():
        nodes = tallied(tree, query, query.batches)[NODES].mean()
        cost = bvh_cost(
            BvhTree(tree.bounds, tree.child, tree.count, leaf_order(tree).astype(np.int32))
        )
        # the least of the turns: a disturbance only adds
        yield name, "time of the tree", "ms", 1e3 * min(times[name])
        yield name, RAY, "ns", 1e9 * min(traced[name]) / query.rays.rays
        yield name, "nodes of a ray", "", float(nodes)
        yield name, "SAH cost", "", float(cost)


def _tracing(tree: Any, query: Any) -> Callable[[int], float]:
    return lambda turn: trace(tree, query, query.batches)


def verdict(table: Table) -> str:
    """Say how much longer rays take in a fitted tree than in a new one, at worst."""
    times = table.where(quantity=RAY)
    worst = []
    for case in times.distinct("case"):
        new, fitted = (
            times.curve(case=case, contender=name) for name in ("rebuilt", "refitted")
        )
        ratios = [b.value / a.value for a, b in zip(new, fitted, strict=True)]  # type: ignore
        worst.append(f"{case} {number(max(ratios), 2)} times")
    text = "; ".join(worst)
    return f"In a fitted tree a ray takes at worst as long: {text}." if text else ""


STUDY = described(
    "moving-scene",
    cases=tuple(MOTIONS),
    measure=measure,
    verdict=verdict,
)
