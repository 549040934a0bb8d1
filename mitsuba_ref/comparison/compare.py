"""Two renderers' arrays -> distances with their noise floors -> a verdict with reasons."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.comparison.aovs import NOTHING_SEEN, compare_aovs, sees_nothing
from mitsuba_ref.comparison.noise_floor import (
    NOISY_RMSE_FACTOR,
    compare_filtered,
    judge_with_noise,
)
from mitsuba_ref.comparison.preconditions import (
    Incomparable,
    count_non_finite,
    find_obstacle,
)
from mitsuba_ref.comparison.without_noise import judge_without_noise
from mitsuba_ref.metrics import distances
from mitsuba_ref.records.results import AovResult, Finite, Metric, ReplayResult
from mitsuba_ref.records.verdicts import Verdict, most_severe
from renderer.integrators.kind import as_picture

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Comparison:
    """What was measured and what follows from it."""

    verdict: Verdict
    reasons: tuple[str, ...]
    finite: Finite
    metrics: dict[str, Metric]
    aovs: tuple[AovResult, ...]
    notes: tuple[str, ...] = ()  # why it passes, if by unusual evidence


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
    Values that are not finite, a missing reference and a different size have separate
    verdicts (`find_obstacle`), and nothing else is measured then.
    """
    if rmse_factor is None:
        rmse_factor = 1.0 if deterministic else NOISY_RMSE_FACTOR
    aov_arrays = [*(ours_aovs or {}).values()], [*(reference_aovs or {}).values()]
    finite = count_non_finite([ours, *aov_arrays[0]], [*references, *aov_arrays[1]])
    obstacle = find_obstacle([ours], references, ours_aovs, reference_aovs)
    if obstacle:
        return without_numbers(Comparison(obstacle.verdict, (), finite, {}, ()), obstacle)
    measured = _for_the_eye(ours, references)
    aovs: tuple[AovResult, ...] = ()
    if reference_aovs is not None:
        aovs = compare_aovs(ours_aovs or {}, reference_aovs)
    if deterministic:
        measured |= judge_without_noise(ours, references, reference_aovs, rmse_factor)
    else:
        measured |= judge_with_noise(ours, references, rmse_factor)
    reasons = tuple(_reasons(measured, aovs))
    notes: tuple[str, ...] = ()
    if reference_aovs and sees_nothing(reference_aovs):
        pixels = ours.shape[0] * ours.shape[1]
        notes = (
            f"{NOTHING_SEEN}: compared were the colours of {pixels} pixels of background, "
            "and that ours miss as well",
        )
    return Comparison("fail" if reasons else "pass", reasons, finite, measured, aovs, notes)


def with_metric(comparison: Comparison, name: str, metric: Metric) -> Comparison:
    """Return the comparison with one more metric, which counts for the verdict."""
    reasons = (*comparison.reasons, *_reasons({name: metric}, ()))
    return replace(
        comparison,
        verdict="fail" if reasons else "pass",
        reasons=reasons,
        metrics={**comparison.metrics, name: metric},
    )


def with_listed_aov(
    comparison: Comparison,
    name: str,
    ours: Array,
    references: Sequence[Array | None],
) -> Comparison:
    """Return the comparison with an AOV that the file lists, its channels as a picture's.

    Parameters
    ----------
    comparison, name
        To what the metric `name` is added.
    ours, references
        (H, W, C) with C up to 3, of all samples; None: Mitsuba has none by this name. Equal
        ones have no noise, whatever the colours have.
    """
    shape = ours.shape
    if any(values is None or values.shape != shape for values in references):
        found = [None if values is None else values.shape for values in references]
        what = f"our {name} has shape {shape}, Mitsuba's {found[0]}"
        return without_numbers(comparison, Incomparable("size-mismatch", what), name)
    picture = as_picture(ours)
    theirs = [as_picture(values) for values in references if values is not None]
    obstacle = find_obstacle([picture], theirs)
    if obstacle:
        return without_numbers(comparison, obstacle, name)
    if np.array_equal(theirs[0], theirs[1]):
        metric = judge_without_noise(picture, theirs, None, 1.0)["rmse"]
    else:
        metric = compare_filtered(picture, theirs)
    return with_metric(comparison, name, metric)


def with_known_fault(comparison: Comparison, fault: str) -> Comparison:
    """Return the comparison, not as a pass if Mitsuba's own picture is known to be wrong.

    `fault` says how, and that it was undone; it is empty without a fault.
    """
    if not fault or comparison.verdict != "pass":
        return comparison
    return replace(comparison, verdict="reference-wrong", reasons=(fault,))


def with_replays(comparison: Comparison, replays: Sequence[ReplayResult]) -> Comparison:
    """Return the comparison with the results of replays, which count for the verdict."""
    reasons = [
        f"replay at {replay.spp} samples per pixel: {replay.sentence}"
        for replay in replays
        if not replay.passed
    ]
    notes = [
        f"replay at {replay.spp} samples per pixel: {replay.sentence}"
        for replay in replays
        if replay.passed and replay.explained
    ]
    comparison = replace(comparison, notes=(*comparison.notes, *notes))
    if not reasons:
        return comparison
    return replace(
        comparison,
        verdict=most_severe((comparison.verdict, *(r.verdict for r in replays))),
        reasons=(*comparison.reasons, *reasons),
    )


def without_numbers(
    comparison: Comparison, obstacle: Incomparable, name: str = "rmse"
) -> Comparison:
    """Return the comparison with the metric `name` as one that could not be measured."""
    unmeasured = Metric(None, None, None, False, f"not measured: {obstacle.what}")
    return replace(
        comparison,
        verdict=most_severe((comparison.verdict, obstacle.verdict)),
        reasons=(obstacle.sentence, *comparison.reasons),
        metrics={**comparison.metrics, name: unmeasured},
    )


def _for_the_eye(ours: Array, references: Sequence[Array]) -> dict[str, Metric]:
    """Return the metrics that are shown with their floor but do not decide."""
    first, other = references[0], references[1]

    def shown(function: Callable[[Array, Array], float | None], meaning: str) -> Metric:
        return Metric(function(ours, first), function(other, first), None, None, meaning)

    colour, colour_floor = (
        distances.ciede2000(ours, first),
        distances.ciede2000(other, first),
    )
    return {
        "relative_mse": shown(
            distances.relative_mse, "mean squared error relative to the squared value"
        ),
        "ssim": shown(
            distances.ssim, "structural similarity of the tone-mapped picture; 1 is equal"
        ),
        "flip": shown(
            distances.flip, "difference that an eye sees when flipping; 0 is equal"
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
