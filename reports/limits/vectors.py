"""Vectors in rows, in whatever precision they come: what a first renderer would write."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[Any]  # (n, 3), or (n, m, 3)


def dot(a: Rows, b: Rows) -> NDArray[Any]:
    """Return inner products, summed in the precision of the rows."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def unit(rows: Rows) -> Rows:
    """Return the rows with length 1."""
    return np.asarray(rows / np.sqrt(dot(rows, rows))[..., None])


def directions(count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Return unit vectors (count, 3) without a preferred direction."""
    return unit(generator.standard_normal((count, 3)))


def single(rows: Any) -> NDArray[np.float32]:
    """Return numbers in float32."""
    return np.asarray(rows, np.float32)
