"""What judges a noisy picture: distances beside their floors, tests for a bias."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics import distances
from mitsuba_ref.records.results import Metric
from mitsuba_ref.statistics import floors
from mitsuba_ref.statistics.floors import Distance
from mitsuba_ref.statistics.one_picture import BiasTest, bias_tests

Array = NDArray[np.float32]

NOISY_RMSE_FACTOR = 1.25
"""Of the noise floor, where a scene's proof.toml says nothing."""


def judge_with_noise(
    ours: Array, references: Sequence[Array], factor: float
) -> dict[str, Metric]:
    """Return the metrics that decide for a noisy picture.

    Parameters
    ----------
    ours, references
        As `compare` takes them, finite.
    factor
        How much larger than its floor the RMSE may be.
    """
    tests = bias_tests(ours, references)
    return {
        "rmse": _beside_floor(distances.rmse, "distance", ours, references, factor),
        "trimmed_rmse": _beside_floor(
            distances.trimmed_rmse,
            "distance without the worst 0.1 % of the values",
            ours,
            references,
            # What makes a plain RMSE wander is left out, whatever the scene.
            NOISY_RMSE_FACTOR,
        ),
        "tile_rmse": _beside_floor(
            distances.tile_rmse, "distance of 8 x 8 tile means", ours, references
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

    Neighbours share samples then, so that no test of independent pixels holds; the RMSE
    beside its floor does.

    Parameters
    ----------
    ours, references
        As `compare` takes them, finite.
    """
    what = "distance, with the file's own filter on both sides,"
    return _beside_floor(distances.rmse, what, ours, references, NOISY_RMSE_FACTOR)


def _beside_floor(
    distance: Distance,
    what: str,
    ours: Array,
    references: Sequence[Array],
    factor: float | None = None,
) -> Metric:
    """Return a distance to Mitsuba's pictures beside the same among those."""
    value, floor = floors.beside_floor(ours, references, distance)
    meaning = (
        f"{what} to {len(references)} Mitsuba pictures, root mean square; floor: the same "
        "among those"
    )
    if factor is None:
        return Metric(value, floor, None, None, meaning)
    limit = factor * floor
    meaning += f"; at most {factor:g} times the floor"
    return Metric(value, floor, limit, value <= limit, meaning)


def _judged(test: BiasTest, meaning: str) -> Metric:
    return Metric(test.value, test.floor, test.limit, test.passed, meaning)
