"""What judges a picture without noise: pixel by pixel, on and off the edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics import distances
from mitsuba_ref.metrics.edges import (
    MAX_MASKED_FRACTION,
    dilated,
    discontinuities,
    silhouettes,
)
from mitsuba_ref.records.results import Metric

Array = NDArray[np.float32]

DETERMINISTIC_TOLERANCE = 1e-4
"""Relative RMSE of pictures without noise, off shadow and silhouette edges."""

EDGE_DIFFERENCE = 0.01  # relative: a pixel on an edge that differs by more counts
EDGE_TOLERANCE = 0.002  # fraction of all pixels that may do so

EDGE_FLIPS = 2
"""Pixels without noise that may be wrong by as much as the picture's root mean square: rays
that the last bit of a float sends past the other side of an edge. It gives the limit of the
RMSE over all pixels. Measured: an edge that whitted-spheres shows through glass, 3.4e-3 of
5.1e-3 in the demo size; one of the sixteen shadows of many-lights, 1.4e-3 of 1.7e-2 at
96 x 72; one pixel each. Scenes without such a pixel stay below 2e-5."""


def judge_without_noise(
    ours: Array,
    references: Sequence[Array],
    aovs: Mapping[str, Array] | None,
    factor: float,
) -> dict[str, Metric]:
    """Return the metrics that decide for a picture without noise.

    Parameters
    ----------
    ours, references
        As `compare` takes them, finite.
    aovs
        The reference's, for its silhouettes.
    factor
        How many times `DETERMINISTIC_TOLERANCE` the RMSE off the edges may be.
    """
    reference, other = references[0], references[1]
    edge = discontinuities(reference)
    if aovs is not None and aovs["depth"].shape[:2] == edge.shape:
        edge = edge | silhouettes(aovs)
    edge = dilated(edge)  # a filter of radius 2 carries an edge one pixel further
    off = ~edge
    masked = float(edge.mean())
    scale = distances.rmse(reference, np.zeros_like(reference))
    limit = factor * DETERMINISTIC_TOLERANCE * scale
    value = distances.rmse(ours, reference, off) if off.any() else None
    floor = distances.rmse(other, reference, off) if off.any() else None
    worst = np.max(np.abs(ours.astype(np.float64) - reference), axis=-1)
    brightest = np.max(np.abs(reference), axis=-1)
    differing = worst > EDGE_DIFFERENCE * brightest + limit
    on_edges = float((differing & edge).mean())
    everywhere = distances.relative_rmse(ours, reference)
    other_everywhere = distances.relative_rmse(other, reference)
    everywhere_limit = float(np.sqrt(EDGE_FLIPS / edge.size))
    mean = distances.mean_difference(ours, reference)
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
            everywhere_limit,
            everywhere <= everywhere_limit,
            "over all pixels, edges included, relative to the picture's root mean square; "
            f"at most what {EDGE_FLIPS} pixels make that are wrong by this much",
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
            distances.mean_difference(other, reference),
            None,
            None,
            "relative difference of the picture means, edges included",
        ),
    }
