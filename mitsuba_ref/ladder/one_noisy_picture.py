"""Judges noisy pictures: distances compared with their floors, and tests for a bias."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics import distances
from mitsuba_ref.metrics.distances import TILE
from mitsuba_ref.records.results import Metric
from mitsuba_ref.statistics.hypothesis_tests.one_picture import BiasTest, bias_tests
from mitsuba_ref.statistics.one_distance import EXCESS_LIMIT, beside_floor, most_by_noise

Array = NDArray[np.float32]

NOISY_RMSE_FACTOR = 1.25
"""Limit of the RMSE over the noise floor, if a scene's proof.toml has none."""

WIDEST_RMSE_FACTOR = 2.5
"""Largest limit over the noise floor, whatever noise may explain: a single bright pixel
raises its own limit. (Measured: 2.3 between pictures of the Cornell box.)"""


def judge_with_noise(
    ours: Array, references: Sequence[Array], factor: float
) -> dict[str, Metric]:
    """Return the metrics that decide for a noisy picture.

    Parameters
    ----------
    ours, references
        As `compare` takes them, finite.
    factor
        How much larger than its floor the RMSE may be, whatever the noise.
    """
    tests = bias_tests(ours, references)
    tiles = beside_floor(ours, references, distances.tile_rmse)
    return {
        "rmse": _judged_distance(ours, references, "distance", factor),
        "trimmed_rmse": _judged_distance(
            ours,
            references,
            "distance without the worst 0.1 % of the values",
            # What makes a plain RMSE wander is left out, whatever the scene.
            NOISY_RMSE_FACTOR,
            trimmed=True,
        ),
        "tile_rmse": Metric(
            *tiles, None, None, _beside(references, "distance of 8 x 8 tile means")
        ),
        "tile_bias": _judged(
            tests.tiles,
            f"distance of {tests.tile_count} tile means in units of their own noise, worst "
            "of three channels; at most one false alarm in 10,000 for each channel",
        ),
        "worst_tile": _judged(
            tests.worst_tile,
            "largest distance of a single tile's mean, in units of its own noise; 5.3 was "
            "the largest in 18,000 simulated pictures without a bias",
        ),
        "mean_difference": _judged(
            tests.mean,
            "relative difference of the picture means; floor: one standard error; at most "
            "4.5 of them: one false alarm in 50,000 pictures of ordinary noise",
        ),
    }


def compare_filtered(ours: Array, references: Sequence[Array]) -> Metric:
    """Judge pictures made with the scene's own filter instead of the box.

    Neighbours share samples then, so tests of independent pixels do not hold. The RMSE
    compared with its floor does.

    Parameters
    ----------
    ours, references
        As `compare` takes them, finite.
    """
    what = "distance, with the file's own filter on both sides,"
    return _judged_distance(ours, references, what, NOISY_RMSE_FACTOR, tile=TILE)


def _judged_distance(
    ours: Array,
    references: Sequence[Array],
    what: str,
    factor: float,
    *,
    trimmed: bool = False,
    tile: int = 1,
) -> Metric:
    """Return the RMSE to Mitsuba's pictures, the RMSE among those, and the limit.

    `trimmed` and `tile` as in `most_by_noise`.
    """
    distance = distances.trimmed_rmse if trimmed else distances.rmse
    value, floor = beside_floor(ours, references, distance)
    by_noise = most_by_noise(ours, references, floor, trimmed=trimmed, tile=tile)
    by_noise = min(by_noise, WIDEST_RMSE_FACTOR * floor)
    limit = max(factor * floor, by_noise)
    meaning = (
        f"{_beside(references, what)}; at most {factor:g} times the floor, or "
        f"{EXCESS_LIMIT:g} standard errors more up to {WIDEST_RMSE_FACTOR:g} times, "
        f"{by_noise:.3g}"
    )
    return Metric(value, floor, limit, value <= limit, meaning)


def _beside(references: Sequence[Array], what: str) -> str:
    return (
        f"{what} to {len(references)} Mitsuba pictures, root mean square; floor: the same "
        "among those"
    )


def _judged(test: BiasTest, meaning: str) -> Metric:
    return Metric(test.value, test.floor, test.limit, test.passed, meaning)
