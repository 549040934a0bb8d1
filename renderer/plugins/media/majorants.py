"""Bounds of the extinction on a coarse grid, and the way of rays through its cells.

One bound for a whole medium makes tentative collisions as frequent everywhere as in its
densest place. A cell has bounds of its own, and a ray goes from cell to cell as through a
uniform grid [Amanatides1987].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    fabs,
    floor,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import gather_rows3, select3, vec3
from renderer.scene_file.media_description import GridVolume, Medium

# Of a cell along an axis, with the largest extinction of the medium; in thinner cells a
# ray would cross more of them than it has collisions.
_DEPTH = 1.0
_MOST = 16  # cells along an axis
_MARGIN = 1e-3  # of a cell: what rounding may put into its neighbour
_ROUNDING = 2.0**-22  # of a coordinate: rays, and the cells themselves, are in float32
_RAISED = 1.0 + 2.0**-20  # of numbers that interpolation may raise by some units
_FAR = np.float32(np.inf)

Array = NDArray[np.float64]


def world_box(to_world: Array) -> Array:
    """Return the corners of the world's box around a placed unit cube, (6,)."""
    corners = np.stack(np.meshgrid(*([[0.0, 1.0]] * 3)), axis=-1).reshape(-1, 3)
    placed = corners @ to_world[:3, :3].T + to_world[:3, 3]
    return np.concatenate((placed.min(axis=0), placed.max(axis=0)))


def cell_bounds(medium: Medium) -> tuple[NDArray[np.int64], Array]:
    """Return cells along x, y, z of a heterogeneous medium, and their bounds.

    Returns
    -------
    size : ndarray of shape (3,)
    bounds : ndarray of shape (2, cells)
        Largest and smallest extinction [1/length] of any colour; x is fastest.
    """
    volume = medium.sigma_t
    if not isinstance(volume, GridVolume):
        colors = np.multiply(medium.scale, volume.rgb)
        return np.ones(3, np.int64), np.array([[colors.max()], [colors.min()]])
    box = world_box(volume.to_world)
    low, extent = box[:3], box[3:] - box[:3]
    depth = medium.scale * volume.maximum * extent
    size = np.clip(np.ceil(depth / _DEPTH), 1, _MOST).astype(np.int64)
    largest, smallest = volume.values.max(axis=3), volume.values.min(axis=3)
    cells = np.array(largest.shape[::-1])
    inverse = np.linalg.inv(volume.to_world)
    scaled, moved = inverse[:3, :3] * cells[:, None], inverse[:3, 3] * cells
    half = 0.5 * extent / size
    rounded = half + np.abs(box).max() * _ROUNDING
    reach = np.abs(scaled) @ rounded * (1.0 + _MARGIN) + _MARGIN
    shift = 0.0 if volume.filter_type == "nearest" else 0.5
    bounds = np.empty((2, int(np.prod(size))))
    for k, (z, y, x) in enumerate(np.ndindex(*size[::-1])):
        centre = scaled @ (low + (2 * np.array([x, y, z]) + 1) * half) + moved
        first = np.floor(centre - reach - shift).astype(np.int64)
        last = np.floor(centre + reach - shift).astype(np.int64) + (shift > 0.0)
        if volume.wrap_mode != "clamp":  # beyond the cube everything may come again
            beyond = (first < 0) | (last >= cells)
            first, last = np.where(beyond, 0, first), np.where(beyond, cells, last)
        first, last = np.clip([first, last], 0, cells - 1)
        part = tuple(slice(a, b + 1) for a, b in zip(first[::-1], last[::-1], strict=True))
        bounds[:, k] = largest[part].max(), smallest[part].min()
    return size, medium.scale * bounds * [[_RAISED], [1.0 / _RAISED]]


# ---------------------------------------------------------------------------------- walk


class Cells(NamedTuple):
    """Where 16 rays are: their cells, and how they go on."""

    cell: Any  # column of `Media.cells`
    exit: Any  # distances to the next boundary along x, y, z
    width: Any  # distances from boundary to boundary
    stride: Any  # columns to the neighbour along x, y, z


@kernel
def _axis(origin, direction, low, high, count):
    """Return the cell along one axis, and the distances to its boundary and across."""
    cells = to_f32(count)
    scale = cells / (high - low)
    place = (origin - low) * scale
    cell = minimum(maximum(floor(place), splat_f32(0.0)), cells - 1.0)
    rate = direction * scale
    still = rate == 0.0
    inverse = 1.0 / select(still, splat_f32(1.0), rate)
    ahead = select(rate > 0.0, cell + 1.0, cell)
    left = maximum((ahead - place) * inverse, splat_f32(0.0))
    width = fabs(inverse)
    return (
        to_i32(cell),
        select(still, splat_f32(_FAR), left),
        select(still, splat_f32(_FAR), width),
        select(rate > 0.0, splat_i32(1), splat_i32(-1)),
    )


@kernel
def enter_cells(media, medium, origin, direction, mask):
    """Return the cells in which rays start."""
    low = gather_rows3(media.box, 0, medium, mask)
    high = gather_rows3(media.box, 3, medium, mask)
    nx = gather_row(media.cells_along, 0, medium, mask)
    ny = gather_row(media.cells_along, 1, medium, mask)
    nz = gather_row(media.cells_along, 2, medium, mask)
    begin = gather_row(media.cells_begin, 0, medium, mask)
    one = splat_f32(1.0)
    high = select3(mask, high, vec3(one, one, one))  # no division of 0 by 0
    x, exit_x, width_x, step_x = _axis(origin.x, direction.x, low.x, high.x, nx)
    y, exit_y, width_y, step_y = _axis(origin.y, direction.y, low.y, high.y, ny)
    z, exit_z, width_z, step_z = _axis(origin.z, direction.z, low.z, high.z, nz)
    return Cells(
        begin + (z * ny + y) * nx + x,
        vec3(exit_x, exit_y, exit_z),
        vec3(width_x, width_y, width_z),
        vec3(step_x, step_y * nx, step_z * nx * ny),
    )


@kernel
def way_out(cells):
    """Return the distances at which rays leave their cells."""
    return minimum(cells.exit.x, minimum(cells.exit.y, cells.exit.z))


@kernel
def cross(cells, media, mask):
    """Move the masked rays on to the next cell of their way."""
    there = way_out(cells)
    x = mask & (cells.exit.x <= there)
    y = mask & ~x & (cells.exit.y <= there)
    z = mask & ~x & ~y
    zero = splat_i32(0)
    stride = select(x, cells.stride.x, zero) + select(y, cells.stride.y, zero)
    cell = cells.cell + stride + select(z, cells.stride.z, zero)
    last = splat_i32(np.int32(media.cells.shape[1] - 1))
    cell = select(cell < 0, zero, select(cell > last, last, cell))
    ahead = vec3(
        cells.exit.x + select(x, cells.width.x, 0.0),
        cells.exit.y + select(y, cells.width.y, 0.0),
        cells.exit.z + select(z, cells.width.z, 0.0),
    )
    return Cells(cell, ahead, cells.width, cells.stride)
