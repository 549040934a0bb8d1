"""Rays from inside of closed meshes: one that meets nothing has leaked.

However near to an edge or a vertex it passes: the triangle test is watertight
(`renderer.plugins.shapes.watertight`), and boxes have room for rounding. All structures
trace the same rays. Half of them go anywhere; the others are aimed past an edge or a
vertex, at distances from 10^-8 to 10^-2 of the edge's length. A ray that leaks and meets
the mesh again from outside, as it may in the ring, is not noticed; the balls have few such
places.
"""

from __future__ import annotations

import functools
import time
from collections import Counter
from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from renderer.process.names import ACCELERATORS
from renderer.process.worker_pool import default_threads, in_threads
from reports.bench.steps import Step, Sums
from reports.trials.meshes import surfaces_of
from reports.trials.rays import RAY_KINDS, flat
from reports.trials.soaking.closed_meshes import ClosedMesh, meshes, rays_from_inside
from reports.trials.tracing import Query, make_query, trace

STRUCTURES = ACCELERATORS[1:]  # without "auto", which chooses one of them
# Rays wanted of each structure. The first half of them is of a triangle test that was not
# watertight, and lost what came nearer to an edge than its rounding.
EACH = 2 * 10**9
BATCH = 1 << 17  # rays of a turn
PIECE = 1 << 13  # of a turn, for one thread: all it works on stays in its cache
NUMBERS = 1 << 24  # of rays, kept for each turn
# the most triangles of these; they have the rays of the first mesh instead of larger ones,
# where each costs them 3 to 100 times as much as it does the others
SMALL = {"brute": 400, "boxes": 2000, "bsp": 2000}
KINDS = ("random", "shadow_nearest", "shadow")  # one by one, in packets, any hit
# from share to share of the meshes: of 54, the first 21 are then of all six meshes, and in
# their order the first 40 are of one
STRIDE = 13
TURNS = "turns"


def rays_of(structure: str) -> str:
    """Return the name of the count of a structure's rays."""
    return f"rays: {structure}"


AIMS = {rays_of(structure): EACH for structure in STRUCTURES}


def ray_steps(
    so_far: Sums,
    deadline: float,
    structures: tuple[str, ...] = STRUCTURES,
    batch: int = BATCH,
) -> Generator[Step]:
    """Trace turn after turn, each by all structures that have not had `EACH` rays yet.

    Which turn is next, and its rays, follow from the counts so far.
    """
    counts = Counter(so_far.counts)
    while time.monotonic() < deadline:
        behind = tuple(name for name in structures if counts[rays_of(name)] < EACH)
        if not behind:
            return
        step = traced(behind, counts[TURNS], batch, default_threads())
        counts.update(step.counts)
        yield step


def traced(structures: tuple[str, ...], turn: int, count: int, threads: int = 1) -> Step:
    """Trace the rays of a turn by the structures, and say which of them are lost."""
    mesh, kind, aimed = combination(turn)
    spared = tuple(s for s in structures if len(mesh.faces) > SMALL.get(s, np.inf))
    others = tuple(s for s in structures if s not in spared)
    groups = [one for one in ((mesh, others), (meshes()[0], spared)) if one[1]]
    for traced_mesh, those in groups:
        for structure in those:
            _built(structure, traced_mesh)  # once, before the threads need it
    places = range(0, count, PIECE)
    leaks: list[list[str]] = [[] for _ in places]

    def work(piece: int) -> None:
        first, number = turn * NUMBERS + places[piece], min(PIECE, count - places[piece])
        for traced_mesh, those in groups:
            rays = rays_from_inside(traced_mesh, aimed, first, number)
            query = make_query(kind, rays)
            leaks[piece] += [
                f"{name}, {traced_mesh.name}, {kind}, turn {turn}, ray {first + ray}: lost"
                for name in those
                for ray in np.flatnonzero(~_met(name, traced_mesh, query))
            ]

    in_threads(threads, len(places), work)
    faults = tuple(leak for part in leaks for leak in part)
    way = "aimed at edges" if aimed else "anywhere"
    return Step(
        count * len(structures),
        {
            **{rays_of(structure): count for structure in structures},
            TURNS: 1,
            f"rays {way}": count * len(structures),
            "leaks": len(faults),
        },
        {},
        faults,
    )


def combination(turn: int) -> tuple[ClosedMesh, str, bool]:
    """Return mesh, kind of rays and whether they are aimed at edges.

    Each meets each within six turns for every share of a mesh; the kinds move on by one
    from turn to turn, and the meshes take turns, so that a short run has them all.
    """
    turn, aimed = divmod(turn, 2)
    shares = [mesh for mesh in meshes() for _ in range(mesh.share)]
    rounds, place = divmod(turn, len(shares))
    mesh = shares[STRIDE * place % len(shares)]
    return mesh, KINDS[(rounds + place) % len(KINDS)], aimed == 1


@functools.cache
def _built(structure: str, mesh: ClosedMesh) -> Any:
    surfaces = surfaces_of(mesh.vertices, mesh.faces)
    reach = float(np.abs(mesh.vertices).sum(axis=1).max())
    order = np.arange(len(mesh.faces))
    return build_accelerator("triangles", surfaces, order, structure, reach)


def _met(structure: str, mesh: ClosedMesh, query: Query) -> NDArray[np.bool_]:
    """Return for each ray whether the structure says that it meets something."""
    query.hits.prim[:] = -1  # nothing is left of another structure's answers
    query.blocked[:] = 0
    trace(_built(structure, mesh), query, query.batches)
    answers = flat(
        query.blocked if RAY_KINDS[query.kind].any_hit else query.hits.prim, query.rays
    )
    return answers != 0 if RAY_KINDS[query.kind].any_hit else answers >= 0
