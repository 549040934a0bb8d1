"""A replay beyond its limits: whether what went beyond them is rounding, or a defect.

A sample of the pixels is traced, spread evenly over all of them. Rounding must explain each
one, in every step of every sample that matters (`explained_pixel`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.records.proof_file import ReplayLimits
from mitsuba_ref.records.request import TIME_LIMIT, RenderRequest
from mitsuba_ref.records.results import DivergentPixel, Parting, ReplayResult
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.replay.explained_pixel import DifferentPixel, explain_pixel, parting
from mitsuba_ref.replay.paths.path_from_reference_rays import Finding
from mitsuba_ref.replay.paths.traced_pair import TracedPair
from mitsuba_ref.replay.replay_comparison import (
    BRIGHT,
    DARK,
    TOLERANCE,
    errors_in_common,
    relative_difference,
)
from renderer.errors import SceneError

Array = NDArray[np.float32]

SEED = 7
"""Of the places inside of the strata: the same pixels are traced at every run."""

DOUBT = 0.05
"""Probability that a share as large as is said to be excluded is not met by the sample."""


@dataclass(frozen=True)
class PixelsOverTolerance:
    """Pixels that go beyond one limit."""

    what: str  # they do
    places: NDArray[np.intp]  # (n, 2): row and column of each
    scale: NDArray[np.float64]  # (H, W): what differences are relative to
    tolerance: float


def look_at_causes(
    result: ReplayResult,
    ours: Array,
    reference: Array,
    request: RenderRequest,
    limits: ReplayLimits,
    time_limit: float = TIME_LIMIT,
) -> ReplayResult:
    """Return the result of a replay that failed, as passed if rounding explains it.

    Parameters
    ----------
    result
        Of `compare_replay`; finite numbers, and not passed.
    ours, reference
        The pictures, (H, W, 3).
    request
        The request to both renderers; its integrator is traceable.
    limits
        What was allowed, and of how many pixels the causes count (`traced`).
    time_limit
        Seconds for one answer of Mitsuba.
    """
    said: list[str] = []
    partings: list[Parting] = []
    traced = unexplained = 0
    excluded = 0.0
    try:
        with TracedPair(request, time_limit) as pair:
            for beyond in pixels_beyond(result, ours, reference, limits):
                count = len(beyond.places)
                chosen = spread_evenly(count, limits.traced)
                found = {
                    int(k): _explain(pair, beyond, int(k), ours, reference) for k in chosen
                }
                traced += len(found)
                unexplained += sum(not one.within_rounding for one in found.values())
                if len(chosen) < count:
                    excluded = max(excluded, excluded_share(len(chosen)))
                said.append(_sentence(beyond, found))
                partings += _first_parting(beyond, found)
    except (MitsubaError, SceneError) as error:
        return replace(result, sentence=f"{result.sentence}; causes not traced: {error}")
    passed = traced > 0 and unexplained == 0
    return replace(
        result,
        passed=passed,
        verdict="pass" if passed else "fail",
        sentence="; ".join([result.sentence, *said]),
        traced=traced,
        unexplained=unexplained,
        excluded=excluded,
        partings=tuple(partings),
    )


def causes_of(
    pixels: Sequence[DivergentPixel],
    ours: Array,
    reference: Array,
    request: RenderRequest,
    time_limit: float = TIME_LIMIT,
) -> tuple[DivergentPixel, ...]:
    """Return divergent pixels, each with the step in which its paths part.

    They are held to the limits of `look_at_causes`, so that both say the same of a pixel.
    Parameters are as there; `pixels` are those of its `listed`.
    """
    scale = _scale_of_divergence(reference)
    explained = []
    with TracedPair(request, time_limit) as pair:
        for pixel in pixels:
            places = np.array([[pixel.y, pixel.x]])
            beyond = PixelsOverTolerance("diverged", places, scale, TOLERANCE)
            found = _explain(pair, beyond, 0, ours, reference)
            step = parting((pixel.x, pixel.y), found)
            explained.append(replace(pixel, cause=found.sentence, parting=step))
    return tuple(explained)


def pixels_beyond(
    result: ReplayResult, ours: Array, reference: Array, limits: ReplayLimits
) -> Iterator[PixelsOverTolerance]:
    """Yield the pixels that diverged, if too many have, and those of too large an RMSE.

    The latter are those beyond the limit of the RMSE by themselves: that of the rest is
    below it.
    """
    diverged = relative_difference(ours, reference) > TOLERANCE
    theirs = np.abs(reference.astype(np.float64))
    own, mean = theirs.max(axis=2), theirs.mean()
    if result.divergent > result.divergent_allowed:
        scale = _scale_of_divergence(reference)
        yield PixelsOverTolerance("diverged", np.argwhere(diverged), scale, TOLERANCE)
    if result.rmse is not None and result.rmse > limits.rmse:
        errors = np.abs(errors_in_common(ours, reference)).max(axis=2)
        beyond = ~diverged & (errors > limits.rmse)
        scale = np.maximum(BRIGHT * own, mean)
        what = f"differ by more than {limits.rmse:g} without diverging"
        yield PixelsOverTolerance(what, np.argwhere(beyond), scale, limits.rmse)


def _scale_of_divergence(reference: Array) -> NDArray[np.float64]:
    """Return what `relative_difference` is relative to at each pixel, (H, W)."""
    theirs = np.abs(reference.astype(np.float64))
    return np.maximum(theirs.max(axis=2), DARK * theirs.mean())


def spread_evenly(count: int, wanted: int) -> NDArray[np.intp]:
    """Return at most `wanted` of `count` places, rising: one of each of equal strata.

    The place in its stratum is random, so that (1 - p)^n bounds the probability of meeting
    none of a share p, however those are spread: the product over the strata is largest
    where all have the same share.
    """
    if count <= wanted:
        return np.arange(count)
    inside = np.random.default_rng(SEED).random(wanted)
    places = ((np.arange(wanted) + inside) * (count / wanted)).astype(np.intp)
    return np.unique(places)


def excluded_share(traced: int) -> float:
    """Return which share of unexplained pixels a sample without any excludes."""
    return float(1.0 - DOUBT ** (1.0 / traced))


def _explain(
    pair: TracedPair, beyond: PixelsOverTolerance, k: int, ours: Array, reference: Array
) -> Finding:
    y, x = (int(place) for place in beyond.places[k])
    a, b = (tuple(float(c) for c in picture[y, x]) for picture in (ours, reference))
    scale = float(beyond.scale[y, x])
    return explain_pixel(
        pair,
        DifferentPixel(
            (x, y), (a[0], a[1], a[2]), (b[0], b[1], b[2]), scale, beyond.tolerance
        ),
    )


def _first_parting(beyond: PixelsOverTolerance, found: dict[int, Finding]) -> list[Parting]:
    """Return the step in which the first pixel parts that rounding does not explain."""
    bad = [k for k, one in found.items() if not one.within_rounding]
    if not bad:
        return []
    row, column = (int(place) for place in beyond.places[bad[0]])
    step = parting((column, row), found[bad[0]])
    return [] if step is None else [step]


def _sentence(beyond: PixelsOverTolerance, found: dict[int, Finding]) -> str:
    count, traced = len(beyond.places), len(found)
    bad = [(k, one.sentence) for k, one in found.items() if not one.within_rounding]
    of = f"of {count} pixels that {beyond.what}"
    if bad:
        (k, cause), are = bad[0], "is" if len(bad) == 1 else "are"
        row, column = beyond.places[k]
        return (
            f"{of} {traced} were traced and {len(bad)} {are} NOT explained by rounding, "
            f"as pixel {column},{row}: {cause.rstrip('.')}"
        )
    step = max((one.step for one in found.values()), default=0.0)
    moves = f" (by moves of {step:g} at most)" if step else ""
    if traced == count:
        return f"{of} all were traced, and rounding explains each{moves}"
    return (
        f"{of} {traced}, spread evenly, were traced, and rounding explains each{moves}: "
        f"with 95 % confidence less than {100.0 * excluded_share(traced):.2g} % have "
        "another cause"
    )
