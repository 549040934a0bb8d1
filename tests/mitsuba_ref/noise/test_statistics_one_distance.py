"""The limit of a distance that knows its noise: silent for equal pictures, not deaf."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from mitsuba_ref.metrics.distances import TILE, rmse, trimmed_rmse
from mitsuba_ref.statistics.one_distance import EXCESS_LIMIT, beside_floor, most_by_noise

SHAPE = (36, 48, 3)


def gaussian(rng: np.random.Generator) -> np.ndarray:
    return 1.0 + 0.3 * rng.standard_normal(SHAPE)


def heavy(rng: np.random.Generator) -> np.ndarray:
    """Infinite variance: what a caustic looks like to an average."""
    return rng.pareto(1.8, SHAPE)


def fireflies(rng: np.random.Generator) -> np.ndarray:
    """Three pixels or so, a hundred times as bright as the rest."""
    return gaussian(rng) + 100.0 * (rng.random((36, 48, 1)) < 2e-3)


def pictures_of(noise, rng: np.random.Generator, references: int = 4) -> list[np.ndarray]:
    return [noise(rng) for _ in range(1 + references)]


def standard_errors(pictures, *, trimmed=False, tile=1) -> float:
    """Return by how many the squared distance exceeds its floor."""
    value, floor = beside_floor(
        pictures[0], pictures[1:], trimmed_rmse if trimmed else rmse
    )
    most = most_by_noise(pictures[0], pictures[1:], floor, trimmed=trimmed, tile=tile)
    return EXCESS_LIMIT * (value**2 - floor**2) / (most**2 - floor**2)


@pytest.mark.parametrize("references", [4, 2])
@pytest.mark.parametrize("trimmed", [False, True])
@pytest.mark.parametrize("noise", [gaussian, heavy, fireflies])
def test_no_false_alarm_in_two_hundred_equal_pictures(noise, trimmed, references):
    """With 3e-6 to 1e-3 a picture, as claimed, seldom one; 5e-4 of them 1 in 10 here."""
    rng = np.random.default_rng(1)
    errors = [
        standard_errors(pictures_of(noise, rng, references), trimmed=trimmed)
        for _ in range(200)
    ]
    assert max(errors) < EXCESS_LIMIT


@pytest.mark.parametrize("noise", [gaussian, heavy])
def test_a_standard_error_is_one(noise):
    """A root mean square over 400 pictures has itself an error of 0.035 or so."""
    rng = np.random.default_rng(2)
    errors = [standard_errors(pictures_of(noise, rng)) for _ in range(400)]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=0.12)


def test_a_fixed_factor_of_the_floor_alarms_where_there_are_fireflies():
    """Which is why the limit has to know: one time in ten it is beyond 1.25 of them."""
    rng = np.random.default_rng(3)
    pairs = [(p[0], p[1:]) for p in (pictures_of(fireflies, rng) for _ in range(200))]
    beyond = [np.divide(*beside_floor(ours, rest, rmse)) > 1.25 for ours, rest in pairs]
    assert np.mean(beyond) > 0.05


def test_pixels_that_share_samples_count_as_tiles():
    """A filter ties neighbours together: taken for independent they promise too much."""

    def filtered(rng: np.random.Generator) -> np.ndarray:
        return gaussian_filter(gaussian(rng), 1.5, axes=(0, 1))

    rng = np.random.default_rng(4)
    pictures = [pictures_of(filtered, rng, 2) for _ in range(200)]
    alone = [standard_errors(p) for p in pictures]
    together = [standard_errors(p, tile=TILE) for p in pictures]
    assert np.std(alone) > 2.0
    assert np.std(together) < 1.5
    assert max(together) < EXCESS_LIMIT


@pytest.mark.parametrize("trimmed", [False, True])
def test_a_tenth_more_noise_in_ours_is_seen(trimmed):
    """Which 1.25 times the floor does not see: the distance is 1.05 times it."""
    rng = np.random.default_rng(5)
    ours, *references = pictures_of(gaussian, rng)
    ours = 1.0 + 1.1 * (ours - 1.0)
    assert standard_errors([ours, *references], trimmed=trimmed) > EXCESS_LIMIT


def test_a_handful_of_fireflies_in_ours_alone_is_seen():
    """Eight of one size in ours, none in four references."""
    rng = np.random.default_rng(6)
    ours, *references = pictures_of(gaussian, rng)
    ours[::9, ::24] += 100.0
    assert standard_errors([ours, *references]) > EXCESS_LIMIT
    ours[::9, ::24] -= 100.0
    assert standard_errors([ours, *references]) < EXCESS_LIMIT


def test_pictures_without_noise_leave_no_room():
    """Nothing differs among the references, and any difference of ours is a bias."""
    references = [np.full(SHAPE, 3.0)] * 4
    assert most_by_noise(references[0], references, 0.0) == 0.0
    assert most_by_noise(references[0] + 1e-3, references, 0.0) < 0.5e-3
