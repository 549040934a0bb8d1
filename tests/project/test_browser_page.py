"""The readable renderer in a browser: with NumPy alone, and in Pyodide if it is there."""

from __future__ import annotations

import functools
import http.server
import os
import runpy
import threading
import zipfile
from pathlib import Path

import numpy as np
import pytest
from headless_browser import PATIENCE, Browser, Page, find_browser
from processes import run_python

ROOT = Path(__file__).parents[2]
ASSEMBLE = ROOT / "docs" / "browser" / "assemble.py"
SCENE = ROOT / "scenes" / "cornell-box" / "scene.xml"
PYODIDE = os.environ.get("LIGHTPROOF_PYODIDE", "")

# as the page's worker does; then whether anything was imported that a browser does not have
WORKER = """
import sys
import stand_ins, rows
rows.begin(open(sys.argv[1]).read(), 6, "")
sys.stdout.write("".join(rows.row(y).hex() for y in range(6)) + "\\n")
real = [name for name, module in sys.modules.items() if getattr(module, "__file__", None)]
sys.stdout.write(" ".join(sorted({name.partition(".")[0] for name in real})))
"""


def assemble(folder, *words):
    return run_python(ASSEMBLE, folder, *words)


def test_the_packed_sources_render_with_numpy_alone(tmp_path):
    """The same bits as outside of a browser, and neither Numba, OpenEXR nor Pillow."""
    assert assemble(tmp_path).returncode == 0
    with zipfile.ZipFile(tmp_path / "renderer.zip") as sources:
        sources.extractall(tmp_path / "home")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "home")}
    done = run_python(
        "-c", WORKER, SCENE, folder=tmp_path / "home", environment=environment, check=True
    )
    pixels, imported = done.stdout.split("\n")
    rows = runpy.run_path(str(ASSEMBLE.with_name("rows.py")))
    rows["begin"](SCENE.read_text(encoding="utf-8"), 6, "")
    assert pixels == "".join(rows["row"](y).hex() for y in range(6))
    assert np.frombuffer(bytes.fromhex(pixels), np.float32).mean() > 0.05
    assert "renderer" in imported.split()
    assert not {"numba", "llvmlite", "OpenEXR", "PIL", "scipy"} & set(imported.split())


def test_a_missing_file_of_pyodide_is_one_line(tmp_path):
    """Exit status 2."""
    done = assemble(tmp_path / "page", "--pyodide", tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "pyodide-lock.json" in done.stderr


@pytest.fixture
def opened(tmp_path):
    """Return a function that serves the page, opens it and waits for its status."""
    executable = find_browser()
    if executable is None:
        pytest.skip("no Chromium is installed")
    folder = tmp_path / "page"
    handler = functools.partial(Quiet, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()

    def open_page(browser, *words, until, patience=PATIENCE, mark=""):
        assert assemble(folder, *words).returncode == 0
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        attached = browser.call("Target.attachToTarget", targetId=target, flatten=True)
        page = Page(browser, str(attached["sessionId"]))
        for domain in ("Page", "Runtime", "Log", "Network"):
            page.call(f"{domain}.enable")
        address = f"http://127.0.0.1:{server.server_port}/index.html{mark}"
        page.call("Page.navigate", url=address)
        status = "(document.querySelector('#status') || {}).textContent"
        for _ in range(max(1, int(patience / PATIENCE))):
            try:
                page.wait_for(f"({status} || '').includes({until!r})")
                break
            except TimeoutError:
                continue
        return page, page.evaluate(status)

    with Browser(executable, tmp_path / "profile") as browser:
        yield functools.partial(open_page, browser)
    server.shutdown()
    thread.join()
    server.server_close()


class Quiet(http.server.SimpleHTTPRequestHandler):
    """A file server that prints nothing."""

    def log_message(self, *arguments):
        """Print nothing."""


def test_the_page_says_that_python_is_missing(opened):
    """A site that was built without Pyodide; no other server gets a request."""
    page, status = opened(until="not part of this copy")
    assert "docs/decisions/browser.md" in status
    assert page.evaluate("document.querySelector('#scene').value") == SCENE.read_text()
    assert all(address.startswith("http://127.0.0.1:") for address in page.requests())


@pytest.mark.skipif(not PYODIDE, reason="LIGHTPROOF_PYODIDE names no folder with Pyodide")
@pytest.mark.slow
def test_the_cornell_box_in_chromium(opened):
    """All rows arrive, and the lamp is white."""
    page, status = opened(
        "--pyodide", PYODIDE, until="pixels, 1 sample each", patience=240, mark="#render"
    )
    assert "pixels, 1 sample each" in status
    canvas = "document.querySelector('canvas').getContext('2d')"
    lamp = page.evaluate(f"Array.from({canvas}.getImageData(32, 9, 1, 1).data)")
    assert lamp == [255, 255, 255, 255]
    assert all(address.startswith("http://127.0.0.1:") for address in page.requests())
