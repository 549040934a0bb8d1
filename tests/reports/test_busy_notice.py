"""A page made on a busy machine says so at its top, whichever page of seconds it is."""

from __future__ import annotations

import json

import pytest
from report_samples import compared, scene

from mitsuba_ref.records import other_programs
from mitsuba_ref.records.machine import describe_machine
from mitsuba_ref.records.other_programs import KEY, busy_sentence, cores_of_other_programs
from reports.bench.store import Store
from reports.bench.study import find_study
from reports.pages.index_page import index_page

BUSY, QUIET = {"cores": 2, KEY: 1.7}, {"cores": 2, KEY: 0.1}


def index(folder, machine):
    compared(folder, scene("one", "pass"))
    path = folder / "data/scenes.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        if "done" in line:
            line["cores_of_other_programs"] = machine.get(KEY)
        if "created" in line:
            line["machine"] = {"cores": 2}
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    table = Store(folder / "data", folder / "none").read("scenes")
    return index_page({"scenes": (find_study("scenes"), table)}, folder)


def test_the_index_says_under_its_title_that_the_machine_was_busy(tmp_path):
    """In the worst of its cases."""
    busy = index(tmp_path / "busy", BUSY)
    under = busy.partition("</h1>")[2].lstrip().removeprefix("<div>").lstrip()
    assert under.startswith('<p class="banner warning" role="note">⚠ The machine was busy')
    assert "other programs took 1.7 of its 2 cores" in under
    assert "was busy" not in index(tmp_path / "quiet", QUIET)
    assert "was busy" not in index(tmp_path / "unknown", {})


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
    monkeypatch.setattr(
        other_programs._SINCE_IMPORT, "_begin", other_programs._Times(0.0, 0.0, 0.0)
    )
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
