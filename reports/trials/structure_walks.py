"""The walk of one ray through each structure, step by step, in plain Python.

Each walk repeats what the kernel of its structure does with a ray that goes alone, on the
same record and in the same single precision, and notes every step. A test compares hit and
counts with the kernel's own.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    CHILD,
    ORIGIN,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.bvh.wide_bvh import WideBvh
from renderer.accelerators.rays.box_entry import MARGIN, STRETCH
from renderer.accelerators.rays.boxes import Boxes, BruteForce
from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.vectors import column
from renderer.plugins.shapes.blocks import WIDTH
from renderer.plugins.shapes.primitives import hit_primitive, primitive_at
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.grid_walk import Grids
from renderer.textbook.one_ray import MAILBOXES

F32 = np.float32
INFINITY = F32(np.inf)
VISIT, LEAF, SKIP = "visit", "leaf", "skip"  # kinds of steps


class Step(NamedTuple):
    """One step, and the counts after it."""

    text: str
    item: int  # which of `structure_cells.Cells` the step is at; -1: none
    kind: str  # VISIT, LEAF or SKIP
    tested: tuple[int, ...]  # ids of the triangles that are tested in this step
    nodes: int
    boxes: int
    primitives: int
    saved: int  # tests that mailboxes saved
    waiting: int  # nodes on the stack
    t: float  # distance of the nearest hit so far; infinite: none
    prim: int  # its triangle, -1: none


@dataclass
class Walk:
    """A ray on its way; `distance` says where it meets each triangle, if at all."""

    origin: NDArray[np.float32]  # (3,)
    direction: NDArray[np.float32]  # (3,) unit
    distance: NDArray[np.float32]  # (triangles,) infinite: a miss
    t: Any = INFINITY
    prim: int = -1
    nodes: int = 0
    boxes: int = 0
    primitives: int = 0
    saved: int = 0
    waiting: int = 0
    steps: list[Step] = field(default_factory=list)

    @property
    def counts(self) -> tuple[int, int, int, int]:
        """Nodes, box tests, primitive tests, mailbox saves: rows of the kernels' tally."""
        return self.nodes, self.boxes, self.primitives, self.saved

    def test(self, ids: Sequence[int]) -> str:
        """Test triangles; return what comes of it in words; the smaller id wins a tie."""
        self.primitives += len(ids)
        before = self.t, self.prim
        for k in ids:
            t = self.distance[k]
            if t < self.t or (t == self.t < INFINITY and not 0 <= self.prim <= k):
                self.t, self.prim = t, int(k)
        if (self.t, self.prim) != before:
            return f"Triangle {self.prim} is hit at {self.t:.2f}."
        if not (self.distance[list(ids)] < INFINITY).any():
            return "None is hit."
        return "What is hit lies behind the nearest hit."

    def note(
        self, text: str, item: int, kind: str = VISIT, tested: Sequence[int] = ()
    ) -> None:
        """Add a step."""
        done = (*self.counts, self.waiting, float(self.t), self.prim)
        self.steps.append(Step(text, item, kind, tuple(map(int, tested)), *done))


@entry_kernel
def _hit_distances(primitives, origin, direction, t):  # type: ignore[no-untyped-def]
    for k in range(len(t)):
        o, d = column(origin, 0), column(direction, 0)
        x = hit_primitive(primitives, primitive_at(primitives, k), o, d, INFINITY)
        t[k] = x.t if x.hit else INFINITY


def hit_distances(brute: BruteForce, origin: Any, direction: Any) -> NDArray[np.float32]:
    """Return where a ray meets each triangle of a group in the scene's order."""
    t = np.zeros(brute.primitives.count, F32)
    rows = (np.ascontiguousarray(v, F32).reshape(3, 1) for v in (origin, direction))
    _hit_distances(brute.primitives, *rows, t)
    return t


@functools.singledispatch
def walk_through(accel: Any, walk: Walk) -> None:
    """Let a ray walk through a structure to its nearest hit."""
    raise TypeError(f"no walk through {type(accel).__name__}")


def _triangles(count: int) -> str:
    return f"{count} triangle" + ("s" if count != 1 else "")


@walk_through.register
def _brute(accel: BruteForce, walk: Walk) -> None:
    every = range(len(walk.distance))
    said = walk.test(every)
    walk.note(f"Every triangle is tested, all {len(every):,}. {said}", 0, LEAF, every)


# ------------------------------------------------------------------------- BVH and boxes


class _Slabs:
    """A ray against boxes, with the margins of `box_entry`."""

    def __init__(self, walk: Walk) -> None:
        far = np.abs(walk.origin).sum(dtype=F32)
        self.low, self.high = walk.origin - far * MARGIN, walk.origin + far * MARGIN
        with np.errstate(divide="ignore"):
            self.inverse = F32(1.0) / walk.direction

    def enter(self, box: NDArray[np.float32], t: Any) -> Any:
        """Return where the ray enters a box; infinity if not before t."""
        with np.errstate(invalid="ignore"):
            a = (box[:3] - self.high) * self.inverse
            b = (box[3:] - self.low) * self.inverse
            enter, leave = F32(0.0), t
            for x, y in zip(a, b, strict=True):
                enter = min(v if v > enter else enter for v in (x, y))
            for x, y in zip(a * STRETCH, b * STRETCH, strict=True):
                leave = max(v if v < leave else leave for v in (x, y))
        return enter if enter <= leave else INFINITY


@walk_through.register
def _boxes(accel: Boxes, walk: Walk) -> None:
    slabs, ids = _Slabs(walk), accel.primitives.id
    entered = [slabs.enter(box, INFINITY) < INFINITY for box in accel.bounds]
    walk.boxes = len(entered)
    walk.note(f"All {len(entered)} boxes are tested: {sum(entered)} are entered.", 0)
    for box, enters in enumerate(entered):
        held = ids[accel.start[box] : accel.start[box + 1]]
        if not enters:
            text = f"A box that the ray misses: its {_triangles(len(held))} are left out."
            walk.note(text, box + 1, SKIP)
            continue
        walk.nodes += 1
        said = walk.test(held)
        walk.note(f"A box with {_triangles(len(held))}: all are tested. {said}", box + 1,
                  LEAF, held)  # fmt: skip


def _pop_behind(walk: Walk, item: int, enter: Any) -> None:
    text = f"This box begins at {enter:.2f}, behind the hit at {walk.t:.2f}: skipped."
    walk.note(text, item, SKIP)


@walk_through.register
def _bvh(accel: Bvh, walk: Walk) -> None:
    slabs, ids = _Slabs(walk), accel.primitives.id

    def enter(node: int) -> Any:
        walk.boxes += 1
        return slabs.enter(accel.bounds[node], walk.t)

    def leaf(node: int) -> Any:
        first, count = int(accel.child[node]), int(accel.count[node])
        return ids[first : first + count] if count else None

    _binary_tree(walk, accel.child, leaf, enter, first_of_equals=0)


@walk_through.register
def _box_tree(accel: BoxTree, walk: Walk) -> None:
    ids = accel.primitives.id

    def enter(node: int) -> Any:
        walk.boxes += 1
        start, end = _interval(accel.boxes[node], walk, walk.t)
        return start if start <= end else INFINITY

    def leaf(node: int) -> Any:
        if accel.child[node]:
            return None
        return ids[accel.items[accel.first[node] : accel.end[node]]]

    _binary_tree(walk, accel.child, leaf, enter, first_of_equals=1)


def _binary_tree(
    walk: Walk, child: Any, leaf: Any, enter: Any, first_of_equals: int
) -> None:
    """Walk a binary tree of boxes: the nearer child first, the other waits."""
    stack = [(0, start)] if (start := enter(0)) < INFINITY else []
    walk.waiting = len(stack)
    walk.note(
        "The box of the whole scene is entered: the root waits."
        if stack
        else "The ray misses the box of the whole scene.",
        0,
        VISIT if stack else SKIP,
    )
    while stack:
        node, start = stack.pop()
        walk.waiting = len(stack)
        if start > walk.t:
            _pop_behind(walk, node, start)
            continue
        walk.nodes += 1
        held = leaf(node)
        if held is not None:
            said = walk.test(held)
            walk.note(f"A leaf: {_triangles(len(held))}. {said}", node, LEAF, held)
            continue
        first = int(child[node])
        entries = [(first, enter(first)), (first + 1, enter(first + 1))]
        entered = [entry for entry in entries if entry[1] < INFINITY]
        # the nearer one on top of the stack
        stack += sorted(
            entered, key=lambda entry: (-entry[1], entry[0] == first + first_of_equals)
        )
        walk.waiting = len(stack)
        outcomes = ("Neither is entered.", "One is entered.",
                "Both are entered: the nearer is next, the other waits.")  # fmt: skip
        walk.note(f"The two boxes in this one are tested. {outcomes[len(entered)]}", node)


@walk_through.register
def _wide(accel: WideBvh, walk: Walk) -> None:
    """Follow `wide_rays`: eight boxes a node, all that are entered wait."""
    slabs = _Slabs(walk)
    d = walk.direction
    least = F32(np.abs(d).max() * F32(1e-12))
    inverse = F32(1.0) / np.where(np.abs(d) > least, d, np.where(d < 0, -least, least))
    stack: list[tuple[int, Any, int]] = [(0, F32(0.0), 0)]
    ids = accel.blocks.id.reshape(-1, WIDTH)
    while stack:
        node, start, item = stack.pop()
        walk.waiting = len(stack)
        if start > walk.t:
            _pop_behind(walk, item, start)
            continue
        if node < 0:
            held = ids[~node][ids[~node] >= 0]
            said = walk.test(held)
            text = f"A leaf: {_triangles(len(held))}, tested at once. {said}"
            walk.note(text, item, LEAF, held)
            continue
        walk.nodes += 1
        walk.boxes += WIDTH
        enter = _enter_eight(accel, node, slabs, inverse, walk.t)
        children = accel.integers[node * WIDE_WORDS + CHILD :][:WIDTH]
        entered = np.flatnonzero((enter < INFINITY) & (children != 0))
        # the three lowest bits of a distance make room for the child's place
        keys = (np.maximum(enter, F32(0.0)).view(np.int32) & ~7) | np.arange(WIDTH)
        if entered.size:
            nearest = entered[np.argmin(keys[entered])]
            for k in [*entered[entered != nearest], nearest]:
                begins = enter[k] if k != nearest else (keys[k] & ~7).astype(np.int32)
                begins = begins if k != nearest else begins.view(F32)
                stack.append((int(children[k]), begins, 1 + node * WIDTH + int(k)))
        walk.waiting = len(stack)
        text = f"Eight boxes are tested at once: {entered.size} are entered."
        walk.note(text, item)


def _enter_eight(accel: WideBvh, node: int, slabs: _Slabs, inverse: Any, t: Any) -> Any:
    """Return where the ray enters the boxes of a node's children; infinity: it does not."""
    enter, leave = np.zeros(WIDTH), np.full(WIDTH, float(t))
    for axis in range(3):
        word = node * WIDE_WORDS + axis
        at = node * WIDE_BYTES + BOX_BYTES + axis * AXIS_BYTES
        octets = accel.octets[at : at + 2 * WIDTH].astype(np.float64)
        planes = octets * accel.floats[word + SCALE] + accel.floats[word + ORIGIN]
        planes = planes.astype(F32)
        down = inverse[axis] < 0.0
        near, far = (planes[WIDTH:], planes[:WIDTH]) if down else np.split(planes, 2)
        low, high = slabs.low[axis], slabs.high[axis]
        start = F32(-(low if down else high) * inverse[axis])
        end = F32((high if down else low) * inverse[axis])
        # products and sums of the kernel are fused: one rounding
        i = float(inverse[axis])
        enter = np.maximum(enter, F32(near.astype(np.float64) * i + float(start)))
        stop = F32(F32(far.astype(np.float64) * -i + float(end)) * -STRETCH)
        leave = np.minimum(leave, stop)
    return np.where(enter <= leave, enter, np.inf).astype(F32)


# ---------------------------------------------------------------------------- cell trees


def _interval(box: Any, walk: Walk, t_max: Any) -> tuple[Any, Any]:
    """Return where a ray enters and leaves a box, within 0 to t_max."""
    enter, leave = F32(0.0), t_max
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = F32(1.0) / walk.direction
        a, b = (box[:3] - walk.origin) * inverse, (box[3:] - walk.origin) * inverse
    for x, y, i in zip(a, b, inverse, strict=True):
        x, y = (y, x) if i < 0.0 else (x, y)
        enter, leave = (x if x > enter else enter), (y if y < leave else leave)
    return enter, leave


@walk_through.register
def _cell_tree(accel: CellTree, walk: Walk) -> None:
    walk.boxes += 1
    enter, leave = _interval(accel.bounds, walk, walk.t)
    if not enter <= leave:
        walk.note("The ray misses the box of the whole scene.", 0, SKIP)
        return
    walk.note(f"The ray enters the box of the whole scene at {enter:.2f}.", 0)
    ids, node, stack = accel.primitives.id, 0, []
    while True:
        walk.nodes += 1
        if accel.child[node] > 0:
            walk.boxes += 1
            t, near, far = _crossing(accel, node, walk)
            here = node
            if t < enter:
                said, node = "crossed before this cell: only the half behind it", far
            elif t > leave:
                said, node = "not reached in this cell: only the half before it", near
            else:
                stack.append((far, t, leave))
                said, node, leave = "crossed: the near half is next, the far waits", near, t
            walk.waiting = len(stack)
            walk.note(f"{_plane(accel.plane[here])} is {said}.", here)
            continue
        held = ids[accel.items[accel.first[node] : accel.end[node]]]
        said = walk.test(held) if len(held) else ""
        text = f"A leaf: {_triangles(len(held))}. {said}" if said else "An empty cell."
        walk.note(text, node, LEAF, held)
        if not stack:
            return
        node, enter, leave = stack.pop()
        walk.waiting = len(stack)
        leave = min(leave, walk.t)
        if enter > leave:
            text = f"All that waits begins at {enter:.2f} or later, behind the hit: done."
            walk.note(text, node, SKIP)
            return


def _plane(plane: Any) -> str:
    for axis, name in enumerate("xyz"):
        if plane[axis] == 1.0:
            return f"The plane {name} = {plane[3]:.2f}"
    return "An oblique plane"


def _crossing(accel: CellTree, node: int, walk: Walk) -> tuple[Any, int, int]:
    x, y, z, offset = accel.plane[node]
    o, d = walk.origin, walk.direction
    away = x * o[0] + y * o[1] + z * o[2] - offset
    speed = x * d[0] + y * d[1] + z * d[2]
    behind = int(accel.child[node])
    if speed == 0.0:
        halves = (behind + 1, behind) if away > 0.0 else (behind, behind + 1)
        return INFINITY, *halves
    halves = (behind + 1, behind) if speed < 0.0 else (behind, behind + 1)
    return -away / speed, *halves


# --------------------------------------------------------------------------------- grids


@walk_through.register
def _grids(accel: Grids, walk: Walk) -> None:
    n = accel.primitives.count
    slots = MAILBOXES if accel.mailboxed is not None else 0
    tested, entered = np.full(MAILBOXES, -1), np.full(MAILBOXES, -1)
    with np.errstate(divide="ignore"):
        inverse = F32(1.0) / walk.direction

    def distance(g: int, axis: int, plane: int) -> Any:
        if not abs(inverse[axis]) < INFINITY:
            return INFINITY
        position = accel.lower[g, axis] + F32(plane) * accel.size[g, axis]
        return (position - walk.origin[axis]) * inverse[axis]

    def entry(g: int) -> Any:
        enter, leave = F32(0.0), INFINITY
        for axis, cells in enumerate(accel.resolution[g]):
            if abs(inverse[axis]) < INFINITY:
                ends = distance(g, axis, 0), distance(g, axis, int(cells))
                enter, leave = max(enter, min(ends)), min(leave, max(ends))
            elif not (
                0.0
                <= walk.origin[axis] - accel.lower[g, axis]
                <= F32(cells) * accel.size[g, axis]
            ):
                return INFINITY
        return enter if enter <= leave else INFINITY

    def triangles_of(cell: int, items: Any) -> None:
        fresh, spared = [], 0
        for k in items:
            if slots and tested[k % slots] == k:
                spared += 1
                continue
            tested[k % MAILBOXES] = k
            fresh.append(int(accel.primitives.id[k]))
        walk.saved += spared
        said = walk.test(fresh) if fresh else ""
        text = (
            f"A cell with {_triangles(len(items))}. {said}"
            if len(items)
            else "An empty cell."
        )
        if spared:
            text += f" {spared} had been tested in an earlier cell (mailbox)."
        walk.note(text, len(accel.first) + cell, LEAF, fresh)

    def go(g: int, level: int) -> None:
        walk.boxes += 1
        begin = entry(g)
        size = " x ".join(map(str, accel.resolution[g]))
        if not (begin <= walk.t and begin < INFINITY):
            walk.note(f"The ray misses the grid of {size} cells here.", g, SKIP)
            return
        walk.nodes += 1
        walk.waiting = level
        walk.note(f"The ray enters a grid of {size} cells at {begin:.2f}.", g)
        place = walk.origin + begin * walk.direction - accel.lower[g]
        last_cell = (accel.resolution[g] - 1).astype(F32)
        k = np.minimum(np.maximum(place / accel.size[g], F32(0.0)), last_cell).astype(int)
        stride = np.cumprod([1, *accel.resolution[g][:2]])
        forward = inverse > 0.0
        plane = np.where(forward, k + 1, k)
        last = np.where(forward, accel.resolution[g], 0)
        crossing = [distance(g, axis, int(plane[axis])) for axis in range(3)]
        cell = int(accel.first[g] + (k * stride).sum())
        while True:
            items = accel.items[accel.start[cell] : accel.start[cell + 1]]
            triangles_of(cell, items[items < n])
            for k in items[items >= n]:
                if entered[k % MAILBOXES] != k:
                    entered[k % MAILBOXES] = k
                    go(int(k) - n, level + 1)
                    walk.waiting = level
            axis = 0 if crossing[0] < crossing[1] else 1
            axis = 2 if crossing[2] < crossing[axis] else axis
            if plane[axis] == last[axis]:
                return
            start = crossing[axis]
            plane[axis] += 1 if forward[axis] else -1
            crossing[axis] = distance(g, axis, int(plane[axis]))
            cell += int(stride[axis] if forward[axis] else -stride[axis])
            if not start <= walk.t:
                text = f"The next cell begins at {start:.2f}, behind the hit: done."
                walk.note(text, len(accel.first) + cell, SKIP)
                return
            walk.nodes += 1

    go(0, 0)
