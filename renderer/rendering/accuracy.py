"""How far a picture is from its limit, told from the picture's own samples.

The error of a picture a against the limit r that it would reach with samples without end:

    error = sqrt(mean((a - r)^2 / (r^2 + 0.01 m^2)))

over all pixels and channels but the thousandth part with the largest quotients, where m is
the mean of r: 0.02 means "2 %", and pixels darker than a tenth of the mean count as if they
were that bright.

To estimate it, the samples are divided into two halves with the means a1 and a2. Where
these are independent, (a1 - a2) / 2 has the variance of a = (a1 + a2) / 2 at every pixel,
whatever the reconstruction filter, if both halves have samples there; and where both are
normal it hardly says anything about a, so that stopping when it is small hardly pulls the
picture anywhere. It takes the place of a - r. A thousandth is left out of both, so heavy
tails weigh alike.

In the place of r stands a, but where one half is more than 1.5 times the other: a rare
bright sample makes that pixel of a too bright, and its error, divided by that, looks small.
There it is the mean of the 3 x 3 pixels around, if that is darker. With a alone the claims
for `scenes/evening-sky` were low by 21 %, with this by 2 %.

What that cannot know: light that no sample has met, or so few that they are all among the
thousandth, such as a lamp that one path in a million finds. And a very noisy picture is a
poor r: at an error of 57 % claims were low by a third. Up to 33 % they are good to a tenth.
Where either shows, the estimate says that it is unsure.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

LEFT_OUT = 1e-3  # of all values, the largest
FLOOR = 0.01  # times the squared mean is added to squares in the denominator
BLOCK = 8  # pixels on a side of the parts whose scatter shows how sure the estimate is
UNSURE = 0.1  # an estimate whose own relative standard error is more is called unsure
TOO_NOISY = 0.3  # and so is a larger error
APART = 0.2  # (a - b) / (a + b) where a is one and a half times b
Floats = NDArray[np.float64]


def relative_squares(difference: Any, reference: Any) -> Floats:
    """Return d^2 / (r^2 + 0.01 m^2) for every pixel and channel; 0 where one is no number.

    Where the denominator is 0, all of `reference` is.
    """
    d, r = np.asarray(difference, np.float64), np.asarray(reference, np.float64)
    known = np.isfinite(d) & np.isfinite(r)
    d, r = np.where(known, d, 0.0), np.where(known, r, 0.0)
    denominator = r * r + FLOOR * float(np.mean(r)) ** 2
    return np.divide(d * d, denominator, out=np.zeros_like(d), where=denominator > 0.0)


def relative_error(difference: Any, reference: Any) -> float:
    """Return the error of the module's formula, for pictures (height, width, channels)."""
    return float(np.sqrt(_kept(relative_squares(difference, reference)).mean()))


def _kept(squares: Floats) -> Floats:
    """Return all but the largest, the last of them being the largest of these."""
    kept = max(1, squares.size - int(LEFT_OUT * squares.size))
    return np.partition(squares, kept - 1, axis=None)[:kept]


class Accuracy(NamedTuple):
    """An estimated error."""

    samples: int  # per pixel that it is the error of
    error: float  # relative: 0.02 is 2 %
    uncertainty: float  # relative standard error of `error` itself; infinite: no idea
    of_pixels: NDArray[np.float32]  # (height, width, channels), one guess of a - r each

    @property
    def steady(self) -> bool:
        """Whether many pixels make up the estimate; if not: heavy tails, a tiny picture."""
        return self.uncertainty <= UNSURE

    @property
    def unsure(self) -> bool:
        """Whether the true error may well be another one."""
        return not (self.steady and self.error <= TOO_NOISY)


def estimate(first: Any, second: Any, samples: int) -> Accuracy:
    """Estimate the error of the mean of two pictures of as many samples each."""
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    with np.errstate(invalid="ignore"):  # infinite in both
        guess, limit = (first - second) / 2, _limit(first, second)
        error = relative_error(guess, limit)
        uncertainty = _uncertainty(guess, limit)
    return Accuracy(samples, error, uncertainty, guess.astype(np.float32))


def _limit(first: Floats, second: Floats) -> Floats:
    """Return what stands for the limit of the mean of two pictures."""
    mean = (first + second) / 2
    rows, columns = mean.shape[:2]
    padded = np.pad(mean, ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = sum(padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3))
    bright = np.abs(first - second) > APART * np.abs(first + second)
    return np.where(bright, np.fmin(mean, around / 9.0), mean)


def _uncertainty(guess: Floats, limit: Floats) -> float:
    """Return the relative standard error of the root, from the scatter between blocks.

    The root of a mean has half of the mean's relative error.
    """
    squares = relative_squares(guess, limit)
    clipped = np.minimum(squares, _kept(squares)[-1])
    if not np.isfinite(guess).all() or not limit.any():
        return float("inf")
    if not squares.any():
        return 0.0  # of a picture without noise
    beyond = squares > clipped
    if np.sum(guess[beyond] ** 2) > 0.5 * np.sum(guess**2):
        return float("inf")  # what was left out is most of it
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
    # blocks differ in brightness too, not only by chance: mostly this is too large
    return float(means.std(ddof=1) / np.sqrt(means.size) / means.mean() / 2)
