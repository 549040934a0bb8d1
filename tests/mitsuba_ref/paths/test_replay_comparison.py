"""`compare_replay`: hand-worked pictures."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_ref.records.proof_file import USUAL_LIMITS, ReplayLimits
from mitsuba_ref.replay.replay_comparison import LISTED, compare_replay, relative_difference


def grey(height=50, width=40, value=0.5):
    return np.full((height, width, 3), value, np.float32)


def test_equal_pictures_pass():
    """No pixel diverges and nothing is left of the RMSE."""
    result = compare_replay(grey(), grey())
    assert (result.passed, result.divergent, result.rmse) == (True, 0, 0.0)
    assert (result.pixels, result.divergent_allowed) == (2000, 2)


def test_black_pictures_pass():
    """A mean of 0 is no division by zero."""
    result = compare_replay(grey(value=0.0), grey(value=0.0))
    assert (result.passed, result.rmse) == (True, 0.0)


def test_a_black_reference_is_no_division_by_zero():
    """A warning would be an error here. The one pixel that shines has diverged."""
    ours = grey(value=0.0)
    ours[7, 31, 2] = 1e-3
    result = compare_replay(ours, grey(value=0.0))
    assert (result.divergent, result.listed[0].relative) == (1, np.inf)


def test_a_divergent_pixel_is_named_and_left_out_of_the_rmse():
    """One pixel in 2000 may part; its place is (x, y) as in the picture."""
    ours = grey()
    ours[7, 31] = 0.75
    result = compare_replay(ours, grey())
    assert (result.passed, result.divergent, result.rmse) == (True, 1, 0.0)
    pixel = result.listed[0]
    assert (pixel.x, pixel.y, pixel.relative) == (31, 7, 0.5)


SIGNS = pytest.mark.parametrize("sign", [1, -1], ids=["brighter", "darker"])


@SIGNS
def test_three_divergent_pixels_of_two_thousand_fail(sign):
    """0.15 % is more than 0.1 %; two pixels are just that."""
    ours = grey()
    ours[0, :2] *= 1 + sign * 0.01
    assert compare_replay(ours, grey()).passed
    ours[0, 2] *= 1 + sign * 0.01
    result = compare_replay(ours, grey())
    assert (result.passed, result.divergent) == (False, 3)


@SIGNS
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_pixel_diverges_from_three_parts_in_ten_thousand_on(channel, sign):
    """Of its brightest channel, whichever channel differs, and in which direction."""
    for brightest in range(3):
        reference = np.tile(np.roll([0.8, 0.4, 0.2], brightest), (50, 40, 1))
        for difference, divergent in ((2.8e-4, 0), (3.2e-4, 1)):
            ours = reference.copy()
            ours[7, 31, channel] += sign * difference * 0.8
            result = compare_replay(ours.astype(np.float32), reference.astype(np.float32))
            assert result.divergent == divergent, f"{difference}, brightest {brightest}"
            seen = result.listed[0].relative if divergent else result.largest
            assert seen == pytest.approx(difference, rel=1e-3)


@SIGNS
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_small_difference_everywhere_fails(channel, sign):
    """2e-5 of every pixel is below the tolerance of each, and twice the RMSE allowed.

    In one channel alone sqrt(3) times as much makes the same RMSE.
    """
    result = compare_replay(grey(value=0.5 * (1 + sign * 2e-5)), grey())
    assert (result.passed, result.divergent) == (False, 0)
    assert result.rmse == pytest.approx(2 * USUAL_LIMITS.rmse, rel=0.01)
    ours = grey()
    ours[..., channel] *= 1 + sign * 2e-5 * np.sqrt(3)
    result = compare_replay(ours, grey())
    assert (result.passed, result.divergent) == (False, 0)
    assert result.rmse == pytest.approx(2 * USUAL_LIMITS.rmse, rel=0.01)
    half = compare_replay(grey(value=0.5 * (1 + sign * 0.5e-5)), grey())
    assert half.passed, half.sentence


def test_a_scene_may_have_wider_limits():
    """The same three pixels where 0.2 % may diverge."""
    ours = grey()
    ours[0, :3] *= 1.01
    assert compare_replay(ours, grey(), ReplayLimits(divergent=2e-3, reason="x")).passed


def test_differences_in_the_dark_are_relative_to_the_mean():
    """A black pixel: 4e-6 are 8e-4 of a hundredth of the mean 0.5, with either sign."""
    for sign in (1, -1):
        reference = grey()
        reference[0, 0] = 0.0
        ours = reference.copy()
        ours[0, 0, 1] = sign * 4e-6
        assert relative_difference(ours, reference)[0, 0] == pytest.approx(8e-4, rel=1e-3)
        assert compare_replay(ours, reference).divergent == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("side", ["ours", "theirs"])
def test_values_that_are_not_finite_never_pass(bad, side):
    """On either side."""
    broken = grey()
    broken[3, 3, 1] = bad
    pair = (broken, grey()) if side == "ours" else (grey(), broken)
    result = compare_replay(*pair)
    assert not result.passed
    assert "finite" in result.sentence


def test_another_size_never_passes():
    """The sentence names both."""
    result = compare_replay(grey(40, 50), grey())
    assert not result.passed
    assert "(40, 50, 3)" in result.sentence and "(50, 40, 3)" in result.sentence


def test_the_list_holds_the_worst():
    """A picture that is wrong everywhere names a few pixels, not all."""
    ours = grey() * np.linspace(1.01, 2.0, 2000, dtype=np.float32).reshape(50, 40, 1)
    result = compare_replay(ours, grey())
    assert len(result.listed) == LISTED
    # from the last pixel backwards
    assert [(pixel.x, pixel.y) for pixel in result.listed] == [
        (39 - k, 49) for k in range(LISTED)
    ]
    assert result.listed[0].relative == pytest.approx(1.0)
    np.testing.assert_allclose(result.listed[0].ours, 1.0)
    np.testing.assert_allclose(result.listed[0].reference, 0.5)


def with_a_lamp(error, times=1e4):
    """A grey picture with one pixel so many times as bright, off by a relative error."""
    reference = grey()
    reference[3, 4] *= times
    ours = reference.astype(np.float64)
    ours[3, 4] *= 1.0 + error
    return ours.astype(np.float32), reference


@SIGNS
def test_a_few_roundings_of_a_lamp_seen_are_within_the_limit(sign):
    """3e-7 of 1e4 times the grey is 3e-3 of it, as RMSE of 2000 pixels 1e-5 of the mean."""
    ours, reference = with_a_lamp(sign * 3e-7)
    old = np.sqrt(np.mean((ours.astype(np.float64) - reference) ** 2)) / reference.mean()
    assert old > USUAL_LIMITS.rmse
    assert compare_replay(ours, reference).passed


@SIGNS
def test_a_lamp_that_is_off_by_more_than_roundings_fails(sign):
    """2e-5 of it: no pixel diverges, and sixty roundings are none."""
    result = compare_replay(*with_a_lamp(sign * 2e-5))
    assert (result.passed, result.divergent) == (False, 0)


def test_up_to_thirty_times_the_mean_the_rmse_is_relative_to_the_mean():
    """The figure is that of before, bit for bit what it was."""
    ours, reference = with_a_lamp(1e-4, 30.0)
    squares = (ours.astype(np.float64) - reference) ** 2
    old = np.sqrt(squares.mean()) / np.abs(reference).mean(dtype=np.float64)
    assert compare_replay(ours, reference).rmse == pytest.approx(old, rel=1e-12)
