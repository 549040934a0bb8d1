"""The start of the command and of `import renderer`: no wait for what is not used.

Nothing is timed here: what costs the time is imports, and these can be counted.
"""

from __future__ import annotations

import logging
import re
import sys
from pathlib import Path

import pytest
from processes import run_python

import renderer
from renderer import __main__ as process
from renderer.accelerators.build import BUILDERS
from renderer.process import names

ROOT = Path(__file__).parents[2]
SLOW = {"numba", "llvmlite", "scipy", "OpenEXR", "PIL", "rich"}


def run(*arguments):
    """Run Python in a process that imports our sources, and tell what it imports."""
    return run_python(
        "-X", "importtime", *map(str, arguments), environment={"PYTHONPATH": str(ROOT)}
    )


def imported(finished):
    """Return the packages that a process of `run` has imported."""
    return set(re.findall(r"^import time:.*\| +(\w+)", finished.stderr, flags=re.MULTILINE))


@pytest.mark.parametrize("option", ["--version", "--help"])
def test_version_and_help_import_nothing_slow(option):
    """Not even NumPy; what --help lists comes from `renderer.process.names`."""
    finished = run("-m", "renderer", option)
    assert finished.returncode == 0
    assert "lightproof" in finished.stdout
    assert not imported(finished) & {*SLOW, "numpy"}


@pytest.mark.parametrize("word", ["demo", "upgrade", "convert"])
def test_help_of_a_subcommand_imports_nothing_slow(word):
    """It has an example too."""
    program = f"import sys; from renderer.command.{word} import main; sys.exit(main())"
    finished = run("-c", program, "--help")
    assert finished.returncode == 0
    assert f"lightproof {word} " in finished.stdout.split("xample")[1]
    assert not imported(finished) & {*SLOW, "numpy", "trimesh"}


def test_the_harness_tells_its_options_before_it_imports_what_compares():
    """It took 3 to 5 seconds; a wrong option is told as fast."""
    for options, status in ((["--help"], 0), (["--seeds", "3"], 2)):
        finished = run("-m", "mitsuba_ref", *options)
        assert finished.returncode == status
        assert "--checks" in finished.stdout + finished.stderr
        assert not imported(finished) & {*SLOW, "numpy", "msgspec", "mitsuba"}


def test_the_package_imports_its_parts_when_they_are_asked_for():
    finished = run("-c", "import renderer; print(renderer.__version__, dir(renderer))")
    assert renderer.__version__ in finished.stdout
    assert "'render'" in finished.stdout and "'Image'" in finished.stdout
    assert not imported(finished) & {*SLOW, "numpy"}


def test_reading_scenes_needs_no_numba():
    """Nor does the simple path tracer, whose reader may have NumPy alone."""
    finished = run("-c", "import renderer.scene_file, renderer.simple.path_tracer")
    assert finished.returncode == 0, finished.stderr
    assert "numpy" in imported(finished)
    assert not imported(finished) & SLOW


@pytest.mark.parametrize(
    "name", ["reference.picture_process", "replay.paths.mitsuba_trace_process"]
)
def test_mitsubas_processes_need_no_kernels(name):
    """They wait for Mitsuba alone, which comes with their first request."""
    finished = run("-c", f"import mitsuba_ref.{name}")
    assert finished.returncode == 0, finished.stderr
    assert "numpy" in imported(finished)
    assert not imported(finished) & SLOW


def test_a_picture_imports_what_it_is_made_with(tmp_path):
    """Numba, but not the linear algebra of SciPy, which Numba alone takes along."""
    scene = ROOT / "scenes" / "grey-furnace" / "scene.xml"
    output = tmp_path / "ball.npy"
    size = ("-D", "width=8", "-D", "height=6", "--spp", "1")
    finished = run("-m", "renderer", scene, *size, "-o", output)
    assert finished.returncode == 0, finished.stderr
    assert output.exists() and "wrote" in finished.stdout
    assert imported(finished) & SLOW - {"scipy"} == {"numba", "llvmlite"}


def test_public_names_are_what_they_were():
    """`render` is the function, also after an import of its module; typos are errors."""
    from renderer import Image, Progress, Scene, SceneError, render

    assert callable(render) and render is renderer.render
    assert all(isinstance(kind, type) for kind in (Image, Progress, Scene, SceneError))
    with pytest.raises(AttributeError, match="no attribute 'rendre'"):
        _ = renderer.rendre


def test_the_listed_names_are_those_that_exist():
    assert names.ACCELERATORS == ("auto", *BUILDERS)


@pytest.mark.parametrize("status", [0, 1, 130])
def test_the_process_ends_with_the_status_and_all_that_was_said(status, monkeypatch):
    """Ending without teardown must not swallow what stands in a buffer."""
    said = []
    monkeypatch.setattr(process.os, "_exit", lambda code: said.append(code))
    monkeypatch.setattr(logging, "shutdown", lambda: said.append("logged"))
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "flush", lambda: said.append("flushed"))
    process._end(status)
    assert said == ["logged", "flushed", "flushed", status]
