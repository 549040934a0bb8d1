"""The atlas of failures, comparing: each method holds before its limit, not behind it.

A row that no longer fails where it did is an alarm: the method was changed, or what
measures it has gone blind. Everything has fixed seeds, so that there are no false alarms.
"""

from __future__ import annotations

import numpy as np
import pytest

from reports.limits.comparing import ROWS
from reports.limits.comparing.metrics_and_defects import noisy, right_picture
from reports.limits.row import measure_sides

rows = [
    pytest.param(row, id=row.name, marks=[pytest.mark.slow] if row.slow else [])
    for row in ROWS
]


@pytest.mark.parametrize("row", rows)
def test_both_sides_of_the_boundary(row):
    sides = measure_sides(row)
    assert sides.holds_before, f"{sides.before} at {row.holds_at}, not {row.tolerance}"
    assert sides.fails_behind, f"ALARM: {sides.behind} at {row.fails_at} holds"


PICTURED = [row for row in ROWS if row.picture is not None]


@pytest.mark.parametrize("row", PICTURED, ids=lambda row: row.name)
def test_pictures_show_something(row):
    picture = row.picture()
    assert picture.dtype == np.uint8 and picture.ndim == 3 and picture.shape[2] == 3
    assert np.std(picture) > 10.0


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_rows_make_sense(row):
    """Strengths grow, the boundary lies among them, and every word is there."""
    assert list(row.strengths) == sorted(set(row.strengths))
    assert row.strengths[0] <= row.holds_at <= row.strengths[-1]
    if row.fails_at is not None:
        assert row.holds_at < row.fails_at <= row.strengths[-1]
    assert row.chapter == "comparing" and row.why and row.instead and row.source
    assert len({other.name for other in ROWS}) == len(ROWS)


def test_noise_keeps_the_mean_and_has_its_deviation():
    """Over 4096 pixels: four standard errors, a false alarm in 8000 other seeds."""
    flat = np.ones((64, 64, 3))
    made = noisy(flat, 0.1, np.random.default_rng(1))
    assert np.mean(made) == pytest.approx(1.0, abs=4 * 0.1 / 64)
    assert np.std(made) == pytest.approx(0.1, rel=4 / (2 * 4096) ** 0.5)


def test_picture_has_what_the_defects_change():
    """Contrast in the pattern, shadow and colour: a flat picture would hide a shift."""
    picture = right_picture()
    assert picture.shape == (64, 64, 3)
    assert np.std(picture) > 0.5 * np.mean(picture)
