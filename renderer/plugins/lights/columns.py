"""Tables of lights: one column for each light id, zero for lights of other kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns


def vector_columns(count: int, rows: dict[int, Any]) -> NDArray[np.float32]:
    """Return (4, count), vectors for `gather_vectors`, zero for ids without a vector."""
    table = np.zeros((4, count), np.float32)
    for i, row in rows.items():
        table[:3, i] = row
    return by_columns(table)


def number_column(count: int, values: dict[int, float]) -> NDArray[np.float32]:
    """Return (count,) with the given numbers, zero elsewhere."""
    table = np.zeros(count, np.float32)
    for i, value in values.items():
        table[i] = value
    return table
