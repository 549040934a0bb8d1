"""Volumes: numbers between the centres of a grid's cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from renderer.errors import SceneError
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    floor,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import affine_of, times, vec3
from renderer.kernels.records.media import Grids
from renderer.scene_file.media_description import GridVolume

_FAR = np.float32(2.0**30)


_WRAPS = {"clamp": 0, "repeat": 1, "mirror": 2}
_MOST = 2**31 - 1  # numbers of all grids together: kernels count in 32 bits


def grid_tables(grids: Sequence[GridVolume]) -> Grids:
    """Return grids as tables, columns in their order.

    Raises
    ------
    SceneError
        If they have too many numbers together.
    """
    sizes = [grid.values.size for grid in grids]
    if sum(sizes) > _MOST:
        raise SceneError(
            f"the grids of the media have {sum(sizes)} numbers; {_MOST} are possible"
        )
    rows = []
    for grid in grids:
        inverse = np.linalg.inv(grid.to_world)
        counts = np.array(grid.values.shape[2::-1])
        scaled = inverse[:3] * counts[:, None]
        rows.append(np.concatenate((scaled[:, :3].ravel(), scaled[:, 3])))
    shapes = [grid.values.shape for grid in grids]
    size = np.array([shape[2::-1] for shape in shapes] or [(1, 1, 1)], np.int32)
    return Grids(
        np.concatenate([*rows, np.zeros(16)]).astype(np.float32),
        np.ascontiguousarray(size.T),
        np.array([*(shape[3] for shape in shapes), 1], np.int32),
        np.cumsum([0, *sizes]).astype(np.int32),
        np.array([*(grid.filter_type == "nearest" for grid in grids), 0], np.int32),
        np.array([*(_WRAPS[grid.wrap_mode] for grid in grids), 0], np.int32),
        np.concatenate([*(grid.values.ravel() for grid in grids), np.zeros(16, "f4")]),
    )


@kernel
def _bounded(x):
    """Return a coordinate of cells, bounded so that it is a whole number of 32 bits."""
    return minimum(maximum(x, splat_f32(-_FAR)), splat_f32(_FAR))


@kernel
def _cell(place, count, wrap):
    """Return the cell at a place on an axis, which may lie beyond the grid."""
    last = count - 1
    clamped = minimum(maximum(place, splat_f32(0.0)), to_f32(last))
    size = to_f32(count)
    period = select(wrap == np.int32(2), size * 2.0, size)
    turn = place - floor(place / period) * period  # place modulo the period
    mirrored = select(turn >= size, period - 1.0 - turn, turn)
    cell = to_i32(select(wrap == np.int32(0), clamped, mirrored))
    return select(cell < 0, splat_i32(0), select(cell > last, last, cell))


class Sizes(NamedTuple):
    """The cells of 16 grids along each axis."""

    x: Any
    y: Any
    z: Any


@kernel
def _numbers_at(grids, first, step, place, sizes, wrap, mask):
    """Return one channel of the cells at 16 places."""
    x = _cell(place.x, sizes.x, wrap)
    y = _cell(place.y, sizes.y, wrap)
    z = _cell(place.z, sizes.z, wrap)
    cell = (z * sizes.y + y) * sizes.x + x
    return gather_row(grids.values, 0, first + cell * step, mask)


@kernel
def _channel(grids, first, step, place, sizes, wrap, nearest, mask):
    """Return one channel at 16 places in cells, whose centres are at k + 1/2."""
    half = select(nearest, splat_f32(0.0), splat_f32(0.5))
    x, y, z = place.x - half, place.y - half, place.z - half
    low = vec3(floor(x), floor(y), floor(z))
    one = splat_f32(1.0)
    fx = select(nearest, 0.0, x - low.x)
    fy = select(nearest, 0.0, y - low.y)
    fz = select(nearest, 0.0, z - low.z)
    total = splat_f32(0.0)
    for corner in range(8):
        dx, dy, dz = corner & 1, (corner >> 1) & 1, corner >> 2
        weight = (fx if dx else one - fx) * (fy if dy else one - fy)
        weight = weight * (fz if dz else one - fz)
        there = mask & (weight > 0.0)
        if mask_bits(there) == 0:
            continue
        at = vec3(low.x + np.float32(dx), low.y + np.float32(dy), low.z + np.float32(dz))
        number = _numbers_at(grids, first, step, at, sizes, wrap, there)
        total = total + number * select(there, weight, 0.0)
    return total


@kernel
def look_up_grid(grids, grid, position, mask):
    """Return the colours of 16 grids, given by id, at positions in the world.

    One channel is grey. Beyond the cube the wrap mode decides.
    """
    to_cells = affine_of(grids.to_cells, grid, mask)
    place = times(to_cells, position) + to_cells.at
    place = vec3(_bounded(place.x), _bounded(place.y), _bounded(place.z))
    sizes = Sizes(
        gather_row(grids.size, 0, grid, mask),
        gather_row(grids.size, 1, grid, mask),
        gather_row(grids.size, 2, grid, mask),
    )
    first = gather_row(grids.begin, 0, grid, mask)
    step = gather_row(grids.channels, 0, grid, mask)
    wrap = gather_row(grids.wrap, 0, grid, mask)
    nearest = mask & (gather_row(grids.nearest, 0, grid, mask) != 0)
    red = _channel(grids, first, step, place, sizes, wrap, nearest, mask)
    colored = mask & (step > 1)
    if mask_bits(colored) == 0:
        return vec3(red, red, red)
    green = _channel(grids, first + 1, step, place, sizes, wrap, nearest, colored)
    blue = _channel(grids, first + 2, step, place, sizes, wrap, nearest, colored)
    return vec3(red, select(colored, green, red), select(colored, blue, red))
