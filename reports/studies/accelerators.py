"""Every structure that finds the nearest hit: hits compared, counted, timed, looked into.

Brute force gives the truth, Embree runs on the same rays in the same rounds.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from mitsuba_ref.records.machine import usable_cores
from renderer.accelerators.build import BUILDERS
from renderer.accelerators.choice import RayCounts, choose_structure
from renderer.kernels.records import batch as tally
from reports.bench.rows import Row
from reports.bench.study import Bench, Study
from reports.bench.timing import median, ratio
from reports.look.heat_map import heat_map
from reports.trials import meshes
from reports.trials.embree_peers import EMBREEX
from reports.trials.growth import growth
from reports.trials.inside import Looks, kernel_counts, script
from reports.trials.ray_times import Effort, RayTimes, time_rays
from reports.trials.rays import camera_rays, flat, pixel_order
from reports.trials.structures import NAIVE, affordable, build, build_all, depth_and_cost
from reports.trials.tracing import bytes_of, make_query, spread, tallied, trace

MESHES = {
    "teapot": meshes.teapot,
    "displaced ball": lambda: meshes.displaced_icosphere(128),
    "triangle soup": lambda: meshes.soup(100_000),
    "teapot in a stadium": meshes.teapot_in_a_stadium,
    "street of boxes": lambda: meshes.street(8000),
}
SMALL = {"triangle soup": lambda: meshes.soup(10_000)}  # with --quick
MAPPED = ("teapot", "teapot in a stadium")
INSIDE, MAPS, GROWTH, FIGURE = "look inside", "work per pixel", "growth", "a full screen"
COUNTS = ("nodes", "box tests", "triangle tests", "tests saved", "stack")
WIDTH, HEIGHT, TURNS = 1920, 1080, 3  # the lecture's figure: a ray for each pixel
# rays that a picture may need: one sample of a megapixel, and a hundred
WORKLOADS = (1_000_000, 100_000_000)

FULL = Effort(pixels=768, rounds=5, build_rounds=3, seconds=0.25)
QUICK = Effort(pixels=128, rounds=2, build_rounds=2, seconds=0.005)


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the rows of a case."""
    special = {INSIDE: _inside, MAPS: _maps, GROWTH: _growth, FIGURE: _figure}
    if case in special:
        yield from special[case](bench, partial(Row, case=case))
        return
    mesh = (SMALL.get(case) if bench.quick else None) or MESHES[case]
    effort, every = QUICK if bench.quick else FULL, usable_cores()
    found = time_rays(mesh(), effort, sorted({1, every}), tuple(BUILDERS), show=bench.show)
    yield from mesh_rows(found, mesh(), every, partial(Row, case=case))


def mesh_rows(
    found: RayTimes, mesh: meshes.StudyMesh, every: int, row: partial[Row]
) -> Iterator[Row]:
    """Yield what was found on one mesh.

    Parameters
    ----------
    found, mesh
        The measurement.
    every
        The threads that "all threads" are.
    row
        Makes a row of the case.
    """
    yield row(quantity="triangles", value=mesh.triangles)
    for one in found.structures:
        mine = partial(row, contender=one.name)
        if one.fault:
            yield mine(quantity="fault", value=one.fault)
            continue
        depth, cost = depth_and_cost(one.accel)
        yield mine(quantity="memory", unit="bytes", value=bytes_of(one.accel))
        if depth is not None:
            yield mine(quantity="depth", value=depth)
        if cost is not None:
            yield mine(quantity="SAH cost", value=cost)
        for kind, query in found.queries.items():
            counts = tallied(one.accel, query, found.shares[one.name, kind])
            values = [*counts[: tally.STACK].mean(axis=1), counts[tally.STACK].max()]
            for name, value in zip(COUNTS, values, strict=True):
                yield mine(quantity=f"{kind} rays: {name}", value=float(value))
            share = query.rays.count[found.shares[one.name, kind]].sum() / query.rays.rays
            if share < 1.0:
                yield mine(quantity=f"{kind} rays: share traced", value=float(share))
    for peer in found.peers:
        if peer.fault:
            yield row(contender=peer.name, quantity="left out", value=peer.fault)
        shares = [one.get("same_primitive", 1.0) for one in peer.agreement.values()]
        if shares:
            yield row(contender=peer.name, quantity="same triangle", value=min(shares))
    for name, seconds in found.builds.items():
        if seconds:
            mine = partial(row, contender=name, quantity="build", unit="s")
            yield mine(value=min(seconds), interval=(min(seconds), max(seconds)))
    for (name, kind, threads), seconds in found.seconds.items():
        if seconds:
            times = [1e9 * value for value in seconds]
            yield row(
                contender=name,
                quantity=f"{kind} rays" + (", all threads" if threads == every > 1 else ""),
                unit="ns",
                **median(times),
            )
    yield from _beside_peers(found, every, row)
    for rays in WORKLOADS:
        surfaces, shared = meshes.triangle_surfaces(mesh), RayCounts(0.2 * rays, 0.8 * rays)
        chosen = choose_structure("triangles", surfaces, mesh.triangles, "auto", shared)
        yield row(quantity=f"auto takes, {rays:,} rays", value=chosen.name)


def _beside_peers(found: RayTimes, every: int, row: partial[Row]) -> Iterator[Row]:
    """Yield how many times as fast each structure is as a peer, round by round."""
    for (name, kind, threads), theirs in found.seconds.items():
        # embreex has one thread; of Mitsuba only all threads are compared
        if name in BUILDERS or not theirs or (threads < every and name != EMBREEX):
            continue
        for one in found.structures:
            ours = found.seconds.get((one.name, kind, threads), [])
            if ours and len(ours) == len(theirs) and one.name != NAIVE:
                times, interval = ratio(theirs, ours)
                yield row(
                    contender=one.name,
                    quantity=f"{kind} rays: times as fast as {name}",
                    value=times,
                    interval=interval,
                )


def _inside(bench: Bench, row: partial[Row]) -> Iterator[Row]:
    """Yield the files that the page draws the structures from, and the counts of walks."""
    looks = Looks(meshes.teapot(2))
    yield bench.file(INSIDE, "scene", "scene.js", script("scene", looks.scene()))
    for one in looks.structures():
        bench.show(one.name)
        yield bench.file(INSIDE, one.name, f"{one.name}.js", script(one.name, one.data))
        accel = None
        if one.name in BUILDERS:
            accel, _ = build(one.name, looks.surfaces, looks.reach)
        for ray, walk in zip(looks.rays, one.walks, strict=True):
            mine = partial(row, contender=one.name)
            if accel is not None and walk.counts != kernel_counts(accel, ray):
                wrong = f"{ray.title}: the walk counts other work than the kernel"
                yield mine(quantity="fault", value=wrong)
            for name, value in zip(COUNTS, walk.counts, strict=False):
                yield mine(quantity=f"{ray.title}: {name}", value=value)


def _maps(bench: Bench, row: partial[Row]) -> Iterator[Row]:
    """Yield pictures of what each pixel's camera ray costs each structure, alone."""
    width, height = (96, 72) if bench.quick else (240, 180)
    for case in MAPPED:
        mesh = MESHES[case]()
        query = make_query("camera", camera_rays(mesh.view, width, height))
        order, works = pixel_order(width, height), {}
        for one in build_all(mesh, [n for n in BUILDERS if n != NAIVE], 1, bench.show):
            if one.fault:
                continue
            bench.show(f"{case}: {one.name}")
            counts = tallied(one.accel, query, query.batches, coherent=False)
            works[one.name] = np.zeros(width * height, np.int64)
            works[one.name][order] = counts[tally.NODES] + counts[tally.PRIMITIVES]
            mean = float(works[one.name].mean())
            yield row(contender=one.name, quantity=f"work, {case}", value=mean)
            prim = flat(query.hits.prim, query.rays)
            ball = (prim >= 0) & (prim < meshes.BALL_TRIANGLES)
            if case == MAPPED[1] and ball.any():
                tests = float(counts[tally.PRIMITIVES][ball].mean())
                yield row(contender=one.name, quantity="tests into the ball", value=tests)
        most = int(max(work.max() for work in works.values()))
        yield row(quantity=f"most work, {case}", value=most)
        for name, work in works.items():
            pixels = heat_map(work.reshape(height, width), most)
            yield bench.picture(MAPS, f"{case}: {name}", pixels)


def _growth(bench: Bench, row: partial[Row]) -> Iterator[Row]:
    sizes = (2, 7, 22, 71) if bench.quick else (1, 2, 4, 7, 22, 71, 224, 707)
    limit, effort = (1.2, QUICK) if bench.quick else (120.0, FULL)
    for point in growth(sizes, effort, limit, bench.show):
        here = partial(row, contender=point.name, at=float(point.triangles))
        if point.stopped:
            fault = "fault" if "wrongly" in point.stopped else "stopped"
            yield row(contender=point.name, quantity=fault, value=point.stopped)
            continue
        yield here(quantity="build", unit="s", value=point.build)
        yield here(quantity="memory", unit="bytes", value=point.bytes)
        for kind, nanoseconds in point.nanoseconds:
            yield here(quantity=f"{kind} rays", unit="ns", value=nanoseconds)


def _figure(bench: Bench, row: partial[Row]) -> Iterator[Row]:
    """Yield the lecture's figure: 1920 x 1080 rays at 6320 triangles.

    What cannot do the whole picture in time is measured on tiles that lie evenly over it.
    """
    mesh = meshes.teapot()
    query = make_query("camera", camera_rays(mesh.view, WIDTH, HEIGHT))
    seconds, some = (0.1, 0.005) if bench.quick else (3.0, 0.25)
    for one in build_all(mesh, tuple(BUILDERS), 1, bench.show):
        bench.show(one.name)
        mine = partial(row, contender=one.name)
        share = affordable(one.accel, query, seconds / TURNS)
        for threads in sorted({1, usable_cores()}):
            part = spread(len(query.rays.count), len(share) * threads)
            spent = min(trace(one.accel, query, part, threads) for _ in range(TURNS))
            whole = spent * query.rays.rays / int(query.rays.count[part].sum())
            name = "whole picture" + (", all threads" if threads > 1 else "")
            yield mine(quantity=name, unit="s", value=whole)
        # each ray on its own: a packet's tests would count for all of its 16 rays
        work = tallied(one.accel, query, affordable(one.accel, query, some), coherent=False)
        tests = float(work[tally.PRIMITIVES].mean())
        yield mine(quantity="triangle tests of a ray", value=tests)


LARGE = "displaced ball", "street of boxes"  # left out with --quick
CASES = (INSIDE, MAPS, *MESHES, GROWTH, FIGURE)
STUDY = Study(
    title="Finding the nearest hit",
    sentence="How does each structure find the triangle that a ray meets first, and how "
    "fast is it?",
    minutes=45,
    quick_minutes=4,
    cases=CASES,
    quick_cases=[case for case in CASES if case not in LARGE],
    axis="triangles",
    measure=measure,
    page="reports.pages.accelerators_page:accelerators_page",
)
