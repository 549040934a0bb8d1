"""Embree on the same rays, by embreex and inside of Mitsuba, or why it is absent.

embreex: one thread, one ray a call inside; it has no wheels for Linux on ARM. Answers are
compared before anything is timed. Different formulas round differently, so distances agree
to a ten thousandth, and primitives but for shared edges and coincident faces.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.traced_mitsuba import TracedMitsuba
from reports.trials.meshes import StudyMesh
from reports.trials.rays import RAY_KINDS, RayBatches, flat
from reports.trials.tracing import Answers

EMBREEX = "embreex"
MITSUBA = "mitsuba llvm_ad_rgb"
NAMES = (EMBREEX, MITSUBA)

SAME_DISTANCE = 1e-4  # relative
LEAST_SHARE = 0.99  # of rays that must agree; edges of walls are where Embree differs

Rows = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]


class EmbreeAnswers(NamedTuple):
    """What Embree found for n rays."""

    t: NDArray[np.float32]  # (n,)
    prim: NDArray[np.int32]  # (n,) -1 for a miss; for any hit 0 where something is met


class EmbreePeer:
    """A mesh in Embree.

    Parameters
    ----------
    vertices, faces
        (V, 3) float32 and (F, 3) int32.

    Raises
    ------
    ImportError
        If embreex is not installed, or does not run here.
    """

    def __init__(self, vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
        from embreex import mesh_construction, rtcore_scene

        self._new_scene: Any = rtcore_scene.EmbreeScene
        self._new_mesh: Any = mesh_construction.TriangleMesh
        self._vertices, self._faces = vertices, faces
        self.build()

    def build(self) -> float:
        """Build the tree, anew; return the seconds it took."""
        self._scene = self._new_scene()
        self._mesh = self._new_mesh(self._scene, self._vertices, self._faces)
        # The first query builds the tree. Copying the mesh before is not counted: it is a
        # loop of Python objects in the binding, no work of Embree's.
        ray = np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)
        start = time.perf_counter()
        self._scene.run(*ray)
        return time.perf_counter() - start

    def trace(self, rows: Rows, *, any_hit: bool) -> float:
        """Trace rays (origins, directions, ends); return the seconds it took."""
        origin, direction, ends = rows
        ends = ends.copy()  # Embree shortens them
        query = "OCCLUDED" if any_hit else "INTERSECT"
        start = time.perf_counter()
        self._scene.run(origin, direction, dists=ends, query=query)
        return time.perf_counter() - start

    def found(self, rows: Rows, *, any_hit: bool) -> EmbreeAnswers:
        """Return the answers for rays (origins, directions, ends)."""
        origin, direction, ends = rows
        if any_hit:
            met = self._scene.run(origin, direction, dists=ends.copy(), query="OCCLUDED")
            return EmbreeAnswers(ends, np.where(met >= 0, 0, -1).astype(np.int32))
        given = self._scene.run(origin, direction, dists=ends.copy(), output=1)
        return EmbreeAnswers(given["tfar"], given["primID"])


@dataclass
class Peer:
    """One peer with a mesh and rays loaded; `fault` says why it is not timed."""

    name: str
    most_threads: int
    build: Callable[[int], float] | None = None  # seconds, by so many threads
    seconds: Callable[[str, int], float] | None = None  # of a kind, by so many threads
    found: Callable[[str], Any] | None = None
    fault: str = ""
    agreement: dict[str, dict[str, float]] = field(default_factory=dict)

    def time(self, kind: str, threads: int) -> float | None:
        """Return the seconds for all rays of a kind; None where it cannot or may not."""
        if self.seconds is None or self.fault or threads > self.most_threads:
            return None
        try:
            return self.seconds(kind, threads)
        except MitsubaError as error:
            self.fault = str(error)
            return None

    def time_builds(self, rounds: int, threads: int) -> list[float]:
        """Return the seconds of some builds; nothing where it cannot or may not."""
        if self.build is None or self.fault:
            return []
        try:
            return [self.build(threads) for _ in range(rounds)]
        except MitsubaError as error:
            self.fault = str(error)
            return []

    def check(self, kind: str, truth: Answers, batches: RayBatches) -> None:
        """Compare with our answers for all batches; a difference becomes `fault`."""
        if self.found is None or self.fault:
            return
        try:
            theirs = self.found(kind)
        except MitsubaError as error:
            self.fault = str(error)
            return
        ours = [flat(row, batches) for row in truth.values]
        if RAY_KINDS[kind].any_hit:
            same = (theirs.prim >= 0) == (ours[0] != 0)
            shares = {"same_distance": float(same.mean())}
        else:
            shares = _shares(ours[0], ours[1], theirs.t, theirs.prim)
        self.agreement[kind] = shares
        if shares["same_distance"] < LEAST_SHARE:
            share = f"{shares['same_distance']:.2%}"
            self.fault = f"{kind} rays: only {share} agree with ours; not timed"


def _shares(
    t: NDArray[Any], prim: NDArray[Any], their_t: NDArray[Any], their_prim: NDArray[Any]
) -> dict[str, float]:
    """Return the shares of rays with the same primitive, and the same distance or miss."""
    both_miss = (prim < 0) & (their_prim < 0)
    both_hit = (prim >= 0) & (their_prim >= 0)
    with np.errstate(invalid="ignore"):  # infinite ends of misses
        near = np.abs(their_t - t) <= SAME_DISTANCE * np.abs(t)
    return {
        "same_primitive": float((prim == their_prim).mean()),
        "same_distance": float((both_miss | (both_hit & near)).mean()),
    }


def load_peers(
    mesh: StudyMesh, rays: Mapping[str, RayBatches], stack: ExitStack
) -> list[Peer]:
    """Return every peer, loaded where it is available.

    Parameters
    ----------
    rays
        By kind.
    stack
        Ends the peers' processes.
    """
    rows = {kind: batches.rows() for kind, batches in rays.items()}
    return [_embreex(mesh, rows), _mitsuba(mesh, rows, stack)]


def _embreex(mesh: StudyMesh, rows: Mapping[str, Rows]) -> Peer:
    peer = Peer(EMBREEX, 1)
    try:
        embree = EmbreePeer(mesh.vertices, mesh.faces)
    except ImportError as error:
        peer.fault = f"not available: {error}"
        return peer
    peer.build = lambda threads: embree.build()
    peer.seconds = lambda kind, threads: embree.trace(
        rows[kind], any_hit=RAY_KINDS[kind].any_hit
    )
    peer.found = lambda kind: embree.found(rows[kind], any_hit=RAY_KINDS[kind].any_hit)
    return peer


def _mitsuba(mesh: StudyMesh, rows: Mapping[str, Rows], stack: ExitStack) -> Peer:
    peer = Peer(MITSUBA, 1 << 16)
    variant = MITSUBA.split()[1]
    try:
        mitsuba = stack.enter_context(
            TracedMitsuba(variant, mesh.vertices, mesh.faces, rows)
        )
    except MitsubaError as error:
        peer.fault = f"not available: {error}"
        return peer

    peer.build = mitsuba.build
    peer.seconds = lambda kind, threads: mitsuba.trace(
        kind, threads=threads, **RAY_KINDS[kind]._asdict()
    )
    peer.found = lambda kind: mitsuba.found(kind, **RAY_KINDS[kind]._asdict())
    return peer
