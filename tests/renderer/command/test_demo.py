"""`lightproof demo`: the scenes that travel with the program."""

from __future__ import annotations

import glob
import tomllib
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from renderer.command.built_in_scenes import FOLDER, demos, list_of_demos
from renderer.command.cli import main as lightproof
from renderer.command.demo import main
from renderer.scene_file import read_file

pytestmark = pytest.mark.usefixtures("in_an_empty_folder")

ROOT = Path(__file__).parents[3]
SMALL = ["-D", "width=16", "-D", "height=12", "--spp", "1"]
MOST_BYTES = 2_000_000  # by which the wheel may grow


def test_without_a_name_the_scenes_are_listed_with_a_sentence_each(capsys):
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert 5 <= len(demos()) <= 8
    assert {"cornell-box", "appel-teapot"} <= set(demos())
    for name, line in zip(demos(), lines[: len(demos())], strict=True):
        assert line.split()[0] == name and line.endswith(".")
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert list_of_demos() in told and "lightproof demo cornell-box -o" in told


def test_lightproof_without_a_scene_lists_them_too(capsys):
    assert lightproof([]) == 2
    said = capsys.readouterr().err
    assert said.startswith("lightproof: error: the following arguments are required")
    assert "lightproof demo NAME" in said and list_of_demos() in said


def test_a_scene_is_rendered_to_a_png_of_its_name(capsys):
    """A picture that every program shows, where `lightproof SCENE.xml` writes an EXR."""
    assert main(["whitted-spheres", *SMALL]) == 0
    with PIL.Image.open("whitted-spheres.png") as picture:
        assert picture.size == (16, 12)
    assert "wrote whitted-spheres.png" in capsys.readouterr().out


def test_the_options_of_lightproof_are_possible(capsys):
    assert main(["cornell-box", *SMALL, "-o", "a.exr", "-o", "b.npy", "--quiet"]) == 0
    assert sorted(p.name for p in Path().iterdir()) == ["a.exr", "b.npy"]
    assert main(["cornell-box", "--explain"]) == 0
    assert "What is done" in capsys.readouterr().out
    assert sorted(p.name for p in Path().iterdir()) == ["a.exr", "b.npy"]
    assert main(["cornell-box", "--no-such-option"]) == 2


def test_the_command_in_the_file_gives_the_picture_again():
    """On another machine too, where the scenes are in another folder."""
    main(["cornell-box", *SMALL, "-o", "a.exr", "--quiet"])
    with OpenEXR.File("a.exr") as file:
        words = str(file.header()["command"]).split()
    assert words[:3] == ["lightproof", "demo", "cornell-box"]
    assert main([*words[2:], "-o", "b.npy", "--quiet"]) == 0
    assert main(["cornell-box", *SMALL, "-o", "c.npy", "--quiet"]) == 0
    np.testing.assert_array_equal(np.load("b.npy"), np.load("c.npy"))


def test_a_mistyped_name_gets_the_nearest(capsys):
    assert main(["cornel-box"]) == 2
    said = capsys.readouterr().err
    assert "did you mean cornell-box?" in said and len(said.splitlines()) == 1
    assert lightproof(["cornell-box"]) == 1  # a name in the place of a file
    assert "`lightproof demo cornell-box`" in capsys.readouterr().err


def test_the_wheel_carries_all_files_of_these_scenes_and_not_much_more():
    """By the patterns of pyproject.toml; setuptools builds wheels by them alone."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"]["renderer"]
    root = ROOT / "renderer"
    carried = {
        root / file for pattern in patterns for file in glob.glob(pattern, root_dir=root)
    }
    for name in demos():
        folder = FOLDER / name
        assert folder.resolve() == ROOT / "scenes" / name
        needed = {Path(file) for file in read_file(folder / "scene.xml").files}
        assert needed | {folder / "README.md"} <= carried
    assert sum(file.stat().st_size for file in carried) < MOST_BYTES
