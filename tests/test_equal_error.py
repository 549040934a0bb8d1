"""Error times time: the formula by hand, and the tool from end to end on a small room."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from test_benchmark_run import CLOSED_ROOM

from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.timed_mitsuba import TimedRender
from mitsuba_ref.statistics.equal_error import (
    geometric_mean,
    log_ratio_error,
    relative_mse_of,
    worth,
)
from reports.commands import equal_error
from reports.records.equal_error import SceneWorth, Worth


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


def test_the_best_samplers_are_compared():
    ours = [Worth("lightproof", name, [e], [1.0]) for name, e in (("a", 0.5), ("b", 0.1))]
    theirs = [Worth("mitsuba x", name, [e], [2.0]) for name, e in (("a", 0.1), ("c", 0.3))]
    assert SceneWorth("s", 1, 1, "", ours + theirs).ratio == pytest.approx(2.0)


def test_a_small_room_from_end_to_end(tmp_path, monkeypatch, capsys):
    """Errors beside Mitsuba's are of one size; a file that is not there is one line."""
    monkeypatch.setattr(equal_error, "PEERS", ("scalar_rgb",))
    monkeypatch.setattr(equal_error, "THEIR_SAMPLERS", ("independent", "multijitter"))
    path = tmp_path / "scene.xml"
    path.write_text(CLOSED_ROOM)
    words = [str(path), "--spp", "16", "--seeds", "2", "--reference", "64"]
    assert equal_error.main([*words, "--out", str(tmp_path)]) == 0
    record = json.loads((tmp_path / "data" / "equal_error.json").read_text())
    (scene,) = record["scenes"]
    of = {(c["renderer"], c["sampler"]): np.mean(c["errors"]) for c in scene["contenders"]}
    theirs = of["mitsuba scalar_rgb", "independent"]
    assert 0.5 < of["lightproof", "independent"] / theirs < 2.0
    assert of["mitsuba scalar_rgb", "multijitter"] < theirs  # it has another sampler
    assert (scene["width"], scene["height"]) == (8, 8)
    assert scene["reference"].startswith("64 samples of mitsuba scalar_rgb, multijitter")
    assert re.search(r"ours / best\W+16 samples\W+[\d.]+ ± [\d.]+", capsys.readouterr().out)
    assert equal_error.main([str(tmp_path / "none.xml")]) == equal_error.WRONG_USE
    assert "no such scene file" in capsys.readouterr().err


# ------------------------------------------------------------- contenders without Mitsuba


class FakeMitsuba:
    """Pictures of 1 with a little noise; what else it does is a test's."""

    broken: tuple[str, str] | None = None  # a variant's sampler that does not work
    shift: tuple[str, str] | None = None  # one whose pictures are brighter
    value_at_last = 1.0  # of the pictures that are judged
    open_now = 0

    def __init__(self, variant, path, parameters, threads, sampler):
        self.name = (variant, sampler)

    def __enter__(self):
        FakeMitsuba.open_now += 1
        return self

    def __exit__(self, *_):
        FakeMitsuba.open_now -= 1

    def render(self, seed, spp, keep):
        if self.name == self.broken:
            raise MitsubaError("not today")
        picture = noisy_picture(seed, spp) + 0.5 * (self.name == self.shift)
        if spp != equal_error.CHECK_SPP and seed < equal_error.REFERENCE_SEED:
            picture[0, 0] *= self.value_at_last
        np.save(keep, picture)
        return TimedRender(0.1, (1.0, 1.0, 1.0))


def noisy_picture(seed, spp):
    return np.random.default_rng((seed, spp)).normal(1.0, 0.01, (4, 4, 3))


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Run the tool with two variants and our samplers, all made up; return its status."""

    def ours(path, parameters, sampler, threads):
        brighter = 0.5 * (FakeMitsuba.shift == ("ours", sampler))
        return lambda seed, spp: (0.1, noisy_picture(seed + 50, spp) + brighter)

    monkeypatch.setattr(equal_error, "TimedMitsuba", FakeMitsuba)
    monkeypatch.setattr(equal_error, "_ours", ours)
    path = tmp_path / "scene.xml"
    path.write_text(CLOSED_ROOM)

    def run(*words, **deeds):
        for name, value in deeds.items():
            monkeypatch.setattr(FakeMitsuba, name, value)
        given = [str(path), "--spp", "5", "--reference", "16", *words]
        return equal_error.main([*given, "--out", str(tmp_path)])

    return run


def test_a_variant_that_lacks_one_sampler_is_left_out(fake, tmp_path):
    """As a whole, its processes ended; and the reference's samples are those taken."""
    assert fake(broken=("llvm_ad_rgb", "multijitter")) == 0
    assert FakeMitsuba.open_now == 0
    record = json.loads((tmp_path / "data" / "equal_error.json").read_text())
    (scene,) = record["scenes"]
    assert scene["unavailable"] == {"mitsuba llvm_ad_rgb": "not today"}
    found = {one["renderer"] for one in scene["contenders"]}
    assert found == {"lightproof", "mitsuba scalar_rgb"}
    # 4 pictures; Mitsuba's `multijitter` makes 2 x 3 cells of 5 samples
    assert scene["reference"].startswith("24 samples of mitsuba scalar_rgb, multijitter")


@pytest.mark.parametrize(
    "shift",
    [("ours", "sobol"), ("scalar_rgb", "stratified"), ("llvm_ad_rgb", "multijitter")],
)
def test_no_contender_is_timed_whose_mean_is_another(fake, capsys, shift):
    assert fake(shift=shift) == equal_error.WRONG_USE
    error = capsys.readouterr().err
    assert "nothing was timed" in error
    assert " ".join(shift).replace("ours", "lightproof") in error


def test_a_picture_with_a_nan_ends_it(fake, capsys):
    assert fake(value_at_last=math.nan) == equal_error.WRONG_USE
    assert "seed 0: 3 of 48 values of the picture are not finite" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--reference", "--spp"])
def test_no_samples_are_no_use(fake, capsys, option):
    with pytest.raises(SystemExit):
        fake(option, "0")
    assert f"argument {option}: 0: must be 1 or more" in capsys.readouterr().err
