"""Choosing one of many, a pixel of a sky, a lamp, with one float32 random number."""

from __future__ import annotations

import numpy as np

from reports.limits.row import Row

NUMBERS = 2**24  # that a float32 in [0, 1) has, evenly spaced


def _uneven(entries: float) -> float:
    """Return by how much the likeliest of n equal entries is too likely."""
    n = int(entries)
    # entry k gets the numbers j with k <= n j / 2^24 < k + 1
    firsts = -(-np.arange(n + 1, dtype=np.int64) * NUMBERS // n)
    return float(np.abs(np.diff(firsts) * (n / NUMBERS) - 1.0).max())


ROWS = (
    Row(
        name="choice-by-one-float",
        method="One of n by one float32 random number",
        stress="n, equally likely",
        measure=_uneven,
        quantity="error",
        unit="of the worst entry's probability",
        strengths=(1e2, 1e3, 1e4, 1e5, 1e6, 3e6),
        tolerance=1e-2,
        holds_at=1e5,
        fails_at=1e6,
        why="There are 2^24 such numbers: an entry gets 16 or 17 of them when n is 10^6.",
        instead="A second number for what is left, as our alias tables take, or 64 bits.",
        source="measured here",
    ),
)
