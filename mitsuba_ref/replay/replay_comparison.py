"""Two pictures that were drawn with the same random numbers: what differs, and how much."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder.preconditions import find_obstacle
from mitsuba_ref.records.proof_file import USUAL_LIMITS, ReplayLimits
from mitsuba_ref.records.results import DivergentPixel, ReplayResult

Array = NDArray[np.float32]
Errors = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCE = 3e-4
"""Relative difference from which on a pixel has diverged. (With
1e-3 a single pixel just below it decides the RMSE of a small picture.)"""

DARK = 1e-2
"""Of the picture's mean: below it a pixel's difference is relative to this instead."""

LISTED = 32
"""Divergent pixels that a result names, the worst first."""

BRIGHT = 1.0 / 32.0
"""Of a pixel's own brightness: what its part of the RMSE is relative to at least, else to
the picture's mean. 1e-5 of it are five units in the last place of a float32, which is what
a sum of samples may be off; up to 32 times the mean nothing is measured otherwise."""


def relative_difference(ours: Array, reference: Array) -> Errors:
    """Return the largest relative difference of each pixel's channels, (H, W).

    Relative to the reference's brightest channel there, and where that is dark to
    `DARK` times the picture's mean: a difference of two tiny numbers tells nothing.
    """
    theirs = reference.astype(np.float64)
    scale = np.maximum(np.abs(theirs).max(axis=2), DARK * np.abs(theirs).mean())
    difference = np.abs(ours.astype(np.float64) - theirs).max(axis=2)
    infinite = np.where(difference > 0.0, np.inf, 0.0)
    return np.divide(difference, scale, out=infinite, where=scale > 0.0)


def errors_in_common(ours: Array, reference: Array) -> Errors:
    """Return the errors whose RMSE is limited, (H, W, 3).

    Relative to the picture's mean, and in pixels so bright that single precision does not
    hold that much to `BRIGHT` times their own; absolute in a black picture.
    """
    theirs = np.abs(reference.astype(np.float64))
    scale = np.maximum(theirs.mean(), BRIGHT * theirs.max(axis=2, keepdims=True))
    difference = ours.astype(np.float64) - reference
    return np.asarray(difference / np.where(scale > 0.0, scale, 1.0))


def compare_replay(
    ours: Array, reference: Array, limits: ReplayLimits = USUAL_LIMITS
) -> ReplayResult:
    """Compare two pictures that were drawn with the same numbers.

    Parameters
    ----------
    ours, reference
        (H, W, 3), linear. Values that are not finite, or another size, fail.
    limits
        What is allowed.
    """
    obstacle = find_obstacle([ours], [reference, reference])
    if obstacle is not None:
        return ReplayResult(
            passed=False, verdict=obstacle.verdict, sentence=obstacle.sentence
        )
    relative = relative_difference(ours, reference)
    diverged = relative > TOLERANCE
    together = ~diverged
    errors = errors_in_common(ours, reference)[together]
    rmse = float(np.sqrt((errors**2).mean())) if errors.size else 0.0
    count = int(diverged.sum())
    allowed = int(limits.divergent * diverged.size)
    passed = count <= allowed and rmse <= limits.rmse
    return ReplayResult(
        pixels=diverged.size,
        divergent=count,
        divergent_allowed=allowed,
        rmse=rmse,
        rmse_limit=limits.rmse,
        largest=float(relative[together].max()) if together.any() else None,
        passed=passed,
        verdict="pass" if passed else "fail",
        sentence=_sentence(count, allowed, diverged.size, rmse, limits.rmse),
        listed=_worst(ours, reference, relative, diverged),
    )


def _sentence(count: int, allowed: int, pixels: int, rmse: float, rmse_limit: float) -> str:
    paths = f"{pixels - count} of {pixels} pixels took the same paths in both renderers"
    return (
        f"{paths}; {count} diverged ({allowed} may); RMSE of the others {rmse:.2g} of the "
        f"mean (limit {rmse_limit:g})"
    )


def _worst(
    ours: Array,
    reference: Array,
    relative: Errors,
    diverged: Mask,
) -> tuple[DivergentPixel, ...]:
    rows, columns = np.nonzero(diverged)
    order = np.argsort(-relative[rows, columns], kind="stable")[:LISTED]
    return tuple(
        DivergentPixel(
            int(columns[k]),
            int(rows[k]),
            tuple(float(v) for v in ours[rows[k], columns[k]]),
            tuple(float(v) for v in reference[rows[k], columns[k]]),
            float(relative[rows[k], columns[k]]),
        )
        for k in order
    )
