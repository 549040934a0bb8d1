"""The page of speed against accuracy, from a canned record; records that are refused."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from drawn_charts import figures, points
from speed_accuracy_sample import PEER, noisy, record

from reports.commands import speed_accuracy as command
from reports.errors import ReportError
from reports.look.formatting import number
from reports.records.measured import MEASURED
from reports.speed_accuracy.page import speed_accuracy_page
from reports.speed_accuracy.record import (
    FILE,
    read_speed_accuracy,
    write_speed_accuracy,
)
from reports.speed_accuracy.summary import efficiencies


@pytest.fixture
def page():
    return speed_accuracy_page(record(failed={"cellar": "no <light>"}))


def test_one_chart_a_scene_with_every_contender(page):
    box, room, teapot = figures(page)
    for chart, count in ((box, 4), (room, 4), (teapot, 3)):
        assert sum(trace.get("hoverinfo") != "skip" for trace in chart["data"]) == count
    looks = [trace["marker"]["symbol"] for trace in room["data"] if "marker" in trace]
    assert len(set(looks)) == 4  # ours, another method of ours, and a peer's
    ours, theirs = (box["data"][index]["marker"] for index in (2, 4))
    assert theirs["symbol"] == ours["symbol"] + "-open"
    assert theirs["color"] == ours["color"]  # the same sampler


def test_bars_are_the_intervals(page):
    """Two errors 10 % around the mean: 12.7 times a tenth, on both sides of it."""
    curve = figures(page)[0]["data"][2]
    assert points(curve) == [(2.0, 0.25), (8.0, pytest.approx(0.0625))]
    bars = curve["error_y"]
    assert 0.25 + bars["array"][0] == pytest.approx(0.25 * 3.563, rel=1e-3)
    assert 0.25 - bars["arrayminus"][0] == pytest.approx(0.25 / 3.563, rel=1e-3)
    assert curve["error_x"]["array"] == [0.0, 0.0]


def test_the_front_is_marked(page):
    """In the chart, and in the table beside each curve that has a part of it."""
    front = figures(page)[0]["data"][0]
    assert front["name"] == "Pareto front" and front["line"]["shape"] == "hv"
    assert points(front) == [(1.0, 0.125), (4.0, 0.03125)]  # of our `sobol`
    section = page[page.index('id="noisy-1"') : page.index('id="noisy-2"')]
    assert section.count("✓ on it") == 1


def test_who_is_absent_and_what_failed_is_at_the_top(page):
    head = page[: page.index("<main")]
    assert "mitsuba llvm_ad_rgb takes no part" in head and "no &lt;LLVM&gt;" in head
    assert "1 scene could not be measured" in head and "no &lt;light&gt;" in head
    assert "Not all scenes" not in head
    assert "Not all scenes" in speed_accuracy_page(record(whole=False))
    partly = noisy("only", *record().noisy[0].curves, unavailable={f"{PEER} x": "off"})
    found = speed_accuracy_page(record(noisy=[*record().noisy, partly]))
    assert f"{PEER} x takes no part in only" in found


def test_an_older_file_tells_by_its_load_whether_the_machine_was_busy(tmp_path):
    """The load average of the minute before it began, which may be a command of ours."""
    for load, busy in (([0.1, 2.0], False), ([1.5, 3.0], True)):
        write_speed_accuracy(tmp_path / "old.json", record(load=load))
        page = speed_accuracy_page(read_speed_accuracy(tmp_path / "old.json"))
        assert ("⚠ The machine may have been busy: its load was 1.5" in page) == busy


def test_a_structure_with_another_picture_is_seen():
    still = record().noiseless[0]
    assert "bit for bit" in speed_accuracy_page(record())
    still.different.append("lightproof grid")
    page = speed_accuracy_page(record(noiseless=[still]))
    assert "lightproof grid" in page and "bit for bit" not in page


def test_an_exact_picture_has_a_place_on_a_logarithmic_axis(page):
    assert any(points(trace) == [(0.1, 1e-9)] for trace in figures(page)[2]["data"])


def test_the_readme_has_the_numbers_of_the_record_and_no_others():
    """The table that the command prints; "at equal error" is said nowhere with another."""
    readme = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    summary = efficiencies(read_speed_accuracy(MEASURED / FILE))
    assert "\n".join(command.markdown(summary)) in readme
    told = re.findall(r"equal error,? it is \**([\d.]+)", " ".join(readme.split()))
    assert set(told) <= {number(summary[0].mean)}, "another number than the record's"


def test_the_page_loads_nothing(page):
    assert "http" not in page.split('id="plotly"')[0].replace("http-equiv", "")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            lambda r: r["noisy"][0]["curves"][1]["pictures"][0]["errors"].append(1),
            "box: not",
        ),
        (
            lambda r: r["noisy"][1].update(curves=r["noisy"][0]["curves"][2:]),
            "room: no curve",
        ),
        (lambda r: r["noiseless"][0]["pictures"][1].update(seconds=[-1.0]), "> 0.0"),
        (lambda r: r["noisy"][0]["curves"][0].pop("sampler"), "missing required"),
        (lambda r: r.update(noisy=[], noiseless=[]), "holds no scene"),
        (lambda r: r.update(schema=2), "schema 2"),
    ],
)
def test_a_bad_record_is_one_line(tmp_path, capsys, change, told):
    path = tmp_path / "speed_accuracy.json"
    write_speed_accuracy(path, record())
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(ReportError, match=told):
        read_speed_accuracy(path)
    out = tmp_path / "out"
    words = ["--from", str(path), "--out", str(out)]
    assert command.main(words) == command.WRONG_USE
    assert told in capsys.readouterr().err and not out.exists()


def test_drawing_is_not_measuring(capsys):
    assert command.main(["--from", "x.json", "--quick"]) == command.WRONG_USE
    assert "not with --scene, --quick" in capsys.readouterr().err
