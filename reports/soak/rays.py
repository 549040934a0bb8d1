"""Rays from inside of closed meshes: one that meets nothing has leaked.

Neighbouring triangles do not share their edge exactly (`reports.limits`, row edges-ours),
so that a ray which passes nearer to an edge than rounding may be lost. Such a ray is
counted, and is no fault: a *leak* is a ray that is lost although its line, in double
precision, keeps `BOUND` away from every edge. Half of the rays go anywhere; the others
are aimed past an edge or a vertex, at distances from 10^-8 to 10^-2 of it.

All structures trace the same rays, because making a ray costs as much as tracing it three
times. Most are in the meshes of few triangles, where they are cheap and as near to edges.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from renderer.names import ACCELERATORS
from reports.accelerator_trials.meshes import displaced_icosphere, surfaces_of
from reports.accelerator_trials.rays import RAY_KINDS, flat, in_batches
from reports.accelerator_trials.tracing import Query, make_query, trace
from reports.soak.record import Step

STRUCTURES = ACCELERATORS[1:]  # without "auto", which chooses one of them
EACH = 10**9  # rays wanted of each structure
BATCH = 1 << 17
# of the largest coordinate. The farthest of 300,000 lost rays was 3e-7 away, of 9 million
# 9.98e-7: the bound is measured, and 10^9 rays may well go beyond it
BOUND = 1e-6
BRUTE_TRIANGLES = 400  # brute force has the rays of the first mesh instead of larger ones
WANTED = {f"rays: {structure}": EACH for structure in STRUCTURES}
KINDS = ("random", "shadow_nearest", "shadow")  # one by one, in packets, any hit

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """A closed mesh, and where rays start inside of it."""

    name: str
    vertices: NDArray[np.float32]  # (V, 3)
    faces: NDArray[Any]  # (F, 3)
    inside: Callable[[np.random.Generator, int], Floats]  # (n, 3) origins
    share: int  # how many of the turns it has

    @functools.cached_property
    def edges(self) -> tuple[Floats, Floats]:
        """Both ends of every edge, (E, 3) each."""
        pairs = np.concatenate([self.faces[:, [k, (k + 1) % 3]] for k in range(3)])
        pairs = np.unique(np.sort(pairs, axis=1), axis=0)
        ends = self.vertices[pairs].astype(float)
        return ends[:, 0], ends[:, 1]


def _ball(
    name: str, frequency: int, share: int, stretch: float = 1.0, away: float = 0.0
) -> ClosedMesh:
    mesh = displaced_icosphere(frequency)
    scale = np.array([1.0, 1.0, stretch])

    def inside(rng: np.random.Generator, n: int) -> Floats:
        return 0.1 * scale * _directions(rng, n) + away

    # neighbours share their vertices, so that rounding moves both alike
    vertices = np.unique(mesh.vertices, axis=0, return_inverse=True)
    placed = (vertices[0] * scale + away).astype(np.float32)
    return ClosedMesh(name, placed, vertices[1].reshape(-1)[mesh.faces], inside, share)


def _torus(around: int, across: int, share: int) -> ClosedMesh:
    """Return a ring of radius 1 and thickness 0.4."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(across)))
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / across
    distance = 1.0 + 0.4 * np.cos(v)
    vertices = np.stack((distance * np.cos(u), distance * np.sin(u), 0.4 * np.sin(v)), 1)
    a, b = j * around + i, j * around + (i + 1) % around
    c, d = (((j + 1) % across) * around + k for k in (i, (i + 1) % around))
    faces = np.concatenate((np.stack((a, b, d), 1), np.stack((a, d, c), 1)))

    def inside(rng: np.random.Generator, n: int) -> Floats:
        angle = rng.uniform(0, 2 * np.pi, n)
        middle = np.stack((np.cos(angle), np.sin(angle), np.zeros(n)), 1)
        return middle + 0.1 * _directions(rng, n)

    return ClosedMesh("torus of 1536", vertices.astype(np.float32), faces, inside, share)


@functools.cache
def meshes() -> tuple[ClosedMesh, ...]:
    """Return the closed meshes: few and many triangles, slivers, far away, with a hole."""
    return (
        _ball("ball of 80", 2, share=10),
        _ball("ball of 320, stretched 50 times", 4, share=1, stretch=50.0),
        _ball("ball of 320, at 100", 4, share=5, away=100.0),
        _torus(32, 24, share=2),
        _ball("ball of 20480", 32, share=1),
    )


def ray_steps(
    done: int, deadline: float, structures: tuple[str, ...] = STRUCTURES, batch: int = BATCH
) -> Iterator[Step]:
    """Trace batches from ray number `done` on, each by all structures.

    Parameters
    ----------
    done
        Rays so far: which batch is next follows from it, and its seed from that.
    deadline
        Of `time.monotonic`.
    structures, batch
        What to trace with, and how many rays at a time.
    """
    turn = done // (batch * len(structures))
    while time.monotonic() < deadline:
        yield _traced(structures, turn, batch)
        turn += 1


def _traced(structures: tuple[str, ...], turn: int, count: int) -> Step:
    """Trace batch number `turn`, the same rays for every structure that has its mesh."""
    mesh, kind, aimed = _combination(turn)
    way = "aimed at edges" if aimed else "anywhere"
    kept_out = () if len(mesh.faces) <= BRUTE_TRIANGLES else ("brute",)
    counts = {f"rays: {structure}": count for structure in structures}
    farthest, leaks, lost = 0.0, [], 0
    for asked, those in (
        (mesh, [name for name in structures if name not in kept_out]),
        (meshes()[0], [name for name in structures if name in kept_out]),
    ):
        if not those:
            continue
        rays = _rays(asked, aimed, turn, count)
        for structure, ray, distance in _lost(those, asked, kind, rays):
            lost += 1
            farthest = max(farthest, distance)
            if distance > BOUND:
                leaks.append(
                    f"{structure}, {asked.name}, {kind}, batch {turn}, ray {ray}: lost "
                    f"{distance:.2g} of the largest coordinate away from the nearest edge"
                )
    counts[f"rays {way}"] = count * len(structures)
    counts[f"lost within rounding of an edge, {way}"] = lost - len(leaks)
    counts["leaks"] = len(leaks)
    largest = {"distance of a lost ray from its edge": farthest} if lost else {}
    return Step(count * len(structures), counts, largest, tuple(leaks))


class _Rays(NamedTuple):
    """Rays from inside of a mesh."""

    origin: NDArray[np.float32]  # (n, 3)
    direction: NDArray[np.float32]  # (n, 3)
    edge: NDArray[np.int64]  # (n,) the one that each is aimed at, if they are


def _rays(mesh: ClosedMesh, aimed: bool, turn: int, count: int) -> _Rays:
    rng = np.random.Generator(np.random.SFC64([15, turn]))
    origin = mesh.inside(rng, count)
    edge = rng.integers(0, len(mesh.edges[0]), count)
    going = _past_edges(mesh, edge, origin, rng) if aimed else _directions(rng, count)
    return _Rays(origin.astype(np.float32), going.astype(np.float32), edge)


def _lost(
    structures: list[str], mesh: ClosedMesh, kind: str, rays: _Rays
) -> Iterator[tuple[str, int, float]]:
    """Yield structure, number and distance from the nearest edge of each ray it loses."""
    query = make_query(kind, in_batches(rays.origin, rays.direction, np.inf))
    missed = np.stack([~_met(structure, mesh, query) for structure in structures])
    lost = np.flatnonzero(missed.any(axis=0))  # mostly by all structures alike
    distances = _edge_distances(
        mesh, rays.origin[lost], rays.direction[lost], rays.edge[lost]
    )
    for structure, misses in zip(structures, missed[:, lost], strict=True):
        for k in np.flatnonzero(misses):
            yield structure, int(lost[k]), float(distances[k])


def _combination(turn: int) -> tuple[ClosedMesh, str, bool]:
    """Return mesh, kind of rays and whether they are aimed at edges.

    Each meets each within six turns for every share of a mesh; the kinds move on by one
    from turn to turn, so that a short run has them all.
    """
    turn, aimed = divmod(turn, 2)
    shares = [mesh for mesh in meshes() for _ in range(mesh.share)]
    rounds, place = divmod(turn, len(shares))
    return shares[place], KINDS[(rounds + place) % len(KINDS)], aimed == 1


@functools.cache
def _built(structure: str, mesh: ClosedMesh) -> Any:
    surfaces = surfaces_of(mesh.vertices, mesh.faces)
    reach = float(np.abs(mesh.vertices).sum(axis=1).max())
    order = np.arange(len(mesh.faces))
    return build_accelerator("triangles", surfaces, order, structure, reach)


def _met(structure: str, mesh: ClosedMesh, query: Query) -> Any:
    """Return for each ray whether the structure says that it meets something."""
    query.hits.prim[:] = -1  # nothing is left of another structure's answers
    query.blocked[:] = 0
    trace(_built(structure, mesh), query, query.batches)
    if RAY_KINDS[query.kind].any_hit:
        return flat(query.blocked, query.rays) != 0
    return flat(query.hits.prim, query.rays) >= 0


def _past_edges(
    mesh: ClosedMesh, edge: Any, origin: Floats, rng: np.random.Generator
) -> Floats:
    """Return directions that pass edges, a vertex each eighth time, at a small distance."""
    n = len(origin)
    first, second = mesh.edges
    along = np.where(np.arange(n) % 8 == 0, 0.0, rng.random(n))[:, None]
    target = first[edge] + along * (second[edge] - first[edge])
    aside = np.linalg.norm(second[edge] - first[edge], axis=1) * 10 ** rng.uniform(
        -8, -2, n
    )
    going = target + aside[:, None] * _directions(rng, n) - origin
    return np.asarray(going / np.linalg.norm(going, axis=1, keepdims=True))


def _edge_distances(mesh: ClosedMesh, origin: Any, direction: Any, edge: Any) -> Floats:
    """Return how near the rays' lines come to an edge, over the largest coordinate.

    Mostly it is the edge that a ray was aimed at, and the others need no look.
    """
    first, second = (ends[edge] for ends in mesh.edges)
    size = max(np.abs(mesh.vertices).max(), np.abs(origin).max(initial=0.0))
    found = _distance(first, second, origin, direction) / size
    for i in np.flatnonzero(found > BOUND):
        found[i] = _distance(*mesh.edges, origin[i], direction[i]).min() / size
    return found


def _distance(first: Floats, second: Floats, origin: Any, direction: Any) -> Floats:
    """Return the distance of each line from its segment, seen along the line."""
    d = direction.astype(float)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    a, b = (
        ends - (ends * d).sum(axis=-1, keepdims=True) * d
        for ends in (first - origin, second - origin)
    )
    along = b - a
    square = np.maximum((along * along).sum(axis=1), 1e-300)
    s = np.clip(-(a * along).sum(axis=1) / square, 0.0, 1.0)[:, None]
    return np.asarray(np.linalg.norm(a + s * along, axis=1))


def _directions(rng: np.random.Generator, n: int) -> Floats:
    vectors = rng.standard_normal((n, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
