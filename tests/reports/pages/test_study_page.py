"""The page of any study: what is on top, which charts and tables rows become."""

from __future__ import annotations

import re

import pytest
from drawn_charts import figures

from mitsuba_ref.records.other_programs import KEY
from reports.bench.rows import Done, Row, Run, Table
from reports.bench.study import Bench, Study
from reports.errors import OptionError
from reports.look.formatting import NOTHING
from reports.pages.study_page import study_page

RUN = Run(run="r", created="2026-01-01", command="c", machine={"cores": 2, KEY: 0.0})


def drawn(*rows, busy=0.0, **given):
    done = {row.case: Done(done=row.case, run="r", seconds=1.0) for row in rows}
    worst = Done(done=rows[0].case, run="r", seconds=1.0, cores_of_other_programs=busy)
    table = Table(tuple(rows), {"r": RUN}, done | {rows[0].case: worst})
    given = {
        "sentence": "How fast?",
        "minutes": 1,
        "measure": lambda c, b: iter(()),
        **given,
    }
    return study_page("s", Study(title="T", **given), table)


def row(case, contender, value, quantity="ratio", **given):
    return Row(
        case=case, contender=contender, quantity=quantity, value=value, run="r", **given
    )


def test_the_verdict_stands_before_everything_but_that_the_machine_was_busy():
    rows = row("a", "x", 1.0), row("a", "x", "it is slow", "left out")
    page = drawn(*rows, busy=1.7, verdict=lambda table: f"{len(table)} rows say so.")
    top = page[page.index("</h1>") : page.index("</header>")]
    order = [top.index(word) for word in ("was busy", "How fast?", "2 rows say so.")]
    assert order == sorted(order)
    assert "was busy" not in drawn(*rows, busy=0.1)
    left_out = page[page.index("Left out, and why: 1") :]
    assert left_out.index("a, x: it is slow") < left_out.index("</details>")
    assert page.count("it is slow") == 1  # no table of sentences


def test_ratios_of_several_cases_are_one_chart_with_a_line_at_one():
    rows = [
        row("a", "x", 2.0, unit="times", interval=(1.5, 3.0)),
        row("a", "y", 4.0, unit="times", interval=(3.5, 4.5)),
        row("b", "x", 0.5, unit="times"),
        row("b", "y", None, unit="times"),
    ]
    page = drawn(*rows)
    (found,) = figures(page)
    x, y = found["data"]
    assert (x["x"], x["y"], y["x"], y["y"]) == ([2.0, 0.5], ["a", "b"], [4.0], ["a"])
    assert (x["error_x"]["array"], x["error_x"]["arrayminus"]) == ([1.0, 0.0], [0.5, 0.0])
    (line,) = found["layout"]["shapes"]
    assert line["x0"] == line["x1"] == 1.0
    assert "<h2>Ratio</h2>" in page and "2 (1.5 to 3)" in page
    assert figures(drawn(*rows[:2])) == []  # one case is a table
    assert figures(drawn(row("a", "x", 2.0), row("b", "x", 3.0))) == []  # no intervals


def test_one_case_is_a_table_with_a_line_for_each_contender():
    page = drawn(
        row("night", "first", 0.05, "time", unit="s"),
        row("night", "second", 2.0, "time", unit="s"),
        row("night", "first", "killed", "outcome"),
        row("night", "second", "resumed", "outcome"),
    )
    assert re.findall("<h2>(.*?)</h2>", page) == ["The numbers"]
    cells = re.findall("<t[hd][^>]*>([^<]*)</t[hd]>", page)
    assert cells == ["", "Time", "Outcome", "first", "50 ms", "killed", *cells[6:]]
    assert cells[6:] == ["second", "2 s", "resumed"]


def test_tables_over_the_same_cases_are_one():
    rows = [row(case, "", 2.0, name) for name in ("first", "second") for case in "ab"]
    page = drawn(*rows, row("a", "x", 1.0, "third"), row("b", "y", "yes", "third"))
    cells = re.findall("<t[hd][^>]*>([^<]*)</t[hd]>", page)
    assert cells[:5] == ["", "First", "Second", "Third: x", "Third: y"]
    assert cells[5:] == ["a", "2", "2", "1", NOTHING, "b", "2", "2", NOTHING, "yes"]


def test_numbers_of_a_curve_are_a_folded_table_over_its_places():
    rows = [
        row("a", name, at * 10.0, at=at, unit="%") for at in (1.0, 2.0) for name in "xy"
    ]
    page = drawn(*rows, axis="workers")
    cells = re.findall("<t[hd][^>]*>([^<]*)</t[hd]>", page)
    assert cells == ["", "1 workers", "2 workers", "a, x", "10", "20", "a, y", "10", "20"]
    assert len(figures(page)) == 1 and "<h2>Ratio [%]</h2>" in page


@pytest.mark.parametrize("text", ["0", "-1", "two", "", "1.5"])
def test_an_option_that_is_no_number_is_one_line(text):
    bench = Bench("s", options={"spp": text})
    with pytest.raises(OptionError, match=f"--set spp={text}: expected a whole number, 1 "):
        bench.whole("spp", 4)
    assert bench.whole("rounds", 4) == 4
    assert Bench("s", options={"spp": "16"}).whole("spp", 4) == 16
