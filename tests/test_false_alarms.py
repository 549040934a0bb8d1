"""The command that counts how often the ladder alarms when nothing is wrong."""

from __future__ import annotations

import json

from mitsuba_stand_in import NOISY

from mitsuba_ref.false_alarms import WHOLE, main


def test_an_unchanged_scene_is_measured_with_itself(tmp_path, capsys):
    """Two pairs: seven rungs and the convergence of the side that is named first.

    The file's sampler is `stratified`, with which the noise falls faster than it must for
    that rung: at 12 pixels a side the exponent scatters by 0.01, and -0.6 and less would
    be found.
    """
    folder = tmp_path / "ball"
    folder.mkdir()
    scene = folder / "scene.xml"
    scene.write_text(NOISY.replace('"independent"', '"stratified"'))
    out = tmp_path / "data" / "false_alarms.json"
    words = ["--scenes", str(tmp_path), "--scene", "ball", "--pairs", "2", "--size", "12"]
    assert main([*words, "--spp", "4", "--out", str(out)]) == 0
    record = json.loads(out.read_text())
    assert record["pairs"] == 2
    assert [one["comparison"] for one in record["comparisons"]] == [
        "Mitsuba against Mitsuba",
        "ours against Mitsuba",
    ]
    printed = capsys.readouterr().out
    for comparison, side in zip(record["comparisons"], ("Mitsuba", "ours"), strict=True):
        *_, floors, convergence, whole = comparison["rungs"]
        assert (floors["name"], whole["name"]) == ("floors", WHOLE)
        assert convergence["name"] == f"convergence, {side}"
        assert convergence["name"] in printed
        assert convergence["alarms"]["count"] == 0
        assert 0.0 < convergence["detectable_bias"] < 0.1
        assert whole["alarms"]["trials"] == 2
        assert abs(whole["claimed"] - 8e-3) < 1e-9
