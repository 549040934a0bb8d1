"""A reference: one primitive in one cell, and the box of its part in there.

Trees of cells (kd-tree, octree) share out references where they cut. What crosses the cut
comes to both sides, each with the box of what is left there ("split clipping"
[Havran2002, Wald2006]), unless it turns out that nothing is left.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.plugins.shapes.extents import Extents


class Hulls(NamedTuple):
    """The extents of n primitives, one primitive's numbers side by side."""

    points: NDArray[np.float32]  # (n, 4, 3) corners of the convex hull
    growth: NDArray[np.float32]  # (n,) by which it grows along each axis
    normal: NDArray[np.float32]  # (n, 3) unit, of the plane it lies in; 0: not flat


def hulls_of(extents: Extents) -> Hulls:
    """Return the hulls, grown by radius and pad."""
    return Hulls(
        np.ascontiguousarray(extents.points.transpose(2, 1, 0)),
        (extents.radius + np.float32(extents.pad)).astype(np.float32),
        np.ascontiguousarray(extents.normal.T),
    )


def boxes_of(extents: Extents) -> NDArray[np.float32]:
    """Return the boxes grown by the pad, (n, 6): lower x y z, upper x y z.

    The pad is 16 or more units in the last place of any coordinate, so that rounding it to
    single precision matters to none.
    """
    pad = np.float32(extents.pad)
    return np.concatenate((extents.lower - pad, extents.upper + pad)).T.copy()


@kernel
def copy_reference(held, parts, source, target):
    """Copy a reference: the primitive's column, and the box of its part."""
    held[target] = held[source]
    for side in range(6):
        parts[target, side] = parts[source, side]


@kernel
def lies_below(box, axis, plane):
    """Return whether a box reaches below a plane; one that only touches it does not."""
    return box[axis] < plane or box[axis + 3] <= plane


@kernel
def lies_above(box, axis, plane):
    """Return whether a box reaches above a plane; whatever does not, lies below."""
    return box[axis + 3] > plane


@kernel
def fits(hulls, k, box, axis):
    """Shrink the box to what primitive k has between its two sides across `axis`.

    Returns whether anything is left. `box` has just been cut across that axis; cuts across
    the others were taken into account when they were made.
    """
    for other in range(3):
        if other != axis:
            low, high = _part_between(hulls, k, axis, box[axis], box[axis + 3], other)
            box[other] = max(box[other], low)
            box[other + 3] = min(box[other + 3], high)
    for side in range(3):
        if not box[side] <= box[side + 3]:
            return False
    return _plane_meets(hulls, k, box)


@kernel
def _part_between(hulls, k, axis, low, high, other):
    """Return from where to where, along `other`, a hull reaches between two planes.

    The part of a convex hull between two planes is spanned by its corners there and by
    where the lines between corners meet the planes: six lines, since the hull has four
    corners. In float64: the growth covers all rounding.
    """
    points = hulls.points
    growth = np.float64(hulls.growth[k])
    below = np.float64(low) - growth
    above = np.float64(high) + growth
    least = np.inf
    most = -np.inf
    for a in range(4):
        start = np.float64(points[k, a, axis])
        at_start = np.float64(points[k, a, other])
        if below <= start <= above:
            least = min(least, at_start)
            most = max(most, at_start)
        for b in range(a):
            end = np.float64(points[k, b, axis])
            rise = np.float64(points[k, b, other]) - at_start
            for side in range(2):
                plane = below if side == 0 else above
                if (start < plane) != (end < plane):
                    p = at_start + (plane - start) / (end - start) * rise
                    least = min(least, p)
                    most = max(most, p)
    return np.float32(least - growth), np.float32(most + growth)


@kernel
def _plane_meets(hulls, k, box):
    """Return whether the plane of a flat primitive meets the box; True for others.

    The plane is as thick as the hull is along the normal, so that its rounding is harmless.
    """
    thick = np.float64(0.0)
    centre = np.float64(0.0)
    half = np.float64(0.0)
    for axis in range(3):
        n = np.float64(hulls.normal[k, axis])
        low, high = np.float64(box[axis]), np.float64(box[axis + 3])
        centre += n * (0.5 * low + 0.5 * high)
        half += abs(n) * (0.5 * high - 0.5 * low)
        thick += abs(n) * np.float64(hulls.growth[k])
    if thick == 0.0:
        return True
    least, most = np.inf, -np.inf
    for a in range(4):
        p = np.float64(0.0)
        for axis in range(3):
            p += np.float64(hulls.normal[k, axis]) * np.float64(hulls.points[k, a, axis])
        least = min(least, p)
        most = max(most, p)
    return least - thick <= centre + half and centre - half <= most + thick
