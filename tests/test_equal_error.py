"""Error times time: the formula by hand, and the tool from end to end on a small room."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from test_benchmark_run import CLOSED_ROOM

from mitsuba_ref.statistics.equal_error import geometric_mean, relative_mse_of, worth
from reports.commands import equal_error
from reports.commands.equal_error import SceneWorth, Worth


def test_relative_mse_by_hand():
    """Of 2000 values the two largest are left out; the mean of the reference is 2."""
    reference = np.full((20, 25, 4), 2.0)
    picture = reference.copy()
    picture[:10] += 0.5  # half of the values: 0.25 / (4 + 0.04)
    picture[-1, -1, :2] = 1e6
    rest = 0.25 / 4.04 * 1000 / 1998
    assert relative_mse_of(picture, reference) == pytest.approx(rest, rel=1e-12)


def test_twice_the_samples_are_worth_the_same():
    assert worth([0.2, 0.4], [3.0, 1.0, 2.0]) == pytest.approx(1 / 0.6)
    assert worth([0.1, 0.2], [6.0, 2.0, 4.0]) == pytest.approx(1 / 0.6)
    assert worth([0.0], [1.0]) == math.inf
    assert geometric_mean([1.0, 8.0, 27.0]) == pytest.approx(6.0)


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
    assert "ours / best" in capsys.readouterr().out
    assert equal_error.main([str(tmp_path / "none.xml")]) == equal_error.WRONG_USE
    assert "no such scene file" in capsys.readouterr().err
