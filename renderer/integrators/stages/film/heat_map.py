"""The picture of the work per pixel: five counters as AOVs, their sum as a colour."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.kernels.records.tally import BOXES, NAMES, PRIMITIVES

# Where the colours pass, as (L, a, b) of Oklab [Ottosson2020]: black, violet, red, orange,
# pale yellow. L grows evenly along the way, so that equal steps of work are equal steps of
# lightness and the picture survives a grey printer; every colour lies within sRGB.
CONTROL_POINTS = np.array(
    [
        [0.00, 0.000, 0.000],
        [0.24, 0.055, -0.105],
        [0.48, 0.160, -0.020],
        [0.72, 0.100, 0.120],
        [0.96, -0.020, 0.070],
    ]
)
# Oklab to cone responses (their cube roots), and cone responses to linear sRGB
_ROOTS_FROM_OKLAB = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_SRGB_FROM_CONES = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


class HeatMap(NamedTuple):
    """A picture of work."""

    pixels: NDArray[np.float32]  # (H, W, 3) linear sRGB
    aovs: dict[str, NDArray[np.float32]]  # "work.nodes" and so on -> (H, W, 1)
    brightest: float  # box and primitive tests per camera ray that the last colour means


def heat_colours(values: ArrayLike, brightest: float) -> NDArray[np.float32]:
    """Return the colours of values from 0 (black) to `brightest` (pale yellow).

    Parameters
    ----------
    values
        Any shape; what lies above `brightest` has its colour.
    brightest
        The same number gives several pictures one scale. 0 makes everything black.

    Returns
    -------
    Linear sRGB, float32, of the shape of `values` with an axis of 3 more.
    """
    scaled = np.asarray(values, np.float64) / brightest if brightest > 0.0 else 0.0
    place = np.clip(scaled + np.zeros(np.shape(values)), 0.0, 1.0)
    stations = np.linspace(0.0, 1.0, len(CONTROL_POINTS))
    lab = np.stack([np.interp(place, stations, axis) for axis in CONTROL_POINTS.T], -1)
    linear = ((lab @ _ROOTS_FROM_OKLAB.T) ** 3) @ _SRGB_FROM_CONES.T
    return np.clip(linear, 0.0, 1.0).astype(np.float32)


def heat_map(counts: NDArray[np.float32]) -> HeatMap:
    """Return the picture of the counts (H, W, rows of the tally), means over the samples.

    The pixel with the most box and primitive tests gets the brightest colour.
    """
    aovs = {
        f"work.{name.replace(' ', '_')}": np.ascontiguousarray(counts[..., row, None])
        for row, name in enumerate(NAMES)
    }
    tests = counts[..., BOXES].astype(np.float64) + counts[..., PRIMITIVES]
    brightest = float(tests.max(initial=0.0))
    return HeatMap(heat_colours(tests, brightest), aovs, brightest)
