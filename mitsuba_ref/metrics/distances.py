"""How far one picture is from another; each number with its settings spelled out.

All take linear float pictures of shape (H, W, 3) with finite values; `mask`, where it is
taken, is (H, W) and true for the pixels that count.
"""

from __future__ import annotations

import os
import warnings

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics.tone_map import DESCRIPTION as TONE_MAP
from mitsuba_ref.metrics.tone_map import tone_map
from mitsuba_ref.records.results import Metric

Image = NDArray[np.floating]
Mask = NDArray[np.bool_]

RELATIVE_MSE_EPSILON = 0.01
TRIMMED_FRACTION = 0.001
TILE = 8  # [pixels]
SSIM_WINDOW = 11  # [pixels], what sigma 1.5 and truncation at 3.5 sigma amount to

SETTINGS = {
    "tone_map": TONE_MAP,
    "relative_mse": f"(a - b)^2 / (b^2 + {RELATIVE_MSE_EPSILON}), mean over all values",
    "trimmed_rmse": f"without the worst {TRIMMED_FRACTION:.1%} of the values",
    "tile_rmse": f"RMSE between the means of tiles of {TILE} x {TILE} pixels",
    "ssim": "scikit-image, tone-mapped, data range 1, Gaussian window of sigma 1.5, "
    "population covariance, mean of the three channels",
    "flip": "LDR-FLIP (flip-evaluator) on the tone-mapped picture, 67 pixels per degree",
    "ciede2000": "colour-science, tone-mapped sRGB to CIE L*a*b* under D65",
}


def rmse(a: Image, b: Image, mask: Mask | None = None) -> float:
    """Return the root of the mean squared difference over pixels and channels."""
    return float(np.sqrt(np.mean(_squares(a, b, mask))))


def relative_rmse(a: Image, reference: Image, mask: Mask | None = None) -> float:
    """Return the RMSE divided by the reference's own root mean square.

    Against a black reference it is 0 for a black picture, else infinite.
    """
    difference = rmse(a, reference, mask)
    scale = rmse(reference, np.zeros_like(reference), mask)
    if scale == 0.0:
        return 0.0 if difference == 0.0 else float("inf")
    return difference / scale


def trimmed_rmse(a: Image, b: Image) -> float:
    """Return the RMSE without the worst 0.1 % of the values (at least one is left out).

    A few pixels at a light's edge can carry most of the squared error of a path-traced
    picture (facts: 200 of 196,608 values carry three quarters), so that the plain RMSE
    wanders by several per cent from seed to seed; this one does not.
    """
    squares = np.sort(_squares(a, b, None), axis=None)
    kept = squares[: squares.size - max(1, int(np.ceil(squares.size * TRIMMED_FRACTION)))]
    return float(np.sqrt(np.mean(kept))) if kept.size else 0.0


def relative_mse(a: Image, reference: Image) -> float:
    """Return the mean of squared differences, each divided by its reference squared."""
    b = np.asarray(reference, dtype=np.float64)
    return float(np.mean(_squares(a, b, None) / (b**2 + RELATIVE_MSE_EPSILON)))


def mean_difference(a: Image, b: Image) -> float:
    """Return the difference of the picture means, relative to the mean of `b`."""
    mean_b = float(np.mean(b, dtype=np.float64))
    difference = float(np.mean(a, dtype=np.float64)) - mean_b
    return difference / mean_b if mean_b else difference


def tile_means(image: Image, tile: int = TILE) -> NDArray[np.float64]:
    """Return the means of `tile` x `tile` squares, (rows, columns, C); a rest is kept."""
    pixels = np.ones((*image.shape[:2], 1))
    return tile_sums(image, tile) / tile_sums(pixels, tile)


def tile_sums(image: Image, tile: int = TILE) -> NDArray[np.float64]:
    """Return the sums over the same squares."""
    rows = np.arange(0, image.shape[0], tile)
    columns = np.arange(0, image.shape[1], tile)
    down = np.add.reduceat(np.asarray(image, dtype=np.float64), rows, axis=0)
    return np.asarray(np.add.reduceat(down, columns, axis=1))


def tile_rmse(a: Image, b: Image) -> float:
    """Return the RMSE of the tile means: noise averages out in it, a bias does not."""
    return rmse(tile_means(a), tile_means(b))


def ssim(a: Image, b: Image) -> float | None:
    """Return the structural similarity, 1 for equal; None if smaller than the window."""
    from skimage.metrics import structural_similarity

    if min(a.shape[:2]) < SSIM_WINDOW:
        return None
    value = structural_similarity(
        tone_map(a),
        tone_map(b),
        data_range=1.0,
        channel_axis=2,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
    )
    return float(value)


def flip(a: Image, reference: Image) -> float:
    """Return the mean FLIP error, 0 for equal, 1 for as different as can be."""
    # Its OpenMP threads spin while they wait. On a busy machine 120 small pictures took
    # 11 s, and 0.3 s with threads that sleep. Read when the library is loaded.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    import flip_evaluator

    _, mean, _ = flip_evaluator.evaluate(
        tone_map(reference).astype(np.float32),
        tone_map(a).astype(np.float32),
        "LDR",
        applyMagma=False,
        parameters={"ppd": 67.0},
    )
    return float(mean)


def ciede2000(a: Image, b: Image) -> tuple[float, float]:
    """Return mean and 99th percentile of the colour difference; about 1 is visible."""
    with warnings.catch_warnings():
        # Its import warns that its plots lack matplotlib; nothing here plots.
        warnings.filterwarnings("ignore", message='"Matplotlib" related API')
        import colour

    differences = colour.delta_E(_lab(colour, a), _lab(colour, b), method="CIE 2000")
    return float(np.mean(differences)), float(np.percentile(differences, 99.0))


def _lab(colour: object, image: Image) -> NDArray[np.float64]:
    xyz = colour.sRGB_to_XYZ(tone_map(image))  # type: ignore[attr-defined]
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]  # type: ignore[attr-defined]
    return np.asarray(colour.XYZ_to_Lab(xyz, white))  # type: ignore[attr-defined]


def _squares(a: Image, b: Image, mask: Mask | None) -> NDArray[np.float64]:
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if a.shape != b.shape:
        raise ValueError(f"pictures of different shape: {a.shape} and {b.shape}")
    squares = (a - b) ** 2
    return squares if mask is None else squares[mask]


def reported(ours: Image, reference: Image, other: Image) -> dict[str, Metric]:
    """Return the metrics that are shown and judge nothing.

    Each with its noise floor: the same between two references with different seeds.
    """
    functions = {
        "relative_mse": (
            relative_mse,
            "mean squared error relative to the squared value",
        ),
        "ssim": (ssim, "structural similarity of the tone-mapped picture; 1 is equal"),
        "flip": (flip, "difference that an eye sees when flipping; 0 is equal"),
    }
    found = {
        name: Metric(
            distance(ours, reference), distance(other, reference), None, None, what
        )
        for name, (distance, what) in functions.items()
    }
    colours = zip(ciede2000(ours, reference), ciede2000(other, reference), strict=True)
    names = {
        "ciede2000": "mean colour difference; 1 is just visible",
        "ciede2000_p99": "99th percentile of the colour difference",
    }
    for (name, what), (value, floor) in zip(names.items(), colours, strict=True):
        found[name] = Metric(value, floor, None, None, what)
    return found
