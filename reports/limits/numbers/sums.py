"""Adding many numbers: the sums of a film."""

from __future__ import annotations

import numpy as np

from mitsuba_ref.expected_failures.rounding import single_precision_sum
from reports.limits.row import Row


def _ones_missing(count: float) -> float:
    """Return which share of so many ones a float32 counter does not count."""
    ones = np.ones(int(count), np.float32)
    return 1.0 - float(np.add.accumulate(ones, dtype=np.float32)[-1]) / int(count)


def _single(count: float) -> float:
    return abs(single_precision_sum(int(count)) - 1.0)


def _double(count: float) -> float:
    tenths = np.full(int(count), 0.1, np.float32)
    total = np.add.accumulate(tenths, dtype=np.float64)[-1]
    return abs(float(total) / (int(count) * float(np.float32(0.1))) - 1.0)


_COUNTS = (1e3, 1e4, 1e5, 1e6, 3e6, 1e7)

ROWS = (
    Row(
        name="sum-in-float32",
        method="Running sum in float32",
        stress="summands",
        measure=_single,
        quantity="error",
        unit="of the sum",
        strengths=_COUNTS,
        tolerance=1e-2,
        holds_at=3e5,
        fails_at=3e6,
        why="Each step of the sum is rounded to its last place, which soon is larger than "
        "the summand's own, and always to the same side.",
        instead="Add in float64 (the film does), or a tile's sum to the picture's.",
        source="measured here; register of expected failures, single precision film",
    ),
    Row(
        name="counter-in-float32",
        method="Counter in float32",
        stress="samples counted",
        measure=_ones_missing,
        quantity="error",
        unit="of the count missing",
        strengths=(1e4, 1e5, 1e6, 1e7, 2.0**24, 1.8e7, 2e7),
        tolerance=1e-6,
        holds_at=2.0**24,
        fails_at=2.0**24 + 1000,
        why="Beyond 2^24 the next float32 is 2 away, so that adding 1 changes nothing.",
        instead="Count in integers, or add weights in float64.",
        source="measured here",
    ),
    Row(
        name="sum-in-float64",
        method="Running sum in float64",
        stress="summands",
        measure=_double,
        quantity="error",
        unit="of the sum",
        strengths=_COUNTS,
        tolerance=1e-9,
        holds_at=1e7,
        fails_at=None,
        why="29 bits more put the same loss at some 10^15 summands.",
        instead="Nothing: this is what the film does.",
        source="measured here",
    ),
)
