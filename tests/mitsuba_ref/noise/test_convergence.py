"""RMSE falls with the square root of the number of samples, or the samples are not free."""

from __future__ import annotations

import numpy as np
import pytest
from mitsuba_stand_in import NOISY, stand_in, write_scene
from noise_samples import pictures

from mitsuba_ref.command.cli import main
from mitsuba_ref.ladder.climb import climb
from mitsuba_ref.ladder.rungs_with_noise import exponent
from mitsuba_ref.statistics.convergence import (
    SAMPLES,
    TOLERANCE,
    fit,
    measure_convergence,
)
from reports.look.results import read_results


def test_exponent_of_a_straight_line():
    found = fit([1, 4, 16], [[1.0] * 8, [0.5] * 8, [0.25] * 8])
    assert found.exponent == pytest.approx(-0.5)
    assert found.standard_error == pytest.approx(0.0, abs=1e-12)
    assert found.passed


def test_the_standard_error_is_how_far_exponents_scatter():
    """200 exponents of eight pairs with log-normal errors of 20 %.

    Their standard deviation is known to 5 %; the bootstrap may be off by 15 % on average,
    which it is for medians of eight.
    """
    rng = np.random.default_rng(21)
    counts = np.array(SAMPLES)
    found = [
        fit(SAMPLES, np.exp(0.2 * rng.standard_normal((7, 8))) / np.sqrt(counts)[:, None])
        for _ in range(200)
    ]
    scatter = np.std([one.exponent for one in found])
    mean = np.sqrt(np.mean([one.standard_error**2 for one in found]))
    assert mean == pytest.approx(scatter, rel=0.15)
    assert np.mean([one.p_value <= 0.05 for one in found]) < 0.08
    assert all(one.passed for one in found)


def test_noise_that_scatters_gets_more_pairs():
    """Errors that differ by 25 % from pair to pair: eight pairs would allow 0.1."""

    def render(spp: int, seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)
        loud = np.exp(0.25 * np.random.default_rng(seed // 2).standard_normal())
        return loud * rng.standard_normal((4, 4, 3)) / np.sqrt(spp)

    found = measure_convergence(render)
    assert found.pairs > 8
    assert found.limit == TOLERANCE
    assert found.passed


def test_equal_pictures_are_no_pass():
    """One seed for all pictures: nothing falls, because nothing is random."""
    found = measure_convergence(lambda spp, seed: np.ones((4, 4, 3)))
    assert not found.passed
    rung = exponent(found)
    assert not rung.passed
    assert "they have no noise" in rung.sentence


def averages(shared: float):
    """A renderer of pure noise; the share that all samples of a picture have in common."""

    def render(spp: int, seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal((16, 16, 3)) / np.sqrt(spp)
        return 1.0 + noise + shared * rng.standard_normal((16, 16, 3))

    return render


def test_independent_samples_converge_and_dependent_ones_do_not():
    """A tenth of the noise in common: at 64 samples it is as large as the rest."""
    right = measure_convergence(averages(0.0))
    assert right.passed
    assert right.exponent == pytest.approx(-0.5, abs=0.02)
    wrong = measure_convergence(averages(0.1))
    assert not wrong.passed
    rng = np.random.default_rng(11)
    sides = list(pictures(rng)), list(pictures(rng))
    rungs = climb(*sides, further=[lambda: exponent(wrong), pytest.fail])
    assert [rung.name for rung in rungs if not rung.passed] == ["convergence, ours"]
    top = climb(*sides, further=[lambda: exponent(right, "Mitsuba")])[-1]
    assert top.passed
    assert top.name == "convergence, Mitsuba"
    assert f"{right.exponent:.3f} +- " in top.sentence


def test_too_few_octaves_are_refused():
    with pytest.raises(ValueError, match="6 octaves"):
        measure_convergence(averages(0.0), (1, 2, 4))
    with pytest.raises(ValueError, match="8 pairs"):
        measure_convergence(averages(0.0), pairs=4)


def test_the_harness_measures_both_renderers(tmp_path, monkeypatch, capsys):
    """-0.5 +- 0.05 over six octaves, by the median of eight pairs of seeds each.

    The exponent scatters by 0.006, so that 0.05 is eight standard errors: no false alarm,
    and 0.062 would be seen. The file's sampler is `stratified`, with which both fall faster
    than that: the rung requests `independent` instead.
    """
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))
    scene = tmp_path / "scene.xml"
    scene.write_text(NOISY.replace('"independent"', '"stratified"'))
    report = tmp_path / "report"
    words = ["--checks", "statistics", "--seeds", "8", "--convergence"]
    words += ["-D", "width=16", "-D", "height=12", "-D", "spp=4", "--report", str(report)]
    assert main([str(scene), *words]) == 0
    (result,) = read_results(report / "results.json").scenes
    assert [rung.name for rung in result.rungs][-3:] == [
        "floors", "convergence, ours", "convergence, Mitsuba"
    ]  # fmt: skip
    output = capsys.readouterr().out
    for rung in result.rungs[-2:]:
        assert rung.passed
        assert rung.statistic <= 0.05 <= rung.limit < rung.detectable_bias < 0.09
        assert rung.false_alarm_rate == 1e-3
        assert rung.name in output
        assert rung.sentence in output


def test_a_scene_without_noise_is_not_asked(tmp_path, monkeypatch):
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))
    path = write_scene(tmp_path, deterministic=True)
    report = tmp_path / "report"
    words = ["--checks", "statistics", "--seeds", "8", "--convergence"]
    assert main([str(path), *words, "--report", str(report)], stand_in()) == 0
    (result,) = read_results(report / "results.json").scenes
    assert result.rungs[-1].name == "convergence"
    assert result.rungs[-1].statistic is None
    assert result.rungs[-1].sentence.startswith("Not tested: ")


@pytest.mark.parametrize(
    "words", [["--convergence"], ["--seeds", "8", "--checks", "replay"]], ids=" ".join
)
def test_an_option_without_effect_is_refused(capsys, words):
    assert main(words) == 2
    assert "--seeds" in capsys.readouterr().err
