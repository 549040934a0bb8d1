"""Error times time: the formula by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_ref.statistics.equal_error import (
    geometric_mean,
    log_ratio_error,
    relative_mse_of,
    worth,
)


def test_relative_mse_by_hand():
    """Of 2000 values the two largest are left out; the mean of the reference is 2."""
    reference = np.full((20, 25, 4), 2.0)
    picture = reference.copy()
    picture[:10] += 0.5  # half of the values: 0.25 / (4 + 0.04)
    picture[-1, -1, :2] = 1e6
    rest = 0.25 / 4.04 * 1000 / 1998
    assert relative_mse_of(picture, reference) == pytest.approx(rest, rel=1e-12)


def test_twice_the_independent_samples_are_worth_the_same():
    assert worth([0.2, 0.4], [3.0, 1.0, 2.0]) == pytest.approx(1 / 0.6)
    assert worth([0.1, 0.2], [6.0, 2.0, 4.0]) == pytest.approx(1 / 0.6)
    assert worth([0.0], [1.0]) == math.inf
    assert geometric_mean([1.0, 8.0, 27.0]) == pytest.approx(6.0)


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("which", [0, 1])
def test_what_is_no_number_has_no_error(value, which):
    """Not one of zero: a black hole of NaN would be the best of all pictures."""
    both = np.ones((2, 4, 5, 3))
    both[which, 2, 3, 1] = value
    name = ("picture", "reference")[which]
    with pytest.raises(ValueError, match=f"1 of 60 values of the {name}.* x = 3, y = 2"):
        relative_mse_of(*both)


def test_the_error_of_a_ratio_is_that_of_many_ratios():
    """Of 4000 pairs of 16 noisy products each, with a common factor that must cancel.

    A standard deviation of 4000 numbers is known to 1.1 %; 6 % is more than five of these.
    """
    rng = np.random.default_rng(3)
    common = rng.lognormal(0.0, 1.0, (4000, 16))
    first = common * rng.lognormal(0.0, 0.1, (4000, 16))
    second = 2.0 * common * rng.lognormal(0.0, 0.2, (4000, 16))
    claimed = [log_ratio_error(*pair) for pair in zip(first, second, strict=True)]
    ratios = (np.log(second) - np.log(first)).mean(axis=1)
    assert np.sqrt(np.mean(np.square(claimed))) == pytest.approx(ratios.std(), rel=0.06)
    assert log_ratio_error([0.0, 1.0], [1.0, 1.0]) == math.inf
