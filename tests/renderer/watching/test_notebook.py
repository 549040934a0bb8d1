"""`live=True`: a picture that draws itself in a notebook, by IPython's display handle."""

from __future__ import annotations

import io
import sys
import types

import numpy as np
import PIL.Image
import pytest

import renderer
from renderer.rendering.watching import notebook
from renderer.rendering.watching.notebook import MISSING

SCENE = {
    "type": "scene",
    "sensor": {
        "type": "perspective",
        "film": {"type": "hdrfilm", "width": 20, "height": 12},
    },
    "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 0.0, 0.0]}},
}


@pytest.fixture
def drawn(monkeypatch):
    """What a notebook is told to draw: IPython is no dependency, and may be missing."""
    found = []

    class Handle:
        def update(self, picture):
            found.append(picture)

    def display(picture, display_id):
        assert display_id and not found
        found.append(picture)
        return Handle()

    shell = types.SimpleNamespace(kernel=None)
    ipython = types.ModuleType("IPython")
    ipython.get_ipython = lambda: shell
    displays = types.ModuleType("IPython.display")
    displays.display = display
    displays.Image = lambda content, format: (format, content)
    displays.HTML = str
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", displays)
    return found


def test_the_last_picture_drawn_is_the_whole_one(drawn, monkeypatch):
    monkeypatch.setattr(notebook, "EVERY", 0.0)
    monkeypatch.setattr(notebook, "SHARE", 1e9)
    seen = []
    image = renderer.render(
        renderer.load_dict(SCENE), spp=64, live=True, progress=seen.append
    )
    assert seen and drawn
    form, content = drawn[-1]
    assert form == "png" and content == image._repr_png_()
    with PIL.Image.open(io.BytesIO(content)) as picture:
        assert np.asarray(picture)[0, 0].tolist() == [255, 0, 0]


def test_a_picture_is_drawn_once_a_second(drawn, monkeypatch):
    """However often the loop tells where it is; but the whole one at once."""
    monkeypatch.setattr(notebook.time, "monotonic", iter(range(1000)).__next__)
    live = notebook.LivePicture(None)
    made = []

    def picture():
        made.append(True)
        return types.SimpleNamespace(pixels=np.zeros((2, 2, 3), np.float32))

    for done in (0, 1, 2, 3, 4):
        live(notebook.Progress("render", done, 4, float(done), picture=picture))
    assert len(made) == len(drawn) == 2


def test_without_a_notebook_one_line_says_what_is_possible(monkeypatch):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    with pytest.raises(renderer.SceneError) as caught:
        renderer.render(renderer.load_dict(SCENE), spp=1, live=True)
    assert str(caught.value) == MISSING
