"""The page of the atlas, from canned results; the command around it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from drawn_charts import figure, figures, points
from test_limits_atlas import ROW

from reports.charts.boundary import boundary_chart
from reports.commands import limits as command
from reports.errors import ReportError
from reports.limits.atlas import Chapter
from reports.limits.page import limits_page
from reports.limits.record import (
    AS_SAID,
    BROKEN,
    Limits,
    MeasuredRow,
    read_limits,
    write_limits,
)

SOUND = MeasuredRow(
    "square",
    AS_SAID,
    1.0,
    None,
    ((0.1, 0.01), (1.0, 0.0), (10.0, None)),
    1.9,
    2.1,
    "data:image/png;base64,AAAA",
    seconds=0.5,
)
FAULTY = MeasuredRow("cube", BROKEN, error="ValueError: <no>")
CHAPTERS = (
    Chapter("numbers", "Numbers", (replace(ROW, instead="10^-3 < n^(1/3)."),)),
    Chapter("light", "Light", ()),
    Chapter(
        "structures",
        "Structures",
        (replace(ROW, name="cube", method="Another <method>"),),
    ),
)


@pytest.fixture
def page():
    return limits_page(Limits(rows=(SOUND, FAULTY)), CHAPTERS)


def test_each_row_has_its_place(page):
    assert 'id="chapter-numbers"' in page and 'id="chapter-structures"' in page
    assert 'id="chapter-light"' not in page  # nothing of it was measured
    for name in ("square", "cube"):
        assert page.count(f'id="{name}"') == 1
        assert f'href="#{name}"' in page
    for text in (ROW.why, "between 1.9 and 2.1", "no finite number"):
        assert text in page
    assert "10<sup>-3</sup> &lt; n<sup>1/3</sup>" in page
    assert "Another &lt;method&gt;" in page and SOUND.picture in page
    assert "http" not in page.split('id="plotly"')[0].replace("http-equiv", "")


def test_what_could_not_be_measured_stands_in_its_place(page):
    """And the head of the page counts it."""
    assert "1 of 2 rows is not as the atlas says" in page
    section = page[page.index('id="cube"') :]
    assert "ValueError: &lt;no&gt;" in section and "not measured" in section
    assert len(figures(page)) == 1


def test_a_row_of_another_atlas_is_refused():
    with pytest.raises(ReportError, match="row 'square' is not in the atlas"):
        limits_page(Limits(rows=(SOUND,)))


def test_zero_and_no_number_have_places_on_a_logarithmic_axis():
    chart = figure(
        boundary_chart(
            ((1.0, 0.0), (10.0, 1e-4), (100.0, 1.0), (1e3, None)),
            tolerance=0.01,
            boundary=(10.0, 100.0),
            x_label="x",
            y_label="y",
            description="d",
        )
    )
    level, curve = chart["data"]
    assert points(level) == [(1.0, 0.01), (1e3, 0.01)]
    assert points(curve) == [(1.0, 1e-5), (10.0, 1e-4), (100.0, 1.0), (1e3, 10.0)]
    assert curve["text"] == ["0", "", "", "no number"]
    (band,) = chart["layout"]["shapes"]
    assert (band["x0"], band["x1"]) == (10.0, 100.0)
    assert chart["layout"]["xaxis"]["type"] == chart["layout"]["yaxis"]["type"] == "log"


def test_a_chart_of_nothing_is_refused():
    with pytest.raises(ValueError, match="at least one point"):
        boundary_chart(
            (), tolerance=1, boundary=(1, 2), x_label="", y_label="", description=""
        )


def test_the_record_survives_its_file(tmp_path):
    limits = Limits(rows=(SOUND, FAULTY))
    write_limits(tmp_path / "limits.json", limits)
    assert read_limits(tmp_path / "limits.json") == limits


@pytest.fixture
def canned_atlas(monkeypatch):
    rows = tuple(row for chapter in CHAPTERS for row in chapter.rows)
    monkeypatch.setattr(command, "ATLAS", rows)
    monkeypatch.setattr(limits_page, "__defaults__", (CHAPTERS,))


def test_the_command_measures_and_draws(canned_atlas, tmp_path):
    assert command.main(["--out", str(tmp_path)]) == 0
    rows = read_limits(tmp_path / "data" / "limits.json").rows
    assert [row.name for row in rows] == ["square", "cube"]
    assert "2 rows, each as the atlas says" in (tmp_path / "limits.html").read_text()


def test_one_row_alone_leaves_the_record_of_all(canned_atlas, tmp_path, capsys):
    """It is printed, and nothing is written, where there is a record and where not."""
    assert command.main(["--only", "cube", "--out", str(tmp_path / "new")]) == 0
    assert not (tmp_path / "new").exists()
    command.main(["--out", str(tmp_path)])
    files = [tmp_path / "data" / "limits.json", tmp_path / "limits.html"]
    before = [file.read_bytes() for file in files]
    capsys.readouterr()
    assert command.main(["--only", "cube", "--out", str(tmp_path)]) == 0
    assert [file.read_bytes() for file in files] == before
    said = capsys.readouterr().out
    assert said.startswith("cube: as said; tolerance 4, gives way between 1.9")
    assert said.endswith("; 0.1: 0.01, 1: 1, 10: 100\n")


def test_the_quick_rows_leave_the_record_of_all(canned_atlas, tmp_path, monkeypatch):
    """They have files of their own, also when these are drawn again."""
    command.main(["--out", str(tmp_path)])
    files = [tmp_path / "data" / "limits.json", tmp_path / "limits.html"]
    before = [file.read_bytes() for file in files]
    first, second = command.ATLAS
    monkeypatch.setattr(command, "ATLAS", (first, replace(second, slow=True)))
    assert command.main(["--quick", "--out", str(tmp_path)]) == 0
    quick = tmp_path / "data" / "limits-part.json"
    assert [row.name for row in read_limits(quick).rows] == ["square"]
    page = tmp_path / "limits-part.html"
    drawn = page.read_bytes()
    page.unlink()
    assert command.main(["--from", str(quick), "--out", str(tmp_path)]) == 0
    assert page.read_bytes() == drawn
    assert [file.read_bytes() for file in files] == before


def test_the_page_from_a_file(canned_atlas, tmp_path):
    assert command.main(["--out", str(tmp_path)]) == 0
    source = tmp_path / "data" / "limits.json"
    other = tmp_path / "other"
    assert command.main(["--from", str(source), "--out", str(other)]) == 0
    assert (other / "limits.html").read_text() == (tmp_path / "limits.html").read_text()


def test_an_alarm_is_the_exit_status(canned_atlas, tmp_path, capsys):
    write_limits(tmp_path / "old.json", Limits(rows=(SOUND, FAULTY)))
    given = ["--from", str(tmp_path / "old.json"), "--out", str(tmp_path)]
    assert command.main(given) == 1
    assert "cube: ALARM: it could not be measured ValueError" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words, message",
    [
        (["--only", "circle"], "row 'circle' is unknown; there are: square, cube"),
        (["--from", "nowhere.json"], "nowhere.json: cannot be read"),
        (["--from", "a.json", "--only", "cube"], "not with --only or --quick"),
        (["--from", "a.json", "--quick"], "not with --only or --quick"),
    ],
)
def test_wrong_use_is_one_line(canned_atlas, words, message, tmp_path, capsys):
    assert command.main([*words, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "limits.html").exists()
