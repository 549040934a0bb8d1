"""How often the ladder alarms when nothing is wrong: what is counted, with which seeds."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from mitsuba_stand_in import NOISY

from mitsuba_ref.false_alarms.alarm_counts import WHOLE, exceeds
from mitsuba_ref.false_alarms.measure import (
    EITHER,
    convergence_rung,
    measure,
    measure_convergence_alarms,
)
from mitsuba_ref.ladder.pictures_by_seed import reference_seed
from mitsuba_ref.records.request import FEWEST_SEEDS
from mitsuba_ref.statistics.convergence import MOST_PICTURES
from renderer.replay.pixel_seeds import pixel_seeds


def test_an_unchanged_scene_is_measured_with_itself(tmp_path):
    """Two trials: seven rungs, and the convergence of each side.

    The file's sampler is `stratified`, with which the noise falls faster than it must for
    that rung: at 12 pixels a side the exponent scatters by 0.01, and -0.6 and less would
    be found.
    """
    folder = tmp_path / "ball"
    folder.mkdir()
    scene = folder / "scene.xml"
    scene.write_text(NOISY.replace('"independent"', '"stratified"'))
    theirs, ours = measure(scene, 2, 12, 4, FEWEST_SEEDS)
    noise = measure_convergence_alarms(scene, 2, 12)
    assert theirs.comparison == "Mitsuba against Mitsuba"
    assert ours.comparison == "ours against Mitsuba"
    claims = ((theirs, WHOLE, 7e-3), (ours, WHOLE, 7e-3), (noise, EITHER, 2e-3))
    for comparison, name, claimed in claims:
        whole = comparison.rungs[-1]
        assert whole.name == name
        assert whole.alarms.trials == 2
        assert whole.claimed == pytest.approx(claimed)
        assert not exceeds(comparison)
    sides = noise.rungs[:2]
    assert [rung.name for rung in sides] == ["convergence, ours", "convergence, Mitsuba"]
    for rung in sides:
        assert rung.alarms.count == 0
        assert 0.0 < rung.detectable_bias < 0.1


def test_trials_of_convergence_have_seeds_of_their_own():
    """Errors that differ by 60 % from pair to pair take all pictures that one may take."""
    seeds: dict[tuple[str, int], list[int]] = {}

    def render(side: str, trial: int):
        def picture(spp: int, seed: int) -> np.ndarray:
            found = seeds.setdefault((side, trial), [])
            found.append(seed)
            loud = np.exp(0.6 * np.random.default_rng(len(found) // 2).standard_normal())
            noise = np.random.default_rng(seed).standard_normal((4, 4, 3))
            return loud * noise / np.sqrt(spp)

        return picture

    for side, trial in itertools.product(("ours", "Mitsuba"), range(3)):
        rung = convergence_rung(side, render(side, trial), trial)
        assert rung.name == f"convergence, {side}"
    assert {len(found) for found in seeds.values()} == {MOST_PICTURES}
    assert len({*itertools.chain(*seeds.values())}) == 6 * MOST_PICTURES


@pytest.mark.parametrize(
    "size",
    [(12, 12), (32, 32), (48, 48), (60, 40), (33, 33), (144, 96), (256, 3), (1280, 720)],
)
def test_pictures_of_mitsuba_have_no_random_number_in_common(size):
    """Seeds that follow each other would: 22 % of the pixels at 48 x 48."""
    count = 3 if size[0] > 1000 else 8
    streams = [pixel_seeds(*size, reference_seed(index)) for index in range(count)]
    assert np.unique(streams).size == count * size[0] * size[1]
    if size == (48, 48):
        neighbours = pixel_seeds(48, 48, 1), pixel_seeds(48, 48, 2)
        assert np.isin(*neighbours).mean() == pytest.approx(0.22, abs=0.01)
