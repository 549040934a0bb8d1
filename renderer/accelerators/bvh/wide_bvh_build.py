"""From a binary tree to the two forms that are fast to trace: pairs, and nodes of eight.

`pack_pairs` lays siblings side by side, 64 bytes a pair: one cache line. `collapse` pulls
up to eight descendants into one node of 128 bytes: two lines.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.extents import Extents
from renderer.jit import builder_kernel, entry_kernel, kernel
from renderer.kinds.shapes.blocks import WIDTH, aligned_bytes
from renderer.lanes.local import local_i32

# words of a node of a pair
PAIR_CHILD = 6  # inner: first of two adjacent nodes; leaf: first primitive
PAIR_COUNT = 7  # leaf: primitives; inner: -1 - order, see `_order_of`
PAIR_WORDS = 8

# words of a wide node, then its bytes
ORIGIN = 0  # 3 floats: where byte 0 is
SCALE = 3  # 3 floats: what a byte counts, a power of two
CHILD = 6  # 8 integers: 0 nothing, > 0 a node, < 0 the block ~child
WIDE_WORDS = 32
BOX_BYTES = 56  # byte offset; for each axis 8 lower bounds, 8 upper bounds, 8 lower bounds
AXIS_BYTES = 24
WIDE_BYTES = 128

# Covers the rounding in here. The traversal's own is at most half a unit in the last place
# of a coordinate, an eighth of a byte's unit; the 32 of `primitive_bounds` hold it.
_SLACK = 2.0**-10
_LARGEST_BYTE = 250.0  # leaves room for the rounding of the origin


def pack_pairs(bounds: Any, child: Any, count: Any) -> NDArray[np.uint8]:
    """Return the nodes of a binary tree in pairs; the root is alone in the first.

    Parameters
    ----------
    bounds, child, count
        As in `BvhTree`; siblings are adjacent, the first pair is nodes 1 and 2.
    """
    memory = aligned_bytes(4 * PAIR_WORDS * (len(count) + 1))
    _pack(bounds, child, count, memory.view(np.float32), memory.view(np.int32))
    return memory


@entry_kernel
def _pack(bounds, child, count, floats, integers):
    for node in range(len(count)):
        to = PAIR_WORDS * (node + 1 if node > 0 else 0)
        for j in range(6):
            floats[to + j] = bounds[node, j]
        if count[node] > 0:
            integers[to + PAIR_CHILD] = child[node]
            integers[to + PAIR_COUNT] = count[node]
        else:
            integers[to + PAIR_CHILD] = child[node] + 1
            integers[to + PAIR_COUNT] = -1 - _order_of(bounds, child[node])


@kernel
def _order_of(bounds, first):
    """Return 2 * the axis that separates two siblings + whether the second comes first."""
    best = -1.0
    order = 0
    for axis in range(3):
        a = np.float64(bounds[first, axis]) + np.float64(bounds[first, axis + 3])
        b = np.float64(bounds[first + 1, axis]) + np.float64(bounds[first + 1, axis + 3])
        if abs(b - a) > best:
            best = abs(b - a)
            order = 2 * axis + (1 if b < a else 0)
    return order


def collapse(bounds: Any, child: Any, count: Any) -> NDArray[np.uint8]:
    """Return the nodes of eight; a leaf's `child` is eight times the number of its block.

    From the two children of a node on, the one with the largest surface is replaced by its
    own two children until there are eight: it is the one most likely to be met
    [Wald2008].
    """
    most = max(1, np.count_nonzero(count))
    memory = aligned_bytes(WIDE_BYTES * most)
    waiting = np.zeros((len(count) + 1, 2), np.int32)  # binary node, wide node
    nodes = _collapse(
        bounds,
        child,
        count,
        memory.view(np.float32),
        memory.view(np.int32),
        memory,
        waiting,
    )
    return memory[: WIDE_BYTES * nodes]


@entry_kernel
def _collapse(bounds, child, count, floats, integers, octets, waiting):
    top = 1
    nodes = 1
    members = local_i32(8)
    while top > 0:
        top -= 1
        node = waiting[top, 0]
        wide = waiting[top, 1]
        size = _open(bounds, child, count, node, members)
        _quantise(bounds, node, members, size, floats, octets, wide)
        for k in range(size):
            m = members[k]
            place = WIDE_WORDS * wide + CHILD + k
            if count[m] > 0:
                integers[place] = ~(child[m] >> 3)
                continue
            integers[place] = nodes
            waiting[top, 0] = m
            waiting[top, 1] = nodes
            top += 1
            nodes += 1
    return nodes


@kernel
def _open(bounds, child, count, node, members):
    """Write up to eight descendants of a node that cover it; return how many."""
    members[0] = node
    size = 1
    while size < 8:
        best = -1
        largest = -1.0
        for k in range(size):
            if count[members[k]] == 0:
                area = _half_area(bounds, members[k])
                if area > largest:
                    largest = area
                    best = k
        if best < 0:
            break
        first = child[members[best]]
        members[best] = first
        members[size] = first + 1
        size += 1
    return size


@kernel
def _half_area(bounds, node):
    a = np.float64(bounds[node, 3]) - np.float64(bounds[node, 0])
    b = np.float64(bounds[node, 4]) - np.float64(bounds[node, 1])
    c = np.float64(bounds[node, 5]) - np.float64(bounds[node, 2])
    return a * b + b * c + c * a


@kernel
def _quantise(bounds, node, members, size, floats, octets, wide):
    """Write the boxes of the children in units of a power of two, rounded outwards."""
    for axis in range(3):
        low = np.float64(bounds[node, axis])
        high = np.float64(bounds[node, axis + 3])
        # flat nodes: a unit that float32 can still add to the coordinate
        least = max(abs(low), abs(high)) * 2.0**-21 + 1e-30
        unit = 2.0 ** np.ceil(np.log2(max((high - low) / _LARGEST_BYTE, least)))
        origin = np.float64(np.float32(low - unit))
        floats[WIDE_WORDS * wide + ORIGIN + axis] = origin
        floats[WIDE_WORDS * wide + SCALE + axis] = unit
        place = WIDE_BYTES * wide + BOX_BYTES + AXIS_BYTES * axis
        for k in range(size):
            lower = (np.float64(bounds[members[k], axis]) - origin) / unit
            upper = (np.float64(bounds[members[k], axis + 3]) - origin) / unit
            octets[place + k] = int(np.floor(lower - _SLACK))
            octets[place + 8 + k] = int(np.ceil(upper + _SLACK))
            octets[place + 16 + k] = octets[place + k]


@builder_kernel
def far_to_near(floats: Any, integers: Any, octets: Any) -> Any:
    """Return the order of each node's children for each octant of directions, (8 n,).

    Four bits a child, the farthest first, by their centres along the octant's diagonal.
    """
    nodes = len(integers) // WIDE_WORDS
    found = np.zeros(8 * nodes, np.int32)
    distance = np.zeros(8)
    for place in range(8 * nodes):
        node, octant = place // 8, place % 8
        order = np.int64(0)
        for k in range(8):
            if integers[WIDE_WORDS * node + CHILD + k] == 0:
                continue
            distance[k] = _along_diagonal(floats, octets, node, k, octant)
            rank = 0  # those with lower k that are farther keep their places
            for j in range(k):
                rank += 1 if distance[(order >> (4 * j)) & 7] >= distance[k] else 0
            low = (1 << (4 * rank)) - 1
            order = (order & low) | (k << (4 * rank)) | ((order & ~low) << 4)
        found[place] = order
    return found


@kernel
def _along_diagonal(floats, octets, node, k, octant):
    """Return where the centre of a child is on the way of rays of an octant."""
    distance = 0.0
    for axis in range(3):
        octet = WIDE_BYTES * node + BOX_BYTES + AXIS_BYTES * axis + k
        unit = np.float64(floats[WIDE_WORDS * node + SCALE + axis])
        along = (np.float64(octets[octet]) + np.float64(octets[octet + 8])) * unit
        distance += -along if (octant >> axis) & 1 else along
    return distance


# ------------------------------------------------------------------------ the slow truth


def validate_wide(accel: Any, extents: Extents) -> None:
    """Check that both trees reach every block once and that all boxes hold their contents.

    Parameters
    ----------
    accel
        A `WideBvh`.
    extents
        What it was built over.

    Raises
    ------
    ValueError
        If not; the message says which tree, node and block or primitive.
    """
    lower, upper = _block_boxes(accel.blocks, extents)
    _validate_wide_nodes(accel.octets, lower, upper)
    _validate_orders(accel.integers, accel.order)
    _validate_pairs(accel.pairs, accel.blocks, lower, upper)


def _block_boxes(blocks: Any, extents: Extents) -> tuple[Any, Any]:
    """Return the (n, 3) corners of each block; check that they share out the primitives."""
    ids = blocks.id.reshape(-1, WIDTH)
    held = ids[ids >= 0].astype(np.int64)
    n = extents.lower.shape[1]
    if len(held) != n or len(np.unique(held)) != n:
        raise ValueError(f"blocks hold {len(np.unique(held))} of {n} primitives once")
    column = np.where(ids >= 0, np.searchsorted(np.sort(held), ids), 0)
    filled = (ids >= 0)[..., None]
    lower = np.where(filled, extents.lower.T[column], np.inf).min(axis=1)
    upper = np.where(filled, extents.upper.T[column], -np.inf).max(axis=1)
    return lower, upper


def _validate_wide_nodes(octets: Any, lower: Any, upper: Any) -> None:
    nodes = octets.reshape(-1, WIDE_BYTES)
    floats, integers = nodes.view(np.float32), nodes.view(np.int32)
    origin, unit = floats[:, ORIGIN : ORIGIN + 3, None], floats[:, SCALE : SCALE + 3, None]
    stored = nodes[:, BOX_BYTES:].reshape(len(nodes), 3, 3, 8).astype(np.float64)
    if not np.array_equal(stored[:, :, 0], stored[:, :, 2]):
        raise ValueError("wide node: the two copies of the lower bounds differ")
    low, high = (origin + unit * stored[:, :, k] for k in (0, 1))
    children = integers[:, CHILD : CHILD + 8]
    _require_once("wide node", children[children > 0], 1, len(nodes))
    _require_once("block of the wide tree", ~children[children < 0], 0, len(lower))

    held_low = np.full((len(nodes), 3), np.inf)
    held_high = -held_low
    for node in range(len(nodes) - 1, -1, -1):  # children come after their parents
        for k in np.flatnonzero(children[node]):
            c = children[node, k]
            if c > 0 and c <= node:
                raise ValueError(f"wide node {c} comes before its parent {node}")
            a, b = (held_low[c], held_high[c]) if c > 0 else (lower[~c], upper[~c])
            if (low[node, :, k] > a).any() or (high[node, :, k] < b).any():
                raise ValueError(f"wide node {node}: box {k} does not hold its contents")
            held_low[node] = np.minimum(held_low[node], a)
            held_high[node] = np.maximum(held_high[node], b)


def _validate_orders(integers: Any, order: Any) -> None:
    """Check that the order for each octant names each child once."""
    here = integers.reshape(-1, WIDE_WORDS)[:, CHILD : CHILD + 8] != 0
    size = here.sum(axis=1)
    named = (order.reshape(-1, 8, 1) >> (4 * np.arange(8))) & 15
    named = np.where(np.arange(8) < size[:, None, None], named, 8)
    wanted = np.sort(np.where(here, np.arange(8), 8), axis=1)
    wrong = np.argwhere(np.sort(named, axis=2) != wanted[:, None])
    if wrong.size:
        node, octant, _ = wrong[0]
        raise ValueError(
            f"wide node {node}: the order of octant {octant} names not each child once"
        )


def _validate_pairs(pairs: Any, blocks: Any, lower: Any, upper: Any) -> None:
    boxes = pairs.floats.reshape(-1, PAIR_WORDS)[:, :6]
    links = pairs.integers.reshape(-1, PAIR_WORDS)[:, PAIR_CHILD:]
    seen: list[int] = []
    waiting = [(0, np.array([-np.inf] * 3), np.array([np.inf] * 3))]
    while waiting:
        node, outer_low, outer_high = waiting.pop()
        low, high = boxes[node, :3], boxes[node, 3:]
        if (low < outer_low).any() or (high > outer_high).any():
            raise ValueError(f"pair node {node} is not inside of its parent")
        child, count = links[node]
        if count < 0 and not 0 < child < len(boxes) - 1:
            raise ValueError(f"pair node {node} has children that do not exist")
        if len(seen) + len(waiting) > len(boxes):
            raise ValueError(f"pair node {node} is below itself")
        if count < 0:
            waiting += [(child, low, high), (child + 1, low, high)]
            continue
        block = child // WIDTH
        if not 0 <= block < len(lower):
            raise ValueError(f"pair node {node} names block {block} of {len(lower)}")
        seen.append(block)
        if child % WIDTH or count != (blocks.id[child : child + WIDTH] >= 0).sum():
            raise ValueError(
                f"pair node {node} is a leaf of other primitives than a block's"
            )
        if (low > lower[block]).any() or (high < upper[block]).any():
            raise ValueError(f"pair node {node} does not hold block {block}")
    _require_once("block of the pairs", np.array(seen), 0, len(lower))


def _require_once(what: str, found: Any, first: int, end: int) -> None:
    """Check that `found` holds each number first .. end - 1 once, and no other."""
    numbers, times = np.unique(found, return_counts=True)
    wrong = np.setxor1d(numbers[times == 1], np.arange(first, end))
    if wrong.size:
        reached = np.count_nonzero(found == wrong[0])
        raise ValueError(f"{what} {wrong[0]} is reached {reached} times, not once")
