"""One fixed tone map for every metric that imitates the eye.

Fixed, because a tone map that adapts to the picture would hide an error of scale.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.rendering.picture.picture import srgb_from_linear

DESCRIPTION = "Reinhard x / (1 + x) per channel, then the sRGB transfer curve; exposure 1"


def tone_map(image: ArrayLike) -> NDArray[np.float64]:
    """Return display values in [0, 1) of a linear picture; negative values become 0.

    Parameters
    ----------
    image
        (H, W, 3), linear sRGB, finite.
    """
    linear = np.maximum(np.asarray(image, dtype=np.float64), 0.0)
    return srgb_from_linear(linear / (1.0 + linear))
