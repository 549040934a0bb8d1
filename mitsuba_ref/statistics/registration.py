"""Do both films put the same point into the same pixel? Shifts and flips, with noise.

A shift s changes a picture by -s . gradient, so a weighted least-squares fit of a picture
to the gradient is its shift; the fit is linear, each picture yields two numbers, and
Welch's test compares those of ours with theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from mitsuba_ref.statistics.hypothesis_tests.welch import sidak_p, welch
from mitsuba_ref.statistics.noise_free_mse import (
    brightness,
    noise_free_mse,
    squared_difference,
)
from mitsuba_ref.statistics.samples import ROUNDING, Floats

NEGLIGIBLE = 0.05
"""Pixels. A smaller shift is left to the tests of radiance, which see it as well: any
error of a picture is a little like its gradient, and this test is to name shifts."""

FLIPS = {
    "left and right": (slice(None), slice(None, None, -1)),
    "top and bottom": (slice(None, None, -1), slice(None)),
    "both ways": (slice(None, None, -1), slice(None, None, -1)),
}

FLIP_RATIO = 0.25
"""A picture is flipped if its noise-free MSE is less than this part of what it was."""

EXPLAINED = 0.2
"""A shift is named if it explains this part of the difference. A bright tile looks a little
like a shift, which explains up to 9 % of it. Of half a pixel, on four scenes at 32 x 32
pixels, 16 samples and 8 seeds, it explained 31 to 96 %."""


@dataclass(frozen=True)
class Shift:
    """How far our pictures lie to the right of and below theirs."""

    x: float  # [pixels]
    y: float
    standard_errors: tuple[float, float]  # of x, y [pixels]
    degrees: float  # of freedom, the smaller
    p_value: float  # for no shift, of both directions together
    explained: float  # part of the noise-free difference that the shift accounts for

    @property
    def length(self) -> float:
        """Pixels."""
        return float(np.hypot(self.x, self.y))


def picture_shift(ours: Floats, theirs: Floats) -> Shift:
    """Estimate by how much our pictures (K, H, W, C) are shifted against theirs.

    The picture itself and a constant are fitted along with the gradient, so that a wrong
    factor is not taken for a shift. A direction in which the picture does not change gives
    0. Exact to some tenths of its value for shifts below a pixel.
    """
    everything = np.concatenate([ours, theirs])
    smooth = ndimage.convolve1d(everything, [0.25, 0.5, 0.25], axis=1, mode="nearest")
    smooth = ndimage.convolve1d(smooth, [0.25, 0.5, 0.25], axis=2, mode="nearest")
    mean = smooth.mean(axis=0)
    down, right = np.gradient(mean, axis=(0, 1))
    columns = np.stack([-right, -down, mean, np.ones_like(mean)]).reshape(4, -1)
    # Labels unseen: weights from the variances within each side would favour pixels that
    # by chance scatter little within the sides, and p <= 0.05 came in 7.5 % of right pairs.
    # Sixteen values may still give a variance too small by far: the mean steadies it.
    scatter = smooth.var(axis=0, ddof=1)
    noise = scatter + scatter.mean() + 1e-12 * np.mean(mean**2) + 1e-300
    weights = columns / noise.ravel()
    fit = np.linalg.pinv(weights @ columns.T, rcond=1e-9, hermitian=True) @ weights
    places = (smooth - mean).reshape(len(smooth), -1) @ fit[:2].T
    result = welch(places[: len(ours)], places[len(ours) :], forgiven=0.0)
    return Shift(
        x=float(result.difference[0]),
        y=float(result.difference[1]),
        standard_errors=(
            float(result.standard_error[0]),
            float(result.standard_error[1]),
        ),
        degrees=float(result.degrees.min()),
        p_value=sidak_p(float(result.p.min()), 2),
        explained=_explained(
            smooth, len(ours), noise, result.difference @ columns[:2].reshape(2, -1)
        ),
    )


def _explained(pictures: Floats, count: int, noise: Floats, change: Floats) -> float:
    """Return by which part the difference is less without `change`; 0 without a difference.

    Differences are squared without their noise and in units of it, pixel by pixel.
    """
    change = change.reshape(pictures.shape[1:])
    ours, theirs = pictures[:count], pictures[count:]
    before = float(np.mean(squared_difference(ours, theirs) / noise))
    after = float(np.mean(squared_difference(ours - change, theirs) / noise))
    return 1.0 - after / before if before > max(after, 0.0) else 0.0


def find_flip(ours: Floats, theirs: Floats, alpha: float) -> str | None:
    """Return the flip of their pictures that ours look like; None if no flip fits.

    Judged by the noise-free MSE: it must be significant as the pictures are, so that a
    symmetric scene raises no alarm, and a small part of that when they are flipped.
    An `alpha` of 1 is for pictures without noise.
    """
    # In units of a brightness that a flip leaves as it is, or the light's edge decides.
    mean = np.concatenate([ours, theirs]).mean(axis=0)
    flipped = [mean[rows, columns] for rows, columns in FLIPS.values()]
    scale = brightness(np.mean([mean, *flipped], axis=0))
    ours, theirs = ours / scale, theirs / scale
    as_is = noise_free_mse(ours, theirs, alpha)
    rounding = ROUNDING**2 * as_is.mean_square
    if as_is.p_value > alpha or as_is.value <= rounding:
        return None
    left = {
        name: float(np.mean(squared_difference(ours, theirs[:, rows, columns])))
        for name, (rows, columns) in FLIPS.items()
    }
    name = min(left, key=lambda flip: left[flip])
    return name if left[name] < FLIP_RATIO * as_is.value else None
