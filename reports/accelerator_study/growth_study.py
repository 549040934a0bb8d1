"""How build and rays grow with the number of triangles, from a thousand to ten million."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

try:
    import resource
except ImportError:  # not on Windows: there, nothing watches over the memory
    resource = None  # type: ignore[assignment]

from renderer.accelerators.build import BUILDERS
from renderer.plugins.shapes.triangle import TriangleSurfaces
from reports.accelerator_study.settings import MEMORY_LIMIT, StudySettings
from reports.accelerator_trials.contenders import NAIVE, Progress, build, reach_of
from reports.accelerator_trials.meshes import (
    StudyMesh,
    displaced_icosphere,
    triangle_surfaces,
)
from reports.accelerator_trials.rays import camera_rays, random_rays
from reports.accelerator_trials.tracing import (
    Answers,
    Query,
    answers,
    bytes_of,
    make_query,
    spread,
    trace,
)

KINDS = ("camera", "random")
SLOWER = 1.15  # a build's growth is guessed as the power of this, a little above linear


def study_growth(settings: StudySettings, progress: Progress) -> dict[str, Any]:
    """Measure every structure on balls of growing size, one thread.

    A structure whose next build would take longer than the settings allow stops growing,
    and says so. Each holds the mesh alone, one after the other, within `MEMORY_LIMIT`.

    Returns
    -------
    dict
        The growth entry of accelerators.json.
    """
    series: dict[str, dict[str, Any]] = {
        name: {"name": name, "stopped": "", "points": []} for name in BUILDERS
    }
    mesh = None
    for frequency in settings.frequencies:
        mesh = displaced_icosphere(frequency)
        with _memory_limited(MEMORY_LIMIT):
            _measure_size(mesh, series, settings, progress)
    assert mesh is not None
    return {
        "title": mesh.title,
        "kinds": list(KINDS),
        "memory_limit": MEMORY_LIMIT,
        "peak_bytes": peak_bytes(),
        "series": list(series.values()),
    }


def _measure_size(
    mesh: StudyMesh,
    series: dict[str, dict[str, Any]],
    settings: StudySettings,
    progress: Progress,
) -> None:
    surfaces, reach = triangle_surfaces(mesh), reach_of(mesh)
    side = settings.pixels
    rays = {
        "camera": camera_rays(mesh.view, side, side),
        "random": random_rays(mesh, side * side),
    }
    queries = {kind: make_query(kind, rays[kind]) for kind in KINDS}
    # brute force answers one batch of each kind: at ten million triangles that is seconds
    truths: dict[str, Answers] = {}
    for name in sorted(series, key=lambda name: name != NAIVE):
        one = series[name]
        if not one["stopped"]:
            one["stopped"] = _too_long(one["points"], mesh.triangles, settings.build_limit)
        if one["stopped"]:
            continue
        progress(f"growth: {name}, {mesh.triangles:,} triangles")
        try:
            point = _measure(name, surfaces, reach, queries, truths, settings)
        except MemoryError:
            limit = MEMORY_LIMIT / 2**30
            one["stopped"] = f"{mesh.triangles:,} triangles need more than {limit:g} GiB"
            continue
        except ValueError as error:
            one["stopped"] = str(error)
            continue
        one["points"].append({"triangles": mesh.triangles, **point})


def _measure(
    name: str,
    surfaces: TriangleSurfaces,
    reach: float,
    queries: dict[str, Query],
    truths: dict[str, Answers],
    settings: StudySettings,
) -> dict[str, Any]:
    """Build, check and time one structure; raise ValueError if its hits are wrong."""
    accel, seconds = build(name, surfaces, reach)
    nanoseconds = {}
    for kind, query in queries.items():
        one = spread(len(query.rays.count), 1)
        found = answers(accel, query, one)
        wrong = truths.setdefault(kind, found).differing(found)
        if wrong:
            raise ValueError(f"{wrong} {kind} rays are answered wrongly")
        # one batch of brute force may take seconds, and then is enough
        spent = trace(accel, query, one)
        share = spread(len(query.rays.count), int(settings.seconds / spent))
        if spent < settings.seconds:
            spent = min(trace(accel, query, share) for _ in range(settings.rounds))
        nanoseconds[kind] = spent / int(query.rays.count[share].sum()) * 1e9
    return {
        "build_seconds": seconds,
        "bytes": bytes_of(accel),
        "nanoseconds": nanoseconds,
    }


def _too_long(points: list[dict[str, Any]], triangles: int, limit: float) -> str:
    """Return why the next size is not built, or nothing."""
    if not points:
        return ""
    last = points[-1]
    guess = last["build_seconds"] * (triangles / last["triangles"]) ** SLOWER
    if guess <= limit:
        return ""
    return f"{triangles:,} triangles would build for about {guess:.0f} s"


def peak_bytes() -> int:
    """Return the most memory that this process has held so far; 0: the system hides it."""
    if resource is None:
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


@contextmanager
def _memory_limited(limit: int) -> Iterator[None]:
    """Let allocations beyond `limit` bytes of data fail, where the system can do that."""
    if resource is None:
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    try:
        resource.setrlimit(resource.RLIMIT_DATA, (wanted, hard))
    except (OSError, ValueError):
        yield
        return
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
