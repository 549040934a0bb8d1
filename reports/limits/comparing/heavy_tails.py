"""Heavy tails: an RMSE that depends on whether the one bright sample came."""

from __future__ import annotations

from functools import partial

import numpy as np

from reports.limits.light_transport.caustics import light_below_lamp
from reports.limits.row import Row

PICTURES, PIXELS = 64, 64
SPP = 16
WANTED = 0.05  # to what the error is to be known


def seeds_needed(distance_over_radius: float, *, ball: bool) -> float:
    """Return over how many seeds an RMSE is to be averaged to be known to 5 %.

    Pictures of 64 pixels, below a lamp behind a glass ball or without it. The pixels are
    alike, so that the truth is the mean of all. Normal errors need 3.1: the RMSE of n of
    them varies by one over the root of 2 n.
    """
    values = light_below_lamp(distance_over_radius, ball=ball, spp=SPP, size=64)
    errors = values.reshape(PICTURES, PIXELS) - np.mean(values)
    rmse = np.sqrt(np.mean(errors**2, axis=1))
    return float((np.std(rmse, ddof=1) / np.mean(rmse) / WANTED) ** 2)


_LAMPS = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0)

ROWS = (
    Row(
        name="rmse-seeds-caustic",
        method="RMSE of 16 samples a pixel in a caustic",
        stress="lamp's distance over its radius",
        measure=partial(seeds_needed, ball=True),
        quantity="cost",
        unit="seeds until it is known to 5 %",
        strengths=_LAMPS,
        tolerance=6.0,
        holds_at=20.0,
        fails_at=320.0,
        why="The squares of a few bright samples are most of the sum, and whether a "
        "picture has one is chance.",
        instead="More seeds; or a trimmed RMSE beside a test of the mean, since trimming "
        "alone hides a bias.",
        source="measured here",
    ),
    Row(
        name="rmse-seeds-without-glass",
        method="RMSE of 16 samples a pixel, without the glass",
        stress="lamp's distance over its radius",
        measure=partial(seeds_needed, ball=False),
        quantity="cost",
        unit="seeds until it is known to 5 %",
        strengths=_LAMPS,
        tolerance=6.0,
        holds_at=640.0,
        fails_at=None,
        why="Errors are nearly normal, whose RMSE varies by one over the root of twice "
        "the pixels.",
        instead="This is the method to use.",
        source="measured here",
    ),
)
