"""Welch's t-test for pixels, tiles and whole pictures, and Sidak's correction.

The test asks whether two expectations are equal and lets the variances differ [Welch1947]:
two samplers may differ in noise. It is not exact, but close for roughly normal noise. The
noise of pixels with few samples is not normal. But with as many pictures on both sides the
difference is symmetric when both renderers are right, and heavy tails raise the variance
with the difference. Measured on Mitsuba against itself the largest |t| of a
picture alarms no more often than it claims (docs/statistics.md).

Of m independent tests the smallest p-value is below 1 - (1 - alpha)^(1/m) with probability
alpha; with less if they depend on each other, as the channels of a pixel do [Sidak1967].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from mitsuba_ref.metrics.distances import TILE, tile_means
from mitsuba_ref.statistics.samples import ROUNDING, Floats, standard_errors


@dataclass(frozen=True, eq=False)
class Welch:
    """Welch's test at each place; all arrays have the shape of one picture."""

    t: Floats  # signed; 0 without any difference, infinite if a difference has no noise
    degrees: Floats  # of freedom
    p: Floats  # two-sided
    difference: Floats  # mean of the first sample less that of the second
    standard_error: Floats  # of the difference
    scale: Floats  # mean of the absolute means, what a relative bias refers to


@dataclass(frozen=True)
class FamilyTest:
    """The largest |t| of many tests, judged for all together."""

    largest_t: float
    p_value: float  # Sidak: of the smallest p among `tests`
    tests: int
    degrees: float  # median degrees of freedom, of the tests with noise if there are any
    relative_error: float  # the same of the difference's standard error by the value


def welch(first: Floats, second: Floats, forgiven: float = ROUNDING) -> Welch:
    """Test at each place whether two samples have the same expectation.

    Parameters
    ----------
    first, second
        (K, ...) and (L, ...), K and L at least 2: the same place of independent pictures.
    forgiven
        Relative difference that is ignored. Makes p a little too large where the
        noise is as small as this.
    """
    count, other = len(first), len(second)
    mean, mean_other = first.mean(axis=0), second.mean(axis=0)
    part = first.var(axis=0, ddof=1) / count
    part_other = second.var(axis=0, ddof=1) / other
    variance = part + part_other
    scale = (np.abs(mean) + np.abs(mean_other)) / 2.0
    difference = mean - mean_other
    t = standard_errors(difference, variance, scale, forgiven)
    with np.errstate(divide="ignore", invalid="ignore"):
        degrees = variance**2 / (part**2 / (count - 1) + part_other**2 / (other - 1))
    # Without noise any number serves: t is 0 or infinite. So it does for noise so small
    # that its square is not a number any more.
    degrees = np.where(np.isfinite(degrees), degrees, float(count + other - 2))
    p = np.where(np.isinf(t), 0.0, 2.0 * special.stdtr(degrees, -np.abs(t)))
    return Welch(t, degrees, p, difference, np.sqrt(variance), scale)


def sidak_limit(alpha: float, tests: int) -> float:
    """Return the p-value below which one of `tests` alarms, `alpha` for all together."""
    return -float(np.expm1(np.log1p(-alpha) / tests))


def sidak_p(smallest: float, tests: int) -> float:
    """Return the probability that the smallest of `tests` p-values is this small."""
    return 1.0 if smallest >= 1.0 else -float(np.expm1(tests * np.log1p(-smallest)))


def family_test(result: Welch) -> FamilyTest:
    """Judge all places of a `Welch` together.

    Places without any noise count as tests as well: a difference there is an alarm.
    """
    relative = np.divide(
        result.standard_error,
        result.scale,
        out=np.zeros_like(result.scale),
        where=result.scale > 0.0,
    )
    noisy = relative > ROUNDING
    typical = noisy if noisy.any() else np.ones_like(noisy)
    return FamilyTest(
        largest_t=float(np.max(np.abs(result.t))),
        p_value=sidak_p(float(np.min(result.p)), result.p.size),
        tests=result.p.size,
        degrees=float(np.median(result.degrees[typical])),
        relative_error=float(np.median(relative[typical])),
    )


def pixel_test(ours: Floats, theirs: Floats) -> FamilyTest:
    """Test every pixel and channel of pictures (K, H, W, C).

    Finds one wrong pixel; a small bias of all pixels drowns in their noise.
    """
    return family_test(welch(ours, theirs))


def tile_test(ours: Floats, theirs: Floats, tile: int = TILE) -> FamilyTest:
    """Test the mean of every tile and channel of pictures (K, H, W, C).

    A bias of a whole region stands out 8 times further from the noise in a tile's mean
    than in its pixels, and a mean of 64 pixels is closer to normal than a pixel. Tiles of
    the box filter share no samples. What cancels inside a tile is not seen: a shift of a
    texture.
    """
    return family_test(welch(tiled(ours, tile), tiled(theirs, tile)))


def tiled(pictures: Floats, tile: int = TILE) -> Floats:
    """Return the tile means of pictures (K, H, W, C); a rest at the border is a tile."""
    return np.stack([tile_means(picture, tile) for picture in pictures])


def mean_test(ours: Floats, theirs: Floats) -> FamilyTest:
    """Test the mean of the whole picture (K, H, W, C), channel by channel.

    Most sensitive to what all pixels have in common: a wrong factor, lost or gained energy.
    Blind to what cancels over the picture. Needs no independence between pixels, so it
    holds for any reconstruction filter.
    """
    return family_test(welch(ours.mean(axis=(1, 2)), theirs.mean(axis=(1, 2))))


def critical_t(alpha: float, tests: int, degrees: float) -> float:
    """Return the |t| that one of `tests` must exceed for an alarm."""
    return -float(special.stdtrit(degrees, sidak_limit(alpha, tests) / 2.0))
