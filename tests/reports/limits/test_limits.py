"""The atlas of limits: both sides of every boundary, the search for it, the page."""

from __future__ import annotations

import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from drawn_charts import figure, figures, points

from reports import command
from reports.atlas import Case, Method, every_case, read_atlas
from reports.bench.rows import Done, Row, Run
from reports.bench.store import newest
from reports.bench.study import find_study
from reports.charts.boundary import BoundedCurve, boundary_chart
from reports.errors import ReportError
from reports.look.formatting import marked_up
from reports.pages.limits_page import gives_way, limits_page
from reports.studies.limits import MEASURES, PICTURES, STUDY, measure_method

CASES = every_case()
EACH = [
    pytest.param(case, name, id=name, marks=[pytest.mark.slow] if case.slow else [])
    for case in CASES.values()
    for name in case.methods
]
CASE = Case(
    name="power",
    title="Powers",
    stress="x",
    measured="x^2",
    strengths=(0.1, 1.0, 10.0),
    tolerance=4.0,
    why="So it is.",
    instead="Another.",
    methods={"square": Method(title="x^2", holds=1.0, fails=10.0)},
)


def rows_of(measured, case=CASE, **method):
    """What is measured of one method, by quantity."""
    methods = {"square": msgspec.structs.replace(case.methods["square"], **method)}
    case = msgspec.structs.replace(case, methods=methods)
    return list(measure_method(case, "square", measured))


def faults(*given, **method):
    return [row.value for row in rows_of(*given, **method) if row.quantity == "fault"]


# ------------------------------------------------------------------------------ the atlas


@pytest.mark.parametrize(("case", "name"), EACH)
def test_both_sides_of_the_boundary(case, name):
    """A method that no longer fails is a fault too: its case has gone blind.

    Nothing is random: seeds are fixed, so the rate of false alarms is that of another
    machine's rounding, which the distance between the two strengths covers.
    """
    measured, method = MEASURES[name], case.methods[name]
    tolerance, holds = case.tolerance_of(name), case.holds(name)
    before = measured(holds)
    assert before <= tolerance, f"{before} at {holds}"
    if method.fails is not None:
        behind = measured(method.fails)
        assert not behind <= tolerance, f"{behind} at {method.fails}"


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_show_something(name):
    picture = PICTURES[name]()
    assert picture.dtype == np.uint8 and picture.ndim == 3 and picture.shape[2] == 3
    assert np.std(picture) > 10.0


def test_what_is_measured_is_what_the_atlas_names():
    assert {name for case in CASES.values() for name in case.methods} == MEASURES.keys()
    assert {case.name for case in CASES.values() if case.caption} == PICTURES.keys()
    least = {"numbers": 40, "structures": 40, "light": 30, "comparing": 25}
    for name, chapter in read_atlas().items():
        assert sum(len(case.methods) for case in chapter.cases) >= least[name]


def test_texts_are_sentences_and_names_are_anchors():
    cases = [case for chapter in read_atlas().values() for case in chapter.cases]
    methods = [name for case in cases for name in case.methods]
    assert len({case.name for case in cases}) == len(cases)
    assert len(set(methods)) == len(methods)
    for case in cases:
        for name in (case.name, *case.methods):
            assert re.fullmatch(r"[A-Za-z0-9]+(-[A-Za-z0-9]+)*", name), name
        # a name of a method may be that of its own case alone
        assert case.name not in set(methods) - set(case.methods)
        for sentence in filter(None, (case.why, case.instead, case.caption)):
            assert len(sentence) > 5 and sentence.endswith("."), case.name
        for phrase in (case.title, case.stress, case.measured, case.source):
            assert phrase.strip() == phrase != "", case.name


def test_strengths_go_through_the_boundary():
    for case in CASES.values():
        assert list(case.strengths) == sorted(set(case.strengths)), case.name
        for name, method in case.methods.items():
            if method.fails is None:
                assert method.holds is None, name
            else:
                ends = sorted((case.holds(name), method.fails))
                assert case.strengths[0] <= ends[0] < ends[1], name
                # within a factor of 1000 it is measured; farther apart it is a guess
                most = 1e5 if name == "slabs-margin-too-small" else 1e3
                assert ends[1] <= most * max(ends[0], 1.0), name


def test_the_study_leaves_out_slow_cases_when_quick():
    quick = set(STUDY.chosen((), quick=True))
    assert quick == {name for name, case in CASES.items() if not case.slow}
    assert set(STUDY.chosen((), quick=False)) == set(CASES) > quick
    assert find_study("limits") is STUDY


# ------------------------------------------------------------------------------ the search


def test_the_boundary_is_found_by_halving():
    """x^2 leaves 4 at 2: five halvings of a decade leave a factor of 10^(1/32).

    What is measured twice, as both sides on the curve are, is measured once.
    """
    seen = []
    rows = rows_of(lambda x: seen.append(x) or x**2)
    assert len(seen) == len(set(seen)) == 3 + 5
    assert [(row.quantity, row.at, row.value) for row in rows[:-1]] == [
        ("before", 1.0, 1.0),
        ("behind", 10.0, 100.0),
        ("curve", 0.1, pytest.approx(0.01)),
        ("curve", 1.0, 1.0),
        ("curve", 10.0, 100.0),
    ]
    (low, high), boundary = rows[-1].interval, rows[-1].quantity
    assert boundary == "boundary" and low <= 2.0 < high
    assert high / low == pytest.approx(10.0 ** (1 / 32))


def test_a_boundary_in_the_other_direction():
    """1 / x^2 leaves 4 at 1/2, and fails below."""
    case = msgspec.structs.replace(CASE, strengths=(0.01, 0.1, 1.0, 10.0))
    rows = rows_of(lambda x: x**-2, case, holds=1.0, fails=0.1)
    assert rows[-1].interval[0] <= 0.5 < rows[-1].interval[1]
    (fault,) = faults(lambda x: x**-2 * (x > 0.05), case, holds=1.0, fails=0.1)
    assert fault.startswith("square fails at 0.01 by the atlas; measured: 0,")


@pytest.mark.parametrize("value", [5.0, float("nan"), float("inf")])
def test_a_method_that_fails_too_early_is_a_fault(value):
    """What is not a number is a failure on either side."""
    assert all("holds at" in fault for fault in faults(lambda x: value))
    rows = rows_of(lambda x: value)
    assert len([row for row in rows if row.quantity == "fault"]) == 2
    assert not [row for row in rows if row.quantity == "boundary"]


def test_a_method_that_no_longer_fails_is_a_fault():
    (fault,) = faults(lambda x: 0.0)
    assert fault == "square fails at 10 by the atlas; measured: 0, tolerance 4"


@pytest.mark.parametrize(
    ("strengths", "method", "count"),
    [
        ((0.1, 1.0, 3.0), {"holds": None, "fails": None}, 1),  # 9 is over 4
        ((0.1, 1.0, 1.9), {"holds": None, "fails": None}, 0),
        ((-3.0, 1.0, 10.0), {}, 1),  # before the side that holds
        ((0.1, 3.0, 10.0), {"fails": 3.0}, 0),
        ((0.1, 3.0, 10.0), {"tolerance": 100.0}, 1),
    ],
)
def test_the_whole_curve_is_judged(strengths, method, count):
    """Both sides alone are right in each: x^2 is 1 at 1, and 100 at 10."""
    case = msgspec.structs.replace(CASE, strengths=strengths)
    assert len(faults(lambda x: x**2, case, **method)) == count


# -------------------------------------------------------------------------------- the page


def drawn(rows):
    run = Run(run="", created="2026", command="c")
    ends = [Done(done=case, run="", seconds=1.0) for case in {row.case for row in rows}]
    return limits_page("limits", STUDY, newest([run, *rows, *ends]))


@pytest.fixture
def rows():
    case = CASES["offset-acne"]
    found = [
        row
        for name in case.methods
        for row in measure_method(
            case, name, lambda x, limit=case.methods[name].fails or 1e9: float(x >= limit)
        )
    ]
    return [*found, Row(case=case.name, quantity="picture", value="pictures/acne.png")]


def test_a_case_has_picture_chart_boundary_and_texts(rows):
    text = drawn(rows)
    case = CASES["offset-acne"]
    assert text.count('src="pictures/acne.png"') == 2  # in the gallery and in its place
    assert text.count('id="offset-acne"') == text.count('id="offset-mitsuba-acne"') == 1
    assert case.title in text and marked_up(case.why) in text
    assert "fails from 10<sup>5</sup> on" in text
    assert "no limit up to 10<sup>6</sup>" in text
    assert len(figures(text)) == 1 and "methods hold and fail" in text
    assert "http" not in text.split('id="plotly"')[0].replace("http-equiv", "")
    assert 'id="sum"' not in text  # it was not measured


def test_only_what_differs_is_marked(rows):
    fault = Row(case="offset-acne", quantity="fault", value="a <fault>")
    text = drawn([*rows, fault])
    assert "1 of 1 cases is not as expected" in text and "a &lt;fault&gt;" in text


def test_cases_of_another_atlas_are_left_out(rows):
    other = [replace(row, case="none") for row in rows]
    assert 'id="none"' not in drawn([*rows, *other])
    with pytest.raises(ReportError, match="no case of the atlas"):
        drawn(other)


def test_the_command_measures_a_case_and_draws_it(tmp_path):
    assert command.main(["limits", "--case", "half-float", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "limits.html").read_text()
    assert 'src="pictures/limits/half-float-failure.png"' in text
    assert (tmp_path / "pictures/limits/half-float-failure.png").is_file()


@pytest.mark.parametrize(
    ("method", "interval", "says"),
    [
        ({}, (1.9, 2.1), "fails from 2.1 on"),
        ({}, (1.0, 10.0), "fails between 1 and 10"),
        ({"holds": 0.0, "fails": 1.0}, (0.0, 1.0), "fails between 0 and 1"),
        ({"holds": 1.0, "fails": 0.1}, (0.5, 0.6), "fails below 0.5"),
        ({"fails": None}, None, "no limit up to 1"),
        ({}, None, "see the fault"),
    ],
)
def test_the_boundary_in_words(method, interval, says):
    methods = {"square": msgspec.structs.replace(CASE.methods["square"], **method)}
    case = msgspec.structs.replace(CASE, methods=methods)
    assert gives_way(case, "square", interval) == says


def test_code_and_exponents_are_marked():
    assert marked_up("`a^2 <b>` or 2^n") == "<code>a^2 &lt;b&gt;</code> or 2^n"
    assert marked_up("10^-3 < n^(1/3)") == "10<sup>-3</sup> &lt; n<sup>1/3</sup>"
    assert marked_up("1e-8 or 3.4e38") == "10<sup>-8</sup> or 3.4 · 10<sup>38</sup>"


def test_zero_and_no_number_have_places_on_a_logarithmic_axis():
    curve = ((1.0, 0.0), (10.0, 1e-4), (100.0, 1.0), (1e3, None))
    chart = figure(
        boundary_chart(
            [BoundedCurve("a", curve, (10.0, 100.0)), BoundedCurve("b", curve[:1])],
            tolerance=0.01,
            x_label="x",
            y_label="y",
            description="d",
        )
    )
    level, first, second = chart["data"]
    assert points(level) == [(1.0, 0.01), (1e3, 0.01)]
    assert points(first) == [(1.0, 1e-5), (10.0, 1e-4), (100.0, 1.0), (1e3, 10.0)]
    assert first["text"] == ["0", "", "", "no number"] and second["text"] == [""]
    assert points(second) == [(1.0, 1e-5)]
    (band,) = chart["layout"]["shapes"]
    assert (band["x0"], band["x1"]) == (10.0, 100.0)
    assert chart["layout"]["xaxis"]["type"] == chart["layout"]["yaxis"]["type"] == "log"
    with pytest.raises(ValueError, match="at least one point"):
        boundary_chart([], tolerance=1, x_label="", y_label="", description="")
