"""Two renderers' arrays -> numbers beside their noise floors -> a verdict with reasons."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref import metrics
from mitsuba_ref.aov_comparison import compare_aovs
from mitsuba_ref.edges import MAX_MASKED_FRACTION, dilated, discontinuities, silhouettes
from mitsuba_ref.noise import WORST_TILE_LIMIT, mean_test, tile_test
from mitsuba_ref.results import AovResult, Finite, Metric, Verdict

Array = NDArray[np.float32]

DETERMINISTIC_TOLERANCE = 1e-4
"""Relative RMSE of pictures without noise, off shadow and silhouette edges."""

NOISY_RMSE_FACTOR = 1.25
"""Of the noise floor, where a scene's proof.toml says nothing."""

EDGE_DIFFERENCE = 0.01  # relative: a pixel on an edge that differs by more counts
EDGE_TOLERANCE = 0.002  # fraction of all pixels that may do so

EVERYWHERE_TOLERANCE = 2e-3
"""Relative RMSE of pictures without noise over all pixels, edges included. Four of the five
scenes stay below 2e-5. In many-lights at 96 x 72 one of sixteen lights falls on the other
side of a shadow's edge in one pixel of 6,912, and that alone is 1.4e-3."""


@dataclass(frozen=True)
class Comparison:
    """What was measured and what follows from it."""

    verdict: Verdict
    reasons: tuple[str, ...]
    finite: Finite
    metrics: dict[str, Metric]
    aovs: tuple[AovResult, ...]


def compare(
    ours: Array,
    references: Sequence[Array],
    ours_aovs: Mapping[str, Array] | None = None,
    reference_aovs: Mapping[str, Array] | None = None,
    *,
    deterministic: bool = False,
    rmse_factor: float | None = None,
) -> Comparison:
    """Compare our picture with Mitsuba's of the same scene.

    Parameters
    ----------
    ours
        (H, W, 3), linear.
    references
        Two or more pictures by Mitsuba with different seeds, at the same samples per
        pixel; the first is the one that is shown.
    ours_aovs, reference_aovs
        Kind to (H, W, C) at the pixel centres (see `compare_aovs`); None: not compared.
    deterministic
        The scene has no noise: compare pixel by pixel.
    rmse_factor
        How much larger than the noise floor, or without noise than 1e-4 relative, the
        RMSE may be.

    Notes
    -----
    Values that are not finite, a missing reference and a different size fail before
    anything else is measured.
    """
    if rmse_factor is None:
        rmse_factor = 1.0 if deterministic else NOISY_RMSE_FACTOR
    aov_arrays = [*(ours_aovs or {}).values()], [*(reference_aovs or {}).values()]
    finite = count_non_finite([ours, *aov_arrays[0]], [*references, *aov_arrays[1]])
    obstacle = _obstacle(ours, references, finite)
    if obstacle:
        unmeasured = Metric(None, None, None, False, f"not measured: {obstacle}")
        return Comparison("fail", (obstacle,), finite, {"rmse": unmeasured}, ())
    measured = _for_the_eye(ours, references)
    aovs: tuple[AovResult, ...] = ()
    if reference_aovs is not None:
        aovs = compare_aovs(ours_aovs or {}, reference_aovs)
    if deterministic:
        measured |= _without_noise(ours, references, reference_aovs, rmse_factor)
    else:
        measured |= _with_noise(ours, references, rmse_factor)
    reasons = tuple(_reasons(measured, aovs))
    return Comparison("fail" if reasons else "pass", reasons, finite, measured, aovs)


def compare_filtered(ours: Array, references: Sequence[Array]) -> Metric:
    """Judge pictures made with the scene's own filter instead of the box.

    Neighbours share samples then, so that no test of independent pixels holds; the RMSE
    beside its floor does.

    Parameters
    ----------
    ours, references
        As `compare` takes them, finite.
    """
    pooled = [metrics.rmse(ours, reference) for reference in references]
    value = float(np.sqrt(np.mean(np.square(pooled))))
    pairs = [metrics.rmse(a, b) for a, b in itertools.combinations(references, 2)]
    floor = float(np.sqrt(np.mean(np.square(pairs))))
    limit = NOISY_RMSE_FACTOR * floor
    meaning = (
        f"distance to {len(references)} Mitsuba pictures, all made with the file's own "
        f"filter; floor: the same among those; at most {NOISY_RMSE_FACTOR:g} times that"
    )
    return Metric(value, floor, limit, value <= limit, meaning)


def with_metric(comparison: Comparison, name: str, metric: Metric) -> Comparison:
    """Return the comparison with one more metric, which counts for the verdict."""
    reasons = (*comparison.reasons, *_reasons({name: metric}, ()))
    return replace(
        comparison,
        verdict="fail" if reasons else "pass",
        reasons=reasons,
        metrics={**comparison.metrics, name: metric},
    )


def count_non_finite(ours: Iterable[Array], references: Iterable[Array]) -> Finite:
    """Count NaN and infinite values on both sides."""
    ours, references = list(ours), list(references)
    return Finite(
        ours_nan=sum(int(np.isnan(a).sum()) for a in ours),
        ours_inf=sum(int(np.isinf(a).sum()) for a in ours),
        reference_nan=sum(int(np.isnan(a).sum()) for a in references),
        reference_inf=sum(int(np.isinf(a).sum()) for a in references),
    )


def _obstacle(ours: Array, references: Sequence[Array], finite: Finite) -> str | None:
    """Return why the pictures cannot be compared at all."""
    if len(references) < 2:
        return f"{len(references)} reference pictures; a noise floor needs two"
    for reference in references:
        if reference.shape != ours.shape:
            return f"our picture has shape {ours.shape}, Mitsuba's has {reference.shape}"
    if not finite.passed:
        return (
            f"NOT FINITE: ours has {finite.ours_nan} NaN and {finite.ours_inf} infinite "
            f"values, Mitsuba's {finite.reference_nan} and {finite.reference_inf}"
        )
    return None


def _for_the_eye(ours: Array, references: Sequence[Array]) -> dict[str, Metric]:
    """Return the metrics that are shown beside their floor but do not decide."""
    first, other = references[0], references[1]

    def shown(function: Callable[[Array, Array], float | None], meaning: str) -> Metric:
        return Metric(function(ours, first), function(other, first), None, None, meaning)

    colour, colour_floor = metrics.ciede2000(ours, first), metrics.ciede2000(other, first)
    return {
        "relative_mse": shown(
            metrics.relative_mse, "mean squared error relative to the squared value"
        ),
        "ssim": shown(
            metrics.ssim, "structural similarity of the tone-mapped picture; 1 is equal"
        ),
        "flip": shown(
            metrics.flip, "difference that an eye sees when flipping; 0 is equal"
        ),
        "ciede2000": Metric(
            colour[0],
            colour_floor[0],
            None,
            None,
            "mean colour difference; 1 is just visible",
        ),
        "ciede2000_p99": Metric(
            colour[1],
            colour_floor[1],
            None,
            None,
            "99th percentile of the colour difference",
        ),
    }


def _with_noise(
    ours: Array, references: Sequence[Array], factor: float
) -> dict[str, Metric]:
    """Return the metrics that decide for a noisy picture."""
    count = len(references)
    pairs = list(itertools.combinations(references, 2))

    def pooled(
        function: Callable[[Array, Array], float], pictures: Sequence[tuple[Array, Array]]
    ) -> float:
        squares = [function(a, b) ** 2 for a, b in pictures]
        return float(np.sqrt(np.mean(squares)))

    def against_floor(
        function: Callable[[Array, Array], float], what: str, factor: float | None = None
    ) -> Metric:
        value = pooled(function, [(ours, reference) for reference in references])
        floor = pooled(function, pairs)
        meaning = (
            f"{what} to {count} Mitsuba pictures, root mean square; floor: the same "
            "among those"
        )
        if factor is None:
            return Metric(value, floor, None, None, meaning)
        limit = factor * floor
        meaning += f"; at most {factor:g} times the floor"
        return Metric(value, floor, limit, value <= limit, meaning)

    mean = mean_test(ours, references)
    tiles = tile_test(ours, references)
    return {
        "rmse": against_floor(metrics.rmse, "distance", factor),
        "trimmed_rmse": against_floor(
            metrics.trimmed_rmse,
            "distance without the worst 0.1 % of the values",
            # What makes a plain RMSE wander is left out, whatever the scene.
            NOISY_RMSE_FACTOR,
        ),
        "tile_rmse": against_floor(metrics.tile_rmse, "distance of 8 x 8 tile means"),
        "tile_bias": Metric(
            tiles.statistic,
            1.0,
            tiles.limit,
            tiles.passed,
            f"distance of {tiles.tiles} tile means in units of their own noise, worst of "
            "three channels; at most one false alarm in 10,000 for each channel",
        ),
        "worst_tile": Metric(
            tiles.worst,
            None,
            WORST_TILE_LIMIT,
            tiles.worst_passed,
            "largest distance of a single tile's mean, in units of its own noise; 5.3 was "
            "the largest in 18,000 simulated pictures without a bias",
        ),
        "mean_difference": Metric(
            mean.difference,
            mean.standard_error,
            mean.limit,
            mean.passed,
            "relative difference of the picture means; floor: one standard error; at most "
            "4.5 of them: one false alarm in 50,000 pictures of ordinary noise",
        ),
    }


def _without_noise(
    ours: Array,
    references: Sequence[Array],
    aovs: Mapping[str, Array] | None,
    factor: float,
) -> dict[str, Metric]:
    """Return the metrics that decide for a picture without noise."""
    reference, other = references[0], references[1]
    edge = discontinuities(reference)
    if aovs is not None and aovs["depth"].shape[:2] == edge.shape:
        edge = edge | silhouettes(aovs)
    edge = dilated(edge)  # a filter of radius 2 carries an edge one pixel further
    off = ~edge
    masked = float(edge.mean())
    scale = metrics.rmse(reference, np.zeros_like(reference))
    limit = factor * DETERMINISTIC_TOLERANCE * scale
    value = metrics.rmse(ours, reference, off) if off.any() else None
    floor = metrics.rmse(other, reference, off) if off.any() else None
    worst = np.max(np.abs(ours.astype(np.float64) - reference), axis=-1)
    brightest = np.max(np.abs(reference), axis=-1)
    differing = worst > EDGE_DIFFERENCE * brightest + limit
    on_edges = float((differing & edge).mean())
    everywhere = metrics.relative_rmse(ours, reference)
    other_everywhere = metrics.relative_rmse(other, reference)
    mean = metrics.mean_difference(ours, reference)
    return {
        "rmse": Metric(
            value,
            floor,
            limit,
            value is not None and floor is not None and max(value, floor) <= limit,
            f"off shadow and silhouette edges; tolerance: {factor:g} times 1e-4 of the "
            "picture's root mean square, for the floor as well: a scene called "
            "deterministic has no noise",
        ),
        "rmse_everywhere": Metric(
            everywhere,
            other_everywhere,
            EVERYWHERE_TOLERANCE,
            everywhere <= EVERYWHERE_TOLERANCE,
            "over all pixels, edges included, relative to the picture's root mean square",
        ),
        "edge_disagreement": Metric(
            on_edges,
            None,
            EDGE_TOLERANCE,
            on_edges <= EDGE_TOLERANCE,
            "fraction of the picture that lies on an edge and differs by over 1 %",
        ),
        "masked_fraction": Metric(
            masked,
            None,
            MAX_MASKED_FRACTION,
            masked <= MAX_MASKED_FRACTION,
            "fraction of the picture within a pixel of a silhouette or a jump in value",
        ),
        "mean_difference": Metric(
            mean,
            metrics.mean_difference(other, reference),
            None,
            None,
            "relative difference of the picture means, edges included",
        ),
    }


def _reasons(measured: Mapping[str, Metric], aovs: Iterable[AovResult]) -> Iterable[str]:
    """Name each number that failed, with its limit."""
    for name, metric in measured.items():
        if metric.passed is False:
            floor = "" if metric.floor is None else f", floor {metric.floor:.3g}"
            yield f"{name} {_shown(metric.value)} over {_shown(metric.tolerance)}{floor}"
    for aov in aovs:
        if not aov.passed:
            yield (
                f"AOV {aov.name} {_shown(aov.value)} over {aov.tolerance:g} "
                f"({aov.compared_pixels} pixels compared, {aov.edge_pixels} on edges): "
                f"{aov.meaning}"
            )


def _shown(value: float | None) -> str:
    return "unmeasured" if value is None else f"{value:.3g}"
