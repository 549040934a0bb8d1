"""The page "accelerators": drawn from a record alone, which is checked first."""

from __future__ import annotations

import base64
import io
import json
import math
import re
from pathlib import Path
from typing import Any

import accelerators_sample as sample
import numpy as np
import pytest
from markupsafe import Markup
from PIL import Image
from report_samples import scene as rendered_scene
from report_samples import write_results

from reports.accelerator_page import page
from reports.accelerator_page.fits import logarithm_fit, power_fit
from reports.accelerator_page.section import build_accelerators_section
from reports.accelerator_study.further_studies import FurtherStudy
from reports.commands import accelerators as command
from reports.commands import report as cli
from reports.errors import ReportError
from reports.look.heat_map import RAMP, heat_map_uri

SIZES = [1e3, 1e4, 1e5, 1e6]


def drawn(folder: Path, **changes: Any) -> str:
    return page.accelerators_page(sample.record(folder, **changes))


def structures_with(**changes: Any) -> list[dict[str, Any]]:
    """One scene whose second structure is changed."""
    one = sample.scene("icosphere")
    one["structures"][1] |= changes
    return [one]


# ------------------------------------------------------------------------- the numbers


def test_ratio_beside_a_peer_is_formed_within_each_round(tmp_path: Path) -> None:
    """75 ns of Mitsuba's over 50 ns of ours in each round: 1.5 times; so is the build."""
    section = build_accelerators_section(sample.record(tmp_path))
    assert section.judged == "quick-tree"
    for row in section.beside_embree:
        if row.peer == "mitsuba llvm_ad_rgb":
            assert (row.threads, row.build) == (2, pytest.approx(1.5))
            assert list(row.rays.values()) == [pytest.approx(1.5)] * 4


def test_any_hit_is_compared_on_the_same_rays(tmp_path: Path) -> None:
    """Any hit takes 0.7 of the nearest hit's time: 1.43 times as fast."""
    section = build_accelerators_section(sample.record(tmp_path))
    assert section.any_hit == pytest.approx(1.0 / 0.7)
    assert "1.43 times as fast as when asked" in drawn(tmp_path)


def test_absent_peer_is_not_measured(tmp_path: Path) -> None:
    rows = build_accelerators_section(sample.record(tmp_path)).beside_embree
    absent = [row for row in rows if row.peer == "embreex"]
    assert len(absent) == 2  # on both scenes
    for row in absent:
        assert row.build is None
        assert set(row.rays.values()) == {None}


def test_total_time_is_build_and_a_third_of_each_kind(tmp_path: Path) -> None:
    """Build 0.225 s (median), 2 threads: 10^6 rays of (25 + 17.5 + 25) / 3 ns are 22.5 ms.

    For 10^8 rays auto takes the tree of 200 ns: 0.225 + 9 s against 0.225 + 2.25 s.
    """
    totals = build_accelerators_section(sample.record(tmp_path)).scenes[0].totals
    assert totals[0].best == totals[0].auto == "quick-tree"
    assert totals[0].best_seconds == pytest.approx(0.2475)
    assert totals[1].ratio == pytest.approx(9.225 / 2.475)


def test_speed_is_the_median_of_the_rounds(tmp_path: Path) -> None:
    """Rounds of 50, 55 and 45 ns on one thread are 20 million rays/s."""
    row = build_accelerators_section(sample.record(tmp_path)).scenes[0].speeds[1]
    assert row.one["camera"] == pytest.approx(20.0)
    assert row.all["camera"] == pytest.approx(40.0)
    assert row.build_seconds == 0.2
    assert row.share is None  # all of the scene's camera rays


def test_figure_is_scaled_to_the_whole_picture(tmp_path: Path) -> None:
    """2,073,600 rays of 2500 ns are 5.184 s, measured on one hundredth of them."""
    naive, tree = build_accelerators_section(sample.record(tmp_path)).figure
    assert naive.one == pytest.approx(5.184)
    assert naive.share == pytest.approx(0.01)
    assert naive.tests == pytest.approx(1920 * 1080 * 6320)
    assert tree.share == 1.0
    assert tree.gain == pytest.approx(100.0)


def test_fits_find_the_law_that_made_the_numbers() -> None:
    """3 n^0.4 and 5 + 7 log2 n, without error; the wrong law has one."""
    power = power_fit(SIZES, [3.0 * n**0.4 for n in SIZES])
    assert power == pytest.approx((3.0, 0.4, 0.0), abs=1e-9)
    values = [5.0 + 7.0 * math.log2(n) for n in SIZES]
    assert logarithm_fit(SIZES, values) == pytest.approx((5.0, 7.0, 0.0), abs=1e-9)
    assert power_fit(SIZES, values).error > 0.02


def test_growth_shows_exponents_and_why_it_stopped(tmp_path: Path) -> None:
    rows = build_accelerators_section(sample.record(tmp_path)).growth.rows
    exponents = [
        row.rays["random"].power.second for row in rows if row.rays["random"].power
    ]
    assert exponents == pytest.approx([1.0, 0.25, 0.5])
    shown = drawn(tmp_path)
    assert "n<sup>0.25</sup>" in shown
    assert "would build for about 9 s" in shown


def test_too_few_sizes_give_no_fit(tmp_path: Path) -> None:
    short = sample.study()["growth"]
    for one in short["series"]:
        del one["points"][2:]
    row = build_accelerators_section(sample.record(tmp_path, growth=short)).growth.rows[0]
    assert row.rays["camera"].power is None
    assert "<sup>0" not in drawn(tmp_path, growth=short)


# ---------------------------------------------------------------------------- the page


def test_page_names_everything_and_loads_nothing(tmp_path: Path) -> None:
    shown = drawn(tmp_path)
    for wanted in (
        "3 structures on 2 scenes give the hits of brute force, bit for bit",
        "Example CPU",
        "0123abc",
        "python -m reports.accelerators --full",
        "not available: No module named &#39;embreex&#39;",
        "at least 99.950 % of the rays",
        "5,002 triangles",
        "Triangle tests of a ray that hits the ball",
        "4900",
        "1 % of it, scaled",
    ):
        assert wanted in shown, wanted
    addresses = re.findall(r'(?:href|src)="([^"#]*)[^"]*"', shown)
    assert all(a in ("", "index.html") or a.startswith("data:") for a in addresses)
    anchors = set(re.findall(r'id="([^"]+)"', shown))
    assert set(re.findall(r'href="#([^"]+)"', shown)) <= anchors


def test_wrong_structure_is_shown_in_red(tmp_path: Path) -> None:
    fault = "camera rays: 3 of 1024 are answered wrongly; not timed"
    scenes = structures_with(fault=fault, nanoseconds={}, work={})
    shown = drawn(tmp_path, scenes=scenes)
    assert "✗ Not every structure gives the hits of brute force" in shown
    assert f"quick-tree on icosphere: {fault}" in shown
    assert "banner pass" not in shown


def test_names_are_escaped(tmp_path: Path) -> None:
    """A name from the file is text, in tables and in charts."""
    shown = drawn(tmp_path, scenes=structures_with(name="<b>tree</b>"))
    assert "<b>tree" not in shown
    assert "&lt;b&gt;tree" in shown


def test_further_study_gets_its_section(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A study that was measured is drawn; one that was not is left out."""

    def section(measured: Any) -> Markup:
        return Markup("<p>{} found</p>").format(measured["number"])

    study = FurtherStudy("Moving things", lambda quick: {"number": 1}, section)
    monkeypatch.setattr(page, "FURTHER_STUDIES", {"moving": study, "other": study})
    shown = drawn(tmp_path, further={"moving": {"number": 42}})
    assert shown.count("<p>42 found</p>") == 1
    assert shown.count(">Moving things</h2>") == 1


# ------------------------------------------------------------------------ broken records


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"schema": 9}, "schema 9; this version reads schema 2"),
        ({"scenes": []}, r"scenes: expected .* length >= 1, found \[\]"),
        ({"threads": "two"}, 'threads: expected `int`, found "two"'),
        ({"scenes": structures_with(bytes=None)}, r"\[1\].bytes: expected `int`"),
        (
            {"scenes": structures_with(nanoseconds={"camera": {"1": [0.0]}})},
            r"nanoseconds.camera.1\[0\]: expected `float` > 0.0, found 0.0",
        ),
        (
            {"scenes": structures_with(nanoseconds={"camera": {"one": [1.0]}})},
            'nanoseconds.camera.one: expected `int`, found "one"',
        ),
        (
            {"maps": [{"scene": "a", "width": 2, "height": 2, "maps": [
                {"name": "b", "mean": 1, "ball_tests": None, "work": [[1, 2], [3]]}]}]},
            r"maps\[0\]: the map of b is not of 2 x 2 numbers",
        ),
        ({"growth": None}, "growth: expected `object`, found null"),
    ],
)  # fmt: skip
def test_malformed_records_are_one_clear_line(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ReportError, match=message) as raised:
        sample.record(tmp_path, **changes)
    assert "\n" not in str(raised.value)


def test_damaged_record_leaves_the_old_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data/accelerators.json").write_text("the old record")
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    assert command.main(["--from", str(broken), "--out", str(tmp_path)]) == 2
    assert (tmp_path / "data/accelerators.json").read_text() == "the old record"
    assert "broken.json:1: not JSON" in capsys.readouterr().err


# ------------------------------------------------------------------------- the commands


def test_page_is_drawn_again_and_linked_from_the_index(tmp_path: Path) -> None:
    """`--from` measures nothing; an index in the same folder gets a link to the page."""
    source = sample.write_study(tmp_path / "old")
    out = tmp_path / "out"
    write_results(out / "data", [rendered_scene("sound", "pass")])
    assert command.main(["--from", str(source), "--out", str(out)]) == 0
    assert "Finding the nearest hit fast" in (out / "accelerators.html").read_text()
    index = (out / "index.html").read_text()
    assert '<a href="accelerators.html">' in index
    assert "at commit <code>0123abc</code>" in index


def test_wrong_structure_is_exit_status_1(tmp_path: Path) -> None:
    source = sample.write_study(tmp_path, scenes=structures_with(fault="wrong"))
    assert command.main(["--from", str(source), "--out", str(tmp_path / "out")]) == 1


@pytest.mark.parametrize(
    ("arguments", "there", "measured"),
    [
        ([], False, True),
        ([], True, False),  # an old study, perhaps the full one, is kept
        (["scenes/a"], False, False),
        (["--accelerators", "scenes/a"], True, True),
        (["--no-accelerators"], False, False),
    ],
)
def test_report_measures_accelerators_once(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    there: bool,
    measured: bool,
) -> None:
    """`python -m reports` on a fresh clone draws this page as well."""
    asked: list[Path] = []

    def harness(words: list[str]) -> int:
        write_results(tmp_path / "data", [rendered_scene("one", "pass")])
        return 0

    def study(target: Path, *_: Any) -> None:
        asked.append(target)
        sample.write_study(target.parent)

    monkeypatch.setattr(cli.harness, "main", harness)
    monkeypatch.setattr(cli, "write_study", study)
    if there:
        sample.write_study(tmp_path / "data")
    assert cli.main(["--no-proof", "--out", str(tmp_path), *arguments]) == 0
    assert asked == ([tmp_path / "data/accelerators.json"] if measured else [])
    assert (tmp_path / "accelerators.html").exists() == (there or measured)


def test_interrupted_study_leaves_the_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C in the study: the page of the scenes is drawn, the exit status says 130."""

    def harness(words: list[str]) -> int:
        write_results(tmp_path / "data", [rendered_scene("one", "pass")])
        return 0

    def study(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli.harness, "main", harness)
    monkeypatch.setattr(cli, "write_study", study)
    assert cli.main(["--no-proof", "--out", str(tmp_path)]) == 130
    assert "Title of one" in (tmp_path / "index.html").read_text()
    assert not (tmp_path / "accelerators.html").exists()


def test_wrong_structure_fails_the_whole_report(tmp_path: Path) -> None:
    """All scenes pass, but a structure finds wrong hits: exit status 1."""
    source = write_results(tmp_path / "data", [rendered_scene("sound", "pass")])
    assert cli.main(["--from", str(source), "--out", str(tmp_path)]) == 0
    sample.write_study(tmp_path / "data", scenes=structures_with(fault="wrong"))
    assert cli.main(["--from", str(source), "--out", str(tmp_path)]) == 1


# ------------------------------------------------------------------------ its pictures


def test_heat_map_runs_from_the_dark_to_the_light_end() -> None:
    """1 (and 0) are the ramp's first colour, the most its last, the root the middle one."""
    uri = heat_map_uri(np.array([[0, 1, 10, 100]]), 100)
    content = base64.b64decode(uri.partition(",")[2])
    pixels = np.asarray(Image.open(io.BytesIO(content)).convert("RGB"), float)[0]
    expected = RAMP[[0, 0, 3, -1]]
    assert np.abs(pixels - expected).max() < 2.0


def test_record_is_json_without_nan(tmp_path: Path) -> None:
    """A file with NaN is refused: nobody could say what it means."""
    path = tmp_path / "accelerators.json"
    text = json.dumps(sample.study()).replace("23.5", "NaN", 1)
    path.write_text(text)
    with pytest.raises(ReportError, match="found NaN"):
        command.read_accelerators(path)
