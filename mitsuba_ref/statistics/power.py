"""What a test would have seen: the smallest bias that it detects with 99 % probability.

A test that passes says little unless it could have failed. From the measured variances
and the noncentral t distribution follows, for each test at its false alarm rate, the bias
that would have raised an alarm in 99 of 100 such runs [Cohen1988].
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy import optimize, special

from mitsuba_ref.statistics.floors import Floor
from mitsuba_ref.statistics.hypothesis_tests.uniformity import BINS, Uniformity
from mitsuba_ref.statistics.hypothesis_tests.welch import FamilyTest, critical_t
from mitsuba_ref.statistics.noise_free_mse import NoiseFreeMse
from mitsuba_ref.statistics.samples import ROUNDING, Floats

POWER = 0.99
Z = 2.3263478740408408
"""The 99th percentile of the normal distribution."""


def noncentrality(critical: float, degrees: float, power: float = POWER) -> float:
    """Return the bias, in standard errors, with which |t| > `critical` at this power."""

    def missing(bias: float) -> float:
        # The other tail, t < -critical, is below 1e-9 for any power worth asking for.
        return 1.0 - float(special.nctdtr(degrees, bias, critical)) - power

    return float(optimize.brentq(missing, 0.0, 4.0 * critical + 20.0, xtol=1e-6))


def detectable_bias(test: FamilyTest, alpha: float) -> float:
    """Return the relative bias of one place that the test would see.

    One place of median noise: one pixel, one tile, or the picture's mean. However small
    the noise, a bias that `welch` forgives is not seen.
    """
    critical = critical_t(alpha, test.tests, test.degrees)
    return ROUNDING + noncentrality(critical, test.degrees) * test.relative_error


def detectable_rms(result: NoiseFreeMse, ours: Floats, theirs: Floats) -> float:
    """Return the root mean square of a bias that the noise-free MSE would see.

    Relative to that of the picture, for a bias in proportion to the picture. Such a bias b
    adds mean(b^2) to the estimate and 2 mean(b * noise) to its scatter.
    """
    if result.mean_square <= 0.0 or not math.isfinite(result.limit):
        return math.inf
    picture = theirs.mean(axis=0)
    noise = ours.var(axis=0, ddof=1) / len(ours) + theirs.var(axis=0, ddof=1) / len(theirs)
    cross = 4.0 * float(np.sum(picture**2 * noise)) / picture.size**2

    def missing(bias: float) -> float:
        scatter = math.sqrt(result.spread**2 + bias**2 * cross)
        return bias**2 * result.mean_square - Z * scatter - max(result.limit, 0.0)

    return _root(missing)


def detectable_in_all_pixels(
    result: Uniformity, degrees: float, relative_error: float
) -> float:
    """Return the relative bias of every pixel that the test of uniformity would see.

    With a bias of d standard errors in each pixel the share of p-values below p is the
    probability that a noncentral t exceeds the critical one; the largest distance from the
    straight line must clear the limit and the scatter of a distance, 1 / (2 sqrt(n)).
    """
    if not math.isfinite(result.limit) or relative_error <= ROUNDING:
        return math.inf
    levels = np.arange(1, BINS) / BINS
    critical = -special.stdtrit(degrees, levels / 2.0)
    needed = result.limit + Z / (2.0 * math.sqrt(result.pixels))

    def missing(bias: float) -> float:
        right = 1.0 - special.nctdtr(degrees, bias, critical)
        left = special.nctdtr(degrees, bias, -critical)
        return float(np.max(right + left - levels)) - needed

    return ROUNDING + _root(missing) * relative_error


def detectable_above_floor(floor: Floor, mean_square: float) -> float:
    """Return the root mean square of a bias that RMSE against its floor would see.

    Relative to that of the picture. A bias b turns a floor f into sqrt(f^2 + b^2).
    """
    if mean_square <= 0.0 or not math.isfinite(floor.limit):
        return math.inf
    base = max(floor.ours, floor.theirs)
    needed = base + max(floor.limit, 0.0) + Z * floor.spread
    return math.sqrt(max(0.0, needed**2 - base**2) / mean_square)


def _root(missing: Callable[[float], float]) -> float:
    """Return where an increasing function becomes positive; infinite if it does not."""
    high = 1e-9
    while missing(high) < 0.0:
        high *= 4.0
        if high > 1e6:
            return math.inf
    return float(optimize.brentq(missing, 0.0, high))
