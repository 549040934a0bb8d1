"""Grid of signed distances: the surface where the trilinear interpolant is 0.

The grid fills [0, 1]^3 of object space. Each cell that contains a part of the surface is
a primitive, so every accelerator can traverse the grid. Normals point to larger distances.
`smooth` normals are Mitsuba's, after [HanssonSoderlund2022]: a blend of the gradients of
eight cells, which is continuous across cells.

Two faults of Mitsuba are not reproduced, and the reader warns of them: Mitsuba exchanges
the sizes along x and z, and its world space boxes do not contain rotated cells.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, never_inline
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import vec3
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import float32
from renderer.plugins.shapes.scalar_shapes import (
    INFINITY,
    box_corners,
    hull_of_box,
    in_double,
    matrix_rows,
    placed_point,
    placed_vector,
    points_alone,
    refuse_lamp,
    unit_normal,
    within_box,
)
from renderer.plugins.shapes.sdf_cells import (
    cubic_along,
    first_root_of,
    smooth_gradient,
    trilinear_of,
    value_and_gradient,
)
from renderer.plugins.shapes.surface import (
    ROUNDING,
    SurfacePoint,
    nowhere,
)
from renderer.scene_file.description import SdfGrid
from renderer.scene_file.meshes.grid_file import check_distances, read_grid
from renderer.scene_file.tree import Tensor

_NEAR = 0.25  # largest Newton step in cells; the error of a float32 hit point is far less


class SdfCells(NamedTuple):
    """Cells with primitive ids first .. end - 1, and their grids.

    Kernels scale object space so that grid points have integer coordinates.
    """

    first: int
    end: int
    cell: NDArray[np.int32]  # (n, 3) x, y, z of the lower corner
    corners: NDArray[np.float32]  # (n, 8) see `trilinear_of`
    grid: NDArray[np.int32]  # (n,) index of the cell's grid
    to_world: NDArray[np.float64]  # (12, grids) 3 x 4 matrices, by rows
    to_grid: NDArray[np.float64]  # (12, grids) their inverses
    size: NDArray[np.float32]  # (grids,) largest absolute coordinate in world space
    smooth: NDArray[np.int32]  # (grids,) 1: smooth normals
    points: NDArray[np.int64]  # (grids, 3) grid points along x, y, z
    begin: NDArray[np.int64]  # (grids,) index of the grid's first distance
    distances: NDArray[np.float32]  # (m,) of all grids, x fastest, z slowest


@kernel
def _place(cells, k):
    x, y, z = cells.cell[k, 0], cells.cell[k, 1], cells.cell[k, 2]
    return np.float64(x), np.float64(y), np.float64(z)


@kernel
def hit_cell(cells, k, origin, direction, t_max):
    """Return t of the first hit, see `intersect_scalar`."""
    never_inline()
    if k < 0 or not (t_max > 0.0):
        return INFINITY
    grid = cells.grid[k]
    o = placed_point(cells.to_grid, grid, in_double(origin))
    d = placed_vector(cells.to_grid, grid, in_double(direction))
    x, y, z = _place(cells, k)
    lower, upper = vec3(x, y, z), vec3(x + 1.0, y + 1.0, z + 1.0)
    near, far = within_box(lower, upper, o, d, t_max)
    if near > far:
        return INFINITY
    begin = vec3(o.x + near * d.x - x, o.y + near * d.y - y, o.z + near * d.z - z)
    reach = far - near
    way = vec3(d.x * reach, d.y * reach, d.z * reach)
    s = first_root_of(cubic_along(trilinear_of(cells.corners, k), begin, way))
    rounded = np.float32(near + s * reach)
    return rounded if rounded > 0.0 else INFINITY


@kernel
def point_of_cell(cells, k, hit_point):
    """Return the point after a Newton step along the gradient; a gradient of 0 gives z."""
    never_inline()
    grid = cells.grid[k]
    p = placed_point(cells.to_grid, grid, in_double(hit_point))
    x, y, z = _place(cells, k)
    between_corners = trilinear_of(cells.corners, k)
    value, g = value_and_gradient(between_corners, vec3(p.x - x, p.y - y, p.z - z))
    square = g.x * g.x + g.y * g.y + g.z * g.z
    if square > 0.0 and abs(value) <= _NEAR * np.sqrt(square):
        step = value / square
        p = vec3(p.x - g.x * step, p.y - g.y * step, p.z - g.z * step)
        _, g = value_and_gradient(between_corners, vec3(p.x - x, p.y - y, p.z - z))
    n = unit_normal(cells.to_grid, grid, g, vec3(0.0, 0.0, 1.0))
    shading_normal = n
    if cells.smooth[grid] != 0:
        points = (cells.points[grid, 0], cells.points[grid, 1], cells.points[grid, 2])
        g = smooth_gradient(cells.distances, cells.begin[grid], points, p)
        shading_normal = unit_normal(cells.to_grid, grid, g, n)
    return placed_point(cells.to_world, grid, p), n, shading_normal


@kernel
def _point_on_cell(cells, index, mask, u, v, hit_point, with_uv):
    """Return the point; it has no texture coordinates."""
    position, normal, shading_normal = points_alone(cells, index, mask, hit_point)
    grid = gather_row(cells.grid, 0, index, mask)
    offset = gather_row(cells.size, 0, grid, mask) * ROUNDING
    nothing = normal.x * 0.0
    return SurfacePoint(
        position, normal, shading_normal, ~nowhere(mask), offset, nothing, nothing
    )


@kernel
def _no_tangent(cells, index, mask, u, v, normal):
    """Return 0: there is no u; frames are built from the normal alone."""
    return normal * 0.0


# ------------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> SdfGrid:
    """Read the properties of a file."""
    refuse_lamp(properties, common)
    name, distances = _read_distances(properties)
    if not len(occupied(distances)):
        properties.fail(
            name, "a grid without a surface", "a cell with numbers of either sign"
        )
    to_world = properties.transform("to_world")
    _warn_of_mitsuba(properties, distances, to_world)
    normals = properties.choice("normals", "smooth", ("analytic", "smooth"))
    return SdfGrid(
        **common, to_world=to_world, distances=distances, smooth=normals == "smooth"
    )


def _read_distances(properties: Any) -> tuple[str, NDArray[np.float32]]:
    given = [name for name in ("filename", "grid") if properties.has(name)]
    if len(given) != 1:
        properties.fail(
            "grid" if given else "filename",
            "one together with a file" if given else "nothing",
            "the path of a .vol file; from Python, it may be a grid instead",
        )
    (name,) = given
    if name == "filename":
        return name, properties.file("the grid", "the path of a .vol file", read_grid)
    value = properties.take(name).value
    expected = "an array of shape (z, y, x, 1), at least 2 points along each axis"
    if not isinstance(value, Tensor):
        kind = properties.element.properties[name].kind
        properties.fail(name, f"a value of type {kind}", expected)
    shape = value.values.shape
    if len(shape) != 4 or shape[3] != 1 or min(shape[:3]) < 2:
        properties.fail(name, f"one of shape {shape}", expected)
    with np.errstate(over="ignore", invalid="ignore"):  # reported below
        distances = np.ascontiguousarray(value.values[..., 0], np.float32)
    if (wrong := check_distances(distances)) is not None:
        properties.fail(name, wrong, "finite numbers")
    return name, distances


def _warn_of_mitsuba(properties: Any, distances: Any, to_world: Any) -> None:
    """Warn if Mitsuba shows only a part of the shape."""
    nz, _, nx = distances.shape
    reasons = []
    if nx != nz:
        reasons.append(f"takes the sizes along x and z ({nx} and {nz} points) for another")
    linear = to_world[:3, :3]
    off = np.abs(linear - np.diag(linear.diagonal())).max()
    if off > 1e-6 * np.abs(linear).max() or linear.diagonal().min() < 0.0:
        reasons.append("cuts off parts where to_world does more than scale and move")
    for reason in reasons:
        properties.reading.warn(
            properties.location,
            f"{properties.element}: Mitsuba {reason}; this renderer shows all of it",
        )


def occupied(distances: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return z, y, x of the cells that contain a sign change, (n, 3), in Mitsuba's order.

    A cell whose eight numbers are all 0 is left out: it has no surface to hit.
    """
    low = high = distances
    for axis in range(3):
        there, next_ = (
            (slice(None),) * axis + (slice(*ends),) for ends in ((None, -1), (1, None))
        )
        low = np.minimum(low[there], low[next_])
        high = np.maximum(high[there], high[next_])
    return np.argwhere((low <= 0.0) & (high >= 0.0) & (low < high))


def surfaces(shapes: list[SdfGrid], first: int) -> SdfCells:
    """Return the cells of shapes with primitive ids from `first` on."""
    found = [occupied(shape.distances) for shape in shapes]
    counts = [len(cells) for cells in found]
    points = np.array([shape.distances.shape[::-1] for shape in shapes], np.int64)
    to_world = np.array([shape.to_world for shape in shapes])
    to_world[:, :3, :3] /= (points - 1)[:, None, :]
    sizes = [shape.distances.size for shape in shapes]
    cells = SdfCells(
        first,
        first + sum(counts),
        np.concatenate(found)[:, ::-1].astype(np.int32, order="C"),
        np.concatenate(
            [_corner_values(s.distances, c) for s, c in zip(shapes, found, strict=True)]
        ),
        np.repeat(np.arange(len(shapes), dtype=np.int32), counts),
        *matrix_rows(to_world),
        np.zeros(len(shapes), np.float32),
        np.array([shape.smooth for shape in shapes], np.int32),
        points,
        np.cumsum(sizes) - sizes,
        np.concatenate([shape.distances.ravel() for shape in shapes]),
    )
    ends = (points - 1).T.astype(np.float64)
    whole = box_corners(np.zeros(ends.shape), ends, cells.to_world)
    return cells._replace(size=float32(np.abs(whole).max(axis=(0, 1))))


def _corner_values(distances: Any, cells: Any) -> NDArray[np.float32]:
    z, y, x = cells.T
    steps = ((corner & 1, (corner >> 1) & 1, corner >> 2) for corner in range(8))
    return np.stack([distances[z + c, y + b, x + a] for a, b, c in steps], axis=1)


def _cell_corners(s: SdfCells, order: Any) -> NDArray[np.float64]:
    lower = s.cell[order].T.astype(np.float64)
    return box_corners(lower, lower + 1.0, s.to_world[:, s.grid[order]])


def _corners(s: Any) -> list[NDArray[np.float32]]:
    return [float32(corner) for corner in _cell_corners(s, slice(None))]


def _hull(s: Any, order: Any) -> tuple[Any, Any, Any]:
    return hull_of_box(_cell_corners(s, order))


SDF_CELLS = ShapeKind(
    name="sdf_cells",
    plugins={"sdfgrid": read},
    description=SdfGrid,
    record=SdfCells,
    surfaces=surfaces,
    primitive=None,
    intersect=hit_cell,
    point=point_of_cell,
    surface_point=_point_on_cell,
    tangent=_no_tangent,
    corners=_corners,
    hull=_hull,
    orientation=lambda shape: 1.0,
    faces=lambda shape: np.arange(len(occupied(shape.distances))),
)
