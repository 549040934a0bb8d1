"""The matrices by which Embree and Mitsuba go into the space of an instance.

Those of ours (`renderer.scene.placed_groups`) undo the translation first, which is better,
and not the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import Instance

Columns = NDArray[np.float32]  # (3, n)


def instance_matrices(instances: Sequence[Instance]) -> NDArray[np.float32]:
    """Return the matrices of all instances, (24, n).

    Rows 0 to 11: Embree's inverse, its columns and then the image of the origin. Rows 12 to
    23: Mitsuba's, whose columns are the rows of the matrix for normals.
    """
    if not instances:
        return np.zeros((24, 0), np.float32)
    matrices = np.array([instance.to_world for instance in instances])
    mitsuba = np.linalg.inv(matrices)[:, :3].transpose(2, 1, 0).reshape(12, -1)
    with np.errstate(all="ignore"):  # tiny instances: what is not finite rounds nothing
        embree = _embree_inverse(matrices[:, :3].astype(np.float32))
        return np.concatenate([embree, mitsuba.astype(np.float32)])


def _embree_inverse(matrices: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the inverse of (n, 3, 4), with instructions that every x86-64 processor has.

    Nothing is fused, and the cofactors are divided by the determinant: found by trying, in
    Embree 3 of Mitsuba 3.9.1.
    """
    x, y, z, at = matrices.transpose(2, 1, 0)  # columns, each (3, n)
    rows = np.array([_cross(y, z), _cross(z, x), _cross(x, y)])
    product = x * rows[0]
    rows = rows / ((product[0] + product[1]) + product[2])
    columns = rows.transpose(1, 0, 2)
    moved = at[0] * columns[0] + (at[1] * columns[1] + at[2] * columns[2])
    return np.concatenate([columns.reshape(9, -1), -moved])


def _cross(a: Columns, b: Columns) -> Columns:
    return a[[1, 2, 0]] * b[[2, 0, 1]] - a[[2, 0, 1]] * b[[1, 2, 0]]
