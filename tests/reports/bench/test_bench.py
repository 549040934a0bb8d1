"""The bench: what is measured is stored line by line, and stays when a command stops."""

from __future__ import annotations

import json
import math
import statistics
from contextlib import contextmanager

import numpy as np
import pytest

from reports import command
from reports.bench import runner, study, timing
from reports.bench.rows import Done, Row, Run, joined
from reports.bench.runner import Request, run_study
from reports.bench.store import Store
from reports.bench.study import Study, find_study, study_names
from reports.errors import ReportError
from reports.pages.study_page import study_page


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "data", tmp_path / "measured")


@pytest.fixture(autouse=True)
def one_commit(monkeypatch):
    """Every run is of the same clean commit."""
    values = {"created": "2026-01-01", "commit": "abc", "command": "c", "machine": {}}
    monkeypatch.setattr(
        runner, "circumstances", lambda module, words: {**values, "versions": {}}
    )


def made(measure, **given):
    return Study(title="T", sentence="S?", minutes=1, measure=measure, **given)


def squares(case, bench):
    for at in (1.0, 2.0):
        yield Row(case=case, contender="x", quantity="square", value=at**2, at=at)


def request(store, tmp_path, **given):
    return Request(store, ["s"], folder=tmp_path, **given)


def run(one, store, tmp_path, **given):
    return run_study("s", one, request(store, tmp_path, **given), lambda stage: None)


def test_rows_come_back_as_they_were_yielded(store, tmp_path):
    assert run(made(squares, cases=("a", "b")), store, tmp_path) == []
    table = store.read("s")
    assert [row.value for row in table.curve(case="b", contender="x")] == [1.0, 4.0]
    assert table.value(case="a", at=2.0) == 4.0
    assert table.value(case="a", at=3.0) is None
    assert table.distinct("case") == ["a", "b"]
    assert {row.study for row in table} == {"s"}
    assert table.newest.commit == "abc"
    assert len(joined([table, table])) == 2 * len(table)
    with pytest.raises(ValueError, match="2 rows"):
        table.value(case="a")


def test_a_place_of_0_stays(store):
    """0.0 equals False, which is left out of lines."""
    row = Row(case="a", quantity="q", value=1.0, at=0.0)
    store.append("s", [row, Done(done="a", run="", seconds=1.0)])
    assert [found.at for found in store.read("s").curve(case="a")] == [0.0]


def test_what_json_cannot_hold_becomes_none(store):
    row = Row(case="a", quantity="q", value=np.float64(np.nan), interval=(0.0, math.inf))
    store.append("s", [row, Done(done="a", run="", seconds=1.0)])
    (found,) = store.read("s")
    assert (found.value, found.interval) == (None, None)


def test_an_interrupt_keeps_the_cases_that_ended(store, tmp_path):
    """The case that was stopped has rows in the file and none in the table."""
    seen = []

    def measure(case, bench):
        seen.append(case)
        yield Row(case=case, quantity="q", value=1.0)
        if seen == ["a", "b"]:
            raise KeyboardInterrupt

    one = made(measure, cases=("a", "b", "c"))
    with pytest.raises(KeyboardInterrupt):
        run(one, store, tmp_path)
    assert store.read("s").distinct("case") == ["a"]
    assert len(store.everything("s")) == 2
    run(one, store, tmp_path)  # goes on where it was
    assert seen == ["a", "b", "b", "c"]
    assert store.read("s").distinct("case") == ["a", "b", "c"]
    run(one, store, tmp_path)
    assert len(seen) == 4
    run(one, store, tmp_path, again=True)
    assert len(seen) == 7


def test_a_session_is_open_for_all_cases_that_are_measured(store, tmp_path):
    """It is not opened where nothing is left to be measured."""
    told = []

    @contextmanager
    def session(cases, bench):
        told.append(list(cases))
        yield "shared"
        told.append("closed")

    def measure(case, bench):
        assert told == [["a", "b"]]
        yield Row(case=case, quantity="session", value=bench.session)

    one = made(measure, cases=("a", "b"), session=session)
    assert run(one, store, tmp_path) == [] and run(one, store, tmp_path) == []
    assert told == [["a", "b"], "closed"]
    assert [row.value for row in store.read("s")] == ["shared"] * 2


def test_a_case_that_raises_is_a_fault_and_the_others_are_measured(store, tmp_path):
    def measure(case, bench):
        if case == "a":
            raise ValueError("no light")
        yield from squares(case, bench)

    faults = run(made(measure, cases=("a", "b")), store, tmp_path)
    assert faults == ["s: a: no light"]
    assert store.read("s").faults == ["a: no light"]
    assert len(store.read("s").where(case="b")) == 2


def test_a_full_run_counts_before_a_quick_one(store, tmp_path):
    def measure(case, bench):
        yield Row(case=case, quantity="q", value="quick" if bench.quick else "full")

    one = made(measure)
    run(one, store, tmp_path, quick=True)
    assert store.read("s").value(quantity="q") == "quick"
    run(one, store, tmp_path)
    assert store.read("s").value(quantity="q") == "full"
    run(one, store, tmp_path, quick=True)
    assert store.read("s").value(quantity="q") == "full"


def test_a_full_measurement_is_not_repeated_after_a_quick_one(store, tmp_path):
    seen = []

    def measure(case, bench):
        seen.append(bench.quick)
        yield Row(case=case, quantity="q", value=1.0)

    for quick in (False, True, False, True):
        run(made(measure), store, tmp_path, quick=quick)
    assert seen == [False, True]


def test_what_a_case_reads_decides_whether_it_is_measured_again(store, tmp_path):
    held = ["first"]
    one = made(squares, inputs=lambda case, options: held[0])
    run(one, store, tmp_path)
    before = len(store.everything("s"))
    run(one, store, tmp_path)
    assert len(store.everything("s")) == before
    held[0] = "second"
    run(one, store, tmp_path)
    assert len(store.everything("s")) == 2 * before


def test_options_are_the_studys_own(store, tmp_path):
    def measure(case, bench):
        yield Row(case=case, quantity="q", value=bench.options["spp"])

    one = made(measure, options={"spp": "samples per pixel"})
    run(one, store, tmp_path, options={"spp": "4"})
    assert store.read("s").value(quantity="q") == "4"
    with pytest.raises(ReportError, match="no option 'size'; there are: spp"):
        run(one, store, tmp_path, options={"size": "4"})
    with pytest.raises(ReportError, match="case 'z' is unknown; there are all"):
        run(one, store, tmp_path, cases=["z"], options={"spp": "4"})


def test_a_study_that_goes_on_sees_what_was_done(store, tmp_path):
    def measure(case, bench):
        done = sum(row.value for row in bench.earlier.where(quantity="done"))
        yield Row(case=case, quantity="done", value=done + 1.0)

    one = made(measure, goes_on=True)
    for _ in range(3):
        run(one, store, tmp_path)
    assert [row.value for row in store.everything("s")] == [1.0, 2.0, 4.0]


def test_half_a_line_is_dropped_and_a_damaged_one_is_named(store, tmp_path):
    run(made(squares), store, tmp_path)
    path = store.folder / "s.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"case": "al')
    assert len(store.read("s")) == 2
    store.append("s", [Row(case="b", quantity="q", value=1.0)])
    assert len(store.everything("s")) == 3
    for damage, says in ((b"[1]\n", "expected an object"), (b"{]\n", "Expecting")):
        path.write_bytes(whole + damage)
        with pytest.raises(ReportError, match=rf"s\.jsonl:5: {says}"):
            store.read("s")


def test_the_repository_keeps_full_measurements_of_a_commit(store, tmp_path, monkeypatch):
    run(made(squares), store, tmp_path, quick=True)
    assert "nothing new" in store.keep("s")
    run(made(squares), store, tmp_path)
    assert store.keep("s") == "s: 2 rows kept"
    assert "nothing new" in store.keep("s")
    assert len(store.read("s")) == len(store.read("s").where(study="s")) == 2
    run(made(squares, cases=("all", "more")), store, tmp_path, cases=["more"])
    assert store.keep("s") == "s: 2 rows kept"  # a case that came later
    assert len(store.read("s")) == 4
    of_changes = Run(run="r", created="2027", command="c", commit="abc-dirty")
    done = Done(done="all", run="r", seconds=1.0)
    store.append("s", [of_changes, Row(case="all", quantity="q", value=1.0, run="r"), done])
    assert "nothing new" in store.keep("s")


def test_paths_of_this_machine_do_not_reach_the_file(store, tmp_path):
    store.append("s", [Row(case="a", quantity="fault", value=f"{tmp_path}/x/y.exr: no")])
    assert str(tmp_path) not in (store.folder / "s.jsonl").read_text()


def test_every_study_says_what_it_is():
    for name in study_names():
        one = find_study(name)
        assert one.title and one.sentence and one.minutes > 0, name
        assert one.chosen((), quick=True), name
    with pytest.raises(ReportError, match="study 'none' is unknown; there are"):
        find_study("none")


def test_a_new_study_is_one_file(tmp_path, monkeypatch, capsys):
    """A file of ten lines is measured, stored and has a page, without HTML."""
    (tmp_path / "cubes.py").write_text(
        "from reports.bench.rows import Row\n"
        "from reports.bench.study import Study\n"
        "def measure(case, bench):\n"
        "    for at in (1.0, 2.0, 3.0):\n"
        "        yield Row(case=case, quantity='cube', value=at**3, at=at, unit='m')\n"
        "    yield Row(case=case, quantity='sum', value=36.0, interval=(35.0, 37.0))\n"
        "STUDY = Study(title='Cubes', sentence='How do cubes grow?', minutes=0.1,\n"
        "              axis='edge', measure=measure)\n"
    )
    monkeypatch.setattr(study, "FOLDER", tmp_path)
    monkeypatch.setattr("reports.studies.__path__", [str(tmp_path)])
    out = tmp_path / "out"
    assert command.main(["cubes", "--out", str(out)]) == 0
    page = (out / "cubes.html").read_text()
    assert "How do cubes grow?" in page and "36 (35 to 37)" in page
    assert page.count("data-figure=") == 1
    lines = (out / "data" / "cubes.jsonl").read_text().splitlines()
    assert len(lines) == 1 + 4 + 1
    assert json.loads(lines[1])["at"] == 1.0
    assert command.main(["cubes", "--case", "z", "--out", str(out)]) == command.WRONG_USE
    assert "case 'z' is unknown" in capsys.readouterr().err


def test_a_page_shows_faults_and_pictures_first(store, tmp_path):
    def measure(case, bench):
        yield bench.picture(case, "ball", np.zeros((2, 3, 3), np.uint8))
        yield Row(case=case, quantity="fault", value="a <ray> leaks")

    one = made(measure)
    run(one, store, tmp_path)
    text = study_page("s", one, store.read("s"))
    assert "a &lt;ray&gt; leaks" in text
    assert (tmp_path / "pictures/s/all-ball.png").is_file()
    assert 'src="pictures/s/all-ball.png"' in text


def test_contenders_take_turns_and_enough_is_enough():
    order = []

    def contender(name):
        return lambda turn: order.append((name, turn)) or 0.5

    times = timing.take_turns({"a": contender("a"), "b": contender("b")}, 2)
    assert times == {"a": [0.5, 0.5], "b": [0.5, 0.5]}
    assert order == [("a", 0), ("b", 0), ("a", 1), ("b", 1)]
    assert len(timing.take_turns({"a": contender("a")}, 9, enough=0.0, least=3)["a"]) == 3


def test_intervals_hold_what_they_promise():
    """Coverage over 2000 samples of 9: the intervals are of 95 % or more, within noise."""
    rng = np.random.default_rng(1)
    samples = np.exp(rng.standard_normal((2000, 9)))
    medians = [timing.median_interval(list(one)) for one in samples]
    assert statistics.fmean(low <= 1.0 <= high for low, high in medians) > 0.94
    others = np.exp(rng.standard_normal((2000, 9)))
    pairs = [timing.ratio(a, b) for a, b in zip(samples, others, strict=True)]
    inside = statistics.fmean(low <= 1.0 <= high for _, (low, high) in pairs)
    assert 0.93 < inside < 0.97
    assert timing.ratio([2.0], [1.0]) == (2.0, (0.0, math.inf))
    assert timing.median_interval([3.0, 1.0, 2.0]) == (1.0, 3.0)
