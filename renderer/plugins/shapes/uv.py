"""Texture coordinates of shapes, and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import (
    fabs,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_columns, gather_row
from renderer.kernels.lanes.vectors import affine_of, cross, gather3, length, times
from renderer.plugins.shapes.primitives import float32
from renderer.plugins.shapes.surface import UvPoint, gather_flat
from renderer.scene_file.meshes.mesh_data import uv_grid

# ----------------------------------------------------------------------------- uv chart
# Finds the triangle of a mesh that covers (u, v): a uniform grid over texture space.

_ROUNDING = np.float32(-1e-6)  # tolerance, so that no (u, v) falls between two triangles


class UvChart(NamedTuple):
    """Grids over texture space; columns by light id, the cells of all lights row by row."""

    corner: NDArray[np.float32]  # (2, n) smallest u and v
    scale: NDArray[np.float32]  # (2, n) cells per unit
    cells: NDArray[np.int32]  # (n,) number of cells along each axis
    first: NDArray[np.int32]  # (n,) first cell
    start: NDArray[np.int32]  # (cells + 1,) first entry of each cell in `triangles`
    triangles: NDArray[np.int32]  # (entries,) columns of the surface table


def uv_chart(count: int, triangles: Any, meshes: dict[int, NDArray[np.int32]]) -> UvChart:
    """Return the grids of mesh lights; `meshes` has the primitive ids of each light."""
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
    """Return the clamped cell index along one axis, and the mask of x in the grid."""
    low = gather_row(chart.corner, row, light, mask)
    place = (x - low) * gather_row(chart.scale, row, light, mask)
    most = gather_row(chart.cells, 0, light, mask)
    inside = (place > -1e-3) & (place < to_f32(most) + 1e-3)
    cell = minimum(maximum(to_i32(place), splat_i32(0)), most - 1)
    return cell, inside


@kernel
def point_of_mesh(triangles, chart, light, prim, orientation, u, v, mask):
    """Return the point in the first triangle of the cell that covers (u, v)."""
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


# ----------------------------------------------------------------------- uv derivatives
# dp/du and dp/dv at points of shapes: the size of texels on the surface, for bump maps.
#
# Only scenes with bump maps use them. The tangent of a shading frame, which each bounce
# needs, is cheaper; its length has no meaning (`tangent_at`).


class ByPrimitive(NamedTuple):
    """Primitives first .. end - 1 by id, with constant derivatives on each."""

    first: int
    end: int
    along_u: NDArray[np.float32]  # (3, n)
    along_v: NDArray[np.float32]  # (3, n)


class ByPlace(NamedTuple):
    """Shapes first .. end - 1 whose derivatives depend on the local point.

    The matrices have the layout of `Placements.to_world`.
    """

    first: int
    end: int
    surfaces: Any  # the table of the kind; its class selects `uv_axes`
    to_world: NDArray[np.float32]  # (12 n,)
    to_object: NDArray[np.float32]  # (12 n,)


def no_derivatives(surfaces: Any, shapes: Sequence[Any]) -> ByPrimitive:
    """Return zeros, for kinds without u and v: bump maps have no effect there."""
    nothing = np.zeros((3, surfaces.end - surfaces.first), np.float32)
    return ByPrimitive(surfaces.first, surfaces.end, nothing, nothing)


def derivatives_by_place(surfaces: Any, shapes: Sequence[Any]) -> ByPlace:
    """Return the object-to-world matrices of shapes, and their inverses.

    For shapes whose dp/du and dp/dv follow from the local hit point (`uv_axes`).
    """
    maps = np.array([shape.to_world for shape in shapes], float)
    back = np.linalg.inv(maps)
    back[:, :3, 3] = maps[:, :3, 3]
    rows = (
        np.ascontiguousarray(
            np.concatenate([m[:, :3, :3].reshape(-1, 9), m[:, :3, 3]], axis=1).ravel(),
            np.float32,
        )
        for m in (maps, back)
    )
    return ByPlace(surfaces.first, surfaces.end, surfaces, *rows)


def derivatives_of_triangles(triangles: Any, meshes: Sequence[Any]) -> ByPrimitive:
    """Return dp/du and dp/dv; unit vectors, as in Mitsuba, where the uv area is 0.

    Without texture coordinates, (u, v) are the barycentric coordinates.
    """
    ids = triangles.first, triangles.end
    edge1, edge2 = triangles.edge1.astype(float), triangles.edge2.astype(float)
    if not triangles.uvs.size:
        return ByPrimitive(*ids, float32(triangles.edge1), float32(triangles.edge2))
    u0, v0, u1, v1, u2, v2 = triangles.uvs.astype(float)
    area = (u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0)
    with np.errstate(all="ignore"):
        along_v = ((u1 - u0) * edge2 - (u2 - u0) * edge1) / area
    _, other = _face_tangents(edge1, edge2)
    along_v = np.where(np.isfinite(along_v).all(axis=0), along_v, other)
    return ByPrimitive(*ids, texture_tangents(triangles), float32(along_v))


def texture_tangents(triangles: Any) -> NDArray[np.float32]:
    """Return dp/du (3, n), not normalised; a unit vector where the uv area is 0.

    Without texture coordinates u is the first barycentric coordinate.
    """
    uvs = triangles.uvs.astype(np.float64)
    if uvs.shape[1] == 0:
        return float32(triangles.edge1)
    edge1, edge2 = triangles.edge1.astype(float), triangles.edge2.astype(float)
    du1, dv1 = uvs[2] - uvs[0], uvs[3] - uvs[1]
    du2, dv2 = uvs[4] - uvs[0], uvs[5] - uvs[1]
    with np.errstate(all="ignore"):
        along_u = (dv2 * edge1 - dv1 * edge2) / (du1 * dv2 - dv1 * du2)
    there = np.isfinite(along_u).all(axis=0)
    other, _ = _face_tangents(edge1, edge2)
    return np.ascontiguousarray(np.where(there, along_u, other), np.float32)


def _face_tangents(
    edge1: NDArray[np.float64], edge2: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two unit vectors along triangles [Duff2017]; 0 for those without area.

    Mitsuba uses these for dp/du and dp/dv where the uv area is 0.
    """
    n = np.cross(edge1, edge2, axis=0)
    length = np.linalg.norm(n, axis=0)
    x, y, z = n / np.where(length > 0.0, length, 1.0)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    s = np.array([1.0 + sign * x * x * a, sign * x * y * a, -sign * x])
    t = np.array([x * y * a, sign + y * y * a, -y])
    return s * (length > 0.0), t * (length > 0.0)


@interface
def uv_derivatives(shapes: Any, index: Any, mask: Any, position: Any) -> Any:
    """Return dp/du and dp/dv in object space at `position`."""


@interface
def uv_axes(surfaces: Any, q: Any, radius: Any) -> Any:
    """Return dp/du and dp/dv of a shape in its own space, at the local point q.

    `radius` is its distance from the z axis, 1 where that is 0.
    """


@uv_derivatives.by(ByPrimitive)
@kernel
def _by_primitive(shapes, index, mask, position):
    return gather3(shapes.along_u, index, mask), gather3(shapes.along_v, index, mask)


@uv_derivatives.by(ByPlace)
@kernel
def _by_place(shapes, index, mask, position):
    back = affine_of(shapes.to_object, index, mask)
    q = times(back, position - back.at)
    radius = sqrt(q.x * q.x + q.y * q.y)
    out = affine_of(shapes.to_world, index, mask)
    du, dv = uv_axes(shapes.surfaces, q, select(radius > 0.0, radius, 1.0))
    return times(out, du), times(out, dv)
