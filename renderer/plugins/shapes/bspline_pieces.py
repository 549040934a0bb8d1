"""Cubic B-splines in the power basis, cut into nearly straight pieces.

A polynomial is an array (4, 4): the coefficients of 1, s, s^2, s^3 for x, y, z and radius.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.curves import first_points
from renderer.scene_file.description import BsplineCurve

Doubles = NDArray[np.float64]

# Pieces overlap by this much (in their parameter s), so that rounding leaves no gap.
OVERLAP = np.float32(1e-4)
_BEND = 0.25  # [rad] a piece may turn by this angle
_OFF_CHORD = 0.5  # largest distance from the chord, in units of the largest radius
OFF_2, OFF_3 = 0.25, 0.4  # upper bounds of s - s^2 and s - s^3 on [0, 1]
_SLENDER, _FEW = 16.0, 4  # straight segments: up to 4 pieces of 16 radii, for tight boxes
_MOST = 64  # pieces of a segment
_PLACES = np.linspace(0.0, 1.0, 9)  # values of s at which the tangent is evaluated

# Uniform cubic B-spline: from control points to the power basis, times 6.
_POWERS = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6.0
# From the power basis to Bezier control points; their convex hull contains the curve.
_HULL = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])


def segment_polynomials(shape: BsplineCurve) -> Doubles:
    """Return the polynomials (segments, 4, 4) of all curves of a shape."""
    points = first_points(shape, 4)[:, None] + np.arange(4)
    return np.asarray(_POWERS @ shape.points[points].astype(np.float64))


_COUNTS: WeakKeyDictionary[BsplineCurve, NDArray[np.int64]] = WeakKeyDictionary()


def piece_counts(shape: BsplineCurve) -> NDArray[np.int64]:
    """Return the number of pieces of each segment, (n,); cached for each shape."""
    if shape not in _COUNTS:
        _COUNTS[shape] = _count(segment_polynomials(shape))
    return _COUNTS[shape]


def _count(segments: Doubles) -> NDArray[np.int64]:
    c1, c2, c3 = (segments[:, k, :3] for k in (1, 2, 3))
    s = _PLACES[:, None, None]
    slopes = c1 + s * (2.0 * c2 + s * 3.0 * c3)  # (places, n, 3)
    thick = (_HULL @ segments)[:, :, 3].max(axis=1)
    with np.errstate(all="ignore"):
        slopes /= np.linalg.norm(slopes, axis=2, keepdims=True)
        cosines = np.clip((slopes[1:] * slopes[:-1]).sum(axis=2), -1.0, 1.0)
        bend = np.arccos(cosines).sum(axis=0) / _BEND
        off = OFF_2 * np.linalg.norm(c2, axis=1) + OFF_3 * np.linalg.norm(c3, axis=1)
        off = np.sqrt(off / (_OFF_CHORD * thick))
        chord = np.linalg.norm(c1 + c2 + c3, axis=1) / (_SLENDER * thick)
        needed = np.ceil(np.maximum(np.maximum(bend, off), np.minimum(chord, _FEW)))
    # NaN: the tangent vanishes somewhere, or the radius is 0
    return np.clip(np.nan_to_num(needed, nan=_MOST, posinf=_MOST), 1, _MOST).astype(
        np.int64
    )


def piece_polynomials(shape: BsplineCurve) -> tuple[NDArray[np.float32], Doubles]:
    """Cut the segments of a shape into pieces.

    Returns
    -------
    polynomials
        Polynomials of the pieces, (n, 4, 4), each for s in [0, 1].
    places
        (n, 2): v of the whole shape at the start of each piece, and the range of v.
    """
    counts, segments = piece_counts(shape), segment_polynomials(shape)
    owner = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    width = 1.0 / counts[owner]
    begin = (np.arange(len(owner)) - (ends - counts)[owner]) * width
    c0, c1, c2, c3 = segments[owner].swapaxes(0, 1)
    b, w = begin[:, None], width[:, None]
    pieces = np.stack(
        [
            c0 + b * (c1 + b * (c2 + b * c3)),
            w * (c1 + b * (2.0 * c2 + b * 3.0 * c3)),
            w * w * (c2 + 3.0 * b * c3),
            w * w * w * c3,
        ],
        axis=1,
    )
    places = np.stack([owner + begin, width], axis=1) / len(counts)
    return pieces.astype(np.float32), places


def extents(numbers: Any) -> tuple[Doubles, Doubles]:
    """Return points (3, 4, n) and radii (n,) that bound pieces of curves.

    A piece lies in the convex hull of balls of these radii around these points. `numbers`
    (16, n) are the polynomials. The points are Bezier control points, computed for a
    slightly longer interval because pieces overlap.
    """
    powers = numbers.reshape(4, 4, -1).astype(np.float64)
    points = np.einsum("pk,kcn->pcn", _HULL, powers)
    over = 2.0 * OVERLAP * np.abs(powers[1:]).sum(axis=(0, 1))
    return points[:, :3].swapaxes(0, 1), points[:, 3].max(axis=0) + over
