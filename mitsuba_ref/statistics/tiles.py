"""Welch's t-test for the mean of each tile of 8 x 8 pixels.

A bias of a whole region stands out 8 times further from the noise in a tile's mean than in
its pixels, and a mean of 64 pixels is closer to normal than a pixel. Tiles of the box
filter share no samples. What cancels inside a tile is not seen: a shift of a texture.
"""

from __future__ import annotations

import numpy as np

from mitsuba_ref.metrics.distances import TILE, tile_means
from mitsuba_ref.statistics.samples import Floats
from mitsuba_ref.statistics.welch import FamilyTest, family_test, welch


def tiled(pictures: Floats, tile: int = TILE) -> Floats:
    """Return the tile means of pictures (K, H, W, C); a rest at the border is a tile."""
    return np.stack([tile_means(picture, tile) for picture in pictures])


def tile_test(ours: Floats, theirs: Floats, tile: int = TILE) -> FamilyTest:
    """Test the mean of every tile and channel of pictures (K, H, W, C)."""
    return family_test(welch(tiled(ours, tile), tiled(theirs, tile)))
