"""Intervals of positive numbers: of a mean over seeds, and of a mean of ratios."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mitsuba_ref.statistics.equal_error import geometric_mean
from mitsuba_ref.statistics.hypothesis_tests.welch import critical_t
from reports.bench.timing import LEVEL, Interval


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the interval of the mean of positive numbers, symmetric in the logarithm.

    By Student's t; never below 0, as an error bar on a logarithmic axis must not be.
    """
    mean = float(np.mean(values))
    if mean <= 0.0:
        return mean, mean
    error = float(np.std(values, ddof=1)) / (math.sqrt(len(values)) * mean)
    return around(mean, error, len(values) - 1)


def around(value: float, log_error: float, degrees: float) -> Interval:
    """Return the interval of a value whose logarithm has this standard error."""
    factor = math.exp(min(float(critical_t(1.0 - LEVEL, 1, degrees)) * log_error, 700.0))
    return value / factor, value * factor


def mean_of_ratios(
    ratios: Sequence[float], intervals: Sequence[Interval], degrees: Sequence[int]
) -> tuple[float, Interval]:
    """Return the geometric mean of ratios that were measured apart, with its interval.

    Parameters
    ----------
    ratios, intervals
        As `around` returns them.
    degrees
        Of freedom, of each interval.
    """
    mean = geometric_mean(ratios)
    errors = [
        math.log(max(high / value, 1.0)) / float(critical_t(1.0 - LEVEL, 1, own))
        for value, (_, high), own in zip(ratios, intervals, degrees, strict=True)
    ]
    error = math.hypot(*errors) / len(errors)
    return mean, around(mean, error, degrees_of_sum(errors, degrees))


def degrees_of_sum(errors: Sequence[float], degrees: Sequence[int]) -> float:
    """Return the degrees of freedom of the sum of independent numbers.

    By Welch and Satterthwaite [Welch1947]: those of the number with the largest
    standard error if it is much larger than the others, all together if they are alike.
    """
    largest = max(errors)
    if not 0.0 < largest < math.inf:
        return min(degrees)
    squares = [(error / largest) ** 2 for error in errors]  # relative: none overflows
    each = zip(squares, degrees, strict=True)
    return sum(squares) ** 2 / sum(square**2 / own for square, own in each)
