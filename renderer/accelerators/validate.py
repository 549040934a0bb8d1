"""Validate any structure: check that no ray can miss a primitive in it.

The check of each structure is in its own file; `validate` selects it by the record's class.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh import Bvh
from renderer.accelerators.bvh.bvh_tree import BvhTree, validate_bvh
from renderer.accelerators.bvh.wide.wide_bvh_checks import validate_wide
from renderer.accelerators.bvh.wide_bvh import WideBvh
from renderer.accelerators.rays.boxes import Boxes, BruteForce
from renderer.plugins.shapes.extents import Extents
from renderer.textbook.bvh import BoxTree
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.grid_walk import Grids
from renderer.textbook.validate import validate_structure


def validate(accel: Any, extents: Extents) -> None:
    """Check that a structure holds all primitives where a ray looks for them.

    Parameters
    ----------
    accel
        The result of a builder.
    extents
        The primitive boxes that the builder was given.

    Raises
    ------
    ValueError
        Otherwise; the message says which node or cell, and what is wrong with it.
    TypeError
        If there is no check for the record's class.
    """
    proof = VALIDATORS.get(type(accel))
    if proof is None:
        known = ", ".join(record.__name__ for record in VALIDATORS)
        raise TypeError(f"no proof for a {type(accel).__name__}; there are: {known}")
    proof(accel, extents)


def columns_held(primitives: Any, n: int) -> NDArray[np.int64]:
    """Return the column, (n,), of each primitive of a group.

    Primitive ids rise with the columns, also if primitives were left out.

    Raises
    ------
    ValueError
        If a primitive is missing or appears twice.
    """
    ids = primitives.id[: primitives.count]
    different, columns = np.unique(ids, return_inverse=True)
    if not len(ids) == len(different) == n:
        raise ValueError(
            f"a group of {len(ids)} primitives, {len(different)} of them different, "
            f"holds not each of {n} once"
        )
    return columns


def _validate_brute_force(accel: BruteForce, extents: Extents) -> None:
    columns_held(accel.primitives, extents.lower.shape[1])


def _validate_boxes(accel: Boxes, extents: Extents) -> None:
    order = columns_held(accel.primitives, extents.lower.shape[1])
    runs = np.diff(accel.start)
    if accel.start[0] != 0 or accel.start[-1] != len(order) or (runs < 1).any():
        raise ValueError("boxes do not hold each primitive once")
    if (np.diff(accel.primitives.id[: len(order)]) < 1).any():
        raise ValueError("primitives in boxes are not in the order of their ids")
    bounds = np.repeat(accel.bounds.T, runs, axis=1)
    lower, upper = extents.lower[:, order], extents.upper[:, order]
    if (bounds[:3] > lower).any() or (bounds[3:] < upper).any():
        raise ValueError("a primitive sticks out of its box")


def _validate_bvh(bvh: Bvh, extents: Extents) -> None:
    order = columns_held(bvh.primitives, extents.lower.shape[1])
    tree = BvhTree(bvh.bounds, bvh.child, bvh.count, order.astype(np.int32))
    validate_bvh(tree, extents.lower, extents.upper)


VALIDATORS: dict[type, Callable[[Any, Extents], None]] = {
    BruteForce: _validate_brute_force,
    Boxes: _validate_boxes,
    Bvh: _validate_bvh,
    WideBvh: validate_wide,
    BoxTree: validate_structure,
    CellTree: validate_structure,
    Grids: validate_structure,
}
