"""Bad input through the command line: each case its own verdict, status and sentence.

For each way of comparing: with noise, by replay, by the ladder of tests. Both renderers
are canned (`tests/probes/canned_renderers.py`): a scene file says what each does.
Mitsuba's side is a real process, which really crashes and really hangs.
"""

from __future__ import annotations

import json
import os
import signal
import time
from types import SimpleNamespace

import pytest

from mitsuba_ref.command import validate_scenes, verdict_of_error
from mitsuba_ref.command.cli import main
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.verdicts import CURRENT, VERDICTS, exit_status, most_severe
from mitsuba_ref.reference import picture_process
from mitsuba_ref.reference.errors import (
    MitsubaCrashed,
    MitsubaError,
    MitsubaRefused,
    MitsubaTimeout,
)
from mitsuba_ref.reference.json_process import JsonProcess
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.replay import replay_scene
from reports.look.results import read_results
from tests.probes import canned_renderers

CANNED = "tests.probes.canned_renderers"
RAW = "tests.probes.raw_answers"


@pytest.fixture(autouse=True)
def canned_mitsuba(tmp_path, monkeypatch):
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(picture_process, "MODULE", CANNED)
    # a canned scene is no XML in which named files could be looked for
    monkeypatch.setattr(verdict_of_error, "check_named_files", lambda *arguments: None)


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a scene for both sides and returns its path."""

    def write_scene(name: str, ours: str = "fine", mitsuba: str = "fine"):
        path = tmp_path / f"{name}.xml"
        path.write_text(json.dumps({"ours": ours, "mitsuba": mitsuba}))
        return path

    return write_scene


def run(*arguments: object, mode: str = "noise") -> int:
    words = [*map(str, arguments), *MODES[mode]]
    return main(words, canned_renderers.render_ours)


MODES = {
    "noise": ["--checks", "statistics"],
    "replay": ["--checks", "replay"],
    "seeds": ["--checks", "statistics", "--seeds", "8"],
    "convergence": ["--checks", "statistics", "--seeds", "8", "--convergence"],
}


CASES = [
    # ours, Mitsuba's, verdict, status, what a sentence of each side holds
    ("fine", "fine", "pass", 0, []),
    ("nan", "fine", "not-finite", 3, ["our picture has 1 NaN", "x=4, y=3", "magenta"]),
    ("fine", "inf", "not-finite", 3, ["Mitsuba's picture 1 has 0 NaN and 1 infinite"]),
    ("own filter nan", "fine", "not-finite", 3, ["our picture has 1 NaN"]),
    ("fine", "own filter inf", "not-finite", 3, ["Mitsuba's picture 1 has"]),
    ("own filter one pixel", "fine", "size-mismatch", 4, ["has shape (1, 1, 3)"]),
    ("aov nan", "fine", "not-finite", 3, ["our AOV depth has 1 NaN"]),
    ("fine", "aov inf", "not-finite", 3, ["Mitsuba's AOV depth has 0 NaN and 1"]),
    ("narrow", "fine", "size-mismatch", 4, ["(18, 23, 3)", "(18, 24, 3)", "crop"]),
    ("fine", "narrow", "size-mismatch", 4, ["(18, 24, 3)", "has (18, 23, 3)"]),
    ("empty", "empty", "size-mismatch", 4, ["there is no pixel to compare"]),
    ("one channel", "one channel", "size-mismatch", 4, ["expected (height, width, 3)"]),
    ("fine", "four channels", "size-mismatch", 4, ["has shape (18, 24, 4)"]),
    ("no channels", "fine", "size-mismatch", 4, ["our picture has shape (18, 24)"]),
    ("aov narrow", "aov narrow", "size-mismatch", 4, ["our AOV depth has shape"]),
    ("bug", "fine", "broken", 5, ["KeyError: 'spheres' (in render_ours, canned", "report"]),
    ("fine", "bug", "broken", 5, ["Mitsuba, seed 1: KeyError: 'emitters'"]),
    ("fine", "crash", "mitsuba-crashed", 6, ["LLVM ERROR: no such", "SIGSEGV", "alone"]),
    ("fine", "leave", "mitsuba-crashed", 6, ["ended with status 0"]),
    ("fine", "hang", "mitsuba-timeout", 7, ["seed 1: ", "within 2 s", "--time-limit"]),
    ("refuse", "fine", "refused-by-us", 8, ["7: bsdf \"velvet\"", "renders it at 1"]),
    ("refuse", "nan", "refused-by-us", 8, ["with NaN or infinite values: 1"]),
    ("memory", "fine", "refused-by-us", 8, ["our renderer: MemoryError"]),
    ("fine", "refuse", "refused-by-mitsuba", 9, ['"velvet" not found; we render it']),
    ("refuse", "refuse", "refused-by-both", 10, ["our renderer: ", "tried as well: "]),
    ("refuse", "crash", "mitsuba-crashed", 6, ["our renderer: ", "tried as well: "]),
    ("refuse", "hang", "mitsuba-timeout", 7, ["our renderer: ", "tried as well: "]),
]  # fmt: skip

REPLAYED = [
    ("fine", "fine", "pass", 0, []),
    ("nan", "fine", "not-finite", 3, ["our picture has 1 NaN", "x=4, y=3", "magenta"]),
    ("fine", "inf", "not-finite", 3, ["has 0 NaN and 1 infinite"]),
    ("narrow", "fine", "size-mismatch", 4, ["(18, 23, 3)", "(18, 24, 3)", "crop"]),
    ("empty", "empty", "size-mismatch", 4, ["there is no pixel to compare"]),
    ("no channels", "fine", "size-mismatch", 4, ["our picture has shape (18, 24)"]),
    ("bug", "fine", "broken", 5, ["KeyError: 'spheres' (in render_ours, canned", "report"]),
    ("refuse", "fine", "refused-by-us", 8, ["7: bsdf \"velvet\"", "renders it at 1"]),
    ("fine", "refuse", "refused-by-mitsuba", 9, ['"velvet" not found; we read it']),
]  # fmt: skip

BY_SEEDS = [
    ("fine", "fine", "pass", 0, []),
    ("later nan", "fine", "not-finite", 3, ["our picture 6 has 1 NaN", "x=4, y=3"]),
    ("fine", "later inf", "not-finite", 3, ["Mitsuba's picture 6 has 0 NaN and 1"]),
    ("later narrow", "fine", "size-mismatch", 4, ["our picture 6 has shape (18, 23, 3)"]),
    ("fine", "later narrow", "size-mismatch", 4, ["(18, 24, 3)", "has (18, 23, 3)"]),
    ("later no channels", "fine", "size-mismatch", 4, ["6 has shape (18, 24),"]),
    ("later bug", "fine", "broken", 5, ["seed 6 of 8: unexpected KeyError: 'spheres'"]),
]  # fmt: skip

CONVERGING = [
    ("fine", "fine", "pass", 0, []),
    ("independent nan", "fine", "not-finite", 3, ["our picture has 1 NaN", "x=4, y=3"]),
    ("fine", "independent narrow", "size-mismatch", 4, ["Mitsuba's has (18, 23, 3)"]),
]

ALL_CASES = [
    (mode, *case)
    for mode, cases in zip(MODES, (CASES, REPLAYED, BY_SEEDS, CONVERGING), strict=True)
    for case in cases
]


NO_OTHER_FILES = SimpleNamespace(files=())

BY_A_PROCESS = {"bug", "crash", "leave", "hang", "refuse"}
"""What only a process can do; for the rest it would take two seconds each."""


@pytest.mark.parametrize(
    ("mode", "ours", "mitsuba", "verdict", "status", "words"),
    ALL_CASES,
    ids=[f"{mode}: {ours}-{mitsuba}" for mode, ours, mitsuba, *_ in ALL_CASES],
)
def test_each_case_has_its_verdict_status_and_sentence(
    write, tmp_path, capsys, monkeypatch, mode, ours, mitsuba, verdict, status, words
):
    """The same words on the terminal and in results.json."""
    if mode == "replay":  # of random numbers a canned picture knows nothing
        monkeypatch.setattr(replay_scene, "read_scene", lambda request: NO_OTHER_FILES)
        monkeypatch.setattr(replay_scene, "_refuse_early", lambda *arguments: None)
    if mode != "noise" or mitsuba not in BY_A_PROCESS:
        monkeypatch.setattr(validate_scenes, "MitsubaWorker", canned_renderers.InProcess)
    report = tmp_path / "report"
    limit = 2 if mitsuba == "hang" else 120
    given = write("case", ours, mitsuba), "--report", report, "--time-limit", limit
    assert run(*given, mode=mode) == status
    output = " ".join(capsys.readouterr().out.split())
    (scene,) = read_results(report / "results.json").scenes
    assert scene.verdict == verdict
    assert "Traceback" not in output
    for word in words:
        assert word in output
        assert any(word in reason for reason in scene.reasons)
    if status:
        assert all(VERDICTS[verdict].advice in reason for reason in scene.reasons)
    if verdict == "refused-by-both":
        assert len(scene.reasons) == 2


def test_one_bad_scene_does_not_stop_the_next(write, tmp_path):
    """After a crash another process renders; the most severe verdict decides."""
    report = tmp_path / "report"
    scenes = [
        write("crashes", mitsuba="crash"),
        write("sound"),
        write("refused", ours="refuse"),
    ]
    assert run(*scenes, "--report", report) == 6
    verdicts = [scene.verdict for scene in read_results(report / "results.json").scenes]
    assert verdicts == ["mitsuba-crashed", "pass", "refused-by-us"]


def test_a_hanging_mitsuba_is_gone_afterwards(write, tmp_path):
    """Ended, not left behind: the process does not outlive its time limit."""
    request = RenderRequest(str(write("hangs", mitsuba="hang")))
    with MitsubaWorker(60.0) as mitsuba:
        mitsuba.render(RenderRequest(str(write("sound"))), tmp_path / "sound.npz")
        assert mitsuba._process is not None
        pid = mitsuba._process._process.pid
        mitsuba.time_limit = 0.5
        with pytest.raises(MitsubaTimeout, match=r"within 0.5 s"):
            mitsuba.render(request, tmp_path / "hangs.npz")
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_the_last_words_are_those_of_this_request(write, tmp_path):
    """An error that Mitsuba printed for an earlier scene is not the cause of a crash."""
    with JsonProcess(CANNED, {}, name="Mitsuba", time_limit=60.0) as mitsuba:
        mitsuba._errors.write(b"error: of an earlier scene\n")
        mitsuba._errors.flush()
        request = RenderRequest(str(write("leaves", mitsuba="leave")))
        with pytest.raises(MitsubaCrashed, match="status 0: no message"):
            mitsuba.ask({"request": vars(request), "path": str(tmp_path / "x.npz")})


@pytest.mark.parametrize(
    ("raw", "kind", "words"),
    [
        ("not JSON\n", MitsubaError, "is no answer"),
        ("[1]\n", MitsubaError, "is no answer"),
        ('{"half', MitsubaCrashed, "ended with status"),
        ('{"error": "no", "refused": true}\n', MitsubaRefused, "Mitsuba: no"),
        ('{"error": "no"}\n', MitsubaError, "Mitsuba: no"),
    ],
)
def test_an_answer_that_is_none_is_an_error(raw, kind, words):
    job = {"raw": raw, "seconds": 0}
    with pytest.raises(MitsubaError, match=words) as caught:
        JsonProcess(RAW, job, name="Mitsuba", time_limit=60.0)
    assert type(caught.value) is kind


def test_a_process_that_hangs_in_the_middle_of_a_line_is_ended():
    job = {"raw": '{"half', "seconds": 3600}
    start = time.monotonic()
    with pytest.raises(MitsubaTimeout):
        JsonProcess(RAW, job, name="Mitsuba", time_limit=1.5)
    assert time.monotonic() - start < 60.0


def test_a_stopped_process_is_ended_too(write, tmp_path):
    """SIGSTOP leaves a process alive that does nothing: the time limit still holds."""
    with JsonProcess(CANNED, {}, name="Mitsuba", time_limit=60.0) as mitsuba:
        os.kill(mitsuba._process.pid, signal.SIGSTOP)
        mitsuba.time_limit = 0.2
        with pytest.raises(MitsubaTimeout):
            mitsuba.ask({"request": {}, "path": str(tmp_path / "x.npz")})


def test_statuses_are_all_different_and_the_most_severe_is_the_smallest():
    """A shell can tell them apart; 2 and 130 are taken, and no scene at all is no pass."""
    statuses = [VERDICTS[verdict].status for verdict in CURRENT]
    assert len(set(statuses)) == len(statuses)
    assert not {2, 130} & set(statuses)
    assert [verdict for verdict in CURRENT if not VERDICTS[verdict].status] == ["pass"]
    assert statuses[:-1] == sorted(statuses[:-1])
    assert exit_status([]) != 0
    for verdict in CURRENT:
        assert most_severe(["pass", verdict]) == verdict
        assert exit_status([verdict, "pass"]) == VERDICTS[verdict].status


def test_help_names_every_verdict_with_its_status(capsys):
    assert main(["--help"]) == 0
    words = capsys.readouterr().out.split()
    for verdict in CURRENT:
        assert str(VERDICTS[verdict].status) == words[words.index(f"{verdict}:") - 1]


def test_a_report_that_cannot_be_written_is_no_traceback(write, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert run(write("sound"), "--report", tmp_path / "file") == 2
    assert "lightproof-validate: " in capsys.readouterr().err
