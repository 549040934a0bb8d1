"""Do both films put the same point into the same pixel? Shifts and flips, with noise.

Two ways. On a special scene, a lit half-plane: the covered share of each pixel is known in
closed form, so a slanted edge tells its shift along its normal to 0.01 pixels. And on
any two sets of pictures: a shift s changes a picture by -s . gradient, so a weighted
least-squares fit of a picture to the gradient is its shift; the fit is linear, each
picture yields two numbers, and Welch's test compares those of ours with theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, optimize

from mitsuba_ref.statistics.hypothesis_tests.welch import sidak_p, welch
from mitsuba_ref.statistics.noise_free_mse import (
    brightness,
    noise_free_mse,
    squared_difference,
)
from mitsuba_ref.statistics.samples import ROUNDING, Floats

LARGEST = 2.0  # [pixels], of a shift that an edge is searched for

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
class Edge:
    """Where a picture has the edge of a half-plane."""

    shift: float  # [pixels] along the normal, towards the dark side
    residual: float  # RMS of what is left: noise, or another picture altogether


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


def half_plane_coverage(
    width: int, height: int, normal: tuple[float, float], offset: float
) -> Floats:
    """Return the share of each pixel in which normal . p < offset, (H, W).

    The distance of a uniform point of the unit square from its centre, along the normal
    (a, b), is a U + b V with U, V uniform in [-1/2, 1/2]; its distribution function is the
    second difference of a ramp squared, a trapezoid integrated.

    Parameters
    ----------
    width, height
        Pixels.
    normal
        Of length 1, x to the right and y *down*; both components away from 0.
    offset
        Pixels, with p = (0, 0) in the upper left corner of the film.
    """
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return _distribution(offset - normal[0] * x - normal[1] * y, normal)


def _distribution(distance: Floats, normal: tuple[float, float]) -> Floats:
    a, b = abs(normal[0]), abs(normal[1])

    def ramp(h: Floats) -> Floats:
        return np.maximum(h, 0.0) ** 2

    outer, inner = (a + b) / 2.0, (a - b) / 2.0
    total = ramp(distance + outer) - ramp(distance + inner)
    total += ramp(distance - outer) - ramp(distance - inner)
    # Two differences of squares, each up to 1e6: rounding leaves 1e-10 on either side.
    return np.asarray(np.clip(total / (2.0 * a * b), 0.0, 1.0))


def edge_shift(picture: Floats, normal: tuple[float, float], offset: float) -> Edge:
    """Fit the half-plane's edge to a picture (H, W) of it, 1 lit and 0 dark.

    The parameters are those of `half_plane_coverage` and say where the edge should be.
    """
    height, width = picture.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    distance = offset - normal[0] * x - normal[1] * y

    def squares(shift: float) -> float:
        return float(np.mean((picture - _distribution(distance + shift, normal)) ** 2))

    # The sum has one minimum for the right picture; the grid guards against wrong ones.
    grid = np.linspace(-LARGEST, LARGEST, 81)
    start = grid[int(np.argmin([squares(shift) for shift in grid]))]
    step = grid[1] - grid[0]
    found = optimize.minimize_scalar(
        squares, bounds=(start - step, start + step), method="bounded"
    )
    return Edge(shift=float(found.x), residual=float(np.sqrt(found.fun)))


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
