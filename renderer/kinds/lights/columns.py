"""Tables of lights: one column for each light id, zero for lights of other kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def vector_columns(count: int, rows: dict[int, Any]) -> NDArray[np.float32]:
    """Return (3, count) with the given columns, zero elsewhere."""
    table = np.zeros((3, count), np.float32)
    for i, row in rows.items():
        table[:, i] = row
    return table


def number_column(count: int, values: dict[int, float]) -> NDArray[np.float32]:
    """Return (count,) with the given numbers, zero elsewhere."""
    table = np.zeros(count, np.float32)
    for i, value in values.items():
        table[i] = value
    return table
