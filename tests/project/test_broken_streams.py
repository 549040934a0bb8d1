"""The command where its environment is broken: what it says must not decide what it does.

Standard streams that are closed, full or without a reader, no home folder, a working
directory that was deleted, a compiler that is switched off.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from renderer.process.signals import TolerantStream

ROOT = Path(__file__).parents[2]
SCENE = """<scene version="3.0.0">
  <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="8"/>
    <integer name="height" value="8"/></film></sensor>
  <shape type="sphere"><point name="center" x="0" y="0" z="9"/></shape>
  <emitter type="constant"/>
</scene>
"""


@pytest.fixture
def scene(tmp_path):
    scene = tmp_path / "ball.xml"
    scene.write_text(SCENE)
    return scene


def run(line, folder, **environment):
    """Run a line of a shell in a folder; `lightproof` is the command from these sources."""
    kept = {
        name: value
        for name, value in (os.environ | environment | {"PYTHONPATH": str(ROOT)}).items()
        if value
    }
    program = f'lightproof() {{ "{sys.executable}" -m renderer "$@"; }}; set -o pipefail\n'
    return subprocess.run(
        ["bash", "-c", program + line],
        cwd=folder,
        env=kept,
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.mark.parametrize(
    "streams",
    [
        "2>&-",
        "2>/dev/full",
        ">&-",
        ">/dev/full",
        "--quiet 2>&-",
        "--quiet <&- >&- 2>&-",
        ">/dev/full 2>/dev/full",
        "| true",
    ],
)
def test_the_picture_is_written_whatever_the_streams_are(scene, streams):
    """With the status of a picture that is there, and without a traceback."""
    line = f"lightproof ball.xml --spp 1 -o a.exr -o a.png {streams}"
    done = run(line, scene.parent)
    assert done.returncode == 0, done.stderr
    assert (scene.parent / "a.exr").read_bytes().startswith(b"\x76\x2f\x31\x01")
    assert (scene.parent / "a.png").stat().st_size > 0
    assert "Error" not in done.stderr


def test_a_closed_stream_gives_its_number_to_no_picture(scene):
    """A file that is opened as number 2 would hold what a library prints."""
    line = "lightproof ball.xml --spp 1 -o a.exr"
    assert run(line, scene.parent).returncode == 0
    whole = (scene.parent / "a.exr").read_bytes()
    for closed in ("<&- >&- 2>&-", "2>&-", ">&-"):
        assert run(f"{line} {closed}", scene.parent).returncode == 0
        assert (scene.parent / "a.exr").read_bytes() == whole


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("lightproof ball.xml --explain > /dev/full", 1),
        ("lightproof --help > /dev/full", 1),
        ("lightproof ball.xml --explain 2>&-", 0),
        ("lightproof ball.xml --explain --spp 1 -o a.exr > /dev/full", 0),
        ("lightproof ball.xml --frames 0:2 --spp 1 -o a_#.png >&- 2>&-", 0),
        ("lightproof nowhere.xml 2>&-", 1),
        ("lightproof --bogus 2>/dev/full", 2),
    ],
)
def test_a_lost_answer_is_a_failure_if_it_was_all_that_was_requested(scene, line, status):
    done = run(line, scene.parent)
    assert done.returncode == status
    expected = "warning: standard output cannot be written: No space left on device\n"
    lost = "> /dev/full" in line
    assert [said for said in done.stderr.splitlines(True) if "written" in said] == (
        [expected] if lost else []
    )
    assert ("a.exr" in os.listdir(scene.parent)) == ("a.exr" in line)


def test_a_compiler_that_is_switched_off_is_one_line(scene):
    done = run("lightproof ball.xml --spp 1 -o a.exr", scene.parent, NUMBA_DISABLE_JIT="1")
    assert done.returncode == 1
    assert done.stderr.startswith("error: NUMBA_DISABLE_JIT is set; unset it")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("{absolute}/ball.xml --spp 1 -o {absolute}/a.exr", None),
        ("{absolute}/ball.xml --spp 1 -o a.exr", "a.exr: the working directory was"),
        ("ball.xml --spp 1 -o {absolute}/a.exr", "ball.xml: the working directory was"),
        ("{absolute}/ball.xml --spp 1", "name the picture with -o"),
        ("ball.xml", "the working directory was deleted"),
    ],
)
def test_a_deleted_working_directory(scene, words, said):
    line = f"mkdir gone; cd gone; rmdir ../gone; lightproof {words}"
    done = run(line.format(absolute=scene.parent), scene.parent)
    if said is None:
        assert done.returncode == 0, done.stderr
        assert (scene.parent / "a.exr").is_file()
    else:
        assert done.returncode == 1
        assert said in done.stderr and done.stderr.count("\n") == 1


def test_text_that_an_encoding_lacks_is_written_as_escapes(tmp_path):
    """A file name that is no UTF-8 reaches Python as lone surrogates."""
    with open(tmp_path / "out", "w", encoding="ascii") as file:
        stream = TolerantStream(file)
        stream.write("wrote \udcff.exr and \u00e9.exr")
        stream.flush()
    assert stream.failure is None
    assert (tmp_path / "out").read_text() == "wrote \\udcff.exr and \\xe9.exr"


def test_a_stream_that_was_closed_by_the_program_is_no_obstacle(tmp_path):
    with open(tmp_path / "out", "w") as file:
        stream = TolerantStream(file)
    for _ in range(2):
        assert stream.write("text") == 4
        stream.flush()
    assert isinstance(stream.failure, ValueError)
