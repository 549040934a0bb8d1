"""The pages in a real browser: slider, cards, sort, charts; nothing from elsewhere."""

from __future__ import annotations

import functools
import http.server
import re
import threading
import time
from pathlib import Path

import pytest
from headless_browser import Browser, Page
from report_samples import compared, proven, replay, scene, stopped_scene

from reports.charts.curves import log_log_chart
from reports.charts.figure import Point, Series
from reports.look.shared_files import write_shared_files
from reports.look.template import fill

SPLIT = "document.querySelector('{0}').style.getPropertyValue('--split')"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the index, pages of scenes and the proof."""
    made = tmp_path_factory.mktemp("pages")
    sound = proven("sound", replay=[replay(1), replay(16, 1)])
    compared(made, sound, study="proof")
    sound = scene("sound", "pass")
    sound["metrics"]["rmse"]["value"] = 0.004
    compared(made, sound, scene("shifted", "fail"), stopped_scene("broken"))
    write_shared_files(made, [("proof.html", "Proof")])
    return made


def split(page: Page, stage: str) -> float:
    """Return the share of ours that a stage shows, in per cent, as the browser clips it."""
    ours = f"getComputedStyle(document.querySelector('{stage} .ours')).clipPath"
    right = re.fullmatch(r"inset\(0px ([\d.]+)%? ?.*\)", page.evaluate(ours))
    assert right, page.evaluate(ours)
    return 100.0 - float(right[1])


def test_the_divider_follows_mouse_keys_and_buttons(browser: Browser, folder: Path) -> None:
    """Drag to three tenths: ours covers three tenths, and the divider stands there."""
    page = browser.open(folder / "scene_shifted.html", 1000)
    stage = ".compare .stage"
    left, top, width, height = page.box(stage)
    assert split(page, stage) == 50
    middle = top + height / 2
    page.drag((left + width / 2, middle), (left + 0.3 * width, middle))
    assert split(page, stage) == pytest.approx(30, abs=1)
    divider = page.box(f"{stage} .divider")
    assert divider[0] + divider[2] / 2 - left == pytest.approx(
        0.3 * width, abs=0.01 * width
    )
    page.evaluate(f"document.querySelector('{stage} input').focus()")
    page.press("Home")
    page.press("ArrowRight")
    assert split(page, stage) == pytest.approx(1)
    page.press("End")
    spoken = f"document.querySelector('{stage} input').getAttribute('aria-valuetext')"
    assert page.evaluate(spoken) == "100 % ours, 0 % Mitsuba"
    page.evaluate("document.querySelector('button[data-split=\"0\"]').click()")
    assert split(page, stage) == 0
    sizes = "[...document.images].filter(i => i.complete).map(i => i.naturalWidth)"
    page.wait_for(f"{sizes}.length === 4 && {sizes}.every(w => w === 16)")


def test_a_card_shows_mitsuba_under_the_mouse_and_opens_its_page(
    browser: Browser, folder: Path
) -> None:
    page = browser.open(folder / "index.html", 1000)
    stage = "#sound .stage"
    left, top, width, height = page.box(stage)
    assert split(page, stage) == 100
    page.move(left + 0.25 * width, top + height / 2)
    page.wait_for(f"Math.abs(parseFloat({SPLIT.format(stage)}) - 25) < 1")
    assert split(page, "#shifted .stage") == 100
    page.move(left + width / 2, top + height + 30)
    page.wait_for(f"{SPLIT.format(stage)} === '100%'")
    at = left + width / 2, top + height / 2
    for _ in range(20):  # a busy browser may lose a click on its way
        page.drag(at, at)
        time.sleep(0.1)
        if page.evaluate("location.pathname.endsWith('scene_sound.html')"):
            break
    page.wait_for("location.pathname.endsWith('scene_sound.html')")


def test_a_click_on_a_head_sorts_by_numbers_and_turns_them(
    browser: Browser, folder: Path
) -> None:
    """As text 0.5 is before a dash; values that are missing come last."""
    page = browser.open(folder / "index.html", 1000)
    head = "document.querySelectorAll('table.sortable th')[4]"
    names = "document.querySelectorAll('table.sortable tbody th')"
    order = f"[...{names}].map(e => e.innerText)"
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    page.evaluate(f"{head}.querySelector('button').click()")
    assert page.evaluate(order) == [f"Title of {n}" for n in ("sound", "shifted", "broken")]
    assert page.evaluate(f"{head}.ariaSort") == "ascending"
    page.evaluate(f"{head}.querySelector('button').click()")
    assert page.evaluate(order)[-2:] == ["Title of shifted", "Title of sound"]


def test_a_chart_is_drawn_when_seen_and_tells_its_numbers(
    browser: Browser, folder: Path
) -> None:
    page = browser.open(folder / "scene_sound.html", 1000)
    page.box(".chart")
    page.wait_for("document.querySelector('.chart.drawn') !== null")
    label = page.evaluate("document.querySelector('.chart').getAttribute('aria-label')")
    assert "Seconds against RMSE" in label
    left, top, width, height = page.box(".chart .points path")
    page.move(left + width / 2, top + height / 2)
    page.wait_for("document.querySelector('.chart .hovertext') !== null")
    said = page.evaluate("document.querySelector('.chart .hovertext').textContent")
    assert "lightproof, 4 samples per pixel: 40 ms, RMSE 0.2" in said


def test_points_of_a_chart_lie_on_the_grid_lines_of_their_values(
    browser: Browser, tmp_path: Path
) -> None:
    """(1, 10) and (10, 1) are where the labels stand, the root of 10 is half way."""
    values = ((1.0, 10.0), (10.0, 1.0), (10.0**0.5, 10.0**0.5))
    series = Series("ours", tuple(Point(x, y) for x, y in values))
    chart = log_log_chart([series], x_label="x", y_label="y", description="A chart")
    frame = fill("base.html")
    file = tmp_path / "chart.html"
    script = f'<script src="plotly.js" defer></script><script>{fill("charts.js")}</script>'
    file.write_text(frame.replace("</body>", f"{chart}{script}</body>"), encoding="utf-8")
    write_shared_files(tmp_path, [])
    page = browser.open(file, 1000)
    page.wait_for("document.querySelector('.chart.drawn') !== null")

    def middles(selector: str) -> list[list]:
        return page.evaluate(
            f"[...document.querySelectorAll('{selector}')].map(e => {{"
            "const b = e.getBoundingClientRect();"
            "return [b.x + b.width / 2, b.y + b.height / 2, e.textContent]})"
        )

    across = {label: x for x, _, label in middles(".xtick text")}
    down = {label: y for _, y, label in middles(".ytick text")}
    first, second, between = [place[:2] for place in middles(".points path")]
    assert first == pytest.approx([across["1"], down["10"]], abs=5)
    assert second == pytest.approx([across["10"], down["1"]], abs=5)
    halves = [(a + b) / 2 for a, b in zip(first, second, strict=True)]
    assert between == pytest.approx(halves, abs=1)


@pytest.mark.parametrize("name", ["index", "scene_sound", "scene_broken", "proof"])
def test_pages_fit_any_window_in_light_and_dark(
    browser: Browser, folder: Path, name: str
) -> None:
    """Wide tables scroll in their own box; the page itself never scrolls sideways."""
    page = browser.open(folder / f"{name}.html", 1280)
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    for width in (1280, 768, 360):
        page.resize(width, 800)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    colour = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert min(page.evaluate(colour)) > 200
    page.prefer_dark()
    assert max(page.evaluate(colour)) < 60
    bar = page.evaluate("[...document.querySelectorAll('nav a')].map(a => a.innerText)")
    assert bar == ["lightproof", "Proof"]
    here = page.evaluate("document.querySelectorAll('nav a[aria-current]').length")
    assert here == (name in ("index", "proof"))


def test_the_circle_lies_over_the_divergent_pixel(browser: Browser, folder: Path) -> None:
    """Pixel (3, 4) of 16 x 12."""
    page = browser.open(folder / "scene_sound.html", 1000)
    page.box(".marked img")
    page.wait_for("document.querySelector('.marked img').complete")
    across, down = page.evaluate(
        "(() => { const [i, c] = ['.marked img', '.marked circle'].map("
        "s => document.querySelector(s).getBoundingClientRect());"
        "return [(c.x + c.width / 2 - i.x) / i.width,"
        " (c.y + c.height / 2 - i.y) / i.height]; })()"
    )
    assert (across, down) == pytest.approx((3.5 / 16, 4.5 / 12), abs=0.005)


@pytest.mark.parametrize("scheme", ["file", "http"])
def test_pages_load_files_of_their_folder_and_nothing_else(
    browser: Browser, folder: Path, scheme: str
) -> None:
    """From a disk and from a server; a script and a picture from elsewhere are refused."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
    handler.func.log_message = lambda *_: None  # type: ignore[attr-defined]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            base = f"http://127.0.0.1:{server.server_port}"
            base = base if scheme == "http" else folder.as_uri()
            before = len(browser.events)
            page = browser.open(folder / "index.html")
            for name in ("index", "proof", "scene_sound"):
                page.call("Page.navigate", url=f"{base}/{name}.html")
                page.wait_for(
                    f"location.href.endsWith('{name}.html')"
                    " && document.readyState === 'complete'"
                )
            page.evaluate("dispatchEvent(new Event('beforeprint'))")
            page.wait_for("document.querySelector('.chart.drawn') !== null")
            asked, page_events = page.requests(), browser.events[before:]
            assert all(a.startswith((base, "data:", "about:", "file:")) for a in asked)
            assert not [e for e in page_events if e.get("method") == "Log.entryAdded"]
            page.evaluate(
                "window.refused = []; addEventListener('securitypolicyviolation',"
                "e => refused.push(e.violatedDirective));"
                "new Image().src = 'http://localhost:1/a.png';"
                "document.head.append(Object.assign(document.createElement('script'),"
                "{src: 'http://localhost:1/a.js'}))"
            )
            page.wait_for("window.refused.length === 2")
        finally:
            server.shutdown()
            thread.join()
    browser.events.clear()
