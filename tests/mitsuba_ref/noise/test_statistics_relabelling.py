"""Tests by relabelling: exact for any noise, and they see what no single pixel shows."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from noise_samples import fireflies, gaussian, pictures, scene, skewed
from scipy import stats

from mitsuba_ref.ladder import rungs_with_noise
from mitsuba_ref.statistics import power
from mitsuba_ref.statistics.floors import floor_test, floor_tests
from mitsuba_ref.statistics.hypothesis_tests.relabelling import deals, limit_of, rank_p
from mitsuba_ref.statistics.hypothesis_tests.uniformity import (
    BINS,
    informative,
    uniformity_test,
    unlike_noise,
)
from mitsuba_ref.statistics.noise_free_mse import (
    noise_free_mse,
    relative_to_brightness,
    squared_difference,
)

ALPHA = 1e-3


def checkerboard(size: float) -> np.ndarray:
    """The scene with a relative bias of alternating sign: no tile and no mean shows it."""
    signs = np.indices(scene().shape[:2]).sum(axis=0) % 2 * 2 - 1
    return scene() * (1.0 + size * signs[..., None])


def test_eight_and_eight_can_be_dealt_in_6435_ways():
    """C(16, 8) / 2: a deal and its opposite are one."""
    dealt = deals(8, 8, 9999)
    assert dealt.shape == (6435, 16)
    assert dealt[0].tolist() == [True] * 8 + [False] * 8
    assert (dealt.sum(axis=1) == 8).all()
    assert (
        len({row.tobytes() for row in dealt} | {(~row).tobytes() for row in dealt}) == 12870
    )


def test_random_deals_begin_with_the_true_one_and_repeat():
    dealt = deals(8, 9, 500)
    assert dealt.shape == (500, 17)
    assert dealt[0].tolist() == [True] * 8 + [False] * 9
    assert (dealt.sum(axis=1) == 8).all()
    np.testing.assert_array_equal(dealt, deals(8, 9, 500))


def test_rank_and_limit_by_hand():
    """The true statistic 9 is second of five: p = 2/5, and 9 is the limit for 40 %."""
    statistics = np.array([9.0, 1.0, 10.0, 2.0, 3.0])
    assert rank_p(statistics) == 0.4
    assert limit_of(statistics, 0.4) == 9.0
    assert limit_of(statistics, 0.39) == 10.0
    assert limit_of(statistics, 0.1) == np.inf
    assert rank_p(np.ones(5)) == 1.0


def p_of_noise_free_mse(a: np.ndarray, b: np.ndarray) -> float:
    return noise_free_mse(*relative_to_brightness(a, b), 0.05, most_deals=500).p_value


def p_of_uniformity(a: np.ndarray, b: np.ndarray) -> float:
    return uniformity_test(a, b, 0.05, most_deals=200).p_value


def p_of_rmse(a: np.ndarray, b: np.ndarray) -> float:
    flat = np.concatenate([a, b]).reshape(16, -1)
    table = np.sqrt(np.mean((flat[:, None] - flat[None]) ** 2, axis=-1))
    return floor_test("rmse", table, deals(8, 8, 500), 0.05).p_value


@pytest.mark.parametrize("p_of", [p_of_noise_free_mse, p_of_uniformity, p_of_rmse])
@pytest.mark.parametrize("noise", [gaussian, fireflies])
def test_p_values_are_exact_for_any_noise(p_of, noise):
    """100 equal pairs: at most 15 alarms at a claimed 5 %, and half of p below a half.

    The bounds hold with probability 1 - 1e-4 each. Fireflies have no variance at all.
    """
    rng = np.random.default_rng(11)
    small = slice(None), slice(0, 12), slice(0, 16)
    p = [p_of(pictures(rng, noise)[small], pictures(rng, noise)[small]) for _ in range(100)]
    assert np.count_nonzero(np.array(p) <= 0.05) <= stats.binom.isf(1e-4, 100, 0.05)
    half = np.count_nonzero(np.array(p) <= 0.5)
    assert abs(half - 50) <= 50 - stats.binom.ppf(5e-5, 100, 0.5)


def test_textbook_uniformity_alarms_for_skewed_noise_where_ours_does_not():
    """Why the distance is measured from relabelled pictures: nothing is wrong here."""
    rng = np.random.default_rng(12)
    result = uniformity_test(pictures(rng, fireflies), pictures(rng, fireflies), ALPHA)
    assert result.textbook_p < 1e-4
    assert result.p_value > ALPHA


def test_textbook_uniformity_is_scipys_for_normal_noise():
    """Welch's p-values and their Kolmogorov-Smirnov test, by SciPy.

    The function is known at steps of 1 / BINS, which is all that may lie between.
    """
    rng = np.random.default_rng(13)
    a, b = pictures(rng), pictures(rng)
    p = stats.ttest_ind(a.mean(axis=-1), b.mean(axis=-1), axis=0, equal_var=False)
    p = p.pvalue.ravel()
    result = uniformity_test(a, b, ALPHA)
    share = np.searchsorted(np.sort(p), np.arange(BINS + 1) / BINS, side="right") / p.size
    np.testing.assert_allclose(result.cumulative, share, atol=0.01)
    expected = stats.kstest(p, "uniform")
    assert (
        abs(np.max(np.abs(share - np.arange(BINS + 1) / BINS)) - expected.statistic) < 0.01
    )
    assert result.textbook_p == pytest.approx(expected.pvalue, abs=0.2)
    np.testing.assert_allclose(result.expected, np.arange(BINS + 1) / BINS, atol=0.01)


def test_the_textbook_alone_sees_pictures_that_agree_too_well():
    """Both renderers with the same random numbers: hardly any small p-values.

    Of 6435 deals 128 keep the two of each pair apart, and they agree as well: a rank
    cannot fall below 2 % by much.
    """
    rng = np.random.default_rng(14)
    a = pictures(rng)
    b = a + 0.1 * (pictures(rng) - scene())
    result = uniformity_test(a, b, ALPHA)
    assert result.textbook_p < 1e-9
    assert result.p_value > ALPHA
    assert result.distance > 0.5


def test_black_and_coarse_pixels_are_left_out():
    """Constant, black, and an outline with two values: no p-value worth its name."""
    rng = np.random.default_rng(15)
    values = rng.random((16, 2, 3))
    values[:, 0, 0], values[:, 0, 1] = 0.0, 1.0
    values[:, 1, 2] = rng.integers(0, 2, 16)
    assert informative(values).shape == (16, 3)
    few = uniformity_test(values[:8, ..., None], values[8:, ..., None], ALPHA)
    assert (few.p_value, few.limit, few.pixels) == (1.0, np.inf, 3)


def test_noise_free_mse_is_the_mean_over_independent_halves():
    """The formula against its definition, E[(A1 - B1)(A2 - B2)] over all pairs of pairs."""
    rng = np.random.default_rng(16)
    a, b = rng.random((4, 3, 2, 1)), rng.random((3, 3, 2, 1))
    products = [
        (a[i] - b[k]) * (a[j] - b[m])
        for i, j in itertools.permutations(range(4), 2)
        for k, m in itertools.permutations(range(3), 2)
    ]
    np.testing.assert_allclose(squared_difference(a, b), np.mean(products, axis=0))
    expected = np.mean(products)
    assert noise_free_mse(a, b, ALPHA).value == pytest.approx(expected)


@pytest.mark.parametrize("noise", [gaussian, skewed])
def test_noise_free_mse_has_no_bias_and_its_interval_holds(noise):
    """A checkerboard of 5 %: MSE 0.0025 of the mean square, under six times that of noise.

    100 pairs: the mean within 4.5 standard errors (1e-5), and the 99 % interval holds the
    truth in at least 93 of them (a coverage of 0.99 does so but for 1e-5).
    """
    rng = np.random.default_rng(17)
    truth = checkerboard(0.05)
    expected = float(np.mean((truth - scene()) ** 2))
    results = [
        noise_free_mse(
            pictures(rng, noise, truth=truth), pictures(rng, noise), ALPHA, most_deals=2
        )
        for _ in range(100)
    ]
    values = np.array([result.value for result in results])
    assert abs(values.mean() - expected) < 4.5 * values.std(ddof=1) / 10.0
    assert sum(result.low <= expected <= result.high for result in results) >= 93


@pytest.mark.parametrize(
    ("name", "noise"), [("uniformity", skewed), ("noise_free", gaussian)]
)
def test_power_against_a_checkerboard_is_as_stated(name, noise):
    """Said to be seen in 99 of 100 runs: in 20 runs at least 16 alarms.

    A true power of 0.95, which allows for the median noise standing for all pixels, stays
    below 16 with probability 3e-3; the seed is fixed. A third of it: less than half.
    """

    rng = np.random.default_rng(18)
    rung = getattr(rungs_with_noise, name)
    first = rung(pictures(rng, noise), pictures(rng, noise), ALPHA)
    assert first.passed

    def alarms(size: float, runs: int) -> int:
        truth = checkerboard(size)
        return sum(
            not rung(pictures(rng, noise, truth=truth), pictures(rng, noise), ALPHA).passed
            for _ in range(runs)
        )

    assert alarms(first.detectable_bias, 20) >= 16
    assert alarms(first.detectable_bias / 3.0, 6) < 3


def test_floors_by_hand():
    """Two and two pictures: 4 across, 1 among ours, 2 among theirs: an excess of 2.

    The other two deals have 11/4 across and 4 within on either side: -5/4.
    """
    table = np.array([[0, 1, 4, 4], [1, 0, 4, 4], [4, 4, 0, 2], [4, 4, 2, 0]], float)
    found = floor_test("any", table, deals(2, 2, 99), 0.5)
    assert (found.across, found.ours, found.theirs, found.excess) == (4.0, 1.0, 2.0, 2.0)
    assert found.p_value == pytest.approx(1.0 / 3.0)
    assert found.spread == pytest.approx(np.std([2.0, -1.25, -1.25]))


@pytest.mark.parametrize("ratio", [0.3, 3.0])
def test_other_noise_alone_is_no_bias(ratio):
    """Ours has a third or three times the noise of theirs, and right expectations.

    A distance across lies between the two floors. Uniformity is not judged: relabelled
    pictures would be no guide. 1e-3 each.
    """
    rng = np.random.default_rng(19)
    for _ in range(3):
        ours = scene() + ratio * (pictures(rng, skewed) - scene())
        theirs = pictures(rng, skewed)
        found = {floor.name: floor for floor in floor_tests(ours, theirs, ALPHA)}
        assert set(found) == {"rmse", "one minus ssim", "flip"}
        for floor in found.values():
            low, high = sorted((floor.ours, floor.theirs))
            assert low < floor.across < high
            assert floor.p_value > 0.1
        assert p_of_noise_free_mse(ours, theirs) > ALPHA
        result = uniformity_test(ours, theirs, ALPHA)
        assert (result.p_value, result.limit) == (1.0, np.inf)


def test_noise_that_differs_by_chance_is_judged():
    """Equal skewed noise stays about 0, the limit is 0.1, and a ratio of 4 far above."""
    rng = np.random.default_rng(21)
    pairs = [pictures(rng, skewed, count=16) for _ in range(9)]
    grey = [informative(pair.mean(axis=-1)) for pair in pairs]
    assert np.median([abs(unlike_noise(values, 8)) for values in grey]) < 0.07
    twice = pairs[0] - scene()
    twice[8:] *= 2.0
    assert unlike_noise(informative((twice + scene()).mean(axis=-1)), 8) > 0.2


def test_what_rmse_beside_its_floor_would_see():
    """A bias b turns a floor f into sqrt(f^2 + b^2)."""
    rng = np.random.default_rng(20)
    floor = floor_tests(pictures(rng), pictures(rng), ALPHA)[0]
    mean_square = float(np.mean(scene() ** 2))
    seen = power.detectable_above_floor(floor, mean_square) * np.sqrt(mean_square)
    base = max(floor.ours, floor.theirs)
    excess = np.sqrt(base**2 + seen**2) - base
    assert excess == pytest.approx(floor.limit + power.Z * floor.spread)
