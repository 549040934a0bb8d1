"""The rungs of the ladder that involve no noise: finite values, AOVs, exact radiance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder.aovs import compare_aovs
from mitsuba_ref.ladder.preconditions import count_non_finite
from mitsuba_ref.ladder.without_noise import (
    DETERMINISTIC_TOLERANCE,
    judge_without_noise,
)
from mitsuba_ref.metrics import distances
from mitsuba_ref.records.results import Rung

Array = NDArray[np.floating]
Aovs = Mapping[str, NDArray[np.float32]]


def finite(
    ours: Sequence[Array],
    theirs: Sequence[Array],
    our_aovs: Aovs | None = None,
    their_aovs: Aovs | None = None,
) -> Rung:
    """Check that all pictures have one size and no value is NaN or infinite."""
    shapes = {picture.shape for picture in (*ours, *theirs)}
    found = count_non_finite(
        [*ours, *(our_aovs or {}).values()], [*theirs, *(their_aovs or {}).values()]
    )
    bad = (found.ours_nan + found.ours_inf, found.reference_nan + found.reference_inf)
    if len(shapes) > 1:
        sentence = f"The pictures have different sizes: {sorted(shapes)}."
    elif any(bad):
        sentence = (
            f"{bad[0]} values of our pictures and {bad[1]} of Mitsuba's are no numbers or "
            "infinite: nothing else can be compared."
        )
    else:
        height, width = next(iter(shapes))[:2]
        sentence = (
            f"All pictures have {width} x {height} pixels, and each value is a number."
        )
    return Rung(
        name="finite",
        passed=len(shapes) == 1 and not any(bad),
        statistic=float(sum(bad)),
        limit=0.0,
        detectable="a single value that is no number",
        sentence=sentence,
    )


def aovs(ours: Aovs, theirs: Aovs) -> Rung:
    """Compare what the first ray of each pixel hits; the worst channel decides."""
    results = compare_aovs(ours, theirs)
    broken = [result.name for result in results if not result.passed]
    ratios = [
        result.value / result.tolerance
        for result in results
        if result.value is not None and result.tolerance > 0.0
    ]
    if broken:
        sentence = f"Rays through pixel centres disagree about: {', '.join(broken)}."
    else:
        sentence = (
            "A ray through the centre of each pixel hits the same object at the same "
            "place in both renderers, off the outlines."
        )
    return Rung(
        name="aovs",
        passed=not broken,
        statistic=max(ratios, default=None),
        limit=1.0,
        detectable_bias=1e-4,
        detectable="relative error of depth in one pixel of a thousand",
        sentence=sentence,
    )


def radiance(ours: Array, theirs: Sequence[Array], their_aovs: Aovs | None) -> Rung:
    """Compare pictures without noise pixel by pixel, as the harness does."""
    picture = ours.astype(np.float32)
    references = [other.astype(np.float32) for other in theirs]
    judged = judge_without_noise(picture, references, their_aovs, 1.0)
    broken = [name for name, metric in judged.items() if metric.passed is False]
    scale = distances.rmse(references[0], np.zeros_like(references[0])) or 1.0
    value, limit = judged["rmse"].value, judged["rmse"].tolerance
    if broken:
        sentence = f"The pictures have no noise and differ: {', '.join(broken)}."
    else:
        sentence = (
            "The pictures have no noise and are equal to "
            f"{DETERMINISTIC_TOLERANCE:.2%} of their brightness, off edges."
        )
    return Rung(
        name="radiance",
        passed=not broken,
        statistic=None if value is None else value / scale,
        limit=None if limit is None else limit / scale,
        detectable_bias=DETERMINISTIC_TOLERANCE,
        detectable="relative bias of the whole picture",
        sentence=sentence,
    )


def no_convergence() -> Rung:
    """Return the rung of convergence of a scene without noise: nothing is measured."""
    return Rung(
        name="convergence",
        passed=True,
        sentence="Not tested: the scene has no noise that could fall.",
    )
