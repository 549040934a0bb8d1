"""`progress=True`: the command's bar for programs and notebooks; `progress=f` as before."""

from __future__ import annotations

import io
import sys
import types
from pathlib import Path

import pytest

import renderer
from renderer.rendering import progress_display
from renderer.rendering.progress_display import Progress, ProgressDisplay

SCENES = Path(__file__).parents[3] / "scenes"


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def ball():
    return renderer.load_file(SCENES / "grey-furnace" / "scene.xml", width=8, height=6)


@pytest.fixture
def _often(monkeypatch):
    """Show a bar of the shortest render too."""
    monkeypatch.setattr(progress_display, "BAR_AFTER", -1.0)
    monkeypatch.setattr(progress_display, "BAR_EVERY", -1.0)
    monkeypatch.setenv("TERM", "xterm")


WAYS = {
    "render": lambda scene, path, **how: [renderer.render(scene, 2, **how)],
    "render_frames": lambda scene, path, **how: list(
        renderer.render_frames(iter([scene, scene]), spp=2, **how)
    ),
    "render_to_file": lambda scene, path, **how: [
        renderer.render_to_file(scene, path, spp=2, **how)
    ],
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_true_is_a_bar_in_a_terminal_that_goes_away(
    way, ball, tmp_path, monkeypatch, _often
):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    pictures = way(ball, tmp_path / "a.exr", progress=True)
    text = stream.getvalue()
    assert text.count("\x1b[?25l") == text.count("\x1b[?25h") == len(pictures)  # cursor
    assert "100%" in text and "left" in text


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_elsewhere_true_is_lines_and_false_is_nothing(way, ball, tmp_path, monkeypatch):
    for progress, expected in ((True, "rendering 96 samples\n"), (False, ""), (None, "")):
        stream = io.StringIO()
        monkeypatch.setattr(sys, "stderr", stream)
        count = len(way(ball, tmp_path / "a.exr", progress=progress))
        assert stream.getvalue() == count * expected


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_a_function_is_called_and_anything_else_is_refused(way, ball, tmp_path):
    seen: list[Progress] = []
    way(ball, tmp_path / "a.exr", progress=seen.append)
    assert seen[-1].done == seen[-1].total > 0
    with pytest.raises(
        TypeError, match="progress is of type str; possible are True, False"
    ):
        way(ball, tmp_path / "a.exr", progress="yes")


@pytest.mark.usefixtures("_often")
def test_the_bar_goes_away_after_an_interrupt(ball, monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    show = ProgressDisplay._show

    def interrupted(self, now):
        show(self, now)
        if now.stage == "render" and now.done > 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(ProgressDisplay, "_show", interrupted)
    assert not renderer.render(ball, 2, progress=True).complete
    assert stream.getvalue().count("\x1b[?25h") == 1


@pytest.fixture
def cell(monkeypatch):
    """What a notebook's cell shows: IPython as far as the bar needs it."""
    shown: dict[int, str] = {}
    ipython = types.ModuleType("IPython")
    module = types.ModuleType("IPython.display")

    class Handle:
        def update(self, content):
            shown[id(self)] = content

    def display(content, display_id):
        assert display_id is True
        handle = Handle()
        handle.update(content)
        shown["most"] = max(shown.get("most", 0), len(shown))
        return handle

    module.HTML, module.display = str, display
    ipython.display = module
    ipython.get_ipython = lambda: types.SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    return shown


def test_a_notebook_has_a_bar_below_the_cell(cell):
    """One, which is updated, and empty at the end; times may have signs of HTML in them."""
    with ProgressDisplay(io.StringIO()) as display:
        display(Progress("render", 0, 400, 0.5))
        display(Progress("render", 100, 400, 1.0, cluster="<b>"))
        (bar,) = (text for key, text in cell.items() if key != "most")
        assert '<progress value="100" max="400"></progress> 25%' in bar
        assert "3 s left, 100 samples/s; &lt;b&gt;" in bar
        display(Progress("render", 400, 400, 4.0))
        (bar,) = (text for key, text in cell.items() if key != "most")
        assert "100%" in bar
    assert [text for key, text in cell.items() if key != "most"] == [""]


@pytest.mark.usefixtures("_often")
def test_ipython_in_a_terminal_has_the_bar_of_a_terminal(cell, monkeypatch):
    """Its shell has no kernel; nor has a program that has imported IPython."""
    for shell in (types.SimpleNamespace(), None):
        monkeypatch.setattr(
            sys.modules["IPython"], "get_ipython", lambda shell=shell: shell
        )
        stream = Terminal()
        with ProgressDisplay(stream) as display:
            display(Progress("render", 100, 400, 1.0))
        assert "25%" in stream.getvalue() and not cell


def test_a_stream_that_is_closed_or_full_does_not_end_the_render(ball, monkeypatch):
    class Full(io.StringIO):
        def write(self, text):
            raise OSError(28, "No space left on device")

    closed = io.StringIO()
    closed.close()
    whole = renderer.render(ball, 2).pixels
    for stream in (Full(), None):
        monkeypatch.setattr(sys, "stderr", stream)
        assert (renderer.render(ball, 2, progress=True).pixels == whole).all()
    display = ProgressDisplay(io.StringIO())
    display._stream = closed
    display(Progress("render", 0, 400, 0.0))
