"""The ladder: what is right reaches the top, each defect breaks the rung that names it."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from mitsuba_stand_in import stand_in, write_scene
from noise_samples import SHAPE, fireflies, gaussian, pictures, scene, skewed

from mitsuba_ref.command.cli import main
from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.false_alarms.alarm_counts import WHOLE, FalseAlarms, count_alarms, exceeds
from mitsuba_ref.false_alarms.binomial import rate
from mitsuba_ref.ladder.climb import FALSE_ALARMS, climb
from mitsuba_ref.ladder.evidence import Evidence
from mitsuba_ref.ladder.evidence_maps import evidence
from mitsuba_ref.records.json_files import to_json
from mitsuba_ref.records.options import Options
from mitsuba_ref.records.results import Results, SceneResult
from mitsuba_ref.reference.cache import ReferenceCache, write_entry
from mitsuba_ref.reference.render import render_reference

NOISY = [
    "finite",
    "registration",
    "pixels",
    "tiles",
    "mean",
    "uniformity",
    "noise-free mse",
    "floors",
]


def broken(rungs) -> list[str]:
    return [rung.name for rung in rungs if not rung.passed]


def climbed(ours, theirs, **arguments):
    return climb(list(ours), list(theirs), **arguments)


@pytest.mark.parametrize("noise", [gaussian, skewed, fireflies])
def test_equal_renderers_reach_the_top(noise):
    """Seven rungs at 1e-3 each; what they would have seen is a number, or is unknown."""
    rng = np.random.default_rng(1)
    rungs = climbed(pictures(rng, noise), pictures(rng, noise))
    assert [rung.name for rung in rungs] == NOISY
    assert broken(rungs) == []
    assert sum(rung.false_alarm_rate or 0.0 for rung in rungs) == pytest.approx(7e-3)
    for rung in rungs[1:]:
        assert rung.p_value > FALSE_ALARMS
        assert rung.detectable_bias > 0.0
        assert rung.sentence.endswith(".")


def one_wrong_pixel(truth):
    truth[5, 7] *= 3.5


def one_wrong_tile(truth):
    truth[8:16, 16:24] *= 1.25


def a_little_brighter(truth):
    truth *= 1.07


def checkerboard(truth):
    truth *= 1.0 + 0.1 * (np.indices(SHAPE[:2]).sum(axis=0) % 2 * 2 - 1)[..., None]


def half_a_pixel(truth):
    truth[:] = (truth + np.roll(truth, 1, axis=1)) / 2.0


@pytest.mark.parametrize(
    ("defect", "first", "also"),
    [
        (one_wrong_pixel, "pixels", set()),
        (one_wrong_tile, "tiles", set()),
        (a_little_brighter, "mean", {"uniformity"}),
        (checkerboard, "uniformity", {"noise-free mse", "floors"}),
        (half_a_pixel, "registration", {"noise-free mse"}),
    ],
)
def test_a_defect_breaks_the_rung_that_names_it(defect, first, also):
    """The ladder stops there; to the top, others see it too."""
    rng = np.random.default_rng(2)
    truth = scene()
    defect(truth)
    ours, theirs = pictures(rng, truth=truth), pictures(rng)
    rungs = climbed(ours, theirs)
    assert broken(rungs) == [first] == [rungs[-1].name]
    all_rungs = climbed(ours, theirs, to_the_top=True)
    assert [rung.name for rung in all_rungs] == NOISY
    assert {first} | also <= set(broken(all_rungs))


def test_a_mirror_image_is_called_one():
    rng = np.random.default_rng(3)
    rungs = climbed(pictures(rng)[:, :, ::-1], pictures(rng))
    assert broken(rungs) == ["registration"]
    assert "left and right exchanged" in rungs[-1].sentence


def test_one_seed_for_all_our_pictures_is_seen():
    """A variance of zero where there is noise: every pixel differs by far too much."""
    rng = np.random.default_rng(4)
    ours = np.repeat(pictures(rng, count=1), 8, axis=0)
    assert broken(climbed(ours, pictures(rng), to_the_top=True)) != []


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("side", [0, 1])
def test_no_rung_is_climbed_with_values_that_are_no_numbers(bad, side):
    rng = np.random.default_rng(5)
    sides = [pictures(rng), pictures(rng)]
    sides[side][3, 2, 1] = bad
    rungs = climbed(*sides, to_the_top=True)
    assert broken(rungs) == ["finite"] == [rung.name for rung in rungs]


def test_other_sizes_are_a_failure():
    rng = np.random.default_rng(6)
    rungs = climbed(pictures(rng)[:, :-1], pictures(rng))
    assert broken(rungs) == ["finite"]
    assert "different sizes" in rungs[0].sentence


def test_too_few_pictures_are_an_error_and_no_pass():
    """With 7 and 7 pictures no relabelling can reach 1e-3."""
    rng = np.random.default_rng(7)
    with pytest.raises(ValueError, match="needs 8 and 8"):
        climbed(pictures(rng, count=7), pictures(rng))
    with pytest.raises(ValueError, match="needs 1 and 2"):
        climbed([scene()], [scene()], deterministic=True)


def smooth_scene() -> np.ndarray:
    """A picture of which less than six tenths lie on an edge, as AOVs and radiance need."""
    y, x = np.meshgrid(
        np.linspace(0, 1, SHAPE[0]), np.linspace(0, 1, SHAPE[1]), indexing="ij"
    )
    grey = 1.0 + 0.6 * y + 0.3 * x**2 + (x > 0.5 + 0.2 * y)
    return (grey[..., None] * np.array([1.0, 0.9, 0.8])).astype(np.float32)


def test_a_scene_without_noise_is_compared_pixel_by_pixel():
    truth = smooth_scene()
    rungs = climbed([truth * np.float32(1.000001)], [truth, truth], deterministic=True)
    assert [rung.name for rung in rungs] == ["finite", "registration", "radiance"]
    assert broken(rungs) == []
    bright = climbed([truth * np.float32(1.001)], [truth, truth], deterministic=True)
    assert broken(bright) == ["radiance"]
    moved = truth.copy()
    moved[1:] = (truth[1:] + truth[:-1]) / 2
    assert broken(climbed([moved], [truth, truth], deterministic=True)) == ["registration"]
    turned = climbed([truth[::-1]], [truth, truth], deterministic=True)
    assert "top and bottom" in turned[-1].sentence


def test_missing_aovs_break_their_rung():
    truth = smooth_scene()
    aovs = {"depth": np.ones((*SHAPE[:2], 1), np.float32)}
    names = ("position", "geo_normal", "sh_normal", "albedo")
    aovs |= {name: np.ones(SHAPE, np.float32) for name in names}
    aovs |= {"uv": np.ones((*SHAPE[:2], 2), np.float32)}
    for name in ("shape_index", "prim_index"):
        aovs[name] = np.ones((*SHAPE[:2], 1), np.float32)
    rungs = climb([truth], [truth, truth], aovs, aovs, deterministic=True)
    assert broken(rungs) == []
    assert [rung.name for rung in rungs][2] == "aovs"
    fewer = {name: array for name, array in aovs.items() if name != "uv"}
    rungs = climb([truth], [truth, truth], fewer, aovs, deterministic=True)
    assert broken(rungs) == ["aovs"]
    assert "uv" in rungs[-1].sentence


def test_rungs_travel_as_json():
    """Infinite numbers become null; a broken rung turns the scene's verdict."""
    rng = np.random.default_rng(8)
    rungs = climbed(pictures(rng), pictures(rng), to_the_top=True)
    rungs[-1] = replace(rungs[-1], limit=np.inf, passed=False)
    blank = SceneResult(name="scene", verdict="pass")
    result = Evidence(rungs=tuple(rungs)).recorded(blank)
    assert result.verdict == "fail"
    assert "rung floors" in result.reasons[0]
    results = Results(
        created="", command="", machine={}, versions={}, commit="", scenes=(result,)
    )
    read = json.loads(to_json(results))["scenes"][0]["rungs"]
    assert read[-1]["limit"] is None
    assert read[3] == asdict(rungs[3])


def test_the_evidence_shows_where():
    """A wrong tile in the maps, and histograms that count every noisy value."""
    rng = np.random.default_rng(9)
    truth = scene()
    one_wrong_tile(truth)
    maps = evidence(pictures(rng, truth=truth), pictures(rng))
    tile = slice(8, 16), slice(16, 24)
    assert maps["z_map"][tile].mean() > 1.0
    assert maps["p_map"][tile].mean() < 0.4
    error = maps["signed_error"][tile].mean()
    assert error == pytest.approx(0.25 * scene()[tile].mean(), rel=0.2)
    for name in ("p_histogram", "z_histogram"):
        assert maps[name][:, 2].sum() == np.prod(SHAPE)
    assert all(array.dtype == np.float32 for array in maps.values())


def test_clopper_and_pearson_by_hand():
    """None of n: the upper end is 1 - 0.025^(1/n); 10 of 100: 4.9 to 17.6 %."""
    none = rate(0, 200)
    assert none.low == 0.0
    assert none.high == pytest.approx(1.0 - 0.025 ** (1.0 / 200.0))
    some = rate(10, 100)
    assert (some.low, some.high) == pytest.approx((0.0490, 0.1762), abs=1e-4)
    assert rate(7, 7).high == 1.0


def test_alarms_are_counted():
    """Three right pairs and one with a brighter scene, no false alarm, but it counts."""
    rng = np.random.default_rng(10)
    small = slice(None), slice(0, 16), slice(0, 16)
    first = [pictures(rng)[small] for _ in range(3)]
    first.append(1.3 * pictures(rng)[small])
    found = count_alarms(first, [pictures(rng)[small] for _ in range(4)])
    by_name = {rung.name: rung for rung in found}
    assert by_name["mean"].alarms.count == 1
    assert by_name[WHOLE].alarms.count == 1
    assert by_name[WHOLE].claimed == pytest.approx(7e-3)
    measured = FalseAlarms("twice", found)
    assert not exceeds(measured)
    often = replace(found[-1], alarms=rate(20, 200))
    assert exceeds(replace(measured, rungs=(*found[:-1], often)))


class TestFromAFile:
    """The command's way, with Mitsuba on both sides."""

    @pytest.fixture
    def references(self, tmp_path):
        def render(request, path):
            write_entry(render_reference(request), path)

        return ReferenceCache(render, tmp_path / "cache")

    @pytest.mark.parametrize("deterministic", [False, True])
    def test_a_scene_climbs(self, tmp_path, references, deterministic):
        path = write_scene(tmp_path, deterministic=deterministic)
        found = validate_scene(path, Options(seeds=8, threads=2), stand_in(), references)
        assert found.result.reasons == ()
        names = [rung.name for rung in found.result.rungs]
        noisy = [*NOISY[:2], "aovs", *NOISY[2:]]
        assert names == ([*NOISY[:2], "aovs", "radiance"] if deterministic else noisy)
        assert ("p_map" in found.pictures) == (not deterministic)

    def test_a_broken_rung_fails_the_scene(self, tmp_path, references):
        """Five per cent too bright; the reason names the rung."""
        path = write_scene(tmp_path, deterministic=False)
        ours = stand_in(lambda picture: picture * np.float32(1.05))
        result = validate_scene(path, Options(seeds=8, threads=2), ours, references).result
        assert result.verdict == "fail"
        assert any(reason.startswith("rung ") for reason in result.reasons)
        assert not result.rungs[-1].passed


def test_the_command_wants_eight_seeds(capsys):
    """Seven are refused before anything is rendered."""
    assert main(["--seeds", "7"]) == 2
    assert "must be 8 or more, or 1" in capsys.readouterr().err
