"""docs/lecture.md leads to the line: every symbol it names exists, where it says."""

from __future__ import annotations

import re

from docs.lecture_lines import LECTURE, LINK, ROOT, on_their_lines, symbols


def test_every_symbol_of_the_lecture_exists():
    """What is missing is listed; a new name has to be written into the page by hand."""
    page, missing = on_their_lines(LECTURE.read_text(encoding="utf-8"))
    assert not missing
    assert len(LINK.findall(page)) > 50
    assert page.count("::") == len(LINK.findall(page))  # none is written in another form


def test_every_link_of_the_lecture_is_on_its_line():
    text = LECTURE.read_text(encoding="utf-8")
    assert on_their_lines(text)[0] == text, "run `make docs`"


def test_lines_are_those_of_the_definitions():
    """Functions under a decorator, methods and constants, as an editor would jump."""
    path = ROOT / "docs" / "lecture_lines.py"
    source = path.read_text(encoding="utf-8").splitlines()
    for symbol, line in symbols(path).items():
        assert re.match(rf"(def |class )?{symbol}\b", source[line - 1])
    assert "RenderLoop.run" in symbols(ROOT / "renderer" / "rendering" / "render_loop.py")


def test_a_link_follows_its_symbol():
    """To another line, to the only other file, and nowhere if there is none."""
    stale = "[`x.py::hit_sphere`](../renderer/nowhere/x.py#L1)"
    page, missing = on_their_lines(stale)
    assert not missing
    assert re.fullmatch(
        r"\[`sphere\.py::hit_sphere`\]\(\.\./renderer/plugins/shapes/sphere\.py#L\d+\)",
        page,
    )
    gone = "[`x.py::no_such_symbol`](../renderer/plugins/sensors/pinhole.py)"
    assert on_their_lines(gone) == (
        gone,
        ["../renderer/plugins/sensors/pinhole.py::no_such_symbol"],
    )
