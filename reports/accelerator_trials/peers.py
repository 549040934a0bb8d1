"""The renderers of others on the same rays: Embree by two ways, or why they are absent.

Answers are compared before anything is timed. Different formulas round differently, so
distances agree to a ten thousandth, and primitives but for shared edges and coincident
faces; the shares are stated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.traced_mitsuba import TracedMitsuba
from reports.accelerator_trials.embree_peer import EmbreePeer
from reports.accelerator_trials.meshes import StudyMesh
from reports.accelerator_trials.rays import RAY_KINDS, RayBatches, flat
from reports.accelerator_trials.tracing import Answers

EMBREEX = "embreex"
MITSUBA = "mitsuba llvm_ad_rgb"
NAMES = (EMBREEX, MITSUBA)

SAME_DISTANCE = 1e-4  # relative
LEAST_SHARE = 0.99  # of rays that must agree; edges of walls are where Embree differs

Rows = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]


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

    def asked(kind: str) -> dict[str, bool]:
        return {"any_hit": RAY_KINDS[kind].any_hit, "coherent": RAY_KINDS[kind].coherent}

    peer.build = mitsuba.build
    peer.seconds = lambda kind, threads: mitsuba.trace(kind, threads=threads, **asked(kind))
    peer.found = lambda kind: mitsuba.found(kind, **asked(kind))
    return peer
