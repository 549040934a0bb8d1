"""What rows of the chapter on comparing measure with: a picture, noise and defects.

That each method holds before its limit and fails behind it is asserted with all rows.
"""

from __future__ import annotations

import numpy as np
import pytest

from reports.limits.comparing.metrics_and_defects import noisy, right_picture


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
