"""What `beside_peers` still calls; it gets its record from `trials.ray_times`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from reports.accelerator_study.settings import Settings
from reports.trials.meshes import StudyMesh
from reports.trials.ray_times import Effort, time_rays
from reports.trials.structures import Structure
from reports.trials.tracing import tallied


def study_scene(
    mesh: StudyMesh,
    settings: Settings,
    threads: list[int],
    progress: Callable[[str], None],
    names: Sequence[str],
    kinds: Sequence[str],
) -> tuple[dict[str, Any], list[Structure]]:
    """Return the rays, times and counts of a mesh, and its structures."""
    effort = Effort(**vars(settings))
    found = time_rays(mesh, effort, threads, names, kinds, progress)

    def nanoseconds(name: str) -> dict[str, dict[str, list[float]]]:
        return {
            kind: {
                str(count): [1e9 * value for value in found.seconds[name, kind, count]]
                for count in threads
                if (name, kind, count) in found.seconds
            }
            for kind in kinds
        }

    def work(name: str) -> dict[str, dict[str, float]]:
        counts = {}
        for kind, query in found.queries.items():
            rows = tallied(found.structure(name).accel, query, found.shares[name, kind])
            _, boxes, primitives, *_ = rows.mean(axis=1)
            counts[kind] = {"boxes": float(boxes), "primitives": float(primitives)}
        return counts

    return {
        "rays": {kind: query.rays.rays for kind, query in found.queries.items()},
        "structures": [
            {
                "name": one.name,
                "work": {} if one.fault else work(one.name),
                "nanoseconds": nanoseconds(one.name),
            }
            for one in found.structures
        ],
        "peers": [
            {"name": p.name, "fault": p.fault, "nanoseconds": nanoseconds(p.name)}
            for p in found.peers
        ],
    }, found.structures
