"""What studies of structures measure with: meshes, rays, counts, and the checks first.

Everything is tiny, and no time is looked at.
"""

from __future__ import annotations

import sys
from collections import Counter
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from mitsuba_ref.reference.errors import MitsubaError
from renderer.accelerators.build import BUILDERS
from renderer.accelerators.rays.boxes import build_brute_force
from renderer.kernels.records import batch as tally
from renderer.kernels.records.batch import CAPACITY
from reports.trials import embree_peers, growth, structures, tracing
from reports.trials.embree_peers import Peer
from reports.trials.growth import Point, too_long
from reports.trials.meshes import (
    StudyMesh,
    displaced_icosphere,
    soup,
    street,
    teapot,
    teapot_in_a_stadium,
    triangle_surfaces,
)
from reports.trials.ray_times import Effort, time_rays
from reports.trials.rays import (
    camera_rays,
    diffuse_rays,
    flat,
    hit_points,
    in_batches,
    pixel_order,
    random_rays,
    shadow_rays,
)
from reports.trials.structures import NAIVE, Structure

PIXELS = 40  # a side: two batches, the second one not full


@pytest.fixture(scope="module")
def ball() -> StudyMesh:
    return displaced_icosphere(4)


def built(name: str, mesh: StudyMesh) -> Structure:
    accel, seconds = structures.build(
        name, triangle_surfaces(mesh), structures.reach_of(mesh)
    )
    return Structure(name, accel, [seconds])


@pytest.fixture(scope="module")
def built_two(ball: StudyMesh) -> list[Structure]:
    return [built(NAIVE, ball), built("bvh", ball)]


@pytest.fixture
def queries(ball: StudyMesh, built_two: list[Structure]) -> dict[str, tracing.Query]:
    return structures.study_queries(ball, built_two[1].accel, PIXELS)


# ------------------------------------------------------------------------------ meshes


@pytest.mark.parametrize(
    ("mesh", "triangles"),
    [
        (displaced_icosphere(1), 20),
        (displaced_icosphere(4), 20 * 4**2),
        (displaced_icosphere(7), 980),
        (teapot(), 6320),
        (teapot(2), 1560),
        (soup(500), 500),
        (teapot_in_a_stadium(), 5002),
        (street(6), 74),
    ],
    ids=lambda value: value.name if isinstance(value, StudyMesh) else str(value),
)
def test_mesh_has_its_number_of_triangles_with_area(
    mesh: StudyMesh, triangles: int
) -> None:
    assert mesh.triangles == triangles
    surfaces = triangle_surfaces(mesh)
    area = np.linalg.norm(np.cross(surfaces.edge1.T, surfaces.edge2.T), axis=1)
    assert area.min() > 0.0


def test_displaced_ball_is_closed() -> None:
    """Each edge, named by the bits of its ends, belongs to two triangles."""
    mesh = displaced_icosphere(5)
    corners = [tuple(vertex.tobytes() for vertex in mesh.vertices[f]) for f in mesh.faces]
    edges = Counter(
        frozenset((corner[k], corner[k - 1])) for corner in corners for k in range(3)
    )
    assert set(edges.values()) == {2}
    assert len(edges) == 3 * mesh.triangles // 2


def test_all_of_the_displaced_ball_looks_outward() -> None:
    """Half of its faces looked inward once: black under one-sided materials."""
    corners = displaced_icosphere(5).vertices[displaced_icosphere(5).faces]
    assert np.linalg.det(corners).min() > 0.0


def test_stadium_is_a_thousand_times_the_ball() -> None:
    mesh = teapot_in_a_stadium()
    size = [np.ptp(mesh.vertices[np.unique(mesh.faces[part])], axis=0).max()
            for part in (slice(5000), slice(5000, None))]  # fmt: skip
    assert size == pytest.approx([1.0, 1000.0], rel=2e-3)


# -------------------------------------------------------------------------------- rays


def test_sixteen_rays_in_a_row_are_four_by_four_pixels() -> None:
    order = pixel_order(64, 40)
    assert sorted(order) == list(range(64 * 40))
    y, x = np.divmod(order, 64)
    for first in range(0, len(order), 16):
        part = slice(first, first + 16)
        assert np.ptp(x[part]) == np.ptp(y[part]) == 3
        assert x[first] % 4 == y[first] % 4 == 0
    assert x[:1024].max() == y[:1024].max() == 31  # a whole tile first


def test_camera_looks_at_its_target(ball: StudyMesh) -> None:
    """The mean of the four middle rays goes from the eye to the target."""
    rays = camera_rays(ball.view, PIXELS, PIXELS)
    origin, direction, ends = rays.rows()
    order = pixel_order(PIXELS, PIXELS)
    middle = np.isin(order % PIXELS, (19, 20)) & np.isin(order // PIXELS, (19, 20))
    towards = np.subtract(ball.view.target, ball.view.eye)
    found = direction[middle].mean(axis=0)
    assert found @ towards == pytest.approx(np.linalg.norm(towards), rel=1e-3)
    assert np.allclose(origin, ball.view.eye)
    assert np.isinf(ends).all()


def test_batches_give_the_rays_back() -> None:
    n = CAPACITY + 7
    rows = np.random.default_rng(3).normal(size=(2, n, 3)).astype(np.float32)
    rays = in_batches(rows[0], rows[1], 2.5)
    assert rays.rays == n
    origin, direction, ends = rays.rows()
    assert np.array_equal(origin, rows[0])
    assert np.array_equal(direction, rows[1])
    assert (ends == 2.5).all()


def test_rays_from_hits_start_off_the_surface_and_end_before_the_light(
    ball: StudyMesh, queries: dict[str, tracing.Query]
) -> None:
    """Shadow rays reach all but the last ten thousandth; diffuse rays leave outwards.

    The cosine of a cosine-distributed direction has mean 2/3 and variance 1/18.
    """
    camera = queries["camera"]
    t, prim = (flat(row, camera.rays) for row in camera.hits[:2])
    points = hit_points(ball, camera.rays, t, prim)
    n = len(points.position)
    assert 0 < n < camera.rays.rays
    origin, direction, ends = shadow_rays(points, ball.view.light).rows()
    gap = np.linalg.norm(origin + ends[:, None] * direction - ball.view.light, axis=1)
    assert (gap / ends).max() < 2e-4
    _, outwards, _ = diffuse_rays(points).rows()
    cosine = np.sum(outwards * points.normal, axis=1)
    assert cosine.min() > 0.0
    assert abs(cosine.mean() - 2 / 3) < 4.5 * np.sqrt(1 / 18 / n) + 1e-3


def test_random_rays_start_in_the_ball_around_the_mesh(ball: StudyMesh) -> None:
    origin, direction, _ = random_rays(ball, 3000).rows()
    low, high = ball.vertices.min(axis=0), ball.vertices.max(axis=0)
    away = np.linalg.norm(origin - (low + high) / 2, axis=1)
    assert away.max() <= np.linalg.norm(high - low) / 2 * 1.001
    assert np.abs(direction.mean(axis=0)).max() < 4.5 * np.sqrt(1 / 3 / 3000)


# ---------------------------------------------------------------- tracing and counting


def test_brute_force_counts_every_triangle(
    ball: StudyMesh,
    built_two: list[Structure],
    queries: dict[str, tracing.Query],
) -> None:
    """A nearest hit by brute force is as many tests as there are triangles, a miss too."""
    for kind in ("camera", "random"):
        counts = tracing.tallied(built_two[0].accel, queries[kind], queries[kind].batches)
        assert counts.shape == (tally.ROWS, queries[kind].rays.rays)
        assert (counts[tally.PRIMITIVES] == ball.triangles).all()
        assert (counts[tally.NODES] == 0).all()


def test_threads_change_nothing(
    built_two: list[Structure], queries: dict[str, tracing.Query]
) -> None:
    """Batches shared out to three threads are answered as by one."""
    accel = built_two[1].accel
    for query in queries.values():
        one = tracing.answers(accel, query, query.batches)
        # u and v of a miss mean nothing: traversals leave them as they are
        for row in (query.hits.t, query.hits.prim, query.blocked):
            row[:] = 77
        tracing.trace(accel, query, query.batches, threads=3)
        rows = (query.blocked,) if query.kind == "shadow" else query.hits[:4]
        for mine, theirs in zip(one.values, rows, strict=True):
            assert np.array_equal(flat(mine, query.rays), flat(theirs, query.rays))


def test_chosen_batches_are_spread() -> None:
    assert tracing.spread(10, 2).tolist() == [2, 7]
    assert tracing.spread(3, 0).tolist() == [1]
    assert tracing.spread(3, 99).tolist() == [0, 1, 2]


def test_bytes_count_shared_memory_once() -> None:
    row = np.zeros(10, np.float32)
    views = (row, row.view(np.int32), row[2:5])
    assert tracing.bytes_of((views, (row, np.zeros(3, np.int8)), None, 5, "text")) == 43


# --------------------------------------------------------------------------- the check


def test_agreeing_structures_are_without_fault(
    built_two: list[Structure], queries: dict[str, tracing.Query]
) -> None:
    agreed = structures.check_all(built_two, queries, patience=1.0)
    assert [one.fault for one in built_two] == ["", ""]
    assert set(agreed) == set(queries)
    hits = agreed["camera"].values[1]
    assert (hits >= 0).any()


def test_structure_that_lost_a_triangle_is_not_timed(
    ball: StudyMesh,
    built_two: list[Structure],
    queries: dict[str, tracing.Query],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One triangle of 320, one that the camera sees, is missing: the check finds it."""
    camera = queries["camera"]
    seen = int(flat(camera.hits.prim, camera.rays).max())

    def forgetful(extents: Any, group: Any) -> Any:
        rest = np.delete(np.arange(extents.lower.shape[1]), seen)
        return build_brute_force(extents, lambda order: group(rest))

    monkeypatch.setitem(BUILDERS, "forgetful", forgetful)
    wrong = built("forgetful", ball)
    structures.check_all([*built_two, wrong], queries, patience=1.0)
    assert "answered wrongly; not timed" in wrong.fault


def test_what_answers_wrongly_has_no_times(
    ball: StudyMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A structure without a third of the triangles is compared and left out of turns."""

    def forgetful(extents: Any, group: Any) -> Any:
        return build_brute_force(extents, lambda order: group(order[:200]))

    monkeypatch.setitem(BUILDERS, "forgetful", forgetful)
    monkeypatch.setattr("reports.trials.ray_times.load_peers", lambda *given: [])
    monkeypatch.setattr("reports.trials.ray_times.PAUSE", 0.0)
    effort = Effort(pixels=32, rounds=2, build_rounds=2, seconds=1e-3)
    found = time_rays(ball, effort, [1], (NAIVE, "bvh", "forgetful"), ("random",))
    assert "not timed" in found.structure("forgetful").fault
    assert set(found.seconds) == {(NAIVE, "random", 1), ("bvh", "random", 1)}
    assert all(len(times) == 2 for times in found.seconds.values())
    assert all(len(found.builds[name]) == 2 for name in (NAIVE, "bvh"))


def test_builder_that_fails_is_a_fault_of_its_own(
    ball: StudyMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuses(extents: Any, group: Any) -> Any:
        raise MemoryError

    monkeypatch.setitem(BUILDERS, "refuses", refuses)
    made = structures.build_all(ball, [NAIVE, "refuses"], 2, lambda stage: None)
    assert made[1].fault == "not built: MemoryError"
    assert len(made[0].build_seconds) == 2


# ------------------------------------------------------------------------------- peers


def answers_of(kind: str, queries: dict[str, tracing.Query], accel: Any) -> Any:
    return tracing.answers(accel, queries[kind], queries[kind].batches)


def test_peers_find_our_hits(
    ball: StudyMesh,
    built_two: list[Structure],
    queries: dict[str, tracing.Query],
) -> None:
    """Embree by two ways, where it is available; where it is not, a sentence says why."""
    with ExitStack() as stack:
        loaded = embree_peers.load_peers(
            ball, {k: q.rays for k, q in queries.items()}, stack
        )
        assert [peer.name for peer in loaded] == list(embree_peers.NAMES)
        for peer in loaded:
            if peer.fault:
                assert peer.fault.startswith("not available: ")
                continue
            for kind, query in queries.items():
                peer.check(kind, answers_of(kind, queries, built_two[1].accel), query.rays)
            assert not peer.fault
            assert peer.agreement["random"]["same_primitive"] > 0.999
            assert peer.seconds is not None and peer.seconds("camera", 1) > 0.0
            assert peer.build is not None and peer.build(2) > 0.0


def test_absent_peers_say_why(ball: StudyMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without embreex, and with a Mitsuba that finds no LLVM, there is no failure."""

    def no_llvm(*arguments: Any) -> Any:
        raise MitsubaError("llvm_ad_rgb: no libLLVM 16 to 19 in the usual folders")

    monkeypatch.setitem(sys.modules, "embreex", None)
    monkeypatch.setattr(embree_peers, "TracedMitsuba", no_llvm)
    with ExitStack() as stack:
        loaded = embree_peers.load_peers(ball, {}, stack)
    assert all(peer.fault.startswith("not available: ") for peer in loaded)
    assert "embreex" in loaded[0].fault
    assert "no libLLVM" in loaded[1].fault


def test_peer_with_other_hits_is_not_timed(
    built_two: list[Structure], queries: dict[str, tracing.Query]
) -> None:
    """Distances off by a thousandth: the share that agrees is that of the misses."""
    query = queries["random"]
    truth = answers_of("random", queries, built_two[1].accel)
    t, prim = (flat(row, query.rays) for row in truth.values[:2])

    class Shifted:
        pass

    shifted = Shifted()
    shifted.t, shifted.prim = t * np.float32(1.001), prim  # type: ignore[attr-defined]
    peer = Peer("peer", 1, found=lambda kind: shifted)
    peer.check("random", truth, query.rays)
    assert peer.agreement["random"]["same_primitive"] == 1.0
    assert peer.agreement["random"]["same_distance"] == pytest.approx((prim < 0).mean())
    assert "not timed" in peer.fault


# ------------------------------------------------------------------------------ growth


def test_growth_stops_where_a_build_would_take_too_long() -> None:
    """0.1 s for 1000 triangles are guessed as 0.1 x 10^1.15 = 1.41 s for 10,000."""
    last = Point("bvh", 1000, build=0.1)
    assert too_long(last, 10_000, 1.5) == ""
    assert "10,000 triangles would build for about 1 s" in too_long(last, 10_000, 1.4)
    assert too_long(None, 10_000, 0.0) == ""


def test_growth_measures_each_structure_at_each_size(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two sizes; what finds nothing, and what gets no memory, stops and says why."""

    def blind(extents: Any, group: Any) -> Any:
        return build_brute_force(extents, lambda order: group(order[:1]))

    def greedy(extents: Any, group: Any) -> Any:
        return np.zeros((1 << 44,), np.uint8)

    names = {NAIVE: BUILDERS[NAIVE], "bvh": BUILDERS["bvh"]}
    names |= {"blind": blind, "greedy": greedy}
    for name, builder in names.items():
        monkeypatch.setitem(BUILDERS, name, builder)
    monkeypatch.setattr(growth, "BUILDERS", names)
    effort = Effort(pixels=32, rounds=2, build_rounds=1, seconds=1e-3)
    points = list(growth.growth((2, 3), effort, 1e9, lambda stage: None))
    for name in (NAIVE, "bvh"):
        mine = [point for point in points if point.name == name]
        assert [point.triangles for point in mine] == [80, 180]
        assert all(value > 0 for point in mine for _, value in point.nanoseconds)
    stopped = {point.name: point.stopped for point in points if point.stopped}
    assert "answered wrongly" in stopped["blind"]
    assert stopped["greedy"] == "80 triangles need more than 8 GiB"
    assert len(points) == 2 * 2 + 2


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits a process's data")
def test_growth_keeps_within_its_memory() -> None:
    """16 GiB are refused while sizes grow; afterwards there is memory again."""
    with growth._memory_limited(growth.MEMORY_LIMIT), pytest.raises(MemoryError):
        np.zeros((1 << 34,), np.uint8)
    assert np.zeros(1 << 33, np.uint8).nbytes == 1 << 33
