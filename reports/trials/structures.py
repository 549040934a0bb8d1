"""The structures over one mesh: built in turn, compared hit for hit, counted."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.bvh_tree import BvhTree, bvh_cost, bvh_depth
from renderer.plugins.shapes.triangle_tables import TriangleSurfaces
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import CellTree, cells_of, tree_cost
from reports.trials.meshes import StudyMesh, triangle_surfaces
from reports.trials.rays import (
    RayBatches,
    camera_rays,
    diffuse_rays,
    flat,
    hit_points,
    random_rays,
    shadow_rays,
)
from reports.trials.tracing import Answers, Query, answers, make_query, spread, trace

NAIVE = "brute"  # no structure: its hits are the truth

Show = Callable[[str], None]
Chosen = NDArray[np.int64]


@dataclass
class Structure:
    """One structure over one mesh; `fault` says why it is not timed."""

    name: str
    accel: Any
    build_seconds: list[float] = field(default_factory=list)
    fault: str = ""


# ---------------------------------------------------------------------------- building


def reach_of(mesh: StudyMesh) -> float:
    """Return the largest |x| + |y| + |z| where a ray of the study can start."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    radius = np.linalg.norm(high - low) / 2.0
    ball = np.abs((low + high) / 2.0).sum() + 3.0**0.5 * radius
    return float(max(ball, np.abs(mesh.view.eye).sum()))


def build(name: str, surfaces: TriangleSurfaces, reach: float) -> tuple[Any, float]:
    """Build one structure; return it and the seconds it took."""
    order = np.arange(surfaces.end - surfaces.first)
    start = time.perf_counter()
    accel = build_accelerator("triangles", surfaces, order, name, reach)
    return accel, time.perf_counter() - start


def build_all(
    mesh: StudyMesh, names: Sequence[str], rounds: int, show: Show
) -> list[Structure]:
    """Build all structures in turn, several rounds; the last of each is kept."""
    surfaces, reach = triangle_surfaces(mesh), reach_of(mesh)
    structures = {name: Structure(name, None) for name in names}
    for turn in range(rounds):
        for name, one in structures.items():
            show(f"building {name}, {turn + 1} of {rounds}")
            if one.fault:
                continue
            one.accel = None  # its memory is free before the next is built
            try:
                one.accel, seconds = build(name, surfaces, reach)
                one.build_seconds.append(seconds)
            except (MemoryError, ValueError) as error:
                one.fault = f"not built: {str(error) or type(error).__name__}"
    return list(structures.values())


def depth_and_cost(accel: Any) -> tuple[int | None, float | None]:
    """Return the edges to the deepest leaf, and the cost by the surface area heuristic.

    The cost is that of a ray that meets the root. None where a structure has no such thing.
    """
    if isinstance(accel, CellTree):
        return int(cells_of(accel)[1].max()), tree_cost(accel)
    if isinstance(accel, BoxTree):
        count = np.where(accel.child == 0, accel.end - accel.first, 0)
        accel = BvhTree(accel.boxes, accel.child, count, accel.items)
    elif not isinstance(accel, Bvh):
        return None, None
    return bvh_depth(accel), bvh_cost(accel)


# ---------------------------------------------------------------------------- the rays


def study_queries(mesh: StudyMesh, accel: Any, pixels: int) -> dict[str, Query]:
    """Return rays of each kind; `accel` finds the camera's hits, where others start."""
    camera = make_query("camera", camera_rays(mesh.view, pixels, pixels))
    trace(accel, camera, camera.batches)
    t, prim = (flat(row, camera.rays) for row in camera.hits[:2])
    points = hit_points(mesh, camera.rays, t, prim)
    shadow = shadow_rays(points, mesh.view.light)
    others: dict[str, RayBatches] = {
        "shadow": shadow,
        "shadow_nearest": shadow,
        "diffuse": diffuse_rays(points),
        "random": random_rays(mesh, max(pixels * pixels // 2, 1)),
    }
    return {"camera": camera} | {k: make_query(k, rays) for k, rays in others.items()}


def affordable(accel: Any, query: Query, seconds: float) -> Chosen:
    """Return as many batches as one thread traces in `seconds`, spread over all."""
    one = spread(len(query.rays.count), 1)
    trace(accel, query, one)  # compiled and in the cache
    each = trace(accel, query, one)
    if each < seconds / 10.0:  # a busy moment must not cost a fast structure its rays
        each = min(each, *(trace(accel, query, one) for _ in range(3)))
    return spread(len(query.rays.count), int(seconds / each))


# --------------------------------------------------------------------------- the check


def check_all(
    structures: Sequence[Structure], queries: Mapping[str, Query], patience: float
) -> dict[str, Answers]:
    """Compare every structure with brute force and with each other; note the faults.

    Brute force answers the rays that it can in time. On these every structure must agree
    with it bit for bit, and on all others with the first structure that does.

    Returns
    -------
    dict
        The agreed answers of all rays, for the peers.
    """
    naive = next(one for one in structures if one.name == NAIVE)
    rest = [one for one in structures if one is not naive and one.accel is not None]
    agreed: dict[str, Answers] = {}
    for kind, query in queries.items():
        part = affordable(naive.accel, query, patience)
        truth = answers(naive.accel, query, part)
        for one in rest:
            if not one.fault:
                _note(one, kind, truth, answers(one.accel, query, part))
        leader = next((one for one in rest if not one.fault), naive)
        agreed[kind] = answers(leader.accel, query, query.batches)
        for one in rest:
            if not one.fault:
                share = affordable(one.accel, query, patience)
                _note(one, kind, agreed[kind].of(share), answers(one.accel, query, share))
    return agreed


def _note(one: Structure, kind: str, truth: Answers, found: Answers) -> None:
    wrong = truth.differing(found)
    if wrong:
        rays = truth.values[0].size
        one.fault = f"{kind} rays: {wrong} of {rays} are answered wrongly; not timed"
