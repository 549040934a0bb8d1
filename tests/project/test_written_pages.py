"""Pages and pictures that scripts of docs/ write are what the code and the rows say."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import docs.draw_speed as draw_speed
from renderer.scene_file.plugins import supported_plugins

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def table():
    return draw_speed.kept_rows()


def test_the_chart_and_the_numbers_beside_it_are_those_of_the_record(table):
    """docs/speed.svg, the table of docs/performance.md and the sentence of the README."""
    for path, text in draw_speed.documents(table).items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: run `make docs`"


def test_a_chart_of_other_rows_is_another(table):
    bars = draw_speed.bars_of(table)
    assert [bar.ratio for bar in bars] == sorted((bar.ratio for bar in bars), reverse=True)
    assert all(bar.low < bar.ratio < bar.high for bar in bars)
    picture = draw_speed.draw(bars)
    assert picture.count("<circle") == len(bars) > 10
    assert draw_speed.draw(bars[1:]) != picture


def test_the_speed_is_told_with_one_number(table):
    """ "Times as fast to the same error" is followed by no other number anywhere."""
    best = draw_speed.efficiencies(draw_speed.noisy_scenes(table))[0]
    told = []
    for path in [ROOT / "README.md", *DOCS.rglob("*.md")]:
        text = " ".join(path.read_text(encoding="utf-8").split())
        told += re.findall(r"([\d.]+) times as fast to the same error", text)
    assert told and set(told) == {draw_speed.number(best.mean)}


def test_other_programs_are_named_in_words():
    """All that were measured, also in a single scene."""
    programs = (
        ("lightproof", "mitsuba scalar_rgb", "mitsuba llvm_ad_rgb"),
        ("luxcore", "cycles"),
    )
    scenes = [
        SimpleNamespace(curves=[SimpleNamespace(program=name) for name in names])
        for names in programs
    ]
    mitsuba = "Mitsuba's `scalar_rgb` and `llvm_ad_rgb`"
    assert draw_speed.other_programs(scenes[:1]) == mitsuba
    assert draw_speed.other_programs(scenes) == f"{mitsuba}, Cycles and LuxCore"


def test_marks_that_are_missing_are_said():
    with pytest.raises(ValueError, match="no marks <!-- speed -->"):
        draw_speed.filled("nothing", "speed", "content")


def test_the_gallery_and_the_page_of_plugins_are_up_to_date(tmp_path):
    """In a process of its own: the script replaces functions of the reader."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from pathlib import Path\n"
        "from docs.write_pages import every_plugin, gallery\n"
        "Path('gallery.md').write_text(gallery(), encoding='utf-8')\n"
        "Path('every-plugin.md').write_text(every_plugin(), encoding='utf-8')\n"
    )
    subprocess.run([sys.executable, "-c", code, ROOT], cwd=tmp_path, check=True)
    for name in ("gallery.md", "every-plugin.md"):
        written = (tmp_path / name).read_text(encoding="utf-8")
        assert (DOCS / name).read_text(encoding="utf-8") == written, "run `make docs`"


@pytest.fixture
def draw_pictures(monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))  # the script lengthens it
    import docs.draw_pictures

    return docs.draw_pictures


def test_every_scene_and_every_bsdf_has_a_picture(draw_pictures):
    """No picture is left that nothing draws."""
    scenes = {path.parent.name for path in (ROOT / "scenes").glob("*/scene.xml")}
    bsdfs = {f"bsdf-{name}" for name in supported_plugins("bsdf")}
    pictures = {path.stem for path in (DOCS / "pictures").iterdir()}
    assert scenes | bsdfs <= pictures == set(draw_pictures.everything())


def test_a_difference_is_red_where_the_first_is_brighter(draw_pictures):
    """White where they are equal, blue where it is darker."""
    reference = np.ones((1, 3, 3))
    mine = reference + np.array([1.0, 0.0, -1.0]).reshape(1, 3, 1)
    red, white, blue = draw_pictures.difference(mine, reference, 0.5)[0]
    assert red.tolist() == [1, 0, 0] and white.tolist() == [1, 1, 1]
    assert blue.tolist() == [0, 0, 1]


def test_pictures_are_small():
    """They are in every clone."""
    sizes = [path.stat().st_size for path in (DOCS / "pictures").iterdir()]
    assert sum(sizes) < 500_000 and max(sizes) < 60_000


def test_the_readme_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 150 and max(map(len, lines)) < 200
