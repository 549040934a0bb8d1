"""The tests that tell a bias from noise: they stay silent, and they speak up."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_ref.statistics.hypothesis_tests.one_picture import MEAN_LIMIT, bias_tests

SHAPE = (32, 40, 3)


def gaussian(rng: np.random.Generator) -> np.ndarray:
    return 1.0 + 0.3 * rng.standard_normal(SHAPE)


def fireflies(rng: np.random.Generator) -> np.ndarray:
    """Infinite variance: what a caustic looks like to an average."""
    return rng.pareto(1.8, SHAPE)


@pytest.mark.parametrize("noise", [gaussian, fireflies])
def test_no_false_alarm_in_two_hundred_equal_pictures(noise):
    """With 5e-5 a picture, 200 pictures raise one alarm in a hundred such tests."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        pictures = [noise(rng) for _ in range(5)]
        tests = bias_tests(pictures[0], pictures[1:])
        assert tests.mean.passed, f"expected a mean within its limit: {tests.mean}"
        assert tests.tiles.passed, f"expected tiles within their limit: {tests.tiles}"
        assert tests.worst_tile.passed, f"expected less than 7: {tests.worst_tile}"


def test_standard_error_is_that_of_the_mean_difference():
    """sigma / sqrt(n) for ours and for the mean of four: 0.3 sqrt(1.25 / 1280)."""
    rng = np.random.default_rng(2)
    result = bias_tests(gaussian(rng), [gaussian(rng) for _ in range(4)])
    assert result.mean.floor == pytest.approx(0.3 * np.sqrt(1.25 / 1280), rel=0.1)


def test_tile_statistic_is_one_for_noise():
    rng = np.random.default_rng(3)
    statistics = [
        bias_tests(gaussian(rng), [gaussian(rng) for _ in range(4)]).tiles.value
        for _ in range(50)
    ]
    # The worst of three channels is a little above the average channel.
    assert np.mean(statistics) == pytest.approx(1.0, abs=0.2)


def test_scale_error_of_six_standard_errors_is_found():
    rng = np.random.default_rng(4)
    references = [gaussian(rng) for _ in range(4)]
    shift = (MEAN_LIMIT + 2.0) * 0.3 * np.sqrt(1.25 / 1280)
    assert not bias_tests(gaussian(rng) * (1.0 + shift), references).mean.passed


# Mean and noise of three channels that have nothing in common: relative to the mean, the
# noise of one picture is 0.004, 0.3 and 10.
MEANS = np.array([5.0, 1.0, 0.2])
SIGMAS = np.array([0.02, 0.3, 2.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
@pytest.mark.parametrize("biased", [0, 1, 2])
def test_the_biased_channel_decides(biased, order, sign):
    """Each channel is judged by its own value, noise and limit.

    A test that takes the channel with the largest value instead always takes the noisiest
    one, and a bias of the quiet channel passes.
    """
    rng = np.random.default_rng(7)
    means, sigmas = MEANS[list(order)], SIGMAS[list(order)]
    ours, *references = (means + sigmas * rng.standard_normal(SHAPE) for _ in range(5))

    def tests_of(bias):
        """Test our picture with a bias (H, W) of one channel, in sigmas of one pixel."""
        wrong = ours.copy()
        wrong[..., biased] += sign * sigmas[biased] * bias
        return bias_tests(wrong, references)

    right = tests_of(0.0)
    assert right.mean.passed and right.tiles.passed and right.worst_tile.passed, right

    error = np.sqrt(1.25 / 1280)  # of the difference of means, in sigmas of one pixel
    shifted = tests_of((MEAN_LIMIT + 5.0) * error)
    relative = error * sigmas[biased] / means[biased]
    assert not shifted.mean.passed, f"channel {biased}: {shifted.mean}"
    assert shifted.mean.value == pytest.approx((MEAN_LIMIT + 5.0) * relative, rel=0.3)
    assert shifted.mean.floor == pytest.approx(relative, rel=0.15)

    halves = tests_of(np.where(np.arange(40) < 20, 0.5, -0.5))
    assert halves.mean.passed, f"the halves cancel in the mean: {halves.mean}"
    assert not halves.tiles.passed, f"channel {biased}: {halves.tiles}"

    spot = np.zeros(SHAPE[:2])
    spot[8:16, 16:24] = 1.5
    assert not tests_of(spot).worst_tile.passed, f"channel {biased}: {tests_of(spot)}"


def test_bias_that_cancels_is_found_by_the_tiles_alone():
    """Left brighter, right darker by as much: the picture's mean is right."""
    rng = np.random.default_rng(5)
    references = [gaussian(rng) for _ in range(4)]
    ours = gaussian(rng)
    ours[:, :20] *= 1.08
    ours[:, 20:] *= 0.92
    assert bias_tests(ours, references).mean.passed
    assert not bias_tests(ours, references).tiles.passed


def test_one_wrong_tile_among_many_is_found_by_the_worst_tile_alone():
    """Half as bright on 64 of 27,648 pixels: in a sum over 432 tiles it drowns."""
    rng = np.random.default_rng(6)
    pictures = [1.0 + 0.3 * rng.standard_normal((144, 192, 3)) for _ in range(5)]
    ours, references = pictures[0], pictures[1:]
    assert bias_tests(ours, references).worst_tile.passed
    ours[64:72, 80:88] *= 0.5
    result = bias_tests(ours, references)
    assert result.tiles.passed
    assert not result.worst_tile.passed


def test_rounding_in_a_picture_without_noise_is_forgiven():
    """Seven digits of float32 are no bias, however many standard errors they are."""
    references = [np.full(SHAPE, 3.0)] * 4
    rounded = bias_tests(references[0] * (1 + 1e-6), references)
    assert rounded.mean.passed and rounded.tiles.passed
    wrong = bias_tests(references[0] * (1 + 1e-3), references)
    assert not wrong.mean.passed and not wrong.tiles.passed


def test_one_reference_has_no_noise_to_tell():
    with pytest.raises(ValueError, match="two references"):
        bias_tests(np.ones(SHAPE), [np.ones(SHAPE)])
