"""Welch's tests of pixels, tiles and means: SciPy's numbers, known error rates and power.

A false alarm rate is held against the binomial distribution of the number of alarms: the
bounds are those that a correct test keeps with probability 1 - 1e-4. Seeds are fixed.
"""

from __future__ import annotations

import noise_samples
import numpy as np
import pytest
from noise_samples import fireflies, gaussian, pictures, scene, skewed
from scipy import stats

from mitsuba_ref.statistics.hypothesis_tests.welch import (
    critical_t,
    family_test,
    mean_test,
    pixel_test,
    sidak_limit,
    sidak_p,
    tile_test,
    tiled,
    welch,
)
from mitsuba_ref.statistics.power import detectable_bias, noncentrality
from mitsuba_ref.statistics.samples import ROUNDING, stack


def at_most(trials: int, rate: float) -> int:
    """The number of alarms that a test with this rate exceeds once in 10,000 times."""
    return int(stats.binom.isf(1e-4, trials, rate))


def test_a_pixel_by_hand():
    """Means 3 and 6, variances of the means 1/3 + 4/3: t = -3 / sqrt(5/3).

    Degrees of freedom (5/3)^2 / ((1/9 + 16/9) / 2) = 50/17.
    """
    result = welch(np.array([2.0, 3.0, 4.0]), np.array([4.0, 6.0, 8.0]), forgiven=0.0)
    assert result.t == pytest.approx(-3.0 / np.sqrt(5.0 / 3.0))
    assert result.degrees == pytest.approx(50.0 / 17.0)
    assert result.difference == -3.0
    assert result.standard_error == pytest.approx(np.sqrt(5.0 / 3.0))


@pytest.mark.parametrize("counts", [(8, 8), (2, 5), (16, 9)])
def test_scipy_says_the_same(counts):
    rng = np.random.default_rng(1)
    a, b = rng.gamma(2.0, 1.0, (counts[0], 50)), rng.gamma(2.0, 1.5, (counts[1], 50))
    found, expected = welch(a, b, forgiven=0.0), stats.ttest_ind(a, b, equal_var=False)
    np.testing.assert_allclose(found.t, expected.statistic, rtol=1e-12)
    np.testing.assert_allclose(found.p, expected.pvalue, rtol=1e-10)
    np.testing.assert_allclose(found.degrees, expected.df, rtol=1e-12)


def test_sidak_by_hand():
    """Two tests at 1 - sqrt(0.75) each have 25 % together, and so back."""
    assert sidak_limit(0.25, 2) == pytest.approx(1.0 - np.sqrt(0.75))
    assert sidak_p(1.0 - np.sqrt(0.75), 2) == pytest.approx(0.25)
    assert sidak_p(0.0, 10) == 0.0
    assert sidak_p(1.0, 10) == 1.0
    # One of 110,592 values of a picture: no rounding to zero.
    assert sidak_limit(1e-3, 110_592) == pytest.approx(1e-3 / 110_592, rel=1e-3)


def test_pixels_without_noise():
    """Equal to rounding: t is 0. Different: no chance explains it. Black: nothing."""
    ours = np.tile([1.00001, 1.01, 0.0], (8, 1))
    result = welch(ours, np.tile([1.0, 1.0, 0.0], (8, 1)))
    np.testing.assert_array_equal(result.t, [0.0, np.inf, 0.0])
    np.testing.assert_array_equal(result.p, [1.0, 0.0, 1.0])
    assert family_test(result).p_value == 0.0


def test_tiles_are_means_of_64_pixels_and_a_rest():
    values = np.arange(2.0 * 10 * 9).reshape(2, 10, 9, 1)
    means = tiled(values)
    assert means.shape == (2, 2, 2, 1)
    assert means[0, 0, 0, 0] == values[0, :8, :8].mean()
    assert means[1, 1, 1, 0] == values[1, 8:, 8:].mean()


@pytest.mark.parametrize("test", [pixel_test, tile_test, mean_test])
@pytest.mark.parametrize("noise", [gaussian, skewed, fireflies])
def test_alarms_no_more_often_than_claimed(test, noise):
    """200 equal pairs at a claimed 5 %: at most 23 alarms.

    The three channels are independent here, the worst case for Sidak.
    """
    rng = np.random.default_rng(2)
    p = [test(pictures(rng, noise), pictures(rng, noise)).p_value for _ in range(200)]
    assert np.count_nonzero(np.array(p) <= 0.05) <= at_most(200, 0.05)


def test_normal_noise_alarms_as_often_as_claimed():
    """The mean of one channel, 2000 pairs at 5 %: Welch is close to exact, 62 to 140.

    The lower bound keeps the test from being one that never alarms.
    """
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((2, 8, 2000))
    alarms = np.count_nonzero(welch(a, b).p <= 0.05)
    assert stats.binom.ppf(1e-4, 2000, 0.05) <= alarms <= at_most(2000, 0.05)


def test_unequal_variances_alarm_as_claimed():
    """A sampler with a tenth of the noise is not wrong: what Student's test would say."""
    rng = np.random.default_rng(4)
    a, b = rng.standard_normal((8, 2000)), 0.1 * rng.standard_normal((8, 2000))
    alarms = np.count_nonzero(welch(a, b).p <= 0.05)
    assert stats.binom.ppf(1e-4, 2000, 0.05) <= alarms <= at_most(2000, 0.05)


def test_binary_pixels_of_few_samples():
    """An outline: 16 samples that are 0 or 1, in 400 pixels, 100 pairs, claimed 1e-3.

    The worst case for a test that wants normal noise. Eight equal values on either side,
    no variance and another mean happen to a pixel at most twice in 1e6 times.
    """
    rng = np.random.default_rng(5)
    cover = np.linspace(0.0, 1.0, 400)
    alarms = 0
    for _ in range(100):
        a, b = rng.binomial(16, cover, (2, 8, 400)) / 16.0
        alarms += family_test(welch(a, b)).p_value <= 1e-3
    assert alarms <= at_most(100, 1e-3)


def biased(where: tuple, size: float) -> np.ndarray:
    truth = scene()
    truth[where] *= 1.0 + size
    return truth


@pytest.mark.parametrize(
    ("test", "where"),
    [
        (pixel_test, (5, 7)),
        (tile_test, (slice(8, 16), slice(16, 24))),
        (mean_test, (slice(None), slice(None))),
    ],
)
def test_power_is_as_stated(test, where):
    """What is said to be seen in 99 of 100 runs is seen in 95 of 100 or more.

    99 or more alarms are expected, as the bias is in three channels; a true power of 0.99
    stays below 95 with probability 5e-4. A fifth of it is seen in less than half.
    """
    rng = np.random.default_rng(6)
    alpha = 1e-3
    seen = detectable_bias(test(pictures(rng), pictures(rng)), alpha)

    def alarms(size: float) -> int:
        truth = biased(where, size)
        tests = [test(pictures(rng, truth=truth), pictures(rng)) for _ in range(100)]
        return sum(found.p_value <= alpha for found in tests)

    assert alarms(seen) >= 95
    assert alarms(seen / 5.0) < 50


def test_without_noise_the_smallest_bias_seen_is_what_rounding_may_do():
    """The mean of a furnace: noise of a millionth, and 1e-4 of the value is forgiven."""
    rng = np.random.default_rng(13)

    def furnace(mean: float) -> np.ndarray:
        return mean + 1e-6 * rng.standard_normal((8, 4, 4, 3))

    found = mean_test(furnace(1.0), furnace(1.0))
    seen = detectable_bias(found, 1e-3)
    assert ROUNDING < seen < 1.2 * ROUNDING
    for _ in range(20):
        assert mean_test(furnace(1.0 + seen), furnace(1.0)).p_value <= 1e-3
    assert mean_test(furnace(1.0 + 0.99 * ROUNDING), furnace(1.0)).p_value > 0.9
    black = np.zeros((8, 4, 4, 3))
    assert detectable_bias(mean_test(black, black), 1e-3) == ROUNDING


def test_noncentrality_is_that_of_the_noncentral_t():
    """SciPy's noncentral t exceeds the critical value with probability 0.99."""
    critical = critical_t(0.01, 3, 12.0)
    assert stats.t.sf(critical, 12.0) == pytest.approx(sidak_limit(0.01, 3) / 2.0)
    bias = noncentrality(critical, 12.0)
    assert stats.nct.sf(critical, 12.0, bias) == pytest.approx(0.99, abs=1e-5)


def test_the_detectable_bias_of_a_mean_by_hand():
    """Noise 0.3 in 8 pictures of n pixels: standard error 0.3 sqrt(2 / (8 n)), relative.

    With 14 degrees of freedom and 1e-3 for three channels, |t| > 4.712 and 7.79 standard
    errors are needed.
    """
    rng = np.random.default_rng(7)
    truth = np.ones(noise_samples.SHAPE)
    a, b = truth + 0.3 * rng.standard_normal((2, 8, *noise_samples.SHAPE))
    found = mean_test(a, b)
    error = 0.3 * np.sqrt(2.0 / (8 * 24 * 32))
    critical = critical_t(1e-3, 3, 14.0)
    assert critical == pytest.approx(4.712, abs=1e-3)
    assert found.relative_error == pytest.approx(error, rel=0.4)
    expected = ROUNDING + noncentrality(critical, found.degrees) * found.relative_error
    assert detectable_bias(found, 1e-3) == pytest.approx(expected, rel=0.1)


def test_what_is_no_set_of_pictures_is_refused():
    with pytest.raises(ValueError, match="two pictures"):
        stack([np.ones((4, 4, 3))])
    with pytest.raises(ValueError, match="one shape"):
        stack([np.ones((4, 4, 3)), np.ones((4, 5, 3))])
