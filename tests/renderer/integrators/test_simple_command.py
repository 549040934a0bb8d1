"""`python -m renderer.simple`: options, files, progress and Ctrl-C as of `lightproof`."""

from __future__ import annotations

import dataclasses
import io
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from processes import run_python

from renderer.command.cli import main as lightproof
from renderer.rendering.picture.image import Image
from renderer.scene_file import read_file
from renderer.simple import command
from renderer.simple.command import main
from renderer.simple.path_tracer import render

pytestmark = pytest.mark.usefixtures("in_an_empty_folder", "heeding_interrupts")

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "scenes" / "grey-furnace"
SMALL = [str(FOLDER), "-D", "width=8", "-D", "height=6"]


def test_the_command_in_a_process_of_its_own(tmp_path):
    """A folder is the scene in it; the header says what the picture was made by."""
    finished = run_python(
        "-m",
        "renderer.simple",
        *SMALL,
        "-o",
        "a.exr",
        "-o",
        "a.npy",
        environment={"PYTHONPATH": str(ROOT)},
        check=True,
    )
    assert finished.stderr == "rendering 192 samples\n"
    last = r"8 x 6 pixels, 4 spp, [\d.]+ s, \d+ samples/s; wrote a.exr, a.npy\n"
    assert re.fullmatch(last, finished.stdout)
    expected = render(read_file(FOLDER / "scene.xml", width=8, height=6), 4)
    assert np.allclose(np.load("a.npy"), expected, rtol=1e-6)
    with OpenEXR.File("a.exr") as file:
        header = dict(file.header())
    assert (header["spp"], header["integrator"]) == (4, "path, by renderer.simple")


@pytest.mark.parametrize(
    "words",
    [
        ["-D", "width"],
        ["-D", "=3"],
        ["--spp", "0"],
        ["--spp", "many"],
        ["--allow-outside", "nowhere"],
        ["-o", "a.jpg"],
        ["-o", "a.png", "-o", "nowhere/b.png"],
        ["-o", str(ROOT)],
        ["-D", "nothing=3"],
        ["-D", "width=no"],
        ["--simplify", "dept=3"],
        ["--what"],
    ],
)
def test_what_is_wrong_is_the_line_of_lightproof_before_anything_is_rendered(
    words, capsys, monkeypatch
):
    monkeypatch.setattr(command, "_render", lambda *_: pytest.fail("it renders"))
    status = main([str(FOLDER), *words])
    said = capsys.readouterr()
    assert status in (1, 2) and said.out == "" and said.err.count("\n") == 1
    assert lightproof([str(FOLDER), *words]) == status
    theirs = capsys.readouterr().err
    assert said.err.removeprefix("python -m renderer.simple: ") == theirs.removeprefix(
        "lightproof: "
    )
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["instances"], "has no instances; possible are shapes alone"),
        (["nowhere"], "nowhere"),
        (
            ["cornell-box", "--integrator", "depth"],
            "possible are 'path', 'direct', 'whitted'",
        ),
    ],
)
def test_scenes_that_it_cannot_render_are_one_line(words, message, capsys):
    assert main([str(ROOT / "scenes" / words[0]), *words[1:]]) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: ") and said.count("\n") == 1 and message in said


def test_another_integrator_than_that_of_the_file():
    """A ball in a white sky: one bounce finds all of its light."""
    assert main([*SMALL, "-o", "a.exr", "--integrator", "direct", "--quiet"]) == 0
    with OpenEXR.File("a.exr") as file:
        found, header = file.channels()["RGB"].pixels, dict(file.header())
    assert header["integrator"] == "direct, by renderer.simple"
    description = read_file(FOLDER / "scene.xml", width=8, height=6)
    direct = dataclasses.replace(description.integrator, name="direct")
    expected = render(dataclasses.replace(description, integrator=direct), 4)
    assert np.allclose(found, expected, rtol=1e-6)


def test_options_of_lightproof_that_mean_nothing_here_are_refused(capsys):
    assert main([str(FOLDER), "--accel", "bvh"]) == 2
    assert "unrecognized arguments: --accel bvh" in capsys.readouterr().err
    assert main(["--help"]) == 0
    assert "--accel" not in capsys.readouterr().out


def interrupted_after(monkeypatch, count, times=1):
    """Send SIGINT so many times while a number of samples is done."""
    estimates = command.estimates

    def interrupted(*arguments):
        for number, estimate in enumerate(estimates(*arguments), start=1):
            if number == count:
                for _ in range(times):
                    signal.raise_signal(signal.SIGINT)
            yield estimate

    monkeypatch.setattr(command, "estimates", interrupted)


def test_ctrl_c_writes_the_picture_so_far(capsys, monkeypatch):
    """Pixels with two samples and with one: each is the mean of its own."""
    interrupted_after(monkeypatch, 8 * 6 + 20)
    assert main([*SMALL, "--spp", "1000000", "-o", "a.exr", "--quiet"]) == 130
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == "interrupted after 68 of 48000000 samples; wrote a.exr\n"
    with OpenEXR.File("a.exr") as file:
        found = np.array(file.channels()["RGB"].pixels)
        header = dict(file.header())
    assert header["spp"] == pytest.approx(68 / 48)
    assert header["interrupted"] == "after 68 of 48000000 samples"
    description = read_file(FOLDER / "scene.xml", width=8, height=6)
    expected = render(description, 1).reshape(-1, 3)
    expected[:20] = render(description, 2).reshape(-1, 3)[:20]
    assert np.allclose(found.reshape(-1, 3), expected, rtol=1e-6)


def test_ctrl_c_before_the_first_round_is_done_leaves_pixels_black(monkeypatch):
    interrupted_after(monkeypatch, 20)
    assert main([*SMALL, "-o", "a.npy"]) == 130
    found = np.load("a.npy").reshape(-1, 3)
    assert found[:20].any(axis=1).all() and not found[20:].any()


def test_a_second_ctrl_c_quits_without_the_picture(capsys, monkeypatch):
    interrupted_after(monkeypatch, 10, times=2)
    assert main([*SMALL, "-o", "a.npy"]) == 130
    assert capsys.readouterr().err.endswith("interrupted; wrote nothing\n")
    assert not list(Path().iterdir())


def test_ctrl_c_from_a_terminal(tmp_path):
    """From outside, into a render without end; not a line of Python's."""
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "renderer.simple",
            *SMALL,
            "--spp",
            "1000000",
            "-o",
            "a.png",
        ],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    with process.stderr:
        assert process.stderr.readline() == "rendering 48000000 samples\n"
        process.send_signal(signal.SIGINT)
        said = process.stderr.read()
    assert process.wait() == 130
    assert re.fullmatch(r"interrupted after \d+ of 48000000 samples; wrote a.png\n", said)
    assert Path("a.png").is_file()


def test_the_time_that_is_left_is_shown(monkeypatch):
    """In a terminal as a bar; seconds pass faster here."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    ticks = iter(range(1_000_000))
    monkeypatch.setattr(command.time, "perf_counter", lambda: next(ticks))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    image: list[Image] = []
    monkeypatch.setattr(Image, "save", lambda self, path: image.append(self))
    assert main([*SMALL, "--spp", "2", "-o", "a.png"]) == 0
    assert re.search(r"rendering .* (\d+ s|\d min) left, 1 samples/s", stream.getvalue())
    assert (image[0].spp, image[0].samples) == (2, 96)
