"""Uniform grid: space in equal cells, each with the list of what lies in it.

A ray visits the cells along its way, in order [Amanatides1987], and tests what they hold;
it stops at a hit before the next cell. The number of cells is proportional to that of the
primitives [Cleary1988]. A primitive lies in each cell that it meets, so a ray would test
it again and again; mailboxes remember the tests of a ray, and can be left out to show what
they save. Cells are all alike: in a teapot in a stadium, one of them holds the teapot.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.grids.grid_cells import (
    MOST_COPIES,
    Grids,
    count_in_grid,
    covers_of,
    enclose,
    make_grids,
    pad_of,
    write_grid,
)
from renderer.accelerators.grids.grid_resolution import DENSITY, cell_count
from renderer.accelerators.grids.grid_validation import validate_grids
from renderer.accelerators.grids.grid_walk import (
    Walk,
    enter_grid,
    is_beyond,
    is_ray,
    set_out,
    step,
)
from renderer.accelerators.rays.ray_by_ray import trace_ray
from renderer.accelerators.rays.single_ray import (
    MAILBOXES,
    already_tested,
    clear_mailboxes,
    nearer,
    nearest_of_all,
)
from renderer.kernels.jit import builder_kernel, kernel
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, add_to
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup


class UniformGrid(NamedTuple):
    """One grid of equal cells, and the primitives in the scene's order."""

    lower: NDArray[np.float32]  # (3,) corner with the smallest x, y, z
    size: NDArray[np.float32]  # (3,) edges of a cell
    resolution: NDArray[np.int32]  # (3,) number of cells along x, y, z
    start: NDArray[np.int32]  # (cells + 1,) where the items of a cell begin; x fastest
    items: NDArray[np.int32]  # columns of `primitives`, ascending in each cell
    reach: np.float32  # rays from farther away (|x| + |y| + |z|) test all primitives
    mailboxed: int | None  # how many tests a ray remembers; None: it has no mailboxes
    primitives: Any  # a group of one kind


def build_uniform_grid(
    extents: Extents,
    group: PrimitiveGroup,
    mailboxed: int | None = MAILBOXES,
    density: float = DENSITY,
) -> UniformGrid:
    """Sort the primitives into cells.

    Parameters
    ----------
    mailboxed
        None for rays without mailboxes: they test a primitive in each cell they find it in.
    density
        Cells for each primitive; fewer where cells would hold more than `MOST_COPIES` of
        each on the average. So memory is at most 144 bytes for each primitive.
    """
    count = extents.lower.shape[1]
    grids = _build(covers_of(extents), pad_of(extents), density)
    return UniformGrid(
        grids.lower[0],
        grids.size[0],
        grids.resolution[0],
        grids.start,
        grids.items,
        np.float32(extents.reach),
        mailboxed,
        group(np.arange(count)),
    )


def build_uniform_grid_without_mailboxes(
    extents: Extents, group: PrimitiveGroup
) -> UniformGrid:
    """Build the same grid, to show what mailboxes save."""
    return build_uniform_grid(extents, group, None)


@builder_kernel
def _build(covers, pad, density):
    """Return a single grid over all covers."""
    columns = np.arange(len(covers)).astype(np.int32)
    low, high = np.empty(3), np.empty(3)
    enclose(covers, columns, pad, low, high)
    room = make_grids(1, max(np.int64(density * len(covers)), 1), 0)
    room.first[0] = 0
    most = max(MOST_COPIES, density) * len(covers)
    total = count_in_grid(room, 0, covers, columns, low, high, density, pad, most)
    start = room.start[: cell_count(room.resolution[0]) + 1].copy()
    items = np.empty(total, np.int32)
    grids = Grids(room.lower, room.size, room.resolution, room.first, start, items)
    start[-1] = write_grid(grids, 0, covers, columns, 0)
    return grids


@trace_ray.by(UniformGrid)
@kernel
def _trace_grid(grid, origin, direction, hit, any_will_do, tally, i):
    """Return the nearest hit of one ray, or the first one found if any will do."""
    return _hit_in_grid(grid, grid.mailboxed, origin, direction, hit, any_will_do, tally, i)


@kernel
def _hit_in_grid(grid, mailboxed, origin, direction, hit, any_will_do, tally, i):
    """Trace one ray.

    `mailboxed` is an argument of its own because only then Numba sees at compile time
    that it is None.
    """
    primitives = grid.primitives
    if not is_ray(origin, direction):
        return hit
    if is_beyond(grid.reach, origin):
        return nearest_of_all(primitives, origin, direction, hit, tally, i)
    if mailboxed is None:
        mailboxes = None
    else:
        mailboxes = local_i32(MAILBOXES)
    clear_mailboxes(mailboxes)
    walk = Walk(
        local_f32(3),
        local_f32(3),
        local_f32(3),
        local_i32(3),
        local_i32(3),
        local_i32(3),
        local_f32(3),
        local_i32(1),
        local_f32(1),
    )
    set_out(walk, origin, direction)
    add_to(tally, BOXES, i, 1)
    lower, size = grid.lower, grid.size
    level = np.int64(0)  # there is one grid, and its cells are all cells
    inside = enter_grid(walk, level, lower, size, grid.resolution, level, hit.t)
    # A cell that begins at a hit's t may hold one of smaller id at the same t.
    while inside and walk.entry[0] <= hit.t:
        add_to(tally, NODES, i, 1)
        cell = walk.cell[0]
        for k in range(grid.start[cell], grid.start[cell + 1]):
            item = grid.items[k]
            if not already_tested(mailboxes, item, tally, i):
                add_to(tally, PRIMITIVES, i, 1)
                hit = nearer(primitives, item, origin, direction, hit)
        if any_will_do != 0 and hit.prim >= 0:
            break
        inside = step(walk, level, lower, size)
    return hit


def validate_uniform_grid(grid: UniformGrid, extents: Extents) -> None:
    """Check that the cells are in order and that each primitive is where rays look for it.

    Raises
    ------
    ValueError
        If not; the message says which cell and which primitive.
    """
    first = np.zeros(1, np.int32)
    rows = grid.lower[None], grid.size[None], grid.resolution[None]
    validate_grids(Grids(*rows, first, grid.start, grid.items), extents)
