"""What judges a noisy picture: distances beside their floors, tests for a bias."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.comparison.noise import WORST_TILE_LIMIT, mean_test, tile_test
from mitsuba_ref.metrics import distances
from mitsuba_ref.records.results import Metric

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
        "rmse": against_floor(distances.rmse, "distance", factor),
        "trimmed_rmse": against_floor(
            distances.trimmed_rmse,
            "distance without the worst 0.1 % of the values",
            # What makes a plain RMSE wander is left out, whatever the scene.
            NOISY_RMSE_FACTOR,
        ),
        "tile_rmse": against_floor(distances.tile_rmse, "distance of 8 x 8 tile means"),
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


def compare_filtered(ours: Array, references: Sequence[Array]) -> Metric:
    """Judge pictures made with the scene's own filter instead of the box.

    Neighbours share samples then, so that no test of independent pixels holds; the RMSE
    beside its floor does.

    Parameters
    ----------
    ours, references
        As `compare` takes them, finite.
    """
    pooled = [distances.rmse(ours, reference) for reference in references]
    value = float(np.sqrt(np.mean(np.square(pooled))))
    pairs = [distances.rmse(a, b) for a, b in itertools.combinations(references, 2)]
    floor = float(np.sqrt(np.mean(np.square(pairs))))
    limit = NOISY_RMSE_FACTOR * floor
    meaning = (
        f"distance to {len(references)} Mitsuba pictures, all made with the file's own "
        f"filter; floor: the same among those; at most {NOISY_RMSE_FACTOR:g} times that"
    )
    return Metric(value, floor, limit, value <= limit, meaning)
