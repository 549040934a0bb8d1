"""BSP tree: a tree of cells whose planes come from the polygons [Fuchs1980].

`SAMPLES` primitives of a cell offer candidate planes: the plane of each polygon, and planes
through faces of its box. The polygons' own planes are characteristic of the method but
not sufficient: every plane of a convex mesh has the whole mesh on one side. If n_b
primitives reach behind a plane and n_f in front of it, the rule is

    cost = (n_b^2 + n_f^2) / n^2        against 1 for a leaf

It is least for a plane that halves the cell and cuts no primitive. The surface area
heuristic does not apply, since cells of general planes are no boxes. So empty space is
never cut off, and rays test primitives elsewhere in their cells.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.cell_tree_build import (
    LEAF,
    build_cell_tree,
    choose_plane,
    side_of,
    span,
)

SAMPLES = 8  # primitives that offer planes, evenly spaced in the cell's list
OFFERS = 4  # planes per primitive: its own, and one across each axis
TRIALS = 128  # primitives on which a candidate is evaluated
GAIN = 0.95  # largest cost of a plane worth its cut


class PolygonPlanes(NamedTuple):
    """The rule of `build_bsp`."""

    pad: float  # offset of a plane from the primitive that it comes from


def build_bsp(extents: Extents, group: PrimitiveGroup) -> CellTree:
    """Build with the planes of polygons and of the faces of their boxes."""
    tree: Any = build_cell_tree(extents, group, PolygonPlanes(extents.pad), None)
    return tree


@choose_plane.by(PolygonPlanes)
@kernel
def _choose_plane(rule, places, columns, cell, depth, plane):
    """Write the plane with the least cost; return False if none is worth it."""
    if len(columns) <= LEAF:
        return False
    zero = np.float32(0.0)
    best, least = (zero, zero, zero, zero), np.float64(GAIN)
    stride = (len(columns) + TRIALS - 1) // TRIALS
    for offer in range(OFFERS):
        for sample in range(SAMPLES):
            k = columns[(2 * sample + 1) * len(columns) // (2 * SAMPLES)]
            candidate = _offered(places, rule.pad, k, offer, sample)
            cost = _cost(places, columns, candidate, stride)
            if cost < least:
                best, least = candidate, cost
    plane[0], plane[1], plane[2], plane[3] = best
    return least < GAIN and (stride == 1 or _cost(places, columns, best, 1) < GAIN)


@kernel
def _cost(places, columns, plane, stride):
    """Return the cost of a plane, estimated on every `stride`th primitive."""
    tried = back = front = 0
    for i in range(0, len(columns), stride):
        side = side_of(places, columns[i], plane)
        tried += 1
        back += side <= 0
        front += side >= 0
    return (back * back + front * front) / np.float64(tried * tried)


@kernel
def _offered(places, pad, k, offer, sample):
    """Return the plane (normal x, y, z, offset) that primitive k offers.

    It is just outside of the grown primitive, alternately below and above. In the polygon
    itself it would have the polygon, and all coplanar ones, on both sides. A curved
    primitive has no plane, and offers another face of its box instead.
    """
    normal = places.normal[k]
    x, y, z = np.float64(normal[0]), np.float64(normal[1]), np.float64(normal[2])
    if offer > 0 or (x == 0.0 and y == 0.0 and z == 0.0):
        axis = (offer - 1 if offer > 0 else sample) % 3
        x = 1.0 if axis == 0 else 0.0
        y = 1.0 if axis == 1 else 0.0
        z = 1.0 if axis == 2 else 0.0
    low, high = span(places, k, x, y, z)
    below = (sample + (offer == 0)) % 2 == 0
    offset = low - pad if below else high + pad  # the pad is for the rounding of the offset
    return np.float32(x), np.float32(y), np.float32(z), np.float32(offset)
