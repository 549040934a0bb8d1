"""Traces rays before a render to find the visibility of an environment by position.

Paths with uniformly random bounces give positions: those that the camera sees, and those
that illuminate them. Then one ray from each cell of a grid around them tests each part of
the sky. The results are averaged over neighbouring cells and parts.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.stages.camera_rays import camera_rays_through
from renderer.integrators.stages.intersect import nearest_hits
from renderer.kernels.jit import Packed, pack
from renderer.kernels.records.batch import (
    CAPACITY,
    TILE_SIZE,
    Tile,
    Workspace,
    make_workspace,
)
from renderer.plugins.lights.envmap import EnvironmentMaps
from renderer.plugins.lights.sky_by_place import Cells, Floats, parts_of_sky
from renderer.plugins.lights.sunsky import SunSkies
from renderer.scene.scene import Scene

MOST_SEEN = 0.25
"""Fraction of the sky's light. If more is visible, such samples would gain little."""
_PATHS, _BOUNCES = 4 * CAPACITY, 3
_MOST_CELLS = 1024
_FINEST = 32  # cells along the longest side of the grid
_FEW = 0.02  # fraction of the positions that may lie outside of the grid on each side
_BACK = np.float32(1e-3)  # offset before a surface, relative to the median distance
# Behind a pane a ray starts at this fraction of its length, and of the coordinates there
_BEHIND, _ROUNDING = np.float32(1e-4), np.float32(4e-7)
_MOST_PANES = 15  # panes that a ray passes at most
_RAYS_TO_SUN = 8

Sky = EnvironmentMaps | SunSkies


class _Tracer(NamedTuple):
    """The scene for tracing visibility rays."""

    groups: NDArray[np.int64]  # methods of the primitives, see `KernelScene`
    work: Workspace
    packed: Packed  # the same
    see_through: NDArray[np.bool_]  # (primitives,) by id


def seen_sky(
    scene: Scene,
    sensor: NDArray[np.int64],
    groups: NDArray[np.int64],
    sky: Sky,
    through_panes: bool,
) -> Sky:
    """Return an environment with the visibility of its parts by position.

    Parameters
    ----------
    scene : Scene
        The scene that occludes it.
    sensor, groups : ndarray
        Methods of the camera and of the primitives.
    sky : EnvironmentMaps or SunSkies
        The environment.
    through_panes : bool
        Whether rays pass up to `_MOST_PANES` surfaces of panes.
    """
    levels, gives = parts_of_sky(sky.warp)
    patches = 2 ** (len(sky.warp.start) - levels)  # along each side of a part
    rng = np.random.Generator(np.random.PCG64(0))

    def towards(parts: NDArray[np.int64]) -> Floats:
        row, column = np.divmod(parts, gives.shape[1])
        u = (column + rng.random(len(parts))) * patches / sky.warp.columns
        v = (row + rng.random(len(parts))) * patches / sky.warp.rows
        return sky.directions(np.minimum(u, 1.0), np.minimum(v, 1.0))

    work = make_workspace(ray_capacity=_PATHS)
    see_through = scene.shapes.pane[scene.shape] != 0
    tracer = _Tracer(groups, work, pack(work), see_through & through_panes)
    places = _places(scene, sensor, tracer, rng)
    if places.shape[1] == 0:
        return sky
    parts = np.flatnonzero(gives)
    # first test some parts, sampled in proportion to their light
    some = rng.choice(parts, _PATHS, p=gives.ravel()[parts])
    looking = places[:, rng.integers(0, places.shape[1], _PATHS)]
    if _see(tracer, looking, towards(some)).mean() > MOST_SEEN:
        return sky
    cells, cell_of_place = _cells(places)
    order = np.argsort(cell_of_place, kind="stable")
    starts = np.searchsorted(cell_of_place[order], np.arange(1, cells.row.max() + 2))
    first, number = starts[:-1], np.diff(starts)
    every = np.arange(len(number))

    def in_cells(cell: NDArray[np.int64]) -> NDArray[np.float32]:
        chosen = first[cell] + (rng.random(len(cell)) * number[cell]).astype(np.int64)
        return places[:, order[chosen]]

    seen = np.zeros((len(every), gives.size))
    pairs = len(every) * len(parts)
    for begin in range(0, pairs, _PATHS):
        part, cell = np.divmod(np.arange(begin, min(begin + _PATHS, pairs)), len(every))
        part = parts[part]
        seen[cell, part] = _see(tracer, in_cells(cell), towards(part))
    sun = np.zeros(len(every))
    if sky.sun_direction is not None:
        to_sun = np.repeat(sky.sun_direction, len(every), axis=1)
        looks = [_see(tracer, in_cells(every), to_sun) for _ in range(_RAYS_TO_SUN)]
        sun = _over_cells(np.mean(looks, axis=0), cells)
    seen = _over_parts(seen.reshape(len(every), *gives.shape), gives)
    return sky.with_places(cells, _over_cells(seen, cells), sun)


def _places(
    scene: Scene, sensor: NDArray[np.int64], tracer: _Tracer, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return points (3, n) slightly before the hits of paths with random bounces."""
    film, work = scene.description.camera.film, tracer.work
    tile = Tile(0, 0, TILE_SIZE, TILE_SIZE, film.width)
    count = 0
    while count < _PATHS:
        across, down = rng.random((2, CAPACITY), np.float32)
        work.film[0, :CAPACITY] = film.crop_offset_x + across * film.crop_width
        work.film[1, :CAPACITY] = film.crop_offset_y + down * film.crop_height
        work.film[2:, :CAPACITY] = rng.random((2, CAPACITY), np.float32)
        count = camera_rays_through(sensor, tile, tracer.packed, count)
    rays, back = work.rays, np.float32(0.0)
    found: list[NDArray[np.float32]] = []
    for _ in range(_BOUNCES + 1):
        nearest_hits(tracer.groups, tracer.packed, count)
        met = work.hits.prim[:count] >= 0
        t = work.hits.t[:count][met]
        if not found and t.size:
            back = _BACK * np.median(t)
        # at least half of the distance: some rays hit their own surface at once
        t = np.maximum(t - back, np.float32(0.5) * t)
        found.append(rays.origin[:, :count][:, met] + t * rays.direction[:, :count][:, met])
        count = len(t)
        rays.origin[:, :count] = found[-1]
        rays.direction[:, :count] = _on_sphere(rng, count)
    return np.concatenate(found, axis=1)


def _on_sphere(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    z, azimuth = 2.0 * rng.random(count) - 1.0, 2.0 * np.pi * rng.random(count)
    across = np.sqrt(1.0 - z * z)
    directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z])
    return directions.astype(np.float32)


def _cells(places: NDArray[np.float32]) -> tuple[Cells, NDArray[np.int64]]:
    """Return a grid around most of the positions, and the row of each position."""
    low, high = np.quantile(places.astype(np.float64), [_FEW, 1.0 - _FEW], axis=1)
    extent = high - low
    extent = np.maximum(extent, 1e-6 * max(np.abs([low, high]).max(), extent.max(), 1e-30))
    low, extent = low - 0.01 * extent, 1.02 * extent
    for along in range(_FINEST, 0, -1):
        width = float(extent.max()) / along
        size = np.ceil(extent / width).astype(np.int64)
        at = (places.T - low) / width
        inside = ((at >= 0.0) & (at < size)).all(axis=1)
        at = np.where(inside[:, None], at, 0.0).astype(np.int64)
        cell = (at[:, 2] * size[1] + at[:, 1]) * size[0] + at[:, 0]
        used = np.unique(cell[inside])
        if len(used) <= _MOST_CELLS:
            break
    row = np.zeros(int(size.prod()), np.int64)
    row[used] = 1 + np.arange(len(used))
    return Cells(low, width, size, row), np.where(inside, row[cell], 0)


def _see(
    tracer: _Tracer, places: NDArray[np.float32], directions: NDArray[np.floating[Any]]
) -> NDArray[np.bool_]:
    """Return whether the sky is visible from each of at most `_PATHS` points (3, n)."""
    rays, hits = tracer.work.rays, tracer.work.hits
    seen = np.zeros(directions.shape[1], bool)
    waiting, origin, directions = (
        np.arange(len(seen)),
        places,
        directions.astype(np.float32),
    )
    for _ in range(_MOST_PANES + 1):
        n = len(waiting)
        rays.origin[:, :n], rays.direction[:, :n] = origin, directions[:, waiting]
        nearest_hits(tracer.groups, tracer.packed, n)
        prim, t = hits.prim[:n], hits.t[:n]
        seen[waiting[prim < 0]] = True
        on = (prim >= 0) & tracer.see_through[prim]
        if not on.any():
            break
        waiting, t, origin = waiting[on], t[on], origin[:, on]
        t = t + _BEHIND * t + _ROUNDING * np.abs(origin).max(axis=0)
        origin = origin + t * directions[:, waiting]
    return seen


def _over_parts(seen: Floats, gives: Floats) -> Floats:
    """Return averages over neighbouring parts of the sky that emit light."""
    weight = np.broadcast_to(gives > 0.0, seen.shape).astype(np.float64)
    total = seen * weight
    columns = int(np.flatnonzero(gives.any(axis=0)).max()) + 1  # periodic
    for axis, size, mode in ((2, columns, "wrap"), (1, gives.shape[0], "constant")):
        total, weight = (_blurred(x, axis, size, mode) for x in (total, weight))
    return np.divide(total, weight, out=np.zeros_like(total), where=weight > 0.0)


def _blurred(x: Floats, axis: int, size: int, mode: Any) -> Floats:
    """Return averages of the first `size` entries along an axis, weights 1, 2, 1."""
    x = np.moveaxis(x.copy(), axis, 0)
    around = np.pad(x[:size], [(1, 1), (0, 0), (0, 0)], mode=mode)
    x[:size] = 0.25 * (around[:-2] + around[2:]) + 0.5 * x[:size]
    return np.moveaxis(x, 0, axis)


def _over_cells(seen: Floats, cells: Cells) -> Floats:
    """Return averages over neighbouring cells; the first axis of `seen` is the cells."""
    rows = cells.row.reshape(cells.size[::-1])
    total, weight = 2.0 * seen, np.full(len(seen), 2.0)
    around = np.pad(rows, 1)
    for axis in range(3):
        for step in (0, 2):
            place = [slice(1, -1)] * 3
            place[axis] = slice(step, step + rows.shape[axis])
            other = around[tuple(place)]
            both = (rows > 0) & (other > 0)
            mine, theirs = rows[both] - 1, other[both] - 1
            total[mine] += seen[theirs]
            weight[mine] += 1.0
    return total / weight.reshape(-1, *(1,) * (seen.ndim - 1))
