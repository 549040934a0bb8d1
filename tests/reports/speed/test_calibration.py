"""The study of claimed errors: its record, and what it leaves out."""

from __future__ import annotations

import json

from reports.commands.calibration import Claims, main


def test_claims_are_held_against_a_finer_picture(tmp_path, capsys):
    words = ["cornell-box", "grey-furnace", "--seeds", "2", "--error", "0.2"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    record = json.loads((tmp_path / "data" / "calibration.json").read_text())
    assert record["command"].startswith("python -m reports.calibration cornell-box")
    (box,) = record["scenes"]
    assert box["scene"] == "cornell-box" and len(box["true"]) == 2
    assert all(0.0 < claimed <= 0.2 for claimed in box["claimed"])
    output = capsys.readouterr()
    assert "16 samples have less" in output.err
    assert "cornell-box" in output.out


def test_right_is_within_a_fifth():
    claims = Claims("x", [0.1, 0.1, 0.1, 0.1], [0.1, 0.084, 0.121, 0.2], [], 0)
    assert claims.right == 0.75  # 0.1 is 19 % from 0.084, 17 % from 0.121, half of 0.2
