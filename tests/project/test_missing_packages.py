"""After `pip install lightproof` alone, commands of the harness say what they need.

They run in processes in which the packages of the extra `harness` cannot be imported.
"""

from __future__ import annotations

import importlib.metadata
import json
import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from processes import run_python

from mitsuba_ref.command.verdict_of_error import stopped_by
from mitsuba_ref.missing_packages import HARNESS, failed_package
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.picture_process import MitsubaWorker

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
SAID = r"error: No module named '\w+'; needs: pip install 'lightproof\[harness\]'\n"

BLOCKED = f"""
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {HARNESS!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Blocked())
"""


@pytest.fixture
def run(tmp_path):
    """Runs Python in another folder, with files of the test's first on its path."""

    def run_one(*arguments, **files):
        for name, text in files.items():
            (tmp_path / f"{name}.py").write_text(text)
        return run_python(
            *arguments, folder=tmp_path, environment={"PYTHONPATH": f"{tmp_path}:{ROOT}"}
        )

    return run_one


def test_all_packages_of_the_extra_are_known():
    """By the names under which they are imported, which installed packages say."""
    wanted = {
        canonicalize_name(Requirement(line).name)
        for line in PROJECT["optional-dependencies"]["harness"]
    }
    providers = importlib.metadata.packages_distributions()
    found = {canonicalize_name(each) for name in HARNESS for each in providers[name]}
    assert found == wanted


@pytest.mark.parametrize("script", ["lightproof-validate", "lightproof-report"])
def test_the_installed_commands_say_one_line(run, script):
    """As the script that pip writes for an entry point."""
    module, function = PROJECT["scripts"][script].split(":")
    program = f"import sys; sys.argv = ['/bin/{script}']; import {module} as m; "
    finished = run("-c", f"{program}sys.exit(m.{function}())", sitecustomize=BLOCKED)
    assert finished.returncode == 1 and finished.stdout == ""
    assert re.fullmatch(SAID, finished.stderr), finished.stderr


@pytest.mark.parametrize("words", [("mitsuba_ref",), ("reports", "--help")])
def test_modules_that_are_run_say_one_line(run, words):
    finished = run("-m", *words, sitecustomize=BLOCKED)
    assert finished.returncode == 1 and finished.stdout == ""
    assert re.fullmatch(SAID, finished.stderr), finished.stderr


RUN_ALL = """
import io, json, runpy, sys
said = {}
for name in json.loads(sys.argv.pop()):
    sys.argv[:] = ["-m", "--help"]
    sys.stderr, sys.stdout = io.StringIO(), io.StringIO()
    try:
        runpy.run_module(name, run_name="__main__", alter_sys=True)
    except SystemExit as stop:
        said[name] = f"status {stop.code}"
    except Exception as error:
        sys.excepthook(type(error), error, error.__traceback__)
        said[name] = sys.stderr.getvalue()
json.dump(said, sys.__stdout__)
"""


def test_every_command_of_the_harness_says_it(run):
    """Those that need no such package show their help."""
    files = [*ROOT.glob("reports/*.py"), *ROOT.glob("reports/*/__main__.py")]
    files += [
        *ROOT.glob("mitsuba_ref/__main__.py"),
        *ROOT.glob("mitsuba_ref/*/__main__.py"),
    ]
    names = {
        ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")
        for file in files
        if "__main__" in file.read_text(encoding="utf-8")
    }
    assert len(names) >= 3
    finished = run("-c", RUN_ALL, json.dumps(sorted(names)), sitecustomize=BLOCKED)
    said = json.loads(finished.stdout)
    assert said.keys() == names
    # the last one tells its options before it imports anything
    without = {"resilience", "mitsuba_ref"}
    for name, line in said.items():
        expected = r"status (0|None)" if name.rpartition(".")[2] in without else SAID
        assert re.fullmatch(expected, line), (name, line)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "ImportError: cannot import name 'Meta' from 'msgspec'"),
        ("1 / 0\n", "ZeroDivisionError: division by zero"),
        ("import no_such_thing\n", "No module named 'no_such_thing'"),
        ('raise ImportError("a.so:\\n  no such file")', "ImportError: a.so: no such"),
    ],
)
def test_a_package_that_cannot_be_imported_is_one_line_too(run, text, reason):
    """Another version without what is used, one that is damaged, one that lacks another."""
    finished = run("-m", "mitsuba_ref", "scene.xml", msgspec=text)
    assert finished.returncode == 1 and finished.stdout == ""
    (line,) = finished.stderr.splitlines()
    assert reason in line and line.endswith("; needs: pip install 'lightproof[harness]'")


def test_a_mitsuba_that_cannot_be_imported_is_not_a_verdict(tmp_path, monkeypatch):
    """It is imported in another process, and says nothing about a scene."""
    (tmp_path / "mitsuba.py").write_text('raise ImportError("libLLVM.so is missing")')
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    scene = ROOT / "scenes" / "grey-furnace" / "scene.xml"
    request = RenderRequest(path=str(scene), parameters={"width": "4", "height": "4"})
    with (
        MitsubaWorker() as worker,
        pytest.raises(ImportError, match=r"libLLVM\.so is missing") as caught,
    ):
        worker.render(request, tmp_path / "a.npz")
    assert failed_package(caught.value) == "mitsuba"
    with pytest.raises(ImportError):
        stopped_by(caught.value, "Mitsuba, seed 1")


@pytest.mark.parametrize(
    ("program", "package"),
    [
        (
            "import msgspec\nmsgspec.nothing",
            "msgspec",
        ),  # while a module of ours is imported
        ("import msgspec\ndef f(): msgspec.nothing\nf()", None),  # a mistake of ours
        ("import renderer\nrenderer.nothing", None),
        ("import no_such_thing", None),
        ("from scipy import no_such_thing", "scipy"),
        ("from renderer import no_such_thing", None),
    ],
)
def test_what_counts_as_a_failing_package(program, package):
    """A name that another version lacks does, where it is used at once."""
    with pytest.raises((ImportError, AttributeError)) as caught:
        exec(compile(program, "module.py", "exec"), {"__name__": "reports.look"})
    assert failed_package(caught.value) == package


def test_other_errors_keep_their_traceback(run):
    """A mistake of ours, or of a user's own file, is not one of an installation."""
    for text in ("import no_such_thing", "1 / 0", "None.a"):
        program = f"import sys; sys.argv = ['lightproof-x']; import reports; {text}"
        finished = run("-c", program)
        assert finished.returncode == 1 and "Traceback" in finished.stderr
        assert "pip install" not in finished.stderr


def test_a_program_that_imports_the_harness_keeps_its_hook(run):
    """Only the process of a command of ours is changed."""
    program = (
        "import sys, reports, mitsuba_ref; assert sys.excepthook is sys.__excepthook__"
    )
    assert run("-c", program).returncode == 0
