"""Rendering until an error or a time is reached: the claim, the picture, the refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import renderer
from renderer.errors import SceneError
from renderer.process.threads import Crew
from renderer.rendering.accuracy import estimate, relative_error
from renderer.rendering.goal import Goal
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.rendering import Rendering
from renderer.rendering.sitting import Sitting

SCENES = Path(__file__).parents[2] / "scenes"


@pytest.fixture(scope="module")
def box():
    return renderer.load_file(SCENES / "cornell-box" / "scene.xml", width=48, height=48)


@pytest.fixture(scope="module")
def limit(box):
    """The picture without noise, nearly: its own error is a tenth of what is tested."""
    return np.asarray(renderer.render(box, 4096, seed=1000, sampler="independent"))


# ------------------------------------------------------------------------- the formula


def test_the_error_by_hand():
    """A constant factor; a dark half, whose floor is a tenth of the mean; the trimming."""
    flat = np.full((40, 50, 3), 2.0)
    assert relative_error(0.1 * flat, flat) == pytest.approx(0.1 / np.sqrt(1.01))
    half = flat.copy()
    half[:20] = 0.0
    squares = np.repeat([0.01 / 0.01, 0.01 / 4.01], [3000 - 6, 3000])  # 6 are left out
    expected = np.sqrt(squares.mean())
    assert relative_error(np.full_like(flat, 0.1), half) == pytest.approx(expected)
    firefly = np.zeros_like(flat)
    firefly[3, 4, 1] = 1e9
    assert relative_error(firefly, flat) == 0.0
    assert relative_error(flat * 0, flat * 0) == 0.0


@pytest.mark.parametrize("noise", [0.02, 0.2])
def test_two_halves_know_the_error_of_their_mean(noise):
    """Normal noise on a gradient: claim and truth differ by the chance of 5760 values."""
    rng = np.random.default_rng(4)
    truth = np.linspace(0.5, 3.0, 60)[None, :, None] * np.ones((32, 1, 3))
    first, second = (truth * (1 + noise * rng.normal(size=truth.shape)) for _ in range(2))
    found = estimate(first, second, 32)
    actual = relative_error((first + second) / 2 - truth, truth)
    assert found.error == pytest.approx(actual, rel=0.05)
    assert found.error == pytest.approx(noise / np.sqrt(2), rel=0.06)
    assert found.uncertainty < 0.05 and not found.unsure
    assert found.of_pixels.shape == truth.shape


@pytest.mark.parametrize(("rate", "bright"), [(0.05, 1.0), (0.05, 2.0), (0.25, 0.8)])
def test_rare_bright_samples_do_not_hide_their_error(rate, bright):
    """A sun that a half meets `rate` times: the pixel that it made bright is no measure.

    Divided by the picture itself, claims were 0.70, 0.55 and 0.79 of the truth.
    """
    rng = np.random.default_rng(9)
    first, second = (
        1.0 + bright * rng.poisson(rate, (64, 64, 1)) * np.ones(3) for _ in range(2)
    )
    truth = np.full_like(first, 1.0 + rate * bright)
    actual = relative_error((first + second) / 2 - truth, truth)
    found = estimate(first, second, 2)
    assert found.error == pytest.approx(actual, rel=0.12)
    first[20, 30] = np.nan  # its neighbours count as before
    assert estimate(first, second, 2).error == pytest.approx(found.error, rel=0.01)


def test_a_few_pixels_that_decide_make_it_unsure():
    """One spot of 3 % of the picture holds nearly all of the noise."""
    rng = np.random.default_rng(5)
    noise = np.full((64, 64, 3), 1e-3)
    noise[10:22, 40:52] = 3.0
    first, second = (1.0 + noise * rng.normal(size=noise.shape) for _ in range(2))
    assert estimate(first, second, 2).unsure


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_pixels_that_are_no_numbers_are_left_out_and_make_it_unsure(value):
    rng = np.random.default_rng(7)
    first, second = (1.0 + 0.1 * rng.normal(size=(32, 32, 3)) for _ in range(2))
    clean = estimate(first, second, 2)
    first[4, 5, 1] = second[9, 9, 0] = value
    found = estimate(first, second, 2)
    assert found.error == pytest.approx(clean.error, rel=0.01)
    assert found.unsure and not clean.unsure


def test_light_that_hardly_a_sample_has_met_makes_it_unsure():
    """Nothing at all; and all of the noise among the values that are left out."""
    black = np.zeros((32, 32, 3))
    assert estimate(black, black, 2).unsure
    spark = np.ones((64, 64, 3))
    spark[7, 7] = 100.0
    found = estimate(np.ones_like(spark), spark, 2)
    assert found.error == 0.0 and found.unsure
    assert not estimate(np.ones_like(spark), np.ones_like(spark), 2).unsure


def test_a_noisy_picture_is_unsure():
    rng = np.random.default_rng(8)
    first, second = (rng.gamma(1.0, 1.0, (64, 64, 3)) for _ in range(2))
    found = estimate(first, second, 2)
    assert found.steady and found.unsure


def test_stopping_pulls_the_picture_nowhere():
    """Samples of skewness 6, stopped at 10 %: the mean of 400 pictures is the limit.

    False alarms 1e-4; a bias of 0.25 % of the mean is seen in 99 of 100 trials.
    """
    rng = np.random.default_rng(6)
    goal, means, counts = Goal(target_error=0.1), [], set()
    for _ in range(400):
        first, second, done, error = np.zeros((8, 8, 3)), np.zeros((8, 8, 3)), 0, np.inf
        while more := goal.next_samples(done, error, 0.0, 10**6):
            for half in (first, second):  # sums of gammas are gammas
                half += rng.gamma(0.1 * (more // 2), 10.0, half.shape)
            done += more
            error = estimate(first * 2 / done, second * 2 / done, done).error
        means.append(np.mean(first + second) / done)
        counts.add(done)
    assert len(counts) > 10  # it stopped at many places
    z = (np.mean(means) - 1.0) / (np.std(means, ddof=1) / np.sqrt(len(means)))
    assert abs(z) < 3.9


# ------------------------------------------------------------------------- the picture


def test_the_claim_is_the_truth(box, limit):
    """Eight seeds, fixed: the true error is within a fifth of the claim in all of them."""
    for seed in range(8):
        image = renderer.render(box, seed=seed, target_error=0.15)
        actual = relative_error(image.pixels - limit, limit)
        assert image.error <= 0.15
        assert image.error == pytest.approx(actual, rel=0.2)
        assert image.complete and not image.error_unsure
        assert image.error_of_pixels.shape == image.pixels.shape


def test_it_is_the_picture_of_so_many_samples(box):
    image = renderer.render(box, target_error=0.2, threads=1)
    again = renderer.render(box, image.spp, sampler="independent")
    np.testing.assert_array_equal(image.pixels, again.pixels)
    assert 16 <= image.spp < 200
    assert again.error is None and "error" not in again.metadata
    assert image.metadata["sampler"] == "independent"
    assert float(image.metadata["error"]) == pytest.approx(image.error, rel=1e-3)


def test_the_number_of_samples_is_the_most(box):
    image = renderer.render(box, 21, target_error=0.01)
    assert image.spp == 20  # two halves
    assert image.error > 0.01


def test_a_time_limit_ends_it_too(box):
    """Whenever that is: nothing is timed here."""
    image = renderer.render(box, time_limit=0.2)
    assert image.spp >= 2 and image.spp % 2 == 0
    again = renderer.render(box, image.spp, sampler="independent")
    np.testing.assert_array_equal(image.pixels, again.pixels)


def test_an_interrupt_keeps_the_picture_and_the_last_error(box):
    shown = []

    def progress(now):
        if now.stage == "render":
            shown.append(now)
            if now.error is not None and now.error < np.inf:
                raise KeyboardInterrupt

    image = renderer.render(box, target_error=1e-5, progress=progress)
    assert not image.complete
    assert image.error is not None and image.spp >= 16
    assert shown[0].error == np.inf and shown[0].done == 0
    assert shown[-1].done <= shown[-1].total


def test_a_second_interrupt_is_raised(box, monkeypatch):
    """While threads still end their jobs: nobody must see sums that they write to."""
    rendering = Rendering(box, make_plan(box, spp=64), accel="auto", seed=0, threads=2)
    stop = Crew.stop

    def interrupted_stop(crew):
        stop(crew)
        raise KeyboardInterrupt

    monkeypatch.setattr(Crew, "stop", interrupted_stop)
    wait, looks = Crew.wait, iter([False])  # a look at them, however fast they are
    monkeypatch.setattr(Crew, "wait", lambda crew: next(looks, None) is None and wait(crew))

    def progress(now):
        if now.seconds > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Sitting(rendering, progress, None, None)._trace(64)
    with pytest.raises(KeyboardInterrupt):
        Sitting(rendering).run()


def test_a_scene_without_light_has_no_error_and_ends():
    scene = renderer.load_string(
        '<scene version="3.0.0"><shape type="sphere"/><sensor type="perspective"/></scene>'
    )
    image = renderer.render(scene, target_error=0.1)
    assert image.complete and image.error is None and image.spp == 1
    assert not image.pixels.any()


def test_the_explanation_knows_the_goal(box):
    image = renderer.render(box, target_error=0.2)
    line = f"{image.spp} samples per pixel were taken: estimated error"
    assert line in image.explain.splitlines()[-1]


def test_looks_at_the_error_come_less_and_less_often():
    """From 1 % of the samples that are needed on: few looks, none far beyond the goal."""
    goal, done, looks = Goal(target_error=0.01), 0, 0
    while more := goal.next_samples(done, 0.5 / np.sqrt(max(done, 1)), 0.0, 10**9):
        done, looks = done + more, looks + 1
    assert looks < 12
    assert 2500 <= done <= 2800
    assert Goal(time_limit=10.0).next_samples(100, 1.0, 9.99, 10**9) == 0
    assert Goal(time_limit=10.0).next_samples(100, 1.0, 5.0, 10**9) == 100
    assert Goal(target_error=0.1).next_samples(10, 0.2, 0.0, 11) == 0


# ------------------------------------------------------------------------ the refusals


@pytest.mark.parametrize(
    ("wanted", "error", "message"),
    [
        ({"target_error": 0}, SceneError, "target_error is 0; positive numbers"),
        ({"target_error": float("nan")}, SceneError, "positive numbers"),
        ({"time_limit": -1.0}, SceneError, "time_limit is -1.0"),
        ({"time_limit": "10"}, TypeError, "positive numbers are possible"),
        (
            {"target_error": 0.1, "sampler": "multijitter"},
            SceneError,
            "'multijitter' depend",
        ),
        ({"target_error": 0.1, "sampler": "mitsuba"}, SceneError, "depend on how many"),
        ({"target_error": 0.1, "integrator": "aov"}, SceneError, "other channels"),
        ({"target_error": 0.1, "spp": 1}, SceneError, "spp is 1; a goal needs 2 samples"),
        ({"target_error": 0.1, "integrator": "work"}, SceneError, "of colours alone"),
    ],
)
def test_what_cannot_have_a_goal(box, wanted, error, message):
    with pytest.raises(error, match=message):
        renderer.render(box, **wanted)
