"""Octree: space cut into eight equal cells, and these again where it is crowded.

The lecture's adaptive subdivision: a cell is cut while it holds too many primitives and the
depth allows. A ray meets at most four of the eight children. The order in which it meets
the three planes between them is the order of the children: each plane takes it into the
neighbour on that axis [Gargantini1993].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.octree_and_bsp.octree_build import EMPTY, build_octree_arrays
from renderer.accelerators.octree_and_bsp.octree_checks import validate_octree_arrays
from renderer.accelerators.rays.ray_by_ray import trace_ray
from renderer.accelerators.rays.ray_interval import interval_in_box, starts_beyond
from renderer.accelerators.rays.single_ray import nearest_in_range, nearest_of_all
from renderer.accelerators.references import boxes_of, hulls_of
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.records.tally import BOXES, NODES, add_to, note_stack
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

STACK = 64  # three more a level than it is deep, at most 16 levels


class Octree(NamedTuple):
    """Blocks of eight sibling cells, and the leaves' primitives."""

    bounds: NDArray[np.float32]  # (6,) of all primitives: lower x y z, upper x y z
    centre: NDArray[np.float32]  # (blocks, 3) where the cells of a block meet
    # (1 + 8 blocks,) the root, then the cells of block b from 1 + 8 b on, by 4 z + 2 y + x
    # where 1 is above the centre. Inner cells: their block; leaf l: -1 - l.
    link: NDArray[np.int32]
    first: NDArray[np.int32]  # (leaves + 1,) leaf l holds items[first[l] : first[l + 1]]
    items: NDArray[np.int32]  # columns of the builder's primitives; leaf 0 has none
    primitives: Any  # a group of one kind: the primitives that `items` names
    reach: float  # rays from beyond test all primitives


def build_octree(extents: Extents, group: PrimitiveGroup) -> Octree:
    """Build from a cube around all primitives."""
    boxes = boxes_of(extents)
    low, high = boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)
    centre, half = 0.5 * low + 0.5 * high, (0.5 * high - 0.5 * low).max()
    cube = np.concatenate((centre - half, centre + half)).astype(np.float32)
    arrays = build_octree_arrays(boxes, hulls_of(extents), cube)
    columns = arrays[-1].astype(np.int64)
    bounds = np.concatenate((low, high))
    return Octree(bounds, *arrays, group(columns), extents.reach)


def validate_octree(tree: Octree, extents: Extents) -> None:
    """Check that a tree is one and that each cell holds whatever reaches into it.

    Raises
    ------
    ValueError
        If not; the message says which cell or leaf, and what is wrong with it.
    """
    validate_octree_arrays(tree, extents)


# ------------------------------------------------------------------------ the traversal


@trace_ray.by(Octree)
@kernel
def _trace_octree(tree, origin, direction, hit, any_will_do, tally, i):
    """Return the nearest hit of one ray, or the first one found if any will do."""
    primitives = tree.primitives
    if starts_beyond(tree.reach, origin):
        return nearest_of_all(primitives, origin, direction, hit, tally, i)
    inverse = np.float32(1.0) / direction
    enter, leave = interval_in_box(tree.bounds, origin, inverse, hit.t)
    if not enter <= leave:
        return hit
    waiting = local_i32(STACK)
    starts, ends = local_f32(STACK), local_f32(STACK)
    depth = 0
    link = np.int64(tree.link[0])
    while True:
        add_to(tally, NODES, i, 1)
        if link >= 0:
            add_to(tally, BOXES, i, 3)
            depth = _push_children(
                tree, link, origin, inverse, enter, leave, waiting, starts, ends, depth
            )
            note_stack(tally, i, depth)
        else:
            begin, end = np.int64(tree.first[-1 - link]), np.int64(tree.first[-link])
            hit = nearest_in_range(primitives, begin, end, origin, direction, hit, tally, i)
        depth -= 1
        if depth < 0 or starts[depth] > hit.t or (any_will_do != 0 and hit.prim >= 0):
            return hit
        link, enter, leave = np.int64(waiting[depth]), starts[depth], ends[depth]


@kernel
def _push_children(
    tree, block, origin, inverse, enter, leave, waiting, starts, ends, depth
):
    """Push the children that a ray meets from `enter` to `leave`, the nearest last.

    Returns how many cells wait now. It does not matter to which side a point within
    rounding of a plane goes, for what lies there is in the cells on both: so neither do
    equal distances, nor the NaN of a ray in the plane (0 * inf).
    """
    octant, x, y, z = 0, leave, leave, leave
    octant, x = _cut(tree.centre[block, 0], origin.x, inverse.x, enter, leave, octant, 1)
    octant, y = _cut(tree.centre[block, 1], origin.y, inverse.y, enter, leave, octant, 2)
    octant, z = _cut(tree.centre[block, 2], origin.z, inverse.z, enter, leave, octant, 4)

    # the planes in the order in which the ray meets them
    a, b, c = 1, 2, 4
    if y < x:
        x, y, a, b = y, x, b, a
    if z < y:
        y, z, b, c = z, y, c, b
    if y < x:
        x, y, a, b = y, x, b, a

    child = 1 + 8 * block
    last = octant ^ a ^ b ^ c
    depth = _push(tree.link[child + last], z, leave, waiting, starts, ends, depth)
    depth = _push(tree.link[child + (last ^ c)], y, z, waiting, starts, ends, depth)
    depth = _push(tree.link[child + (octant ^ a)], x, y, waiting, starts, ends, depth)
    return _push(tree.link[child + octant], enter, x, waiting, starts, ends, depth)


@kernel
def _cut(plane, start, inverse, enter, leave, octant, bit):
    """Return the octant a ray starts in, as to one plane, and where it changes sides.

    That is `leave` if it does not.
    """
    cut = (plane - start) * inverse
    if inverse < 0.0:
        octant ^= bit
    if cut < leave:
        if cut > enter:
            return octant, cut
        octant ^= bit
    return octant, leave


@kernel
def _push(link, enter, leave, waiting, starts, ends, depth):
    """Let a child wait, unless it is empty or the ray is not in it."""
    if link == EMPTY or not enter < leave:
        return depth
    waiting[depth] = link
    starts[depth] = enter
    ends[depth] = leave
    return depth + 1
