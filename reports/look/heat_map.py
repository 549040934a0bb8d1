"""A map of work as a picture: one colour ramp, logarithmic, the same for all of a scene."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Dark to light, so that it reads in grey as well, through hues that all eyes tell apart.
RAMP = np.array(
    [
        [12, 10, 52],
        [62, 24, 110],
        [132, 36, 118],
        [196, 62, 86],
        [236, 118, 44],
        [248, 192, 64],
        [252, 252, 214],
    ],
    dtype=np.float64,
)
STEPS = 256


def heat_map(work: NDArray[np.int64], most: float) -> NDArray[np.uint8]:
    """Return work per pixel (H, W) as colours (H, W, 3); 1 is darkest, `most` lightest."""
    return ramp_colours(np.log(np.maximum(work, 1)) / math.log(max(most, 2.0)))


def ramp_colours(part: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return a map (H, W) of numbers from 0, darkest, to 1, lightest, as a picture."""
    steps = np.round(np.clip(part, 0.0, 1.0) * (STEPS - 1)).astype(np.uint8)
    return _palette()[steps]


def ramp_css() -> str:
    """Return the ramp as the stops of a CSS gradient."""
    return ", ".join("rgb({:.0f} {:.0f} {:.0f})".format(*colour) for colour in RAMP)


def _palette() -> NDArray[np.uint8]:
    at = np.linspace(0.0, len(RAMP) - 1.0, STEPS)
    knots = np.arange(len(RAMP))
    channels = [np.interp(at, knots, RAMP[:, channel]) for channel in range(3)]
    return np.round(np.stack(channels, axis=1)).astype(np.uint8)
