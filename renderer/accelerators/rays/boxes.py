"""Brute force, 16 rays at a time; and brute force with boxes around objects."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.rays.box_entry import origin_margins, packet_enters
from renderer.accelerators.rays.packets import (
    Nearest,
    begin_packet,
    blocked_by,
    end_packet,
    intersect_packet,
    nearest_in_order,
)
from renderer.accelerators.rays.query import traverse
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane_index,
    mask_bits,
    popcount,
    select,
    splat_f32,
    splat_i32,
)
from renderer.kernels.lanes.memory import (
    append_row,
    gather_row,
    load_row,
    scatter_row,
    store_row,
)
from renderer.kernels.lanes.vectors import gather3, load3, local_i32
from renderer.kernels.records.batch import BOXES, NODES, PRIMITIVES, add_to, add_to_packet
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

# -------------------------------------------------------------------------- brute force
# Brute force: every ray against every primitive, the reference for all structures.
#
# It is also the fastest for a few dozen primitives, as 16 rays are tested at a time.


class BruteForce(NamedTuple):
    """The primitives, without any structure."""

    primitives: Any  # a group of one kind, in the scene's order


def build_brute_force(extents: Extents, group: PrimitiveGroup) -> BruteForce:
    """Return all primitives in the scene's order."""
    return BruteForce(group(np.arange(extents.lower.shape[1])))


@traverse.by(BruteForce)
@kernel
def trace_brute_force(accel, query, first, count, tally):
    """Test rays first to first + count - 1, 16 at a time, against all primitives."""
    primitives, end = accel.primitives, accel.primitives.count
    for i in range(first, first + count, 16):
        origin, direction = load3(query.origin, i), load3(query.direction, i)
        left = first + count - i
        if query.any_hit != 0:
            traced = first_lanes(left)
            packet = begin_packet(query, i, traced)
            packet = intersect_packet(
                primitives, 0, end, origin, direction, packet, query.any_hit, tally, i, left
            )
            end_packet(query, i, packet, traced)
            continue
        add_to_packet(tally, PRIMITIVES, i, left, end)
        t, prim = load_row(query.ends, 0, i), load_row(query.prim, 0, i)
        u, v = load_row(query.u, 0, i), load_row(query.v, 0, i)
        nearest = Nearest(t, prim, u, v)
        nearest = nearest_in_order(primitives, 0, end, origin, direction, nearest)
        store_row(query.ends, 0, i, nearest.t)
        store_row(query.prim, 0, i, nearest.prim)
        store_row(query.u, 0, i, nearest.u)
        store_row(query.v, 0, i, nearest.v)


# -------------------------------------------------------------------------------- boxes
# Boxes around objects, without a tree: brute force over the boxes that a ray enters.
#
# A scene of a few dozen primitives has a few objects. The rays of a batch that enter an
# object's box are listed, without a branch per ray. Then 16 rays of a list at a time are
# tested against each primitive of the object: bounding volumes without a hierarchy
# [Whitted1980].

MOST = 8  # boxes: their lists are on the processor's stack, 35 KB
_BATCH = 1024  # rays per batch
_ROW = _BATCH + 48  # of a list: not a power of two, see `records.batch`
_LISTS = MOST * _ROW
# Cost of a ray in primitive tests: per box, and per list that it is on (12 numbers gathered
# and scattered).
_FOR_A_BOX = 2.0
_FOR_A_LIST = 6.0


class Boxes(NamedTuple):
    """Boxes around runs of primitives."""

    bounds: NDArray[np.float32]  # (boxes, 6) lower x y z, upper x y z
    start: NDArray[np.int64]  # (boxes + 1,) first primitive of each, then their number
    primitives: Any  # a group of one kind, in the scene's order


def build_boxes(extents: Extents, group: PrimitiveGroup) -> Boxes:
    """Divide the primitives, in the scene's order, into runs with small boxes."""
    start = divide(extents.lower, extents.upper)
    bounds = _bounds_of_runs(extents.lower, extents.upper, start)
    return Boxes(bounds, start, group(np.arange(extents.lower.shape[1])))


def expected_cost(
    lower: NDArray[np.float32],
    upper: NDArray[np.float32],
    room: NDArray[np.float64] | None = None,
) -> float:
    """Return the expected cost of a ray, in primitive tests.

    Parameters
    ----------
    lower, upper
        (3, n) corners of the primitives' boxes.
    room
        (2, 3) corners of the box that rays fill evenly; None: the primitives' box.
    """
    start = divide(lower, upper)
    bounds = _bounds_of_runs(lower, upper, start)
    if room is None:
        room = np.array([lower.min(axis=1), upper.max(axis=1)])
    share = _areas(bounds[:, :3].T, bounds[:, 3:].T) / max(_areas(*room), 1e-300)
    entered = np.minimum(share, 1.0) * (np.diff(start) + _FOR_A_LIST)
    return float(len(share) * _FOR_A_BOX + entered.sum())


def divide(lower: NDArray[np.float32], upper: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return where runs of primitives begin, and where the last one ends.

    Runs are cut where the surface area heuristic saves most [MacDonald1990], until there
    are `MOST` runs or no cut saves anything.
    """
    low, high = lower.min(axis=1, keepdims=True), upper.max(axis=1, keepdims=True)
    for_a_box = _FOR_A_BOX * float(_areas(low, high)[0])
    start = [0, lower.shape[1]]
    while len(start) <= MOST:
        runs = itertools.pairwise(start)
        saved, place = max(_best_cut(lower[:, a:b], upper[:, a:b], a) for a, b in runs)
        if not saved > for_a_box:
            break
        start = sorted([*start, place])
    return np.array(start, np.int64)


def _best_cut(
    lower: NDArray[np.float32], upper: NDArray[np.float32], first: int
) -> tuple[float, int]:
    """Return the saving of the best cut of a run, times area, and its index; 0 for none."""
    n = lower.shape[1]
    if n < 2:
        return 0.0, first
    # boxes around the first 1 to n primitives, and around the last 1 to n
    ahead = _areas(np.minimum.accumulate(lower, 1), np.maximum.accumulate(upper, 1))
    lower, upper = lower[:, ::-1], upper[:, ::-1]
    behind = _areas(np.minimum.accumulate(lower, 1), np.maximum.accumulate(upper, 1))
    k = np.arange(1, n)
    parts = ahead[:-1] * (k + _FOR_A_LIST) + behind[-2::-1] * (n - k + _FOR_A_LIST)
    saved = ahead[-1] * (n + _FOR_A_LIST) - parts
    best = int(np.argmax(saved))
    return float(saved[best]), first + best + 1


def _bounds_of_runs(lower: Any, upper: Any, start: Any) -> NDArray[np.float32]:
    low = np.minimum.reduceat(lower, start[:-1], axis=1)
    high = np.maximum.reduceat(upper, start[:-1], axis=1)
    return np.ascontiguousarray(np.concatenate([low, high]).T)


def _areas(lower: Any, upper: Any) -> Any:
    """Return half of the surface areas of boxes."""
    x, y, z = np.subtract(upper, lower, dtype=np.float64)
    return x * y + y * z + z * x


# ---------------------------------------------------------------------------- kernels


@kernel
def _list_entering(bounds, origins, directions, ends, first, count, lists, many, tally):
    """List the rays that enter each box before t_max; `many` holds the lists' lengths."""
    boxes = bounds.shape[0]
    for box in range(boxes):
        many[box] = 0
    for i in range(first, first + count, 16):
        left = first + count - i
        inverse = 1.0 / load3(directions, i)
        low, high = origin_margins(load3(origins, i))
        t = select(first_lanes(left), load_row(ends, 0, i), splat_f32(-1.0))
        add_to_packet(tally, BOXES, i, left, boxes)
        for box in range(boxes):
            enters = packet_enters(bounds, box, low, high, inverse, t)
            place = box * _ROW + many[box]
            append_row(lists, 0, place, lane_index() + np.int32(i), enters)
            many[box] += popcount(mask_bits(enters))


@kernel
def _count(tally, lists, place, count, primitives):
    """Count a box as a node, and its primitives, for each ray of a list."""
    if tally is None:
        return
    for k in range(place, place + count):
        add_to(tally, NODES, lists[k], 1)
        add_to(tally, PRIMITIVES, lists[k], primitives)


@traverse.by(Boxes)
@kernel
def trace_boxes(accel, query, first, count, tally):
    """Test the rays that enter a box against its primitives, one box after the other."""
    lists, many = local_i32(_LISTS), local_i32(MOST)
    origins, directions = query.origin, query.direction
    for begin in range(first, first + count, _BATCH):
        n = min(first + count - begin, _BATCH)
        _list_entering(
            accel.bounds, origins, directions, query.ends, begin, n, lists, many, tally
        )
        for box in range(accel.bounds.shape[0]):
            start, end = accel.start[box], accel.start[box + 1]
            _count(tally, lists, box * _ROW, many[box], end - start)
            for j in range(0, many[box], 16):
                live = first_lanes(many[box] - j)
                ray = load_row(lists, 0, box * _ROW + j)
                _test(accel.primitives, start, end, query, ray, live)


@kernel
def _test(primitives, start, end, query, ray, live):
    """Test 16 rays against the primitives of a box, and store their hits."""
    origin = gather3(query.origin, ray, live)
    direction = gather3(query.direction, ray, live)
    t = select(live, gather_row(query.ends, 0, ray, live), splat_f32(-1.0))
    prim = gather_row(query.prim, 0, ray, live)
    if query.any_hit != 0:
        given = (prim != 0) | ~live
        zero = np.int64(0)
        blocked = blocked_by(
            primitives, start, end, origin, direction, t, given, None, zero, zero
        )
        scatter_row(query.prim, 0, ray, splat_i32(1), blocked & live)
        return
    before = Nearest(t, prim, t, t)  # any u and v: no hit yet
    near = nearest_in_order(primitives, start, end, origin, direction, before)
    found = near.prim != prim
    if mask_bits(found) != 0:  # an empty scatter takes as long as any other
        scatter_row(query.ends, 0, ray, near.t, found)
        scatter_row(query.prim, 0, ray, near.prim, found)
        scatter_row(query.u, 0, ray, near.u, found)
        scatter_row(query.v, 0, ray, near.v, found)
