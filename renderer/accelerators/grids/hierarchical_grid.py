"""Grids in grids: the cells of a grid hold primitives and finer grids.

The lecture's answer to the teapot in a stadium. `nested_grids.py` and
`clustered_grids.py` build such hierarchies in its two ways; here is what they have in
common: the record, and the rays that walk through it.

A grid is one more item of a cell. A ray that finds one walks through it with the same
steps, to its end or to a hit, and then goes on in the cell where it was: for each level of
nesting it keeps its place [Jevans1989].

Both constructions are sound, and neither is always the better. Cells visited + primitives
tested per ray:

==============================================  ==========  ==========  ==========
scene                                           one grid    nested      clusters
==============================================  ==========  ==========  ==========
mesh of 81,920 triangles, seen from afar        27 + 25     25 + 13     28 + 25
20,000 triangles everywhere                     16 + 17     13 + 22     18 + 17
ten swarms of 2000 triangles, rays at them      26 + 8.5    21 + 0.5    2.8 + 0.5
four spheres in each other, sizes 1 to 400      11 + 288    11 + 14     17 + 14
a ball of 5000 triangles in a stadium           1 + 5002    9.9 + 13    6.9 + 15
==============================================  ==========  ==========  ==========

Clusters cross empty space in the fewest steps. Nested grids need nothing to cluster, and
refine where a mesh is dense.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.grids.grid_cells import Grids
from renderer.accelerators.grids.grid_validation import validate_grids
from renderer.accelerators.grids.grid_walk import (
    AXES,
    LEVELS,
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
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, add_to, note_stack
from renderer.plugins.shapes.extents import Extents


class HierarchicalGrid(NamedTuple):
    """Grids, of which number 0 is the outermost, over n primitives in the scene's order."""

    grids: Grids  # items below n: columns of `primitives`; n + g: grid g
    reach: np.float32  # rays from farther away (|x| + |y| + |z|) test all primitives
    primitives: Any  # a group of one kind


@kernel
def _enter(grids, g, walk, level, t, tally, i):
    """Enter grid g unless it is beyond t; return whether that was done."""
    add_to(tally, BOXES, i, 1)
    lower, size, resolution = grids.lower[g], grids.size[g], grids.resolution[g]
    if not enter_grid(walk, level, lower, size, resolution, np.int64(grids.first[g]), t):
        return False
    add_to(tally, NODES, i, 1)
    note_stack(tally, i, level + 1)
    return True


@trace_ray.by(HierarchicalGrid)
@kernel
def _trace_grids(accel, origin, direction, hit, any_will_do, tally, i):
    """Return the nearest hit of one ray, or the first one found if any will do."""
    grids, primitives = accel.grids, accel.primitives
    start, items, count = grids.start, grids.items, primitives.count
    if not is_ray(origin, direction):
        return hit
    if is_beyond(accel.reach, origin):
        return nearest_of_all(primitives, origin, direction, hit, tally, i)
    mailboxes = local_i32(MAILBOXES)
    clear_mailboxes(mailboxes)
    # of grids: the primitives inside of a grid would soon overwrite it among their own
    entered = local_i32(MAILBOXES)
    clear_mailboxes(entered)
    within = local_i32(LEVELS)  # the grid
    place = local_i32(LEVELS)  # the next item of the cell
    walk = Walk(
        local_f32(3),
        local_f32(3),
        local_f32(3),
        local_i32(AXES),
        local_i32(AXES),
        local_i32(AXES),
        local_f32(AXES),
        local_i32(LEVELS),
        local_f32(LEVELS),
    )
    set_out(walk, origin, direction)
    level, whole = np.int64(-1), np.int64(0)
    if _enter(grids, whole, walk, level + 1, hit.t, tally, i):
        level += 1
        within[0] = 0
        place[0] = start[walk.cell[0]]
    while level >= 0:
        # the primitives of the cell come before its grids
        k, end = np.int64(place[level]), np.int64(start[walk.cell[level] + 1])
        while k < end and items[k] < count:
            if not already_tested(mailboxes, items[k], tally, i):
                add_to(tally, PRIMITIVES, i, 1)
                hit = nearer(primitives, items[k], origin, direction, hit)
            k += 1
        if any_will_do != 0 and hit.prim >= 0:
            break
        place[level] = k + 1
        if k < end:
            g = np.int64(items[k]) - count
            known = already_tested(entered, g, None, i)
            if not known and _enter(grids, g, walk, level + 1, hit.t, tally, i):
                level += 1
                within[level] = g
                place[level] = start[walk.cell[level]]
            continue

        g = np.int64(within[level])
        if step(walk, level, grids.lower[g], grids.size[g]) and walk.entry[level] <= hit.t:
            add_to(tally, NODES, i, 1)
            place[level] = start[walk.cell[level]]
        else:
            level -= 1
    return hit


def validate_hierarchical_grid(accel: HierarchicalGrid, extents: Extents) -> None:
    """Check that each primitive is where rays look for it, through whatever grids.

    Raises
    ------
    ValueError
        If not; the message says which grid, cell and primitive.
    """
    validate_grids(accel.grids, extents)
