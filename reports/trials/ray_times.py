"""What rays of each kind cost in every structure over a mesh, with Embree on the same rays.

Hits are compared before anything is timed; what answers wrongly is not timed and says so.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

from mitsuba_ref.records.machine import usable_cores
from reports.bench.timing import take_turns
from reports.trials.embree_peers import Peer, load_peers
from reports.trials.meshes import StudyMesh
from reports.trials.rays import RAY_KINDS
from reports.trials.structures import (
    NAIVE,
    Chosen,
    Show,
    Structure,
    affordable,
    build_all,
    check_all,
    study_queries,
)
from reports.trials.tracing import Query, spread, trace

CHECK_PATIENCE = 4  # times the seconds of a turn, for comparing hits
# [s] before a turn: for a while threads that have nothing to do keep looking for work
PAUSE = 0.05

Key = tuple[str, str, int]  # contender, kind of rays, threads


@dataclass(frozen=True)
class Effort:
    """How large a measurement is."""

    pixels: int  # a side of the square picture whose rays are traced
    rounds: int  # turns of each contender
    build_rounds: int
    seconds: float  # for one turn; a slow structure gets a share of the rays


@dataclass(frozen=True)
class RayTimes:
    """What was measured on a mesh; contenders with a fault have no times."""

    structures: list[Structure]
    peers: list[Peer]
    builds: dict[str, list[float]]  # [s] of structures and peers
    queries: dict[str, Query]  # by kind of rays
    shares: dict[tuple[str, str], Chosen]  # batches by structure and kind
    seconds: dict[Key, list[float]]  # per ray, one of each round

    def structure(self, name: str) -> Structure:
        """Return the structure of a name."""
        return next(one for one in self.structures if one.name == name)


def time_rays(
    mesh: StudyMesh,
    effort: Effort,
    threads: Sequence[int],
    names: Sequence[str],
    kinds: Sequence[str] = tuple(RAY_KINDS),
    show: Show = lambda stage: None,
) -> RayTimes:
    """Build, compare and time.

    Parameters
    ----------
    mesh, effort
        What rays are sent to, and how many.
    threads
        Numbers of threads that are timed.
    names
        Structures; `NAIVE`, by which the others are checked, has to be among them.
    kinds
        Of rays.
    show
        Called with a sentence about what is being done.
    """
    structures = build_all(mesh, names, effort.build_rounds, show)
    naive = next(one for one in structures if one.name == NAIVE)
    scout = next((one for one in structures if one is not naive and not one.fault), naive)
    queries = study_queries(mesh, scout.accel, effort.pixels)
    queries = {kind: query for kind, query in queries.items() if kind in kinds}
    show("comparing hits")
    agreed = check_all(structures, queries, CHECK_PATIENCE * effort.seconds)
    with ExitStack() as stack:
        show("loading peers")
        peers = load_peers(mesh, {k: q.rays for k, q in queries.items()}, stack)
        for peer in peers:
            for kind, query in queries.items():
                peer.check(kind, agreed[kind], query.rays)
        sound = [one for one in structures if not one.fault]
        shares = {
            (one.name, kind): affordable(one.accel, query, effort.seconds)
            for one in sound
            for kind, query in queries.items()
        }
        seconds: dict[Key, list[float]] = {}
        for kind, query in queries.items():
            for count in threads:
                turns: dict[str, Callable[[int], float]] = {
                    one.name: partial(_turn, one, query, shares[one.name, kind], count)
                    for one in sound
                }
                for peer in peers:
                    if peer.time(kind, count) is not None:  # compiles
                        turns[peer.name] = partial(_turn_of_peer, peer, query, count)
                stage = f"{kind} rays, {count} threads"
                times = take_turns(
                    turns,
                    effort.rounds,
                    show=lambda turn, stage=stage: show(f"{stage}, {turn}"),  # type: ignore[misc]
                )
                for name, found in times.items():
                    seconds[name, kind, count] = [x for x in found if math.isfinite(x)]
        builds = {one.name: one.build_seconds for one in structures}
        for peer in peers:
            builds[peer.name] = peer.time_builds(effort.build_rounds, usable_cores())
    return RayTimes(structures, peers, builds, queries, shares, seconds)


def _turn(one: Structure, query: Query, share: Chosen, threads: int, turn: int) -> float:
    """Return seconds per ray; the first of two goes wakes threads and fetches the rays."""
    part = spread(len(query.rays.count), len(share) * threads)
    rays = int(query.rays.count[part].sum())
    time.sleep(PAUSE)
    trace(one.accel, query, part, threads)
    return trace(one.accel, query, part, threads) / rays


def _turn_of_peer(peer: Peer, query: Query, threads: int, turn: int) -> float:
    time.sleep(PAUSE)
    peer.time(query.kind, threads)
    seconds = peer.time(query.kind, threads)
    return math.nan if seconds is None else seconds / query.rays.rays
