"""How far a picture is from its limit, told from the picture's own samples.

The error of a picture a beside the limit r that it would reach with samples without end:

    error = sqrt(mean((a - r)^2 / (r^2 + 0.01 m^2)))

over all pixels and channels but the thousandth part with the largest quotients, where m is
the mean of r: 0.02 means "2 %", and pixels darker than a tenth of the mean count as if they
were that bright.

To estimate it, the samples are divided into two halves with the means a1 and a2. Where
these are independent, (a1 - a2) / 2 has the variance of a = (a1 + a2) / 2 at every pixel,
whatever the reconstruction filter; and where both are normal it says nothing about a, so
that stopping when it is small does not pull the picture anywhere. It takes the place of
a - r, and a that of r. A thousandth is left out of both, so heavy tails weigh alike. What
no sample has met yet, such as a lamp that one path in a million finds, is in neither.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

LEFT_OUT = 1e-3  # of all values, the largest
FLOOR = 0.01  # times the squared mean is added to squares in the denominator
BLOCK = 8  # pixels on a side of the parts whose scatter shows how sure the estimate is
UNSURE = 0.1  # an estimate whose own relative standard error is more is called unsure

Floats = NDArray[np.float64]


def relative_squares(difference: Any, reference: Any) -> Floats:
    """Return d^2 / (r^2 + 0.01 m^2) for every pixel and channel."""
    d, r = np.asarray(difference, np.float64), np.asarray(reference, np.float64)
    denominator = r * r + FLOOR * float(np.mean(r)) ** 2
    return np.divide(d * d, denominator, out=np.zeros_like(d), where=denominator > 0.0)


def relative_error(difference: Any, reference: Any) -> float:
    """Return the error of the module's formula, for pictures (height, width, channels)."""
    return _root_of_mean(relative_squares(difference, reference))


def _root_of_mean(squares: Floats) -> float:
    kept = squares.size - int(np.ceil(LEFT_OUT * squares.size))
    if kept == 0:  # a picture of a few pixels
        kept = squares.size
    return float(np.sqrt(np.partition(squares, kept - 1, axis=None)[:kept].mean()))


class Accuracy(NamedTuple):
    """An estimated error."""

    samples: int  # per pixel that it is the error of
    error: float  # relative: 0.02 is 2 %
    uncertainty: float  # relative standard error of `error` itself
    of_pixels: NDArray[np.float32]  # (height, width, channels), one guess of a - r each

    @property
    def unsure(self) -> bool:
        """Whether a few pixels decide the estimate: heavy tails, or a tiny picture."""
        return not self.uncertainty <= UNSURE


def estimate(first: Any, second: Any, samples: int) -> Accuracy:
    """Estimate the error of the mean of two pictures of as many samples each."""
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    guess = (first - second) / 2
    squares = relative_squares(guess, (first + second) / 2)
    error = _root_of_mean(squares)
    return Accuracy(samples, error, _uncertainty(squares), guess.astype(np.float32))


def _uncertainty(squares: Floats) -> float:
    """Return the relative standard error of the root, from the scatter between blocks.

    The root of a mean has half of the mean's relative error.
    """
    largest = np.partition(squares, -1 - int(LEFT_OUT * squares.size), axis=None)
    clipped = np.minimum(squares, largest[-1 - int(LEFT_OUT * squares.size)])
    rows, columns = (max(1, n // BLOCK) for n in clipped.shape[:2])
    means = np.array(
        [
            block.mean()
            for band in np.array_split(clipped, rows, axis=0)
            for block in np.array_split(band, columns, axis=1)
        ]
    )
    if means.size < 2:
        return float("inf")
    if means.mean() == 0.0:
        return 0.0
    # blocks differ in brightness too, not only by chance: this is an upper bound
    return float(means.std(ddof=1) / np.sqrt(means.size) / means.mean() / 2)
