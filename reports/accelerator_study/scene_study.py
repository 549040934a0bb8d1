"""One scene of the study: every structure checked, counted and timed in turn."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

from renderer.accelerators.build import BUILDERS
from renderer.kernels.records import batch as tally
from reports.accelerator_study.settings import StudySettings, all_threads
from reports.accelerator_trials.contenders import (
    NAIVE,
    Contender,
    Progress,
    affordable,
    build_all,
    check_all,
    study_queries,
)
from reports.accelerator_trials.meshes import StudyMesh
from reports.accelerator_trials.peers import Peer, load_peers
from reports.accelerator_trials.rays import RAY_KINDS
from reports.accelerator_trials.structure_facts import structure_facts
from reports.accelerator_trials.tracing import Query, bytes_of, spread, tallied, trace

COUNTED = ("camera", "shadow", "diffuse", "random")
CHECK_PATIENCE = 4  # times the seconds of a turn, for comparing hits


# ------------------------------------------------------------------- counting and timing


def work_of(one: Contender, queries: Mapping[str, Query]) -> dict[str, dict[str, float]]:
    """Return means per ray of what the structure did, by kind; of the stack the largest."""
    work = {}
    for kind in (kind for kind in COUNTED if kind in queries):
        rows = tallied(one.accel, queries[kind], one.share[kind])
        nodes, boxes, primitives, saved = rows[: tally.STACK].mean(axis=1)
        work[kind] = {
            "nodes": float(nodes),
            "boxes": float(boxes),
            "primitives": float(primitives),
            "saved": float(saved),
            "stack": int(rows[tally.STACK].max()),
        }
    return work


Times = dict[str, dict[str, dict[str, list[float]]]]


def take_turns(
    contenders: list[Contender],
    peers: list[Peer],
    queries: Mapping[str, Query],
    threads: list[int],
    rounds: int,
    progress: Progress,
    pause: float = 0.0,
) -> Times:
    """Return nanoseconds per ray by name, kind and threads: one number a round."""
    names = [one.name for one in contenders] + [peer.name for peer in peers]
    times: Times = {name: {kind: {} for kind in queries} for name in names}
    for kind, query in queries.items():
        for count in threads:
            for peer in peers:
                peer.time(kind, count)  # compiles; ours are compiled since the check
            for turn in range(rounds):
                progress(f"{kind} rays, {count} threads, round {turn + 1} of {rounds}")
                for name, each in _one_round(contenders, peers, query, count, pause):
                    times[name][kind].setdefault(str(count), []).append(each * 1e9)
    return times


def _one_round(
    contenders: list[Contender],
    peers: list[Peer],
    query: Query,
    threads: int,
    pause: float,
) -> Iterator[tuple[str, float]]:
    """Let each take its turn; yield names and seconds per ray.

    The first of two goes is not timed: it wakes threads that sleep, and fetches the rays.
    One thread alone leaves none behind that could look for work, but peers may.
    """
    time.sleep(pause)
    for one in contenders:
        if not one.fault:
            share = spread(len(query.rays.count), len(one.share[query.kind]) * threads)
            rays = int(query.rays.count[share].sum())
            if threads > 1:
                time.sleep(pause)
            trace(one.accel, query, share, threads)
            yield one.name, trace(one.accel, query, share, threads) / rays
    for peer in peers:
        time.sleep(pause)
        peer.time(query.kind, threads)
        seconds = peer.time(query.kind, threads)
        if seconds is not None:
            yield peer.name, seconds / query.rays.rays


# --------------------------------------------------------------------------- the record


def study_scene(
    mesh: StudyMesh,
    settings: StudySettings,
    threads: list[int],
    progress: Progress,
    names: Sequence[str] = tuple(BUILDERS),
    kinds: Sequence[str] = tuple(RAY_KINDS),
) -> tuple[dict[str, Any], list[Contender]]:
    """Measure one scene.

    Parameters
    ----------
    threads
        Numbers of threads that are timed.
    names
        Structures; `NAIVE`, by which the others are checked, has to be among them.
    kinds
        Of rays.

    Returns
    -------
    record, contenders
        The scene's entry of accelerators.json, and the structures, for further studies.
    """
    contenders = build_all(mesh, list(names), settings.build_rounds, progress)
    naive = next(one for one in contenders if one.name == NAIVE)
    scout = next((one for one in contenders if one is not naive and not one.fault), naive)
    progress(f"{mesh.name}: rays")
    queries = study_queries(mesh, scout.accel, settings.pixels)
    queries = {kind: query for kind, query in queries.items() if kind in kinds}
    progress(f"{mesh.name}: comparing hits")
    agreed = check_all(contenders, queries, CHECK_PATIENCE * settings.seconds)
    with ExitStack() as stack:
        progress(f"{mesh.name}: loading peers")
        peers = load_peers(mesh, {k: q.rays for k, q in queries.items()}, stack)
        for peer in peers:
            for kind, query in queries.items():
                peer.check(kind, agreed[kind], query.rays)
        progress(f"{mesh.name}: counting")
        work = {}
        for one in contenders:
            if not one.fault:
                one.share = {
                    kind: affordable(one.accel, query, settings.seconds)
                    for kind, query in queries.items()
                }
                work[one.name] = work_of(one, queries)
        times = take_turns(
            contenders,
            peers,
            queries,
            threads,
            settings.rounds,
            lambda stage: progress(f"{mesh.name}: {stage}"),
            settings.pause,
        )
        peer_builds = {
            peer.name: peer.time_builds(settings.build_rounds, all_threads())
            for peer in peers
        }
    return {
        "name": mesh.name,
        "title": mesh.title,
        "about": mesh.about,
        "triangles": mesh.triangles,
        "rays": {kind: query.rays.rays for kind, query in queries.items()},
        "structures": [
            _row(one, queries, work.get(one.name, {}), times[one.name])
            for one in contenders
        ],
        "peers": [
            {
                "name": peer.name,
                "fault": peer.fault,
                "build_seconds": peer_builds[peer.name],
                "agreement": peer.agreement,
                "nanoseconds": {} if peer.fault else times[peer.name],
            }
            for peer in peers
        ],
    }, contenders


def _row(
    one: Contender,
    queries: Mapping[str, Query],
    work: dict[str, dict[str, float]],
    times: dict[str, dict[str, list[float]]],
) -> dict[str, Any]:
    facts = structure_facts(one.accel)
    return {
        "name": one.name,
        "fault": one.fault,
        "build_seconds": one.build_seconds,
        "bytes": bytes_of(one.accel),
        "depth": facts.depth,
        "cost": facts.cost,
        "work": work,
        "rays": {
            kind: int(queries[kind].rays.count[chosen].sum())
            for kind, chosen in one.share.items()
        },
        "nanoseconds": {} if one.fault else times,
    }
