"""A page made on a busy machine says so at its top, whichever page of seconds it is."""

from __future__ import annotations

import dataclasses
import importlib
import re
from pathlib import Path

import pytest
from report_samples import scene, write_results
from reports.speed_accuracy.page import speed_accuracy_page

import reports
from mitsuba_ref.records import other_programs
from mitsuba_ref.records.machine import describe_machine
from mitsuba_ref.records.other_programs import KEY, busy_sentence, cores_of_other_programs
from reports.bench.rows import Table
from reports.bench.store import Store
from reports.bench.study import find_study
from reports.records.results import read_results
from reports.scenes_page.page import results_page

BUSY, QUIET = {"cores": 2, KEY: 1.7}, {"cores": 2, KEY: 0.1}
TEMPLATES = Path(reports.__file__).parent / "templates"


def index(folder, machine):
    path = write_results(folder, [scene("one", "pass")])
    results = read_results(path)
    object.__setattr__(results, "machine", machine)
    return results_page(results, folder)


def page_of(name, machine):
    """Return the page of a study whose kept runs were on that machine."""
    study, kept = find_study(name), Store(Path("nowhere")).everything(name)
    runs = {
        key: dataclasses.replace(run, machine=machine) for key, run in kept.runs.items()
    }
    module, _, function = study.page.partition(":")
    draw = getattr(importlib.import_module(module), function)
    return draw(name, study, Table(kept.rows, runs, kept.done))


PAGES = {
    "index": index,
    "needs": lambda _, machine: page_of("needs", machine),
    "soak": lambda _, machine: page_of("soak", machine),
    "speed_accuracy": lambda _, machine: speed_accuracy_page(curves(machine=machine)),
}


@pytest.mark.parametrize("page", PAGES.values(), ids=PAGES)
def test_the_notice_is_the_first_thing_under_the_title(page, tmp_path):
    busy = page(tmp_path, BUSY)
    under = busy.partition("</h1>")[2].lstrip()
    assert under.startswith('<p class="banner warning" role="note">⚠ The machine was busy')
    assert "other programs took 1.7 of its 2 cores" in under
    assert "was busy" not in page(tmp_path, QUIET)
    assert "was busy" not in page(tmp_path, {"cores": 2})  # a file of before


def test_every_page_that_tells_its_machine_tells_that_it_was_busy():
    """A page that is added later is asked for it here; a history has many machines."""
    pages = [
        path
        for path in TEMPLATES.rglob("*.html")
        if "<h1>" in (text := path.read_text()) and "provenance(" in text
    ]
    assert len(pages) >= 8
    for path in pages:
        text = path.read_text()
        assert re.search(r"</h1>\n\{\{ busy_notice\(", text), path.name


def process(folder, pid, parent, *ticks, name="python"):
    """Write what /proc says of a process: user, system, and both of its ended children."""
    place = folder / str(pid)
    place.mkdir()
    words = [str(pid), f"({name})", "S", str(parent), *["0"] * 9, *map(str, ticks), "20"]
    (place / "stat").write_text(" ".join(words))


def test_own_work_and_that_of_descendants_is_not_of_others(tmp_path, monkeypatch):
    """10 s of clock: 15 s of the machine, of which 9 s are this process and its tree."""
    tick = other_programs.os.sysconf("SC_CLK_TCK")
    own = other_programs.os.getpid()
    (tmp_path / "stat").write_text(
        f"cpu {8 * tick} {tick} {3 * tick} 999 999 {tick} {tick} {tick} 0 0\ncpu0 1\n"
    )
    process(tmp_path, own, 1, 3 * tick, tick, tick, 0)
    process(tmp_path, own + 1, own, 2 * tick, 0, 0, 0, name="a (b) c")
    process(tmp_path, own + 2, own + 1, 0, 0, tick, tick)
    process(tmp_path, own + 3, 1, 6 * tick, 0, 0, 0)
    monkeypatch.setattr(other_programs, "PROC", tmp_path)
    monkeypatch.setattr(other_programs, "_BEGIN", other_programs._Times(0.0, 0.0, 0.0))
    monkeypatch.setattr(other_programs.time, "monotonic", lambda: 10.0)
    assert cores_of_other_programs() == pytest.approx(0.6)


def test_where_proc_does_not_tell_nothing_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(other_programs, "PROC", tmp_path)
    assert cores_of_other_programs() is None
    assert busy_sentence(describe_machine()) == ""


@pytest.mark.parametrize("cores", [1, 2, 64])
def test_a_tenth_of_the_cores_is_busy(cores):
    """What a quiet machine does by the way is less."""
    assert busy_sentence({"cores": cores, KEY: 0.1 * cores}) == ""
    assert busy_sentence({"cores": cores, KEY: 0.11 * cores})


@pytest.mark.parametrize("machine", [{}, {"cores": 2}, {"cores": "two", KEY: "all"}])
def test_a_file_may_tell_nothing(machine):
    assert busy_sentence(machine) == ""
