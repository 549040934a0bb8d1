"""RMSE falls with the square root of the number of samples, or the samples are not free."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from noise_samples import pictures

import renderer
from mitsuba_ref.edited_scene import load_edited_scene
from mitsuba_ref.ladder_of_tests import climb
from mitsuba_ref.statistics.convergence import fit, measure_convergence
from mitsuba_ref.variant import load_mitsuba

SCENE = Path(__file__).parent.parent / "scenes" / "grey-furnace" / "scene.xml"
SIZE = {"width": "32", "height": "32"}


def test_exponent_of_a_straight_line():
    found = fit([1, 4, 16], [1.0, 0.5, 0.25])
    assert found.exponent == pytest.approx(-0.5)
    assert found.standard_error == pytest.approx(0.0, abs=1e-12)


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
    rungs = climb(*sides, convergence=wrong)
    assert [rung.name for rung in rungs if not rung.passed] == ["convergence"]
    assert climb(*sides, convergence=right)[-1].passed


def test_too_few_octaves_are_refused():
    with pytest.raises(ValueError, match="6 octaves"):
        measure_convergence(averages(0.0), (1, 2, 4))
    with pytest.raises(ValueError, match="8 pairs"):
        measure_convergence(averages(0.0), pairs=4)


def by_us():
    scene = renderer.load_file(SCENE, **SIZE)
    return lambda spp, seed: np.asarray(renderer.render(scene, spp=spp, seed=seed))


def by_mitsuba():
    mi = load_mitsuba()
    scene = load_edited_scene(SCENE, SIZE, box_filter=True).scene
    return lambda spp, seed: np.array(mi.render(scene, spp=spp, seed=seed))


@pytest.mark.parametrize("renderer_of", [by_us, by_mitsuba])
def test_both_renderers_have_independent_samples(renderer_of):
    """-0.5 +- 0.05 over six octaves, by the median of eight pairs of seeds each.

    The exponent scatters by 0.008, so that 0.05 is six standard errors: no false alarm,
    and an exponent of -0.47 or -0.53 is still not noise.
    """
    found = measure_convergence(renderer_of())
    assert found.passed, found
    assert found.standard_error < 0.02
