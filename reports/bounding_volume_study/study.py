"""Which bounding volume for which object: fit, test, and how many rays it lets through.

`python -m reports.bounding_volume_study` prints the table. Random lines without a
preferred place or direction meet a compact, a long diagonal and a flat object; each volume
is asked for the same lines. Before anything is timed, every ray that hits the object must
have hit all of its volumes.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from renderer.kernels.jit import entry_kernel
from renderer.kernels.records.batch import PADDING
from renderer.plugins.shapes.extents import extents_of
from renderer.plugins.shapes.triangle import TriangleSurfaces
from renderer.textbook.bounding_volumes import which_hit
from renderer.textbook.volume_fits import VOLUMES, points_of_extents
from reports.accelerator_trials.meshes import surfaces_of
from reports.accelerator_trials.rays import flat, in_batches
from reports.accelerator_trials.tracing import make_query, trace
from reports.errors import ReportError

RAYS = 200_000
DETAIL = 48  # parts along a side of an object's surface
TIMED_RAYS = 1024  # a batch, as in the renderer; stays in the fastest cache
TURNS = 7  # the volumes take turns; the best counts

Points = NDArray[np.float64]  # (n, 3)


class Lines(NamedTuple):
    """Rays that start outside of everything, padded by 16."""

    origin: NDArray[np.float32]  # (3, n)
    direction: NDArray[np.float32]  # (3, n) unit
    number: int  # n without the padding


# --------------------------------------------------------------------------- objects


def _faces(rows: int, columns: int) -> NDArray[np.int64]:
    """Return two triangles for each cell of a grid of points, (m, 3)."""
    k = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    return np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))


def _tilted(points: Points) -> Points:
    """Turn the z axis towards (1, 1, 1)."""
    z = np.full(3, 3.0**-0.5)
    x = np.array([1.0, -1.0, 0.0]) / 2.0**0.5
    return points @ np.stack((x, np.cross(z, x), z))


def _compact(u: Points, v: Points) -> Points:
    """Return a dented ball."""
    radius = 1.0 + 0.06 * np.sin(3.0 * u) * np.sin(5.0 * v)
    return radius[:, None] * np.stack(
        (np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)), 1
    )


def _long(u: Points, v: Points) -> Points:
    """Return a round rod along (1, 1, 1), 20 times as long as thick, with closed ends."""
    radius = 0.1 * np.where((v == 0.0) | (v == np.pi), 0.0, 1.0)
    height = 4.0 * np.clip((v - v[v > 0].min()) / (np.pi - 2.0 * v[v > 0].min()), 0.0, 1.0)
    return _tilted(np.stack((radius * np.cos(u), radius * np.sin(u), height - 2.0), 1))


def _flat(u: Points, v: Points) -> Points:
    """Return a square plate across (1, 1, 1)."""
    return _tilted(np.stack((u / np.pi - 1.0, 2.0 * v / np.pi - 1.0, 0.0 * u), 1))


OBJECTS = {"compact": _compact, "long, diagonal": _long, "flat, tilted": _flat}


def _surfaces(name: str, detail: int) -> TriangleSurfaces:
    """Return the triangles of an object; those without an area are left out."""
    u, v = np.meshgrid(
        np.linspace(0.0, 2.0 * np.pi, detail + 1), np.linspace(0.0, np.pi, detail + 1)
    )
    points, faces = OBJECTS[name](u.ravel(), v.ravel()), _faces(detail + 1, detail + 1)
    a, b, c = (points[faces[:, k]] for k in range(3))
    kept = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9
    return surfaces_of(points.astype(np.float32), faces[kept])


# ----------------------------------------------------------------------------- rays


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


@entry_kernel
def _test_again(
    volume: Any, origin: Any, direction: Any, t_max: Any, found: Any, repeats: int
) -> None:
    """Test one batch again and again: what is timed."""
    for _ in range(repeats):
        which_hit(volume, origin, direction, t_max, TIMED_RAYS, found)


def _hits_object(surfaces: TriangleSurfaces, lines: Lines) -> tuple[Any, Any]:
    """Return (which lines hit the object, where each of them ends), (n,) and padded."""
    accel = build_accelerator("triangles", surfaces, np.arange(surfaces.end), "bvh")
    origin, direction = (rows[:, : lines.number].T for rows in lines[:2])
    query = make_query("random", in_batches(origin, direction, np.inf))
    trace(accel, query, query.batches)
    ends = np.full(lines.number + PADDING, np.inf, np.float32)
    ends[: lines.number] = flat(query.hits.t, query.rays)
    return flat(query.hits.prim, query.rays) >= 0, ends


# ---------------------------------------------------------------------------- study


def bounding_volume_study(
    rays: int = RAYS, detail: int = DETAIL, repeats: int = 2000
) -> dict[str, Any]:
    """Fit, test and time every volume around every object.

    Parameters
    ----------
    rays
        Random lines for each object.
    detail
        Each object has about 2 detail^2 triangles.
    repeats
        Of a batch of `TIMED_RAYS` rays in one timing.

    Returns
    -------
    dict
        For JSON: `volumes` with the nanoseconds of a test of 16 rays, and `objects`, each
        with a row for every volume.

    Raises
    ------
    ReportError
        If a ray hits an object and not its volume: then nothing is timed.
    """
    generator = np.random.default_rng(0)
    objects = [_object(name, rays, detail, generator) for name in OBJECTS]
    return {
        "rays": rays,
        "turns": TURNS,
        "volumes": _test_times(detail, repeats, generator),
        "objects": objects,
    }


def _object(
    name: str, rays: int, detail: int, generator: np.random.Generator
) -> dict[str, Any]:
    surfaces = _surfaces(name, detail)
    points, radius = points_of_extents(
        extents_of("triangles", surfaces, np.arange(surfaces.end))
    )
    fits = {kind: _fitted(volume.fit, points, radius) for kind, volume in VOLUMES.items()}
    lines = _lines(fits["sphere"][0], rays, generator)
    hit, ends = _hits_object(surfaces, lines)
    hits = int(hit.sum())
    if hits == 0:
        raise ReportError(f"{name}: none of {rays} rays hits it; take more")
    endless = np.full_like(ends, np.inf)
    rows = []
    for kind, (record, seconds) in fits.items():
        found = np.zeros(rays + PADDING, np.int32)
        which_hit(record, lines.origin, lines.direction, ends, lines.number, found)
        lost = int((hit & (found[:rays] == 0)).sum())
        if lost:
            raise ReportError(
                f"{name}, {kind}: {lost} rays hit the object and not the volume"
            )
        which_hit(record, lines.origin, lines.direction, endless, lines.number, found)
        let_through = int(found[:rays].sum())
        rows.append(
            {
                "volume": kind,
                "fit_ms": seconds * 1e3,
                "area": VOLUMES[kind].area(record),
                "tightness": hits / let_through,
                "let_through": let_through / hits,
                "false_hits_per_ray": (let_through - hits) / rays,
            }
        )
    return {
        "name": name,
        "triangles": surfaces.end,
        "hit_share": hits / rays,
        "rows": rows,
    }


def _fitted(fit: Any, points: Any, radius: Any) -> tuple[Any, float]:
    """Return the volume and the least seconds of three fits."""
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        record = fit(points, radius)
        seconds.append(time.perf_counter() - start)
    return record, min(seconds)


def _test_times(
    detail: int, repeats: int, generator: np.random.Generator
) -> list[dict[str, Any]]:
    """Return the nanoseconds that a test of 16 rays takes, for every volume.

    No test ends early, so the object does not matter; it is the compact one.
    """
    surfaces = _surfaces("compact", detail)
    points, radius = points_of_extents(
        extents_of("triangles", surfaces, np.arange(surfaces.end))
    )
    records = {kind: volume.fit(points, radius) for kind, volume in VOLUMES.items()}
    lines = _lines(records["sphere"], TIMED_RAYS, generator)
    ends = np.full(TIMED_RAYS + PADDING, np.inf, np.float32)
    found = np.zeros(TIMED_RAYS + PADDING, np.int32)
    best = dict.fromkeys(records, np.inf)
    for record in records.values():
        _test_again(record, lines.origin, lines.direction, ends, found, 1)  # compiles
    for _ in range(TURNS):
        for kind, record in records.items():
            start = time.perf_counter()
            _test_again(record, lines.origin, lines.direction, ends, found, repeats)
            best[kind] = min(best[kind], time.perf_counter() - start)
    tests = repeats * TIMED_RAYS / 16
    return [
        {"name": kind, "ns_per_16_rays": seconds / tests * 1e9}
        for kind, seconds in best.items()
    ]


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rays", type=int, default=RAYS, help="for each object")
    parser.add_argument("--detail", type=int, default=DETAIL, help="2 N^2 triangles each")
    given = parser.parse_args(arguments)
    study = bounding_volume_study(rays=given.rays, detail=given.detail)
    write = sys.stdout.write
    nanoseconds = {one["name"]: one["ns_per_16_rays"] for one in study["volumes"]}
    for found in study["objects"]:
        write(
            f"{found['name']}: {found['triangles']} triangles, hit by "
            f"{found['hit_share']:.1%} of {study['rays']} random rays\n"
            "  volume    fit ms   ns / 16 rays      area   tightness   false hits / ray\n"
        )
        for row in found["rows"]:
            write(
                f"  {row['volume']:7s} {row['fit_ms']:8.2f}"
                f" {nanoseconds[row['volume']]:14.1f} {row['area']:9.4g}"
                f" {row['tightness']:11.1%} {row['false_hits_per_ray']:18.4f}\n"
            )
    return 0
