"""The records behind the page "proof": what is wrong is one line that names its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import proof_samples as sample
import pytest

from reports.errors import ReportError
from reports.proof_page.page import proof_page


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"replay": [sample.replay(1, divergent=-1)]},
            r"replay\[0\].divergent: expected 0",
        ),
        ({"replay": [sample.replay(1, pixels=3) | {"divergent": 4}]}, "4 of 3 pixels"),
        (
            {"replay": [sample.replay(1, passed=None)]},
            "passed: expected `bool`",
        ),
        ({"replay": [sample.replay(1, verdict="fine")]}, "verdict: invalid enum value"),
        ({"replay": [sample.replay(1, sentence=7)]}, "sentence: expected `str`, found 7"),
        ({"rungs": [sample.rung("mean", p_value=1.5)]}, "p_value: expected 0 to 1"),
        ({"rungs": [sample.rung("mean", passed="yes")]}, "passed: expected `bool`"),
        ({"rungs": {}}, "rungs: expected `array`, found {}"),
    ],
)
def test_broken_scene_is_one_clear_line(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ReportError, match=message) as raised:
        sample.record(tmp_path, sample.proven("box", **changes))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("matrix", {"schema": 9}, "schema 9; this version reads schema 1"),
        ("matrix", {"schema": 1, "rows": []}, r"rows: expected .* length >= 1, found \[\]"),
        ("matrix", sample.matrix(sample.mutation("a", harmful=None)),
         "harmful: expected `bool`, found null"),
        ("matrix", sample.matrix(sample.mutation("a", sample.seen("b", 1, seconds=2))),
         r"rungs\[0\].caught: expected `bool`, found 1"),
        ("register", {"schema": 1, "entries": []}, "entries: expected .* length >= 1"),
        ("register", sample.register(sample.entry("a", band=[1])),
         r"band: expected .* length 2, found \[1\]"),
        ("register", sample.register(sample.entry("a", band=["x", 1])),
         r'band\[0\]: expected `float . null`, found "x"'),
        ("false_alarms", {"pairs": 2, "comparisons": []},
         "comparisons: expected .* length >= 1"),
        ("false_alarms", sample.alarms(low=0.9), "no share"),
        ("false_alarms", sample.alarms() | {"pairs": None}, "pairs: expected `int`"),
    ],
)  # fmt: skip
def test_broken_record_is_one_clear_line(
    tmp_path: Path, name: str, content: dict[str, Any], message: str
) -> None:
    with pytest.raises(ReportError, match=message) as raised:
        sample.record(tmp_path, **{name: content})
    assert f"{name}.json" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_broken_maps_are_one_clear_line(tmp_path: Path) -> None:
    record = sample.record(tmp_path)
    np.save(tmp_path / "box/p_histogram.npy", np.zeros((4, 2), np.float32))
    with pytest.raises(ReportError, match="expected rows of low, high, count"):
        proof_page(record, tmp_path)
    (tmp_path / "box/p_histogram.npy").unlink()
    with pytest.raises(ReportError, match="cannot be read"):
        proof_page(record, tmp_path)


def test_replay_without_numbers_is_no_pass(tmp_path: Path) -> None:
    """Pictures of two sizes: the harness writes no RMSE."""
    fields = sample.replay(16, rmse=None, passed=True)
    record = sample.record(tmp_path, sample.proven("box", replay=[fields]))
    assert not record.results.scenes[0].replay[0].passed
