"""Reconstruction filters: how much a sample counts in the pixels around it.

All six are separable, w(x, y) = w(x) w(y), symmetric, and zero beyond `radius`; x is the
distance from the centre of a pixel [pixels]. They are defined exactly as in Mitsuba, since
pictures are compared with its `scalar_rgb`. That variant, and so this film, does this:

- **A table, not the formula.** The half-axis [0, radius] is divided into `TABLE_STEPS`
  equal steps. Within a step the weight is that of its *lower* end, without interpolation;
  from `radius` on it is 0 (`tabulate`, `lookup_weight`). So a gaussian is a step function,
  which differs from the formula by up to 9 % of its peak.
- **Which pixels.** A sample at film position p (pixel i covers i to i + 1) reaches the
  pixels with |i + 1/2 - p| <= radius along each axis (`pixels_touched`).
- **The picture** is sum(w v) / sum(w) per pixel, with the weights of all its samples; a
  pixel whose weights sum to exactly zero is black. Weights are not normalised per sample.
- **Borders.** Only pixels inside the crop window are sampled (unless the film has
  `sample_border`) and stored. So pixels at the border receive samples from fewer
  neighbours; the division by sum(w) compensates for that.
- **Negative lobes** (mitchell, catmullrom, lanczos) are kept: a pixel next to a bright
  edge may be negative, and nothing clamps it.
- **The box** is a special case, recognised by its radius of 1/2: a sample has weight 1 in
  the pixel that it was drawn for and 0 elsewhere, even if rounding moves it into a
  neighbouring pixel.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from renderer.errors import SceneError
from renderer.scene_file.description import ReconstructionFilter

FloatArray = NDArray[np.float64]

TABLE_STEPS = 31  # Mitsuba's resolution; a finer table gives a different picture

# exp(-s / 2) on 0 <= s <= 16 as the polynomial of degree 9 with the smallest relative error
# (4.04e-4, by a Remez exchange), minus its value at 16. Mitsuba's CPU variants use a fit
# that differs from the exponential by up to 4e-4 too.
_GAUSSIAN_FIT = (
    9.992604880e-01,
    -4.977025247e-01,
    1.222248550e-01,
    -1.932406282e-02,
    2.136713061e-03,
    -1.679873860e-04,
    9.202145248e-06,
    -3.329417433e-07,
    7.128382794e-09,
    -6.821193280e-11,
)


def _box(x: FloatArray, _: ReconstructionFilter) -> FloatArray:
    return np.ones_like(x)


def _tent(x: FloatArray, rfilter: ReconstructionFilter) -> FloatArray:
    return 1.0 - x / rfilter.radius


def _gaussian(x: FloatArray, rfilter: ReconstructionFilter) -> FloatArray:
    s = (x / rfilter.stddev) ** 2
    at_radius = polynomial.polyval((rfilter.radius / rfilter.stddev) ** 2, _GAUSSIAN_FIT)
    return np.maximum(polynomial.polyval(s, _GAUSSIAN_FIT) - at_radius, 0.0)


def _cubic(x: FloatArray, b: float, c: float) -> FloatArray:
    """Two cubic pieces that join smoothly at 1 and end at 2 [Mitchell1988]."""
    inner = ((12 - 9 * b - 6 * c) * x + (-18 + 12 * b + 6 * c)) * x * x + (6 - 2 * b)
    outer = (((-b - 6 * c) * x + (6 * b + 30 * c)) * x - (12 * b + 48 * c)) * x
    outer = outer + (8 * b + 24 * c)
    return np.where(x < 1.0, inner, outer) / 6.0


def _mitchell(x: FloatArray, rfilter: ReconstructionFilter) -> FloatArray:
    return _cubic(x, rfilter.b, rfilter.c)


def _catmullrom(x: FloatArray, _: ReconstructionFilter) -> FloatArray:
    return _cubic(x, 0.0, 0.5)


def _lanczos(x: FloatArray, rfilter: ReconstructionFilter) -> FloatArray:
    return np.sinc(x) * np.sinc(x / rfilter.radius)  # np.sinc includes the factor pi


_FORMULAS = {
    "box": _box,
    "tent": _tent,
    "gaussian": _gaussian,
    "mitchell": _mitchell,
    "catmullrom": _catmullrom,
    "lanczos": _lanczos,
}

FILTER_NAMES = tuple(_FORMULAS)


def evaluate(rfilter: ReconstructionFilter, x: ArrayLike) -> FloatArray:
    """Return the weight of a sample at distance `x` by the formula, not the table.

    Parameters
    ----------
    rfilter
        Name and parameters of the filter.
    x
        Distances along one axis [pixels], any shape and sign.

    Returns
    -------
    Weights of the same shape; 0 from `rfilter.radius` on. Not normalised.

    Raises
    ------
    SceneError
        If there is no filter of that name.
    """
    formula = _FORMULAS.get(rfilter.name)
    if formula is None:
        raise SceneError(
            f"no reconstruction filter {rfilter.name!r}; "
            f"there are {', '.join(FILTER_NAMES)}"
        )
    distance = np.abs(np.asarray(x, dtype=np.float64))
    return np.where(distance < rfilter.radius, formula(distance, rfilter), 0.0)


def tabulate(rfilter: ReconstructionFilter, steps: int = TABLE_STEPS) -> FloatArray:
    """Return weights at the lower ends of `steps` equal parts of [0, radius], then a 0.

    Returns
    -------
    Array of shape (steps + 1,) for `lookup_weight`.
    """
    lower_ends = rfilter.radius * np.arange(steps) / steps
    return np.append(evaluate(rfilter, lower_ends), 0.0)


def lookup_weight(table: FloatArray, radius: float, x: ArrayLike) -> FloatArray:
    """Return the weight at distance `x` [pixels] from `tabulate`'s table."""
    steps = len(table) - 1
    step = np.abs(np.asarray(x, dtype=np.float64)) * (steps / radius)
    return table[np.minimum(step, steps).astype(np.int64)]


def pixels_touched(position: float, radius: float, size: int) -> range:
    """Return the pixels of a row of `size` that a sample at film `position` reaches.

    The range is empty if no pixel is reached; `position` is relative to the first pixel.
    """
    first = int(np.ceil(position - 0.5 - radius))
    last = int(np.floor(position - 0.5 + radius))
    return range(max(first, 0), min(last, size - 1) + 1)
