"""Which triangle of a mesh covers a point (u, v): a grid over the texture coordinates."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.columns import gather_columns
from renderer.kernels.lanes.functions import (
    fabs,
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
from renderer.kernels.lanes.vectors import cross, length
from renderer.plugins.shapes.surface import UvPoint, gather_flat
from renderer.scene_file.meshes.uv_grid import uv_grid

_ROUNDING = np.float32(-1e-6)  # so that no point falls between two triangles


class UvChart(NamedTuple):
    """Columns by light id; the cells of all lights, row by row."""

    corner: NDArray[np.float32]  # (2, n) least u and v
    scale: NDArray[np.float32]  # (2, n) cells per unit
    cells: NDArray[np.int32]  # (n,) along each axis
    first: NDArray[np.int32]  # (n,) first cell
    start: NDArray[np.int32]  # (cells + 1,) where the list of a cell begins
    triangles: NDArray[np.int32]  # (entries,) columns of the surfaces


def uv_chart(count: int, triangles: Any, meshes: dict[int, NDArray[np.int32]]) -> UvChart:
    """Return the charts of mesh lights from the primitive ids of each."""
    corner, scale = np.zeros((2, count), np.float32), np.zeros((2, count), np.float32)
    cells, firsts = np.ones(count, np.int32), np.zeros(count, np.int32)
    starts: list[NDArray[np.int64]] = []
    entries: list[NDArray[np.int64]] = []
    total = listed = 0
    for light, ids in meshes.items():
        columns = ids - triangles.first
        corners = triangles.uvs[:, columns].T.astype(np.float64).reshape(-1, 3, 2)
        grid = uv_grid(corners)
        corner[:, light], scale[:, light] = grid.low, grid.scale
        cells[light], firsts[light] = grid.cells, total
        starts.append(grid.start[:-1] + listed)
        entries.append(columns[grid.entries])
        total += grid.cells**2
        listed += len(grid.entries)
    start = np.append(np.concatenate(starts), listed)
    return UvChart(
        corner,
        scale,
        cells,
        firsts,
        start.astype(np.int32),
        np.concatenate(entries).astype(np.int32),
    )


@kernel
def _cell(chart, light, row, x, mask):
    """Return the cell along one axis, at -1 where x is outside."""
    low = gather_row(chart.corner, row, light, mask)
    place = (x - low) * gather_row(chart.scale, row, light, mask)
    most = gather_row(chart.cells, 0, light, mask)
    inside = (place > -1e-3) & (place < to_f32(most) + 1e-3)
    cell = minimum(maximum(to_i32(place), splat_i32(0)), most - 1)
    return cell, inside


@kernel
def point_of_mesh(triangles, chart, light, prim, orientation, u, v, mask):
    """Try the triangles of a cell in turn; the first that covers the point has it."""
    column, inside = _cell(chart, light, 0, u, mask)
    row, between = _cell(chart, light, 1, v, mask)
    within = mask & inside & between
    cells = gather_row(chart.cells, 0, light, mask)
    cell = gather_row(chart.first, 0, light, mask) + row * cells + column
    k = gather_row(chart.start, 0, cell, within)
    end = gather_row(chart.start, 0, cell + 1, within)
    index = splat_i32(0)
    b1, b2, det_found = splat_f32(0.0), splat_f32(0.0), splat_f32(1.0)
    found = within & ~within
    trying = within & (k < end)
    while mask_bits(trying) != 0:
        triangle = gather_row(chart.triangles, 0, k, trying)
        u0, v0, u1, v1 = gather_columns(triangles.uvs, 0, triangle, trying)
        _, _, u2, v2 = gather_columns(triangles.uvs, 2, triangle, trying)
        du1, dv1, du2, dv2 = u1 - u0, v1 - v0, u2 - u0, v2 - v0
        det = du1 * dv2 - dv1 * du2
        a, b = u - u0, v - v0
        inverse = 1.0 / select(det != 0.0, det, splat_f32(1.0))
        x = (a * dv2 - b * du2) * inverse
        y = (b * du1 - a * dv1) * inverse
        covers = (x >= _ROUNDING) & (y >= _ROUNDING) & (x + y <= 1.0 - _ROUNDING)
        covers = trying & covers & (det != 0.0)
        b1, b2 = select(covers, x, b1), select(covers, y, b2)
        det_found = select(covers, det, det_found)
        index = select(covers, triangle, index)
        found = found | covers
        k = k + 1
        trying = trying & ~covers & (k < end)
    p = gather_flat(triangles, index, found)
    position = p.corner + p.edge1 * b1 + p.edge2 * b2
    area = length(cross(p.edge1, p.edge2)) / fabs(det_found)
    return UvPoint(position, p.normal * orientation, area, found)
