"""Tracing the rays of the study through one structure: for the answer, the count, the time.

The loops over batches are kernels, as the renderer's are, so that no time of Python's is
in what is measured; threads take batches as they do for a picture.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import typeof
from numpy.lib.array_utils import byte_bounds
from numpy.typing import NDArray

from renderer.accelerators.dispatch import TRAVERSALS
from renderer.integrators.stages.intersect import reset_hits
from renderer.kernels.jit import (
    Packed,
    call,
    compile_method,
    compiled_for,
    entry_kernel,
    kernel,
    pack,
)
from renderer.kernels.records.batch import CAPACITY, ROWS, Hits, Rays, ShadowRays
from renderer.process.worker_pool import in_threads
from reports.trials.rays import RAY_KINDS, RayBatches, flat

# Evens out batches of unlike cost: of two threads, what one does alone at the end is a 32nd
# of all at most. A job costs a few microseconds, as it is handed over as one pointer.
JOBS_PER_THREAD = 16


@kernel
def _rays_of(rays, batch, integers):  # type: ignore[no-untyped-def]
    """Return a batch as the renderer's own record; what no traversal reads is anything."""
    origin, row = rays.origin[batch], rays.t_max[batch]
    direction, ids = rays.direction[batch], integers
    return Rays(origin, direction, origin, row, row, ids, ids, ids, origin, ids)


@kernel
def _hits_of(hits, batch):  # type: ignore[no-untyped-def]
    """Return the rows of a batch."""
    return Hits(
        hits.t[batch], hits.prim[batch], hits.u[batch], hits.v[batch], hits.instance[batch]
    )


@kernel
def _shadow_rays_of(rays, batch, blocked):  # type: ignore[no-untyped-def]
    """Return a batch as the renderer's own record; what no traversal reads is anything."""
    origin, row = rays.origin[batch], blocked[batch]
    return ShadowRays(origin, rays.direction[batch], rays.t_max[batch], origin, row, row)


@kernel
def _tally_of(tally, batch):  # type: ignore[no-untyped-def]
    """Return the rows of a batch, or None where nothing is counted."""
    if tally is None:
        return None
    return tally[batch]


class _Work(NamedTuple):
    """All that a loop over batches needs; kernels see it through a pointer."""

    method: int  # address of the structure's kernel
    structure: int  # address of the record that it works on
    rays: RayBatches
    answers: Any  # Hits, or (batches, stride) int32 blocked
    ends: bool  # whether rays end at their t_max in a query for the nearest hit
    chosen: NDArray[np.int64]  # numbers of batches
    tally: Any  # None or (batches, ROWS, stride)


@entry_kernel
def trace_closest(work, first, end):  # type: ignore[no-untyped-def]
    """Find the nearest hits of batches chosen[first:end], up to `ends` of each ray."""
    rays, hits = work.rays, work.answers
    for k in range(first, end):
        b = work.chosen[k]
        batch, found = _rays_of(rays, b, hits.prim[b]), _hits_of(hits, b)
        count = rays.count[b]
        reset_hits(found, 0, count)
        if work.ends:
            for i in range(count):
                found.t[i] = rays.t_max[b, i]
        arguments = (batch, found, 0, count, _tally_of(work.tally, b))
        call(work.method, work.structure, arguments)


@entry_kernel
def trace_any(work, first, end):  # type: ignore[no-untyped-def]
    """Set `blocked` of the rays of batches chosen[first:end] that meet something."""
    rays, blocked = work.rays, work.answers
    for k in range(first, end):
        b = work.chosen[k]
        blocked[b, :] = 0
        batch = _shadow_rays_of(rays, b, blocked)
        arguments = (batch, rays.count[b], _tally_of(work.tally, b))
        call(work.method, work.structure, arguments)


@dataclass(frozen=True, eq=False)
class Query:
    """Rays of one kind, and where their answers go."""

    kind: str  # one of RAY_KINDS
    rays: RayBatches
    hits: Hits  # (batches, stride) each
    blocked: NDArray[np.int32]  # (batches, stride)

    @property
    def batches(self) -> NDArray[np.int64]:
        """The numbers of all batches."""
        return np.arange(len(self.rays.count))


def make_query(kind: str, rays: RayBatches) -> Query:
    """Return a query with room for its answers."""
    shape = rays.t_max.shape
    t, u, v = (np.zeros(shape, np.float32) for _ in range(3))
    prim, instance, blocked = (np.zeros(shape, np.int32) for _ in range(3))
    return Query(kind, rays, Hits(t, prim, u, v, instance), blocked)


def spread(batches: int, wanted: int) -> NDArray[np.int64]:
    """Return up to `wanted` batch numbers, evenly over all; at least one."""
    count = max(1, min(wanted, batches))
    return ((np.arange(count) + 0.5) * (batches / count)).astype(np.int64)


class _Loop(NamedTuple):
    """A loop over batches, what it works on, and what that has the address of."""

    entry: Any
    work: Packed  # of `_Work`
    structure: Packed


def _loop_over(
    accel: Any, query: Query, chosen: NDArray[np.int64], coherent: bool, tally: Any
) -> _Loop:
    """Return what traces batches through a structure.

    Its kernel is called by its address, as stages do: an entry that is given the structure
    would compile it once more, and both of its ways.
    """
    ways, packed, rays = TRAVERSALS[type(accel)], pack(accel), query.rays
    row = None if tally is None else tally[0]
    arguments: tuple[Any, ...]
    if RAY_KINDS[query.kind].any_hit:
        kernel = ways.any_hit_coherent if coherent else ways.any_hit
        arguments = (_shadow_rays_of.py_func(rays, 0, query.blocked), 0, row)
        method = compile_method(kernel, packed, *map(typeof, arguments))
        work = _Work(*method, rays, query.blocked, False, chosen, tally)
        return _Loop(trace_any, pack(work), packed)
    kernel = ways.closest_hit_coherent if coherent else ways.closest_hit
    found = _hits_of.py_func(query.hits, 0)
    arguments = (_rays_of.py_func(rays, 0, found.prim), found, 0, 0, row)
    method = compile_method(kernel, packed, *map(typeof, arguments))
    ends = query.kind == "shadow_nearest"
    work = _Work(*method, rays, query.hits, ends, chosen, tally)
    return _Loop(trace_closest, pack(work), packed)


def trace(accel: Any, query: Query, chosen: NDArray[np.int64], threads: int = 1) -> float:
    """Trace the chosen batches; return the seconds it took.

    The answers are in `query.blocked` for a kind that looks for any hit, else in
    `query.hits`.
    """
    loop = _loop_over(accel, query, chosen, RAY_KINDS[query.kind].coherent, None)
    loop.entry(loop.work, 0, 0)
    compiled = compiled_for(loop.entry, loop.work, 0, 0)

    def run(first: int, end: int) -> None:
        compiled(loop.work, first, end)

    n = len(chosen)
    if threads == 1:
        start = time.perf_counter()
        run(0, n)
        return time.perf_counter() - start
    jobs = min(n, JOBS_PER_THREAD * threads)
    # New threads, as for a picture. Their start is timed, 0.3 ms; but sleeping threads of a
    # pool are often woken on one processor, and share it for the first 3 ms.
    start = time.perf_counter()
    in_threads(threads, jobs, lambda job: run(n * job // jobs, n * (job + 1) // jobs))
    return time.perf_counter() - start


@dataclass(frozen=True, eq=False)
class Answers:
    """What a structure found for some batches: t, prim, u, v; or blocked."""

    values: tuple[NDArray[Any], ...]  # (batches, CAPACITY) each; 0 beyond the last ray

    def of(self, chosen: NDArray[np.int64]) -> Answers:
        """Return the answers for some of the batches."""
        return Answers(tuple(rows[chosen] for rows in self.values))

    def differing(self, other: Answers) -> int:
        """Return how many rays are not answered alike, bit for bit."""
        different = np.zeros(self.values[0].shape, bool)
        for mine, theirs in zip(self.values, other.values, strict=True):
            different |= mine.view(np.int32) != theirs.view(np.int32)
        return int(np.count_nonzero(different))


def answers(accel: Any, query: Query, chosen: NDArray[np.int64]) -> Answers:
    """Trace, and return a copy of what was found."""
    trace(accel, query, chosen)
    rows = (query.blocked,) if RAY_KINDS[query.kind].any_hit else query.hits[:4]
    used = np.arange(CAPACITY) < query.rays.count[chosen, None]
    return Answers(tuple(np.where(used, row[chosen, :CAPACITY], 0) for row in rows))


def tallied(
    accel: Any, query: Query, chosen: NDArray[np.int64], coherent: bool | None = None
) -> NDArray[np.int32]:
    """Return what each ray of the chosen batches cost, (ROWS, rays).

    `coherent` None takes the way that the kind is traced.
    """
    together = RAY_KINDS[query.kind].coherent if coherent is None else coherent
    tally = np.zeros((len(query.rays.count), ROWS, query.rays.t_max.shape[1]), np.int32)
    loop = _loop_over(accel, query, chosen, together, tally)
    loop.entry(loop.work, 0, len(chosen))
    part = query.rays._replace(count=query.rays.count[chosen])
    return np.stack([flat(tally[chosen, row], part) for row in range(ROWS)])


def bytes_of(record: Any) -> int:
    """Return the bytes of all arrays in a structure's record, shared memory once."""
    total = reached = 0
    for start, end in sorted(_memory_of(record)):
        total += max(0, end - max(start, reached))
        reached = max(reached, end)
    return total


def _memory_of(record: Any) -> Iterator[tuple[int, int]]:
    """Yield first address and end of each array; several may be views of one memory."""
    if isinstance(record, np.ndarray):
        yield byte_bounds(record)
    elif isinstance(record, tuple):
        for part in record:
            yield from _memory_of(part)
