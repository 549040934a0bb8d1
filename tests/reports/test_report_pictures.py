"""Tone map, exposure and the signed difference, against values worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from reports.look import pictures


def grey(*values: float) -> np.ndarray:
    """A picture of one row with these grey values."""
    return np.repeat(np.array(values, dtype=np.float32)[None, :, None], 3, axis=2)


def test_srgb_curve_at_known_values() -> None:
    """Middle grey 0.2140 is half of 255 (IEC 61966-2-1); below 0.0031308 it is a line."""
    shown = pictures.tone_mapped(grey(0.0, 0.2140, 1.0, 7.0, -1.0, 0.002), stops=0)
    assert shown[0, :, 0].tolist() == [0, 127, 255, 255, 0, 7]


def test_exposure_is_a_power_of_two_of_the_linear_value() -> None:
    np.testing.assert_array_equal(
        pictures.tone_mapped(grey(0.1, 0.2), stops=2),
        pictures.tone_mapped(grey(0.4, 0.8), stops=0),
    )


@pytest.mark.parametrize(("level", "stops"), [(0.5, 0), (0.125, 2), (8.0, -4), (0.0, 0)])
def test_exposure_follows_the_light_parts(level: float, stops: int) -> None:
    """One lamp of 1000 in a hundred pixels does not darken the room."""
    values = [level] * 99 + [1000.0]
    assert pictures.exposure_stops(grey(*values)) == stops


def test_values_that_are_not_finite_are_magenta() -> None:
    shown = pictures.tone_mapped(grey(np.nan, np.inf, -np.inf, 0.5), stops=0)
    assert [tuple(pixel) for pixel in shown[0, :3]] == [pictures.NOT_FINITE] * 3
    assert tuple(shown[0, 3]) != pictures.NOT_FINITE
    difference = pictures.signed_difference(grey(np.nan, np.inf, 1), grey(1, np.inf, 1))
    drawn = pictures.difference_colours(difference, scale=1.0)
    assert [tuple(pixel) for pixel in drawn[0, :2]] == [pictures.NOT_FINITE] * 2
    assert tuple(drawn[0, 2]) == (247, 247, 247)


def test_difference_is_signed_luminance() -> None:
    """Rec. 709 weights sum to 1, so a grey difference keeps its size and its sign."""
    difference = pictures.signed_difference(grey(0.75, 0.25), grey(0.5, 0.5))
    np.testing.assert_allclose(difference, [[0.25, -0.25]], rtol=1e-12)
    red, black = np.float32([[[1, 0, 0]]]), np.float32([[[0, 0, 0]]])
    np.testing.assert_allclose(pictures.signed_difference(red, black), 0.2126)


def test_difference_colours_are_symmetric_about_a_neutral_zero() -> None:
    """Blue below, orange above, equal steps on both sides, clipped at the ends."""
    values = np.array([[-9.0, -1.0, 0.0, 1.0, 9.0]])
    drawn = pictures.difference_colours(values, 1.0)[0]
    assert tuple(drawn[0]) == tuple(drawn[1]) == (8, 48, 107)
    assert tuple(drawn[2]) == (247, 247, 247)
    assert tuple(drawn[3]) == tuple(drawn[4]) == (127, 39, 4)
    steps = pictures.diverging_steps(np.array([[-0.3, 0.3]]), 1.0)[0].astype(int)
    assert steps[0] + steps[1] == pictures.DIVERGING_STEPS - 1


@pytest.mark.parametrize(
    ("largest", "scale"), [(0.03, 0.05), (0.2, 0.2), (0.6, 1.0), (1e-7, 1e-7), (0.0, 1e-6)]
)
def test_scale_is_the_next_round_number(largest: float, scale: float) -> None:
    difference = np.array([[largest, -largest, largest, -largest]])
    assert pictures.symmetric_scale(difference) == scale


def test_scale_is_not_set_by_a_firefly_or_a_nan() -> None:
    difference = np.full((20, 20), 0.04)
    difference[0, 0], difference[0, 1] = 1e6, np.nan
    assert pictures.symmetric_scale(difference) == 0.05


def test_difference_of_one_pixel_is_still_seen_in_the_scale() -> None:
    """If 99 % agree exactly, the rest sets the scale instead of dividing by zero."""
    difference = np.zeros((20, 20))
    difference[3, 3] = -0.3
    assert pictures.symmetric_scale(difference) == 0.5
