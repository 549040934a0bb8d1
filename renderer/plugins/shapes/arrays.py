"""What the tables of shapes are made with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns


def float32(rows: Any) -> NDArray[np.float32]:
    """Return a C-ordered array in single precision."""
    return np.ascontiguousarray(rows, dtype=np.float32)


def unit_normals(edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return edge1 x edge2 / |edge1 x edge2|, all (3, n).

    In double precision: the square of an area leaves float32 for edges beyond 4e9. What
    has no area has the normal 0; no ray hits it.
    """
    n = np.cross(np.asarray(edge1, np.float64).T, np.asarray(edge2, np.float64).T)
    area = np.linalg.norm(n, axis=1, keepdims=True)
    return float32((n / np.where(area > 0.0, area, 1.0)).T)


def empty_rows(rows: int) -> NDArray[np.float32]:
    """Return a table without columns, for values that the scene does not use."""
    return by_columns(np.zeros((rows, 0)))


def mirrors(matrix: NDArray[np.float64]) -> bool:
    """Return whether a transform turns right hands into left ones."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0)
