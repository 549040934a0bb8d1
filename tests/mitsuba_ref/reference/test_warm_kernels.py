"""Kernels compiled ahead in other processes, found by the process that measures."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from mitsuba_stand_in import stand_in, write_scene

from mitsuba_ref.command import cli, compile_ahead, validate_scenes
from mitsuba_ref.records.options import Options


@pytest.fixture
def scenes(tmp_path):
    kinds = {"noisy": False, "still": True}
    return [
        write_scene(tmp_path / name, deterministic=still, width=12, height=11, spp=4)
        for name, still in kinds.items()
    ]


@pytest.fixture(autouse=True)
def own_stamps(tmp_path, monkeypatch):
    monkeypatch.setattr(compile_ahead, "KERNEL_CACHE", tmp_path / "kernels")


def test_each_scene_needs_a_picture_and_its_aovs_with_the_edits_of_a_comparison(scenes):
    requests = compile_ahead.kernel_requests(scenes, Options(size="test"))
    assert [(r.kind, r.spp, r.box_filter) for r in requests] == [
        ("image", 1, True),
        ("aovs", None, True),
        ("image", 1, False),
        ("aovs", None, False),
    ]


def test_what_a_stamp_says_is_done_is_not_done_again(scenes):
    first, *others = compile_ahead.kernel_requests(scenes, Options(size="test"))
    compile_ahead._stamp(first).parent.mkdir(parents=True)
    compile_ahead._stamp(first).touch()
    assert compile_ahead.kernel_requests(scenes, Options(size="test")) == others


def test_a_scene_with_a_wrong_proof_is_left_to_its_own_comparison(scenes):
    scenes[0].with_name("proof.toml").write_text("titel = 1")
    assert len(compile_ahead.kernel_requests(scenes, Options(size="test"))) == 2


def answering(sentence: str) -> str:
    """A worker that says it is ready, and then does this for each request."""
    return f"import sys\nprint('{{}}', flush=True)\nfor line in sys.stdin: {sentence}"


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        (answering("print('{}', flush=True)"), [1, 2, 3, 4]),
        (answering("break"), []),
        ("", []),
    ],
    ids=["answers", "ends in the middle", "ends at once"],
)
def test_progress_counts_answers_and_a_dead_worker_ends_the_warm_up(
    scenes, monkeypatch, program, expected
):
    """Whatever happens to a worker, the comparison goes on and compiles for itself."""
    real = subprocess.Popen

    def instead(command, **options):
        return real([sys.executable, "-c", program], **options)

    monkeypatch.setattr(subprocess, "Popen", instead)
    seen: list[int] = []
    compile_ahead.compile_kernels(
        compile_ahead.kernel_requests(scenes, Options(size="test")), seen.append
    )
    assert seen == expected


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def test_only_our_own_renderer_is_warmed_and_only_for_several_scenes(scenes, monkeypatch):
    """One scene compiles in the process that renders it; a stand-in compiles nothing."""
    asked: list[list[str]] = []

    def note(requests, progress):
        asked.append([request.kind for request in requests])

    monkeypatch.setattr(validate_scenes, "compile_kernels", note)
    monkeypatch.setattr(validate_scenes, "validate_scene", interrupt)
    names = [os.fspath(scene) for scene in scenes]
    assert cli.main([*names, "--size", "test"]) == 130
    assert asked == [["image", "aovs", "image", "aovs"]]
    assert cli.main([*names, "--size", "test"], stand_in()) == 130
    assert cli.main([names[0], "--size", "test"]) == 130
    assert len(asked) == 1
