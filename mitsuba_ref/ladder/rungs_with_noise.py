"""The rungs of the ladder that judge pictures under noise.

Each takes pictures (K, H, W, 3) of both renderers and its false alarm rate, calls one test
of `statistics`, and says in a sentence what came out and what would have been seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_ref.records.results import Rung
from mitsuba_ref.statistics import power
from mitsuba_ref.statistics.convergence import FALSE_ALARMS, INDEPENDENT, Convergence
from mitsuba_ref.statistics.floors import floor_tests
from mitsuba_ref.statistics.hypothesis_tests.uniformity import uniformity_test
from mitsuba_ref.statistics.hypothesis_tests.welch import (
    FamilyTest,
    critical_t,
    mean_test,
    pixel_test,
    tile_test,
)
from mitsuba_ref.statistics.noise_free_mse import (
    CONFIDENCE,
    noise_free_mse,
    relative_to_brightness,
)
from mitsuba_ref.statistics.registration import (
    EXPLAINED,
    NEGLIGIBLE,
    find_flip,
    picture_shift,
)
from mitsuba_ref.statistics.samples import Floats


def registration(
    ours: Floats, theirs: Floats, alpha: float, deterministic: bool = False
) -> Rung:
    """Test that no picture is shifted against or a mirror image of the other."""
    flip = find_flip(ours, theirs, 1.0 if deterministic else alpha)
    shift = picture_shift(ours, theirs)
    shifted = (
        shift.length > NEGLIGIBLE
        and shift.p_value <= alpha
        and shift.explained >= EXPLAINED
    )
    error = max(shift.standard_errors)
    critical = critical_t(alpha, 2, shift.degrees)
    seen = max(
        power.noncentrality(critical, shift.degrees) * error, NEGLIGIBLE + power.Z * error
    )
    if flip:
        sentence = f"Our picture is Mitsuba's with {flip} exchanged."
    elif shifted:
        sentence = (
            f"Our picture lies {shift.x:+.2f} pixels to the right of Mitsuba's and "
            f"{shift.y:+.2f} below it."
        )
    else:
        sentence = (
            "Both films put the same things into the same pixels; a shift by "
            f"{seen:.2g} pixels would have been seen."
        )
    return Rung(
        name="registration",
        passed=not (flip or shifted),
        statistic=shift.length,
        limit=max(NEGLIGIBLE, critical * error),
        p_value=None if deterministic else shift.p_value,
        false_alarm_rate=None if deterministic else alpha,
        detectable_bias=seen,
        detectable="shift of the picture in pixels",
        sentence=sentence,
    )


def welch(name: str, ours: Floats, theirs: Floats, alpha: float) -> Rung:
    """Welch's test for each place and channel; `name` is one of `WELCH`."""
    judge, place, of = WELCH[name]
    test = judge(ours, theirs)
    seen = power.detectable_bias(test, alpha)
    differs = (
        f"At least one {place} differs by {test.largest_t:.1f} times its noise; chance "
        f"alone does this less than once in {1.0 / alpha:,.0f} runs."
    )
    if math.isinf(test.largest_t):
        differs = f"At least one {place} has no noise and yet differs."
    return _rung(
        name,
        alpha,
        test.p_value,
        (test.largest_t, critical_t(alpha, test.tests, test.degrees)),
        (seen, f"relative bias of {of}"),
        f"No {place} differs by more than noise explains; a bias of {seen:.2%} of {of} "
        "would have been seen.",
        differs,
    )


WELCH: dict[str, tuple[Callable[[Floats, Floats], FamilyTest], str, str]] = {
    "pixels": (pixel_test, "pixel", "a single pixel of median noise"),
    "tiles": (tile_test, "tile", "a single tile of median noise"),
    "mean": (mean_test, "channel's mean", "the whole picture"),
}


def _rung(
    name: str,
    alpha: float,
    p_value: float,
    beside: tuple[float, float],
    seen: tuple[float, str],
    fine: str,
    differs: str,
) -> Rung:
    """Judge by a p-value.

    Parameters
    ----------
    name, alpha, p_value
        It passes if chance does this more often than `alpha`.
    beside
        The statistic and its limit.
    seen
        The bias that would have been seen, and what it measures.
    fine, differs
        The sentence for either outcome.
    """
    passed = p_value > alpha
    sentence = fine if passed else differs
    return Rung(name, passed, *beside, p_value, alpha, *seen, sentence)


def uniformity(ours: Floats, theirs: Floats, alpha: float) -> Rung:
    """Kolmogorov and Smirnov's test on the p-values of the pixels."""
    result = uniformity_test(ours, theirs, alpha)
    grey = pixel_test(ours.mean(axis=-1)[..., None], theirs.mean(axis=-1)[..., None])
    seen = power.detectable_in_all_pixels(result, grey.degrees, grey.relative_error)
    fine = (
        "The differences of all pixels together are spread as noise is; "
        f"a bias of {seen:.2%} of each pixel would have been seen."
    )
    differs = (
        "The differences of all pixels together are not spread as noise is: too many "
        "pixels differ a little."
    )
    if not math.isfinite(result.limit):
        fine = differs = (
            "Not judged: the renderers have different noise, or too few pixels have any "
            f"({result.pixels})."
        )
    return _rung(
        "uniformity",
        alpha,
        result.p_value,
        (result.distance, result.limit),
        (seen, "relative bias of every pixel, of any sign"),
        fine,
        differs,
    )


def noise_free(ours: Floats, theirs: Floats, alpha: float) -> Rung:
    """Test the mean squared difference that is left without the noise."""
    ours, theirs = relative_to_brightness(ours, theirs)
    result = noise_free_mse(ours, theirs, alpha)
    seen = power.detectable_rms(result, ours, theirs)
    bounds = [math.sqrt(max(0.0, end)) for end in (result.low, result.high)]
    interval = f"between {bounds[0]:.2%} and {bounds[1]:.2%} (99 % confidence)"
    return _rung(
        "noise-free mse",
        alpha,
        result.p_value,
        (result.value, result.limit),
        (seen, "relative bias of every pixel (root mean square), of any sign"),
        f"Without noise the pixels differ by {interval}, which can be nothing; a bias of "
        f"{seen:.2%} would have been seen.",
        f"Without noise the pixels still differ, by {interval}.",
    )


def floors(ours: Floats, theirs: Floats, alpha: float) -> Rung:
    """Test RMSE, SSIM and FLIP between the renderers against those within each."""
    results = floor_tests(ours, theirs, alpha)
    worst = min(results, key=lambda floor: floor.p_value)
    together = min(1.0, len(results) * worst.p_value)
    mean_square = float(np.mean(theirs.mean(axis=0) ** 2))
    seen = power.detectable_above_floor(results[0], mean_square)
    listed = "; ".join(
        f"{floor.name} {floor.across:.3g}, among ours {floor.ours:.3g}, among Mitsuba's "
        f"{floor.theirs:.3g}"
        for floor in results
    )
    apart = "Pictures of the two renderers are {} two pictures of one: " + listed + "."
    return _rung(
        "floors",
        alpha,
        together,
        (worst.excess, worst.limit),
        (seen, "root mean square of a bias, relative to the picture's, by RMSE"),
        apart.format("as far apart as"),
        apart.format("further apart than"),
    )


def exponent(convergence: Convergence, side: str = "ours") -> Rung:
    """Judge how fast the noise of one renderer falls with the number of samples.

    Parameters
    ----------
    convergence
        With a sampler of independent samples.
    side
        "ours" or "Mitsuba".
    """
    value, limit = convergence.exponent, convergence.limit
    seen = limit + power.Z * convergence.standard_error
    whose = "Our" if side == "ours" else "Mitsuba's"
    if math.isfinite(value):
        around = convergence.beyond(1.0 - CONFIDENCE)
        verb = "as it must" if convergence.passed else "which is not as it must be"
        samples = convergence.samples
        sentence = (
            f"{whose} noise falls with the power {value:.3f} +- {around:.3f} (99 % "
            f"confidence) of the number of samples, {verb} for independent ones (-0.5); "
            f"{INDEPENDENT + seen:.2f} would have been seen. {convergence.pairs} pairs of "
            f"pictures at each of {samples[0]} to {samples[-1]} samples per pixel."
        )
    else:
        sentence = f"{whose} pictures with different seeds are equal: they have no noise."
    return Rung(
        name=f"convergence, {side}",
        passed=convergence.passed,
        statistic=abs(value - INDEPENDENT),
        limit=limit,
        p_value=convergence.p_value,
        false_alarm_rate=FALSE_ALARMS,
        detectable_bias=seen,
        detectable="distance of the exponent from -0.5",
        sentence=sentence,
    )
