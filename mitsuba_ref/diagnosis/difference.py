"""Tests whether a picture differs from a reference by more than noise, and measures it.

One noisy picture of unknown sample count is compared with several reference pictures. Its
noise is not known, so it is told from the bias by one fact: the noise of two pixels that
are farther apart than the reconstruction filter is independent. With r the residual of a
pixel in units of the local brightness, the mean of r_p r_q over such pairs (p, q) is the
mean of the products of their biases alone, whatever the distribution of the noise is
(Moran's statistic of spatial correlation [Moran1950]). It is divided by the root of the sum
of the squared products, its standard deviation if there is no bias.

It sees a bias that neighbouring pixels share. It does not see one that changes its sign
from pixel to pixel, nor one that is only in a few pixels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, stats

Floats = NDArray[np.float64]

FALSE_ALARMS = 1e-3  # of a verdict, all tests together
BLOCK = 8  # [pixels]: sums over blocks are the second scale, and units of the mean's noise
DETECTED = 0.99  # probability of the bias that is stated to be seen
ROUNDING = 1e-4  # of the mean: a smaller difference is not called one


@dataclass(frozen=True)
class Test:
    """One statistic in units of its standard deviation without a bias."""

    name: str
    z: float
    p_value: float  # one-sided for products, two-sided for the mean


@dataclass(frozen=True)
class Difference:
    """What the tests say of a picture.

    Parameters
    ----------
    tests
        The tests, of the mean in each channel and of products at two scales.
    p_value
        Of all tests together (Bonferroni).
    size
        Root of the noise-free mean squared difference, relative to the local brightness.
    mean_bias
        Relative difference of the mean of the picture, all channels together.
    detectable
        Relative bias of the mean that would have been seen with probability `DETECTED`.
    """

    tests: tuple[Test, ...]
    p_value: float
    size: float
    mean_bias: float
    detectable: float

    @property
    def differs(self) -> bool:
        """Whether the picture differs by more than noise."""
        beyond = max(self.size, abs(self.mean_bias)) > ROUNDING
        return self.p_value < FALSE_ALARMS and beyond


def local_brightness(reference: Floats) -> Floats:
    """Return the brightness that differences are measured in, (H, W, 1).

    The mean of the channels, smoothed over some pixels, plus a part of the mean of the
    picture: dark parts count less, and the edge of a lamp does not decide alone.
    """
    grey = np.abs(reference).mean(axis=2)
    smooth = ndimage.uniform_filter(grey, size=5, mode="nearest")
    floor = 0.1 * float(grey.mean()) or 1.0
    return np.maximum(smooth, grey)[..., None] + floor


def residuals(picture: Floats, reference: Floats, scale: Floats) -> Floats:
    """Return the difference in units of a scale, (H, W, C)."""
    return (picture - reference) / scale


def pair_products(r: Floats, lag: int) -> Floats:
    """Return r_p r_q of pairs `lag` pixels apart to the right and below, summed over C.

    Each pixel is in at most one pair of each direction, so that the products of a direction
    are independent without a bias.
    """
    products = []
    for axis in (0, 1):
        moved = np.moveaxis(r, axis, 0)
        count = moved.shape[0] // (2 * lag) * (2 * lag)
        pairs = moved[:count].reshape(-1, 2, lag, *moved.shape[1:])
        products.append((pairs[:, 0] * pairs[:, 1]).mean(axis=-1).ravel())
    return np.concatenate(products)


def noise_free_square(r: Floats, lag: int) -> float:
    """Return an estimate of the mean squared bias in the residuals, perhaps below 0."""
    products = pair_products(r, lag)
    return float(products.mean()) if products.size else 0.0


def compare(picture: Floats, references: Sequence[Floats], lag: int) -> Difference:
    """Test a picture (H, W, C) against reference pictures of the same shape.

    Parameters
    ----------
    picture
        One picture, or the mean of several.
    references
        One or more with independent seeds.
    lag
        Distance [pixels] from which on the noise of pixels is independent: the diameter of
        the wider of the two reconstruction filters, rounded up.
    """
    reference = np.mean(references, axis=0)
    scale = local_brightness(reference)
    r = residuals(picture, reference, scale)
    mean = float(reference.mean()) or 1.0
    tests = [_mean_test(r[..., c], f"mean of channel {c}") for c in range(r.shape[2])]
    tests.append(_product_test(r, lag, "neighbouring pixels"))
    blocks = _blocks(r)
    tests.append(_product_test(blocks, 1, f"neighbouring blocks of {BLOCK} pixels"))
    grey = ((picture - reference) / mean).mean(axis=2)
    bias, error = _mean_and_error(grey)
    critical = stats.norm.isf(FALSE_ALARMS / len(tests) / 2) + stats.norm.ppf(DETECTED)
    return Difference(
        tests=tuple(tests),
        p_value=min(1.0, len(tests) * min(test.p_value for test in tests)),
        size=math.sqrt(max(0.0, noise_free_square(r, lag))),
        mean_bias=bias,
        detectable=critical * error,
    )


def _blocks(r: Floats) -> Floats:
    """Return the means of blocks, (H / BLOCK, W / BLOCK, C); the rest is left out."""
    rows, columns = r.shape[0] // BLOCK, r.shape[1] // BLOCK
    cut = r[: rows * BLOCK, : columns * BLOCK]
    blocks: Floats = cut.reshape(rows, BLOCK, columns, BLOCK, -1).mean(axis=(1, 3))
    return blocks


def _mean_and_error(values: Floats) -> tuple[float, float]:
    """Return the mean of (H, W) and its standard error from the scatter of blocks.

    A bias that differs from block to block raises the error: it errs on the safe side.
    """
    blocks = _blocks(values[..., None]).ravel()
    mean = float(values.mean())
    if blocks.size < 2:
        return mean, math.inf
    return mean, float(blocks.std(ddof=1) / math.sqrt(blocks.size))


def _mean_test(values: Floats, name: str) -> Test:
    mean, error = _mean_and_error(values)
    degrees = max(1, values.size // BLOCK**2 - 1)
    z = mean / error if error > 0.0 else math.copysign(math.inf, mean) if mean else 0.0
    return Test(name, z, float(2.0 * stats.t.sf(abs(z), degrees)))


def _product_test(r: Floats, lag: int, name: str) -> Test:
    products = pair_products(r, lag)
    spread = math.sqrt(float(np.sum(products**2)))
    z = float(products.sum()) / spread if spread > 0.0 else 0.0
    return Test(name, z, float(stats.norm.sf(z)))
