"""Where two correct renderers may differ: pixels at silhouettes and shadow edges.

A ray through the very edge of an object goes left in one renderer and right in the other
by the last bit of a float. The masks come from the *reference* alone, so that our errors
cannot mask themselves, and every user of a mask also limits how much it hides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]

MAX_MASKED_FRACTION = 0.6
"""A picture with more edges than this is no test; render it larger."""

DEPTH_JUMP = 0.1  # relative to the nearer of two neighbours
NORMAL_JUMP = 0.5  # length of the difference of unit normals: about 29 degrees
VALUE_JUMP = 0.2  # relative to the brighter of two neighbours
DARK = 0.01  # of the picture's root mean square: jumps below this are no edge


def silhouettes(aovs: Mapping[str, NDArray[np.float32]]) -> Mask:
    """Return true on both sides of an object's outline or of a crease, (H, W).

    Parameters
    ----------
    aovs
        The reference's "shape_index", "depth" and "geo_normal", each (H, W, C), taken at
        the pixel centres; a miss is 0 in all.
    """
    depth = aovs["depth"]
    nearer = np.where(depth > 0.0, depth, np.inf)
    edge = _jumps(aovs["shape_index"], lambda a, b: np.any(a != b, axis=-1))
    edge |= _jumps(nearer, _relative_depth_jump)
    edge |= _jumps(
        aovs["geo_normal"], lambda a, b: np.linalg.norm(a - b, axis=-1) > NORMAL_JUMP
    )
    return edge


def discontinuities(picture: NDArray[np.floating]) -> Mask:
    """Return true on both sides of a jump in the picture itself, (H, W).

    Finds what AOVs of the first hit cannot: shadow edges, and silhouettes seen in a mirror
    or through glass.
    """
    picture = np.asarray(picture, dtype=np.float64)
    dark = DARK * float(np.sqrt(np.mean(picture**2)))

    def jump(a: NDArray[np.float64], b: NDArray[np.float64]) -> Mask:
        brighter = np.maximum(np.abs(a), np.abs(b))
        return np.any(np.abs(a - b) > VALUE_JUMP * brighter + dark, axis=-1)

    return _jumps(picture, jump)


def dilated(mask: Mask) -> Mask:
    """Return the mask grown by one pixel in all eight directions."""
    padded = np.pad(mask, 1)
    height, width = mask.shape
    grown = np.zeros_like(mask)
    for dy in range(3):
        for dx in range(3):
            grown |= padded[dy : dy + height, dx : dx + width]
    return grown


def _relative_depth_jump(a: NDArray[np.float64], b: NDArray[np.float64]) -> Mask:
    nearer = np.minimum(a, b)
    with np.errstate(invalid="ignore"):  # inf - inf where both rays miss: no jump
        return np.any(np.abs(a - b) > DEPTH_JUMP * nearer, axis=-1)


def _jumps(values: NDArray[Any], is_jump: Callable[[Any, Any], Mask]) -> Mask:
    """Mark both pixels of each pair of neighbours for which `is_jump(a, b)` holds."""
    edge = np.zeros(values.shape[:2], dtype=bool)
    for first, second in _neighbour_pairs():
        found = is_jump(values[first], values[second])
        edge[first] |= found
        edge[second] |= found
    return edge


def _neighbour_pairs() -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    every, start, end = slice(None), slice(None, -1), slice(1, None)
    yield (every, start), (every, end)  # left and right
    yield (start, every), (end, every)  # above and below
    yield (start, start), (end, end)  # the two diagonals
    yield (start, end), (end, start)
