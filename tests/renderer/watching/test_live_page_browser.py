"""`--view` in a real browser: the picture while it is rendered, and after the end."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from headless_browser import Browser, find_browser

ROOT = Path(__file__).parents[3]
SCENE = """<scene version="3.0.0">
<integrator type="moment"><integrator type="path"/></integrator>
<sensor type="perspective">
<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/>
<rfilter type="box"/></film></sensor>
<emitter type="constant"><rgb name="radiance" value="0 1 0"/></emitter>
<shape type="sphere"><point name="center" x="0" y="0" z="9"/>
<float name="radius" value="2"/><bsdf type="diffuse"/></shape>
</scene>
"""
# a shell in the background ignores SIGINT, and so would its children
START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from renderer.command.cli import main
raise SystemExit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(find_browser() is None, reason="no Chromium on the path")
def test_the_page_shows_the_picture_while_it_is_rendered_and_after_the_end(tmp_path):
    """A render that Ctrl-C ends: the page has the last picture when the server is gone."""
    (tmp_path / "scene.xml").write_text(SCENE)
    words = ["scene.xml", "--spp", "10000000", "--view", "-o", "a.npy", "--threads", "1"]
    screen = ("DISPLAY", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in screen}
    render = subprocess.Popen(
        [sys.executable, "-c", START, *words],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        found = re.search(r"view: (\S+)", render.stderr.readline())
        executable = find_browser()
        with Browser(executable, tmp_path / "profile") as browser:
            page = browser.open(found[1], 900, 600)
            page.wait_for("shown.version > 1 && !document.querySelector('canvas').hidden")
            assert render.poll() is None  # it is not over
            assert page.evaluate("[canvas.width, canvas.height]") == [64, 48]
            status = page.evaluate("document.querySelector('#status').textContent")
            assert re.search(r"\d %, .* left", status), status
            left, top, *_ = page.box("#stage")
            page.move(left + 20 + 450 - 400, top + 10)
            render.send_signal(signal.SIGINT)
            page.wait_for("document.body.dataset.over === 'yes'")
            assert render.wait(timeout=60) == 130
            check_what_is_left(page, tmp_path)
            assert page.complaints() == []
            assert all(url.startswith(found[1]) for url in browser_requests(page))
    finally:
        render.kill()
        render.communicate()


def browser_requests(page):
    return [url for url in page.requests() if not url.startswith(("data:", "about:"))]


def check_what_is_left(page, folder):
    """The picture, its values, its AOV and exposure, without a server."""
    expected = np.load(folder / "a.npy")
    names = page.evaluate("shown.layers.map(layer => layer.name)")
    assert names[0] == "picture" and names[2].startswith("m2")
    drawn = page.evaluate("Array.from(shown.data[0])")
    np.testing.assert_array_equal(np.float32(drawn), expected.ravel())
    assert "interrupted" in page.evaluate("document.querySelector('#status').textContent")

    def screenshot(name):
        page.screenshot(folder / name)
        with PIL.Image.open(folder / name) as picture:
            return np.array(picture.convert("RGB")).astype(int)

    left, top, width, height = page.box("#picture")
    x, y = int(left + width / 8), int(top + height / 8)  # the sky
    middle = int(left + width / 2), int(top + height / 2)  # the ball, which is darker
    page.move(left + 0.5 * width / 64, top + 0.5 * height / 48)
    page.wait_for("document.querySelector('#values').textContent.startsWith('x 0  y 0 ')")
    values = page.evaluate("document.querySelector('#values').textContent")
    assert re.match(r"x 0  y 0   0\.0+  1\.0000  0\.0+", values), values
    assert screenshot("picture.png")[y, x].tolist() == [0, 255, 0]
    page.evaluate("exposure.value = -2; exposure.oninput()")
    assert screenshot("darker.png")[y, x].tolist() == [0, 137, 0]  # sRGB of a quarter
    page.evaluate("exposure.value = 0; layer.value = 2; layer.onchange()")
    moments = screenshot("moments.png")  # other numbers: the largest one is white
    assert moments[y, x].max() == 255
    assert moments[middle[1], middle[0]].max() < 255
