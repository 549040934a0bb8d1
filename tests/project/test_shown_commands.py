"""Every command line that the README and the pages show can be typed as it stands."""

from __future__ import annotations

import argparse
import importlib
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

import mitsuba_ref.command.cli as validate
import mitsuba_ref.generate.__main__ as generate
import mitsuba_ref.mutations.__main__ as mutations
import reports.command as reports_command
from renderer.command.options import read_options
from renderer.simple.command import _read_options as read_simple_options
from reports.bench.study import find_study

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md"))]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORDS = PROJECT["entry-points"]["lightproof.commands"]
# What capitals stand for in a line of a page.
PLACEHOLDERS = {
    "SCENE": "scenes/cornell-box/scene.xml",
    "SCENE.xml": "scenes/cornell-box/scene.xml",
    "STUDY": "limits",
    "NAME": "limits",
    "A.exr": "a.exr",
    "B.exr": "b.exr",
    "MINE.exr": "mine.exr",
    "../shared": "scenes",  # a folder that is there
}
COMMANDS = ("lightproof", "make", "pip", "python")
PARSERS = {
    "mitsuba_ref": lambda words: validate._parse(words),
    "mitsuba_ref.generate": lambda words: generate._parser().parse_args(words),
    "mitsuba_ref.mutations": lambda words: mutations._parser().parse_args(words),
    "renderer": read_options,
    "renderer.simple": read_simple_options,
    "reports": lambda words: reports_command._parser().parse_args(words),
}


@dataclass(frozen=True)
class Shown:
    """A command line of a page."""

    page: str
    line: str

    @property
    def words(self):
        return [
            PLACEHOLDERS.get(word, word) for word in shlex.split(self.line, comments=True)
        ]


def shown_commands(page, text):
    """Commands in blocks for a shell, in indented lines and in `python -m ...`."""
    lines = []
    for language, block in re.findall(r"^```(\w*)\n(.*?)^```", text, re.M | re.S):
        if language in ("", "sh", "console"):
            lines += [line.strip().removeprefix("$ ") for line in block.splitlines()]
    lines += re.findall(r"^    ((?:python -m|make|lightproof) .*)$", text, re.M)
    inside = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    lines += re.findall(
        r"`(python -m (?:renderer|mitsuba_ref|reports)[^`]* [^`]*)`", inside
    )
    lines += re.findall(r"`(lightproof (?:-|compare )[^`]*)`", inside)
    return [Shown(page, line) for line in lines if line.split(" ")[0] in COMMANDS]


ALL = [
    command
    for page in PAGES
    for command in shown_commands(
        page.relative_to(ROOT).as_posix(), page.read_text(encoding="utf-8")
    )
]


def check(words):
    """Raise an error that says what is wrong with a command line."""
    program, *rest = words
    if program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)
        assert set(rest) <= {*targets, "help"}, f"no target of make: {rest}"
    elif program == "pip":
        for name in ",".join(re.findall(r"\[(.*?)\]", " ".join(rest))).split(","):
            assert not name or name in PROJECT["optional-dependencies"], f"no extra {name}"
    elif program == "lightproof" and rest and rest[0] in WORDS:
        module = importlib.import_module(WORDS[rest[0]].partition(":")[0])
        if hasattr(module, "_parsed"):
            module._parsed(rest[1:])
        elif rest[0] == "demo":
            if rest[1:]:
                read_options([str(ROOT / "scenes" / rest[1] / "scene.xml"), *rest[2:]])
        else:
            module._parser().parse_args(rest[1:])
    elif program == "lightproof":
        check_renderer(read_options(rest))
    elif rest[:2] == ["-m", "pytest"] or rest[0] != "-m":
        pass  # files are looked at below
    else:
        options = PARSERS[rest[1]](rest[2:])
        if rest[1] == "reports":
            check_studies(options)
        elif rest[1].startswith("renderer"):
            check_renderer(options)
    for word in words:
        if re.match(r"(scenes|tests|docs|reports)/[\w./-]+\w$", word) and "*" not in word:
            assert (ROOT / word).exists(), f"no such file: {word}"


def check_renderer(options):
    """A `-D` names a default of the scene, where the scene is one of ours."""
    scene = options.scene and ROOT / options.scene
    if scene and scene.suffix == ".xml" and scene.is_file():
        for name, _ in options.define:
            assert f'<default name="{name}"' in scene.read_text(encoding="utf-8")


def check_studies(options):
    for name in options.studies:
        if name != "all":
            study = find_study(name)
            for setting in options.set or ():
                assert setting.partition("=")[0] in study.options


@pytest.mark.parametrize("page", sorted({command.page for command in ALL}))
def test_every_command_of_a_page_is_one(page, capsys):
    """Real parsers take its words; its scene, study, target or extra exists."""
    for command in ALL:
        if command.page == page:
            try:
                check(command.words)
            except (SystemExit, Exception) as error:
                said = capsys.readouterr().err.strip().splitlines()[-1:] or [str(error)]
                pytest.fail(f"{page}: {command.line}: {said[0]}")


def test_commands_are_found():
    """The README and each tutorial show some, in all forms."""
    pages = {command.page for command in ALL}
    assert {"README.md", "docs/tutorials/student.md", "docs/tutorials/engineer.md"} <= pages
    assert len(ALL) > 80
    text = "x `python -m reports limits` y\n\n    make demo\n\n"
    text += "```sh\nlightproof a.xml  # b\n```\n"
    found = [command.line for command in shown_commands("page", text)]
    assert found == ["lightproof a.xml  # b", "make demo", "python -m reports limits"]


@pytest.mark.parametrize(
    "line",
    [
        "lightproof scenes/cornell-box/scene.xml --no-such-option",
        "lightproof scenes/no-such-scene/scene.xml",
        "lightproof scenes/cornell-box/scene.xml --accel no-such",
        "lightproof scenes/cornell-box/scene.xml -D no_such=1",
        "lightproof compare a.exr --no-such-option",
        "python -m reports no-such-study",
        "python -m reports needs --set no-such=1",
        "python -m mitsuba_ref scenes/cornell-box/scene.xml --size no-such",
        "make no-such-target",
        "pip install '.[no-such-extra]'",
    ],
)
def test_a_command_that_is_none_is_found(line):
    with pytest.raises((SystemExit, Exception)):
        check(Shown("page", line).words)


# ------------------------------------------------------------------------ run for real

SMALL = ("-D", "width=48", "-D", "height=48", "--spp", "2")
TOO_LONG = ("--cluster", "--resume", "--frames", "scene.xml")


def short(command):
    """Return the arguments of a render that takes a second, or None."""
    words = command.words
    named = words[:1] == ["lightproof"] or words[:3] == ["python", "-m", "renderer"]
    rest = words[1:] if words[0] == "lightproof" else words[3:]
    if not named or not rest or not rest[0].startswith(("scenes/", "tests/")):
        return None
    if any(word in TOO_LONG for word in rest):
        return None
    return [*rest, *SMALL]


@pytest.mark.slow
def test_renders_of_the_pages_run(tmp_path):
    """As in a clone, at 48 x 48 pixels: each ends with status 0 and writes its pictures."""
    for folder in ("scenes", "tests"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    runs = {tuple(words) for words in map(short, ALL) if words}
    assert len(runs) > 8
    for words in sorted(runs):
        command = [sys.executable, "-m", "renderer", *words, "--quiet"]
        done = subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{words}: {done.stderr}"
        for output in outputs_of(words):
            assert (tmp_path / output).stat().st_size > 0


def outputs_of(words):
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", action="append", default=[])
    return parser.parse_known_args(words)[0].o


@pytest.mark.slow
def test_the_tutorial_for_engineers_finds_the_mistake_that_it_makes(tmp_path, monkeypatch):
    """Its first two commands, at 48 x 48 pixels: the mistake is named first."""
    monkeypatch.chdir(tmp_path)
    Path("scenes").symlink_to(ROOT / "scenes")
    page = (ROOT / "docs" / "tutorials" / "engineer.md").read_text(encoding="utf-8")
    make, compare = (
        Shown("", line) for line in re.findall(r"^lightproof .*$", page, re.M)[:2]
    )
    small = ["-D", "width=48", "-D", "height=48"]
    subprocess.run(
        [sys.executable, "-m", "renderer", *make.words[1:], *small, "--quiet"], check=True
    )
    compared = subprocess.run(
        [
            sys.executable,
            "-m",
            "reports.compare_command",
            *compare.words[2:],
            *small,
            "--quick",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert compared.returncode == 1, compared.stderr
    assert "\n1. depth-limited: Paths have 2 segments" in compared.stdout


@pytest.mark.slow
def test_the_frames_of_the_tutorial_have_the_error_that_they_claim():
    """docs/turntable.py at a small size and a large error: 20 %."""
    import renderer
    from docs.turntable import still_life

    image = renderer.render(still_life(36, 48, 32), spp=4096, target_error=0.2)
    assert 0.0 < float(image.metadata["error"]) <= 0.2 and image.spp < 4096
