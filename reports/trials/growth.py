"""How build and rays grow with the number of triangles, from twenty to ten million."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

try:
    import resource
except ImportError:  # not on Windows: there, nothing watches over the memory
    resource = None  # type: ignore[assignment]

from renderer.accelerators.build import BUILDERS
from reports.trials.meshes import StudyMesh, displaced_icosphere, triangle_surfaces
from reports.trials.ray_times import Effort
from reports.trials.rays import camera_rays, random_rays
from reports.trials.structures import NAIVE, Show, build, reach_of
from reports.trials.tracing import Answers, answers, bytes_of, make_query, spread, trace

MEMORY_LIMIT = 8 * 2**30  # [bytes] that growth may take
SLOWER = 1.15  # a build's growth is guessed as the power of this, a little above linear


@dataclass(frozen=True)
class Point:
    """One structure at one size; or why it stops before that size."""

    name: str
    triangles: int
    stopped: str = ""
    build: float = 0.0  # [s]
    bytes: int = 0
    nanoseconds: tuple[tuple[str, float], ...] = ()  # by kind of rays, per ray, one thread


def growth(
    frequencies: Sequence[int], effort: Effort, build_limit: float, show: Show
) -> Iterator[Point]:
    """Measure every structure on balls of growing size, one thread.

    A structure whose next build would take longer than `build_limit` seconds stops growing,
    and says so. Each holds the mesh alone, one after the other, within `MEMORY_LIMIT`.
    """
    last: dict[str, Point] = {}
    stopped: set[str] = set()
    for frequency in frequencies:
        mesh = displaced_icosphere(frequency)
        names = sorted(BUILDERS, key=lambda name: name != NAIVE)  # the truth first
        with _memory_limited(MEMORY_LIMIT):
            yield from _of_size(mesh, names, last, stopped, effort, build_limit, show)


def _of_size(
    mesh: StudyMesh,
    names: Sequence[str],
    last: dict[str, Point],
    stopped: set[str],
    effort: Effort,
    build_limit: float,
    show: Show,
) -> Iterator[Point]:
    truths: dict[str, Answers] = {}
    for name in names:
        if name in stopped:
            continue
        why = too_long(last.get(name), mesh.triangles, build_limit)
        show(f"{name}, {mesh.triangles:,} triangles")
        try:
            point = None if why else _measured(name, mesh, truths, effort)
        except MemoryError:
            gibibytes = MEMORY_LIMIT / 2**30
            why = f"{mesh.triangles:,} triangles need more than {gibibytes:g} GiB"
        except ValueError as error:
            why = str(error)
        if why or point is None:
            stopped.add(name)
            yield Point(name, mesh.triangles, why)
        else:
            last[name] = point
            yield point


def _measured(
    name: str, mesh: StudyMesh, truths: dict[str, Answers], effort: Effort
) -> Point:
    """Build, check and time one structure; raise ValueError if its hits are wrong."""
    accel, seconds = build(name, triangle_surfaces(mesh), reach_of(mesh))
    nanoseconds = {}
    rays = {
        "camera": camera_rays(mesh.view, effort.pixels, effort.pixels),
        "random": random_rays(mesh, effort.pixels**2),
    }
    for kind, batches in rays.items():
        query = make_query(kind, batches)
        # one batch of brute force: at ten million triangles that is seconds
        one = spread(len(query.rays.count), 1)
        found = answers(accel, query, one)
        wrong = truths.setdefault(kind, found).differing(found)
        if wrong:
            raise ValueError(f"{wrong} {kind} rays are answered wrongly")
        spent = trace(accel, query, one)
        share = one
        if spent < effort.seconds:
            share = spread(len(query.rays.count), int(effort.seconds / spent))
            spent = min(trace(accel, query, share) for _ in range(effort.rounds))
        nanoseconds[kind] = spent / int(query.rays.count[share].sum()) * 1e9
    return Point(
        name, mesh.triangles, "", seconds, bytes_of(accel), tuple(nanoseconds.items())
    )


def too_long(last: Point | None, triangles: int, limit: float) -> str:
    """Return why the next size is not built, or nothing."""
    if last is None:
        return ""
    guess = last.build * (triangles / last.triangles) ** SLOWER
    if guess <= limit:
        return ""
    return f"{triangles:,} triangles would build for about {guess:.0f} s"


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
