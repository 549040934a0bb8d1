"""Which bounding volume for which object: fit, test, and how many rays it lets through.

Random lines without a preferred place or direction meet a compact, a long diagonal and a
flat object; each volume gets the same lines. Before anything is timed, every ray that hits
the object must have hit all of its volumes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from renderer.kernels.jit import entry_kernel
from renderer.kernels.records.batch import PADDING
from renderer.plugins.shapes.extents import extents_of
from renderer.plugins.shapes.triangle_tables import TriangleSurfaces
from renderer.textbook.bounding_volumes import which_hit
from renderer.textbook.volume_fits import VOLUMES, points_of_extents
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, Study
from reports.bench.timing import take_turns
from reports.look.formatting import number
from reports.trials.meshes import surfaces_of
from reports.trials.rays import flat, in_batches
from reports.trials.tracing import make_query, trace

DETAIL = 48  # parts along a side of an object's surface
TIMED_RAYS = 1024  # a batch, as in the renderer; stays in the fastest cache
TURNS = 7  # the volumes take turns; the best counts
SIDE = 160  # pixels of a picture
SHARE = "share of its rays that hit"
HIT, FALSE_HIT, MISS = (60, 64, 70), (226, 120, 90), (238, 240, 240)

Points = NDArray[np.float64]  # (n, 3)


class Lines(NamedTuple):
    """Rays that start outside of everything, padded by 16."""

    origin: NDArray[np.float32]  # (3, n)
    direction: NDArray[np.float32]  # (3, n) unit
    number: int  # n without the padding


def _compact(u: Points, v: Points) -> Points:
    """Return a dented ball."""
    radius = 1.0 + 0.06 * np.sin(3.0 * u) * np.sin(5.0 * v)
    ball = np.stack((np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)), 1)
    return radius[:, None] * ball


def _tilted(points: Points) -> Points:
    """Turn the z axis towards (1, 1, 1)."""
    z = np.full(3, 3.0**-0.5)
    x = np.array([1.0, -1.0, 0.0]) / 2.0**0.5
    return points @ np.stack((x, np.cross(z, x), z))


def _long(u: Points, v: Points) -> Points:
    """Return a round rod along (1, 1, 1), 20 times as long as thick, with closed ends."""
    radius = 0.1 * np.where((v == 0.0) | (v == np.pi), 0.0, 1.0)
    height = 4.0 * np.clip((v - v[v > 0].min()) / (np.pi - 2.0 * v[v > 0].min()), 0.0, 1.0)
    return _tilted(np.stack((radius * np.cos(u), radius * np.sin(u), height - 2.0), 1))


def _flat(u: Points, v: Points) -> Points:
    """Return a square plate across (1, 1, 1)."""
    return _tilted(np.stack((u / np.pi - 1.0, 2.0 * v / np.pi - 1.0, 0.0 * u), 1))


OBJECTS: dict[str, Callable[[Points, Points], Points]] = {
    "compact": _compact,
    "long, diagonal": _long,
    "flat, tilted": _flat,
}


def _surfaces(name: str, detail: int) -> TriangleSurfaces:
    """Return about 2 detail^2 triangles of an object, all with an area."""
    u, v = np.meshgrid(
        np.linspace(0.0, 2.0 * np.pi, detail + 1), np.linspace(0.0, np.pi, detail + 1)
    )
    points = OBJECTS[name](u.ravel(), v.ravel())
    k = np.arange((detail + 1) ** 2).reshape(detail + 1, detail + 1)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    faces = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    p, q, r = (points[faces[:, k]] for k in range(3))
    kept = np.linalg.norm(np.cross(q - p, r - p), axis=1) > 1e-9
    return surfaces_of(points.astype(np.float32), faces[kept])


def _lines(sphere: Any, count: int, generator: np.random.Generator) -> Lines:
    """Return lines that meet a ball which holds all volumes of an object.

    Its radius is sqrt(3) times that of the bounding sphere: each slab of a box lies
    within the sphere's, so the box's corners lie that far from its centre at most.
    """
    direction = generator.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.cross(direction, generator.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    radius = 1.01 * 3.0**0.5 * float(sphere.radius[0])
    across *= radius * np.sqrt(generator.random((count, 1)))
    origin = sphere.center[:, 0] + across - 2.0 * radius * direction
    rows = np.zeros((2, 3, count + PADDING), np.float32)
    rows[0, :, :count], rows[1, :, :count] = origin.T, direction.T
    return Lines(rows[0], rows[1], count)


def _hits_object(surfaces: TriangleSurfaces, lines: Lines) -> tuple[Any, Any]:
    """Return (which lines hit the object, where each of them ends), (n,) and padded."""
    accel = build_accelerator("triangles", surfaces, np.arange(surfaces.end), "bvh")
    origin, direction = (rows[:, : lines.number].T for rows in lines[:2])
    query = make_query("random", in_batches(origin, direction, np.inf))
    trace(accel, query, query.batches)
    ends = np.full(lines.number + PADDING, np.inf, np.float32)
    ends[: lines.number] = flat(query.hits.t, query.rays)
    return flat(query.hits.prim, query.rays) >= 0, ends


@entry_kernel
def _test_again(
    volume: Any, origin: Any, direction: Any, t_max: Any, found: Any, repeats: int
) -> None:
    """Test one batch again and again: what is timed."""
    for _ in range(repeats):
        which_hit(volume, origin, direction, t_max, TIMED_RAYS, found)


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield pictures, then what each volume around an object costs, and lets through."""
    for name, pixels in pictures(case).items():
        yield bench.picture(case, name, pixels)
    rays, repeats = (20_000, 200) if bench.quick else (200_000, 2000)
    yield from measure_object(case, rays, DETAIL, repeats)


def pictures(case: str) -> dict[str, NDArray[np.uint8]]:
    """Return a picture by parallel rays for each volume: hits dark, false hits orange."""
    surfaces = _surfaces(case, DETAIL)
    extents = extents_of("triangles", surfaces, np.arange(surfaces.end))
    points = points_of_extents(extents)
    sphere = VOLUMES["sphere"].fit(*points)
    # the rows of Q: along the rays, across and down the picture
    axes = np.linalg.qr(np.array([[0.2, 1.0, 0.0], [0.9, 0.1, 0.3], [0.4, 0.0, 1.0]]))[0].T
    y, x = np.mgrid[1 : -1 : SIDE * 1j, -1 : 1 : SIDE * 1j].reshape(2, -1, 1)
    radius = 1.5 * float(sphere.radius[0])
    start = sphere.center[:, 0] + radius * (x * axes[1] + y * axes[2] - 2.0 * axes[0])
    rows = np.zeros((2, 3, SIDE**2 + PADDING), np.float32)
    rows[0, :, : SIDE**2], rows[1] = start.T, axes[0][:, None]
    lines = Lines(rows[0], rows[1], SIDE**2)
    hit, _ = _hits_object(surfaces, lines)
    endless = np.full(SIDE**2 + PADDING, np.inf, np.float32)
    found = {}
    for name, volume in VOLUMES.items():
        met = np.zeros(SIDE**2 + PADDING, np.int32)
        which_hit(volume.fit(*points), *lines[:2], endless, lines.number, met)
        pixels = np.where(met[: SIDE**2, None] > 0, FALSE_HIT, MISS)
        pixels = np.where(hit[:, None], HIT, pixels).astype(np.uint8)
        found[name] = pixels.reshape(SIDE, SIDE, 3)
    return found


def measure_object(case: str, rays: int, detail: int, repeats: int) -> Iterator[Row]:
    """Yield the rows of an object.

    Parameters
    ----------
    case
        One of `OBJECTS`.
    rays
        Random lines.
    detail
        The object has about 2 detail^2 triangles.
    repeats
        Of a batch of `TIMED_RAYS` rays in one timing.

    Raises
    ------
    ValueError
        If a ray hits the object and not its volume: then nothing is timed.
    """
    generator = np.random.default_rng(0)
    surfaces = _surfaces(case, detail)
    extents = extents_of("triangles", surfaces, np.arange(surfaces.end))
    points, radius = points_of_extents(extents)
    records = {name: volume.fit(points, radius) for name, volume in VOLUMES.items()}
    lines = _lines(records["sphere"], rays, generator)
    hit, ends = _hits_object(surfaces, lines)
    hits, endless = int(hit.sum()), np.full_like(ends, np.inf)
    if hits == 0:
        raise ValueError(f"none of {rays} rays hits the object; take more")
    rows = []
    for name, record in records.items():
        row = partial(Row, case=case, contender=name)
        found = np.zeros(rays + PADDING, np.int32)
        which_hit(record, lines.origin, lines.direction, ends, lines.number, found)
        if lost := int((hit & (found[:rays] == 0)).sum()):
            raise ValueError(f"{name}: {lost} rays hit the object and not the volume")
        which_hit(record, lines.origin, lines.direction, endless, lines.number, found)
        met = int(found[:rays].sum())
        rows += [
            row(quantity=SHARE, value=hits / met),
            row(quantity="false hits per line", value=(met - hits) / rays),
            row(quantity="surface area", value=VOLUMES[name].area(record)),
        ]
    yield from rows
    batch = _lines(records["sphere"], TIMED_RAYS, generator)
    some = np.full(TIMED_RAYS + PADDING, np.inf, np.float32)
    found = np.zeros(1100, np.int32)

    def test(record: Any, count: int) -> None:
        _test_again(record, batch.origin, batch.direction, some, found, count)

    for record in records.values():
        test(record, 1)  # compiles
    tests = take_turns(
        {k: lambda turn, r=r: test(r, repeats) for k, r in records.items()},  # type: ignore[misc]
        TURNS,
    )
    fits = take_turns(
        {k: lambda turn, v=v: v.fit(points, radius) and None for k, v in VOLUMES.items()},  # type: ignore[misc]
        3,
    )
    for name in VOLUMES:
        row = partial(Row, case=case, contender=name)
        each = min(tests[name]) / (repeats * TIMED_RAYS / 16)
        yield row(quantity="test of 16 rays", unit="ns", value=1e9 * each)
        yield row(quantity="fit", unit="s", value=min(fits[name]))


def verdict(table: Table) -> str:
    """Name the tightest volume around each object."""
    shares = table.where(quantity=SHARE)
    best = [
        max(shares.where(case=case), key=lambda row: float(row.value or 0.0))
        for case in shares.distinct("case")
    ]
    named = (
        f"{row.contender} on {row.case} ({number(100.0 * float(row.value or 0.0), 2)} %)"
        for row in best
    )
    text = "; ".join(named)
    return f"Tightest, with the share of its rays that hit: {text}." if text else ""


STUDY = Study(
    title="Bounding volumes",
    sentence="Which volume around an object lets the fewest rays through that miss it "
    "(orange in pictures), and what does its test cost? AABB: a box along the axes, "
    "OBB: a turned box, k-DOP: k planes.",
    advice="Take a box along the axes for what is cheap to test; a tighter volume pays "
    "where what it holds costs more than its own test.",
    minutes=1,
    quick_minutes=0.3,
    cases=tuple(OBJECTS),
    measure=measure,
    verdict=verdict,
)
