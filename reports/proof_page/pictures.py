"""The pictures of one scene's proof: where noise was tested, and where paths parted."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from mitsuba_ref.ladder.climb import FALSE_ALARMS
from mitsuba_ref.records.results import DivergentPixel, SceneResult
from reports.charts.columns import Bin, histogram_chart
from reports.errors import ReportError
from reports.look import pictures
from reports.look.heat_map import ramp_uri


@dataclass(frozen=True)
class Mark:
    """A divergent pixel, by its number in picture and list."""

    number: int
    spp: int
    pixel: DivergentPixel


@dataclass(frozen=True)
class ReplayPictures:
    """The picture of a replay, what is left between the two, and the marked pixels."""

    width: int
    height: int
    spp: int
    stops: int  # exposure
    ours: str
    difference: str
    scale: float  # the difference runs from -scale to scale
    radius: float  # [pixels] of a circle
    marks: tuple[Mark, ...]


@dataclass(frozen=True)
class NoiseMaps:
    """What the tests under noise saw."""

    width: int
    height: int
    p_map: str
    least_p: float  # where the ramp of the p-map ends
    signed_error: str
    scale: float
    p_histogram: Markup | None
    z_histogram: Markup | None


def replay_pictures(scene: SceneResult, folder: Path) -> ReplayPictures | None:
    """Return the pictures of the replay with the most samples.

    None without them, and for two sizes, which the replay's own sentence tells.

    Raises
    ------
    ReportError
        If a picture cannot be read.
    """
    if not ("replay_ours" in scene.images and "replay_reference" in scene.images):
        return None
    ours = pictures.load_picture(folder / scene.images["replay_ours"])
    reference = pictures.load_picture(folder / scene.images["replay_reference"])
    if ours.shape != reference.shape:
        return None
    difference = pictures.signed_difference(ours, reference)
    scale = pictures.symmetric_scale(difference)
    stops = pictures.exposure_stops(reference)
    height, width = difference.shape
    return ReplayPictures(
        width=width,
        height=height,
        spp=max((one.spp for one in scene.replay), default=0),
        stops=stops,
        ours=pictures.picture_uri(pictures.tone_mapped(ours, stops)),
        difference=pictures.difference_uri(difference, scale),
        scale=scale,
        radius=max(width, height) / 32.0,
        marks=marks(scene),
    )


def marks(scene: SceneResult) -> tuple[Mark, ...]:
    """Return the listed divergent pixels of all replays of a scene, numbered."""
    listed = [(one.spp, pixel) for one in scene.replay for pixel in one.listed]
    return tuple(
        Mark(number, spp, pixel) for number, (spp, pixel) in enumerate(listed, start=1)
    )


def noise_maps(scene: SceneResult, folder: Path) -> NoiseMaps | None:
    """Return the maps and histograms of the ladder; None for a scene without noise.

    Raises
    ------
    ReportError
        If a file cannot be read or does not hold what it should.
    """
    if not ("p_map" in scene.images and "signed_error" in scene.images):
        return None
    p = pictures.load_picture(folder / scene.images["p_map"]).astype(np.float64)
    error = pictures.load_picture(folder / scene.images["signed_error"])
    signed = error.astype(np.float64) @ pictures.LUMINANCE
    scale = pictures.symmetric_scale(signed)
    least = least_p(p.shape[0] * p.shape[1])
    return NoiseMaps(
        width=p.shape[1],
        height=p.shape[0],
        p_map=ramp_uri(evidence_against(p) / -math.log(least)),
        least_p=least,
        signed_error=pictures.difference_uri(signed, scale),
        scale=scale,
        p_histogram=_p_histogram(_rows(scene, folder, "p_histogram")),
        z_histogram=_z_histogram(_rows(scene, folder, "z_histogram")),
    )


def least_p(pixels: int) -> float:
    """Return the p-value that one of so many pixels reaches once in 1000 fair runs."""
    return FALSE_ALARMS / pixels


def evidence_against(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return -ln of each pixel's p-value, the smallest of its three counted thrice.

    Parameters
    ----------
    p
        (H, W, 3); what is no number counts as 0.
    """
    least = np.clip(np.nan_to_num(p, nan=0.0).min(axis=2), 1e-300, 1.0)
    return np.maximum(0.0, -np.log(np.minimum(1.0, 3.0 * least)))


def _rows(scene: SceneResult, folder: Path, name: str) -> NDArray[np.float64] | None:
    """Read a histogram: rows of lower end, upper end and count."""
    if name not in scene.images:
        return None
    path = folder / scene.images[name]
    rows: Any = pictures.load_array(path)
    shape = getattr(rows, "shape", None)
    if shape is None or len(shape) != 2 or shape[1] != 3 or shape[0] == 0:
        raise ReportError(f"{path}: expected rows of low, high, count, found {shape}")
    rows = np.asarray(rows, dtype=np.float64)
    if not np.isfinite(rows).all() or (rows[:, 2] < 0.0).any():
        raise ReportError(f"{path}: expected finite rows of low, high, count")
    return np.asarray(rows)


def _bins(rows: NDArray[np.float64], shares: Sequence[float]) -> list[Bin]:
    total = float(rows[:, 2].sum())
    return [
        Bin(float(low), float(high), float(count), total * share)
        for (low, high, count), share in zip(rows, shares, strict=True)
    ]


def _p_histogram(rows: NDArray[np.float64] | None) -> Markup | None:
    """Draw p-values: without a difference each bin holds the same share."""
    if rows is None or rows[:, 2].sum() == 0.0:
        return None
    bins = _bins(rows, list(rows[:, 1] - rows[:, 0]))
    return histogram_chart(
        bins,
        x_ticks=(0.0, 0.25, 0.5, 0.75, 1.0),
        x_label="p-value of each colour value",
        description=(
            f"Histogram of p-values: {bins[0].count:.0f} in the first of {len(bins)} bins, "
            f"expected {bins[0].expected:.0f}; the bins hold {_range(bins)}."
        ),
    )


def _z_histogram(rows: NDArray[np.float64] | None) -> Markup | None:
    """Draw z-values: without a difference they follow the normal distribution."""
    if rows is None or rows[:, 2].sum() == 0.0:
        return None
    below = [0.5 * (1.0 + math.erf(end / math.sqrt(2.0))) for end in [*rows[:, 0], 0.0]]
    below = [0.0, *below[1:-1], 1.0]  # the outer bins hold what lies beyond them
    shares = [high - low for low, high in itertools.pairwise(below)]
    bins = _bins(rows, shares)
    return histogram_chart(
        bins,
        x_ticks=(-4.0, -2.0, 0.0, 2.0, 4.0),
        x_label="difference in standard deviations of its noise (z)",
        description=(
            f"Histogram of z-values: {bins[0].count:.0f} in the leftmost bin and "
            f"{bins[-1].count:.0f} in the rightmost, expected {bins[0].expected:.1f} each; "
            f"the bins hold {_range(bins)}."
        ),
    )


def _range(bins: Sequence[Bin]) -> str:
    counts = [one.count for one in bins]
    return f"{min(counts):.0f} to {max(counts):.0f}"
