"""Tests whether a picture differs from a reference by more than noise, and measures it.

One noisy picture of unknown sample count is compared with several reference pictures. Its
noise is not known, so it is told from the bias by one fact: the noise of two pixels that
are farther apart than the reconstruction filter is independent. With r the residual of a
pixel in units of the local brightness, the mean of r_p r_q over such pairs (p, q) is the
mean of the products of their biases alone, whatever the distribution of the noise is
(Moran's statistic of spatial correlation [Moran1950]). Student's t of its sums over small
cells of the picture tells whether it is above 0.

It sees a bias that neighbouring pixels share. It does not see one that changes its sign
from pixel to pixel, nor one that is only in a few pixels. Several pictures on both sides
tell the noise of each tile, and Welch's test of tiles sees a bias that is in one alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, stats

from mitsuba_ref.statistics.hypothesis_tests.welch import tile_test

Floats = NDArray[np.float64]

FALSE_ALARMS = 1e-3  # of a verdict, all tests together
BLOCK = 8  # [pixels]: means of blocks are the second scale; not below the filter's diameter
SMALLEST = 4 * BLOCK  # [pixels] of a side; a smaller picture has too few pairs
DETECTED = 0.99  # probability of the bias that is stated to be seen
TILES = "tiles"
FOR_TILES = 4  # pictures of either side: fewer say too little about the noise of a tile
ROUNDING = 1e-4  # of the mean: a smaller difference is not called one


@dataclass(frozen=True)
class Test:
    """One statistic in units of its standard deviation without a bias."""

    name: str
    z: float
    p_value: float  # one-sided for products, two-sided for the mean and for tiles


@dataclass(frozen=True)
class Difference:
    """What the tests say of a picture.

    Parameters
    ----------
    tests
        The tests: of the mean in each channel, of products at two scales, of tiles.
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
        return self.p_value < FALSE_ALARMS and (beyond or self._in_a_tile)

    @property
    def _in_a_tile(self) -> bool:
        """Whether one tile differs; the test itself forgives differences by rounding."""
        return any(
            test.name == TILES and test.p_value < FALSE_ALARMS / len(self.tests)
            for test in self.tests
        )


def local_brightness(reference: Floats, lag: int) -> Floats:
    """Return the brightness that differences are measured in, (H, W, 1).

    The mean of the channels around a pixel, plus a part of the mean of the picture: dark
    parts count less, and the edge of a lamp does not decide alone. Pixels nearer than `lag`
    are left out. Their noise is that of the pixel itself, and a residual divided by it has
    a mean that is not 0: equal pictures of 512 x 512 pixels with 30 % noise differed by 13
    standard errors.
    """
    grey = np.abs(reference).mean(axis=2)
    hole, window = 2 * lag - 1, 2 * lag + 7
    around = ndimage.uniform_filter(grey, window, mode="nearest") * window**2
    around -= ndimage.uniform_filter(grey, hole, mode="nearest") * hole**2
    floor = 0.1 * float(grey.mean()) or 1.0
    smooth = np.maximum(around, 0.0) / (window**2 - hole**2)
    return np.asarray(smooth[..., None] + floor)


def residuals(picture: Floats, reference: Floats, scale: Floats) -> Floats:
    """Return the difference in units of a scale, (H, W, C)."""
    return (picture - reference) / scale


def pair_products(r: Floats, lag: int) -> list[Floats]:
    """Return r_p r_q of pairs `lag` pixels apart to the right and below, means over C.

    Each pixel is in at most one pair of each direction. Neighbouring pairs share the noise
    of a filter: the products are summed over cells of 2 lag x 2 lag pixels, which are
    independent but for their borders.
    """
    cells = []
    side = 2 * lag
    for axis in (0, 1):
        moved = np.moveaxis(r, axis, 0)
        rows, columns = (n // side for n in moved.shape[:2])
        cut = moved[: rows * side, : columns * side]
        pairs = cut.reshape(rows, 2, lag, columns, side, -1)
        cells.append((pairs[:, 0] * pairs[:, 1]).mean(axis=(1, 3, 4)))
    return cells


def noise_free_square(r: Floats, lag: int) -> float:
    """Return an estimate of the mean squared bias in the residuals, perhaps below 0."""
    return float(np.mean([cells.mean() for cells in pair_products(r, lag)]))


def compare(
    pictures: Sequence[Floats], references: Sequence[Floats], lag: int
) -> Difference:
    """Test pictures (H, W, C) against reference pictures of the same shape.

    Parameters
    ----------
    pictures, references
        One or more with independent seeds. Tiles are tested as well if there are at least
        `FOR_TILES` of either.
    lag
        Distance [pixels] from which on the noise of pixels is independent: the diameter of
        the wider of the two reconstruction filters, rounded up.
    """
    picture, reference = np.mean(pictures, axis=0), np.mean(references, axis=0)
    r = residuals(picture, reference, local_brightness(reference, lag))
    # not in units of the scale, which is noisy too: see `local_brightness`
    plain = (picture - reference) / (float(reference.mean()) or 1.0)
    tests = [_mean_test(plain[..., c], f"mean of channel {c}") for c in range(r.shape[2])]
    tests.append(_product_test(r, lag, "neighbouring pixels"))
    # blocks that touch share the noise at their border
    tests.append(_product_test(_blocks(r), 2, f"neighbouring blocks of {BLOCK} pixels"))
    if (count := min(len(pictures), len(references))) >= FOR_TILES:
        # as many on both sides: the noise of few samples is skewed, its difference is not
        found = tile_test(np.stack(pictures[:count]), np.stack(references[:count]))
        tests.append(Test(TILES, found.largest_t, found.p_value))
    bias, error = _mean_and_error(plain.mean(axis=2))
    critical = stats.norm.isf(FALSE_ALARMS / len(tests) / 2) + stats.norm.ppf(DETECTED)
    return Difference(
        tests=tuple(tests),
        p_value=min(1.0, len(tests) * min(test.p_value for test in tests)),
        size=math.sqrt(max(0.0, noise_free_square(r, lag))),
        mean_bias=bias,
        detectable=critical * error,
    )


def _blocks(r: Floats, side: int = BLOCK) -> Floats:
    """Return the means of blocks, (H / side, W / side, C); the rest is left out."""
    rows, columns = r.shape[0] // side, r.shape[1] // side
    cut = r[: rows * side, : columns * side]
    blocks: Floats = cut.reshape(rows, side, columns, side, -1).mean(axis=(1, 3))
    return blocks


def _mean_and_error(values: Floats) -> tuple[float, float]:
    """Return the mean of (H, W) and its standard error from the scatter of large blocks.

    Their sides are two of `BLOCK`, so that what a filter lets them share weighs little. A
    bias that differs from block to block raises the error: it errs on the safe side.
    """
    large = _blocks(_blocks(values[..., None]), 2).ravel()
    return float(values.mean()), float(large.std(ddof=1) / math.sqrt(large.size))


def _mean_test(values: Floats, name: str) -> Test:
    mean, error = _mean_and_error(values)
    degrees = values.size // (2 * BLOCK) ** 2 - 1
    z = mean / error if error > 0.0 else math.copysign(math.inf, mean) if mean else 0.0
    return Test(name, z, float(2.0 * stats.t.sf(abs(z), max(1, degrees))))


def _product_test(r: Floats, lag: int, name: str) -> Test:
    cells = np.concatenate([part.ravel() for part in pair_products(r, lag)])
    if cells.size < 2 or not cells.std() > 0.0:
        return Test(name, 0.0, 1.0)
    z = float(cells.mean() / cells.std(ddof=1) * math.sqrt(cells.size))
    return Test(name, z, float(stats.t.sf(z, cells.size - 1)))
