"""The chi-square test is silent for a right sampler and finds the defect that it states."""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import (
    FALSE_ALARM,
    POWER,
    assert_follows,
    binomial_found,
    binomial_p_value,
    cell_masses,
    chi_square,
    histogram,
    noncentrality_found,
    sidak,
)
from scipy import stats

SAMPLES = 50_000
EDGES = np.linspace(0, 1, 9)
REPEATS = 400


def uneven(a, b):
    """A density on the unit square with a range of 1 to 11."""
    return (a + 0.1) * (b**3 + 1) / (0.6 * 1.25)


def draws(masses, rng):
    """Counts of `SAMPLES` points in cells of the given masses, `REPEATS` times."""
    counts = rng.multinomial(SAMPLES, masses.ravel() / masses.sum(), REPEATS)
    return counts.reshape(REPEATS, *masses.shape)


def alarms(histograms, masses):
    return sum(chi_square(c, masses, SAMPLES).p_value < FALSE_ALARM for c in histograms)


def test_integrals_over_cells():
    """A polynomial exactly; a narrow peak to 1e-6 by more points in each cell."""
    masses = cell_masses(uneven, EDGES, EDGES)
    assert masses.sum() == pytest.approx(1, abs=1e-12)
    lower = np.diff((EDGES + 0.1) ** 2) / 2 / 0.6
    np.testing.assert_allclose(masses.sum(axis=1), lower, rtol=1e-12)

    def peak(a, b):
        return 0.02 / np.pi / ((a - 0.4) ** 2 + 0.02**2) + 0 * b

    masses = cell_masses(peak, EDGES, EDGES)
    expected = np.diff(np.arctan((EDGES - 0.4) / 0.02)) / np.pi
    np.testing.assert_allclose(masses.sum(axis=1), expected, atol=1e-6)


def test_a_density_with_a_jump_inside_a_cell_is_refused():
    with pytest.raises(ValueError, match="smooth"):
        cell_masses(lambda a, b: (a < 0.3) + 0 * b, EDGES, EDGES)


def test_histogram():
    """The cell of each sample, borders included; what is outside or NaN in none."""
    a = np.array([0, 0.5, 1, 1.01, -0.01, np.nan, 0.2])
    b = np.array([0, 0.5, 1, 0.5, 0.5, 0.5, 0.9])
    counts = histogram(a, b, np.array([0, 0.5, 1]), np.array([0, 0.25, 0.75, 1]))
    np.testing.assert_array_equal(counts, [[1, 0, 1], [0, 1, 1]])


def test_cells_of_small_counts_are_pooled():
    """Each pool has 5 or more, what is empty joins others, nothing gets lost."""
    masses = np.array([[0, 0.0001, 0.0002, 0.0003], [0.3, 0.0394, 0.3, 0.3]])
    outcome = chi_square(np.zeros((2, 4)), masses, 5000)
    expected = np.bincount(outcome.pool, outcome.masses * 5000)
    assert (expected >= 5).all() and expected.sum() == pytest.approx(5000)
    assert outcome.freedom == 4  # 0.04 of five cells, 0.06 outside the grid, 0.3 thrice
    masses = np.full(10, 0.1)
    assert chi_square(np.zeros(10), masses, 49).freedom == 4
    assert chi_square(np.zeros(10), masses, 51).freedom == 9


def test_samples_beside_the_grid_are_counted():
    """Half of the samples may miss; a tenth more is found."""
    masses = np.full((4, 4), 1 / 32)
    counts = np.full((4, 4), 1000)
    assert chi_square(counts, masses, 32_000).p_value == 1
    assert chi_square(counts, masses, 35_200).p_value < FALSE_ALARM


def test_samples_where_the_density_is_zero_are_found():
    """A single one: pooled with a neighbour it would be lost."""
    masses = np.array([[0.5, 0.5, 0.0]])
    right = np.array([[10_000, 10_000, 0]])
    assert_follows(right, masses, 20_000, finds=0.1)
    wrong = np.array([[10_000, 9999, 1]])
    with pytest.raises(AssertionError, match="1 where the density is zero"):
        assert_follows(wrong, masses, 20_000, finds=0.1)
    with pytest.raises(AssertionError, match="1 where the density is zero"):
        assert_follows(right, masses, 20_001, finds=0.1)
    assert_follows(wrong, masses, 20_000, finds=0.1, stray=1)


def test_p_values_of_a_right_sampler_are_uniform():
    """400 histograms: Kolmogorov and Smirnov see no difference at 1e-3."""
    masses = cell_masses(uneven, EDGES, EDGES)
    rng = np.random.default_rng(1)
    p = [chi_square(c, masses, SAMPLES).p_value for c in draws(masses, rng)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    assert min(p) > sidak(1e-3, REPEATS)


@pytest.mark.parametrize("axis", [0, 1])
def test_the_stated_tilt_is_found(axis):
    """99 % of 400 samplers with the stated defect are found, a third of it hardly ever.

    Found too seldom by chance in 1 of 10^4 such tests (binomial).
    """
    masses = cell_masses(uneven, EDGES, EDGES)
    rng = np.random.default_rng(2 + axis)
    tilt = chi_square(draws(masses, rng)[0], masses, SAMPLES).tilt(axis)
    assert 0.01 < tilt < 0.15
    below = masses.sum(axis=1 - axis).cumsum() - masses.sum(axis=1 - axis) / 2
    slope = np.expand_dims(2 * below - 1, 1 - axis)
    wrong = masses * (1 + tilt * slope)
    assert wrong.sum() == pytest.approx(1)
    assert alarms(draws(wrong, rng), masses) >= stats.binom.ppf(1e-4, REPEATS, POWER)
    weak = masses * (1 + tilt / 3 * slope)
    assert alarms(draws(weak, rng), masses) < 0.05 * REPEATS


def test_the_stated_excess_of_one_cell_is_found():
    masses = np.full((8, 8), 1 / 64)
    rng = np.random.default_rng(4)
    excess = chi_square(draws(masses, rng)[0], masses, SAMPLES).excess()
    wrong = masses - excess / 64 / 63
    wrong[2, 3] = (1 + excess) / 64
    assert alarms(draws(wrong, rng), masses) >= stats.binom.ppf(1e-4, REPEATS, POWER)


def test_noncentrality_is_that_of_the_tables():
    """Degree 1, 5 % and 90 %: (1.95996 + 1.28155)^2 = 10.5074, up to the other tail."""
    assert noncentrality_found(1, 0.05, 0.9) == pytest.approx(10.5074, rel=1e-4)


@pytest.mark.parametrize("probability", [0.04, 0.5, 0.999])
def test_the_stated_shift_of_a_probability_is_found(probability):
    """On the side where it is harder to see, 99 % of 400."""
    rng = np.random.default_rng(6)
    shift = binomial_found(probability, SAMPLES, 1e-3)
    for wrong in (probability + shift, probability - shift):
        counts = rng.binomial(SAMPLES, min(wrong, 1.0), REPEATS)
        found = np.sum(binomial_p_value(counts, SAMPLES, probability) < 1e-3)
        assert found >= stats.binom.ppf(1e-4, REPEATS, POWER)
    right = rng.binomial(SAMPLES, probability, REPEATS)
    assert binomial_p_value(right, SAMPLES, probability).min() > sidak(1e-3, REPEATS)


def test_sidak():
    assert sidak(0.05, 1) == pytest.approx(0.05)
    assert 1 - (1 - sidak(0.01, 300)) ** 300 == pytest.approx(0.01)


def test_what_the_assertion_refuses():
    """A wrong sampler, a wrong integral, and a test that is not as sharp as it says."""
    masses = np.full((8, 8), 1 / 64)
    right = np.full((8, 8), 10_000)
    assert_follows(right, masses, 640_000, finds=0.03)
    wrong = right.copy()
    wrong[:4], wrong[4:] = 10_200, 9800
    with pytest.raises(AssertionError, match="chi-square"):
        assert_follows(wrong, masses, 640_000, finds=0.03)
    with pytest.raises(AssertionError, match="integrates to"):
        assert_follows(right, masses * 1.001, 640_000, finds=0.03)
    with pytest.raises(AssertionError, match="finds no less"):
        assert_follows(right // 100, masses, 6400, finds=0.02)
