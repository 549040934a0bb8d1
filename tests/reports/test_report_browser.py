"""The page in a real browser: mouse and keys move the slider, nothing is fetched."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import proof_samples
import pytest
from headless_browser import Browser, Page, find_browser
from markupsafe import Markup
from report_samples import scene, stopped_scene, write_results

from reports.bench.rows import Row, Run, Table
from reports.bench.study import Bench
from reports.charts.curves import log_log_chart
from reports.charts.figure import Point, Series
from reports.look.shared_files import write_shared_files
from reports.look.template import fill
from reports.pages.accelerators_page import accelerators_page
from reports.proof_page.page import proof_page
from reports.records.results import read_results
from reports.scenes_page.page import results_page
from reports.studies.accelerators import COUNTS, INSIDE, STUDY
from reports.trials.inside import Looks, script
from reports.trials.meshes import teapot
from reports.trials.structure_walks import Walk

DRAWN = "[...document.querySelectorAll('[data-figure]')].every(e => e.matches('.drawn'))"
SLIDER = "#scene-shifted .stage input"
STAGE = "#scene-shifted .stage"
OURS = "#scene-shifted .stage img.ours"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    executable = find_browser()
    if executable is None:
        # CI installs a browser; without one it must not look as if this were checked.
        missing = "no Chromium found (Debian: apt-get install chromium)"
        if os.environ.get("CI") == "true":
            pytest.fail(missing)
        pytest.skip(missing)
    with Browser(executable, tmp_path_factory.mktemp("profile")) as running:
        yield running


def opened(browser: Browser, file: Path, width: int = 1000) -> Page:
    """Return the page once its script has drawn every chart."""
    write_shared_files(file.parent, [])
    page = browser.open(file, width)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")  # draws all of them
    page.wait_for(DRAWN)
    return page


# What tests of the same page change: sliders in the middle, all folded up, nothing focused.
AS_OPENED = """
document.querySelectorAll(".stage input").forEach(slider => {
  slider.value = 50;
  slider.dispatchEvent(new Event("input"));
});
document.querySelectorAll("details").forEach(part => { part.open = false; });
document.activeElement.blur();
scrollTo({top: 0, behavior: "instant"});
"""


@pytest.fixture(scope="module")
def index(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    scenes = [scene("sound", "pass"), scene("shifted", "fail"), stopped_scene("broken")]
    record = read_results(write_results(folder, scenes))
    file = folder / "index.html"
    file.write_text(results_page(record, folder), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def shared(browser: Browser, index: Path) -> Page:
    """Return the page, opened once: its charts take 2 s to draw."""
    return opened(browser, index)


@pytest.fixture
def page(shared: Page) -> Page:
    shared.evaluate(AS_OPENED)
    return shared


@pytest.fixture
def own_page(browser: Browser, index: Path) -> Page:
    """Return a page whose window a test may change: its charts draw themselves anew."""
    return opened(browser, index)


def shown_share_of_ours(page: Page) -> float:
    """Return the percentage of the width that shows ours, as the browser computes it.

    `inset(0px 70% 0px 0px)` cuts 70 % off at the right, which leaves 30.
    """
    clip = page.evaluate(f"getComputedStyle(document.querySelector('{OURS}')).clipPath")
    cut = re.fullmatch(r"inset\(0px ([\d.]+)% 0px 0px\)", clip)
    assert cut, clip
    return 100.0 - float(cut[1])


def test_mouse_drags_the_divider(page: Page) -> None:
    """Press on the middle, drag to three tenths: ours covers three tenths."""
    left, top, width, height = page.box(STAGE)
    assert shown_share_of_ours(page) == 50
    middle = top + height / 2
    page.drag((left + width / 2, middle), (left + 0.3 * width, middle))
    assert float(
        page.evaluate(f"document.querySelector('{SLIDER}').value")
    ) == pytest.approx(30, abs=1)
    assert shown_share_of_ours(page) == pytest.approx(30, abs=1)
    divider = page.box(f"{STAGE} .divider")
    assert divider[0] + divider[2] / 2 - left == pytest.approx(
        0.3 * width, abs=0.01 * width
    )


def test_keyboard_moves_the_divider(page: Page) -> None:
    """Home, arrows and End work on the focused slider, and a screen reader hears it."""
    page.evaluate(f"document.querySelector('{SLIDER}').focus()")
    page.press("Home")
    assert shown_share_of_ours(page) == 0
    page.press("ArrowRight")
    page.press("ArrowRight")
    assert shown_share_of_ours(page) == pytest.approx(2)
    page.press("End")
    assert shown_share_of_ours(page) == 100
    spoken = page.evaluate(
        f"document.querySelector('{SLIDER}').getAttribute('aria-valuetext')"
    )
    assert spoken == "100 % ours, 0 % Mitsuba"


def test_buttons_show_one_picture_whole(page: Page) -> None:
    """By one click each. A busy browser may lose one on its way, which is no click."""
    for split in (0, 100, 50):
        button = f"#scene-shifted button[data-split='{split}']"
        page.evaluate(
            f'window.clicks = 0; document.querySelector("{button}")'
            ".addEventListener('click', () => { window.clicks += 1; })"
        )
        for _ in range(20):
            left, top, width, height = page.box(button)
            center = (left + width / 2, top + height / 2)
            page.drag(center, center)
            time.sleep(0.1)
            if page.evaluate("window.clicks") > 0:
                break
        assert page.evaluate("window.clicks") == 1
        assert shown_share_of_ours(page) == split


def test_one_slider_leaves_the_others_alone(page: Page) -> None:
    page.evaluate(f"document.querySelector('{SLIDER}').focus()")
    page.press("Home")
    other = "#scene-sound .stage input"
    assert page.evaluate(f"document.querySelector('{other}').value") == "50"


def test_every_picture_is_decoded_at_its_size(page: Page) -> None:
    """Data URIs that the browser cannot decode would have no natural size."""
    sizes = page.evaluate(
        "[...document.images].map(i => [i.naturalWidth, i.naturalHeight])"
    )
    assert len(sizes) == 2 * (4 + 2)  # per scene four pictures, two of them on the slider
    assert all(size == [16, 12] for size in sizes)


def test_browser_reports_no_error_and_fetches_nothing(page: Page) -> None:
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    assert page.complaints() == []
    requests = page.requests()
    assert any(address.endswith("/index.html") for address in requests)
    assert all(
        address.startswith("data:")
        or address.endswith(("/index.html", ".js", "about:blank"))
        for address in requests
    )


@pytest.mark.parametrize("width", [360, 768, 1280])
def test_page_fits_the_window(own_page: Page, width: int) -> None:
    """Wide tables scroll in their own box; the page itself never scrolls sideways."""
    own_page.resize(width, 800)
    assert own_page.evaluate("document.documentElement.scrollWidth") <= width


def test_dark_mode_turns_the_page_dark(own_page: Page) -> None:
    colour = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert min(own_page.evaluate(colour)) > 200
    own_page.prefer_dark()
    assert max(own_page.evaluate(colour)) < 60


def test_points_of_a_chart_lie_on_the_grid_lines_of_their_values(
    browser: Browser, tmp_path: Path
) -> None:
    """(1, 10) and (10, 1) are where the labels stand, the root of 10 is half way."""
    values = ((1.0, 10.0), (10.0, 1.0), (10.0**0.5, 10.0**0.5))
    series = Series("ours", tuple(Point(x, y) for x, y in values))
    chart = log_log_chart([series], x_label="x", y_label="y", description="A chart")
    page = opened(browser, chart_page(tmp_path, chart))

    def middles(selector: str) -> list[list]:
        return page.evaluate(
            f"[...document.querySelectorAll('{selector}')].map(e => {{"
            "const b = e.getBoundingClientRect();"
            "return [b.x + b.width / 2, b.y + b.height / 2, e.textContent]})"
        )

    across = {label: x for x, _, label in middles(".xtick text")}
    down = {label: y for _, y, label in middles(".ytick text")}
    first, second, between = [place[:2] for place in middles(".points path")]
    # of some 400 pixels; a label has room for an exponent at its right
    assert first == pytest.approx([across["1"], down["10"]], abs=5)
    assert second == pytest.approx([across["10"], down["1"]], abs=5)
    halves = [(a + b) / 2 for a, b in zip(first, second, strict=True)]
    assert between == pytest.approx(halves, abs=1)


def chart_page(folder: Path, chart: Markup) -> Path:
    """Write a page with one chart alone, under the policy of all pages."""
    frame = fill("base.html")
    policy = frame[frame.index("<meta http-equiv") : frame.index("<link")]
    script = fill("charts.js")
    file = folder / "chart.html"
    file.write_text(
        f"<!DOCTYPE html><meta charset=utf-8>{policy}<body>{chart}"
        '<script src="plotly.js" defer></script>'
        f"<script>{script}</script>",
        encoding="utf-8",
    )
    return file


def test_mouse_over_a_point_tells_its_numbers(page: Page) -> None:
    """What the tooltip says comes from the record; leaving the chart takes it away."""
    chart = "#scene-sound .chart"
    page.evaluate(f"document.querySelector('{chart}').scrollIntoView({{block: 'center'}})")
    left, top, width, height = page.box(f"{chart} .points path")
    page.move(left + width / 2, top + height / 2)
    page.wait_for(f"document.querySelector('{chart} .hovertext') !== null")
    said = page.evaluate(f"document.querySelector('{chart} .hovertext').textContent")
    assert "lightproof, 4 samples per pixel: 40 ms, RMSE 0.2" in said


def test_chart_without_a_script_says_what_it_shows(page: Page) -> None:
    """A screen reader hears the sentence that stands where no script runs."""
    sentences = page.evaluate(
        "[...document.querySelectorAll('.chart')].map(c => c.getAttribute('aria-label'))"
    )
    assert len(sentences) == 2
    assert all("Seconds against RMSE" in sentence for sentence in sentences)


@pytest.mark.parametrize("width", [360, 1000])
def test_proof_fits_the_window_and_circles_the_pixel(
    browser: Browser, tmp_path: Path, width: int
) -> None:
    """The circle lies over pixel (3, 4) of 16 x 12; the page never scrolls sideways."""
    scene = proof_samples.proven("box", replay=[proof_samples.replay(16, 1)])
    file = tmp_path / "proof.html"
    content = proof_page(proof_samples.record(tmp_path, scene), tmp_path)
    file.write_text(content, encoding="utf-8")
    page = opened(browser, file, width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    sizes = page.evaluate(
        "[...document.images].map(i => [i.naturalWidth, i.naturalHeight])"
    )
    assert sizes == [[16, 12]] * 4
    across, down = page.evaluate(
        "(() => { const [i, c] = ['.marked img', '.marked circle'].map("
        "s => document.querySelector(s).getBoundingClientRect());"
        "return [(c.x + c.width / 2 - i.x) / i.width,"
        " (c.y + c.height / 2 - i.y) / i.height]; })()"
    )
    assert (across, down) == pytest.approx((3.5 / 16, 4.5 / 12), abs=0.005)
    assert page.complaints() == []
    assert all(
        address.startswith("data:") or address.endswith((".html", ".js", "about:blank"))
        for address in page.requests()
    )


# ------------------------------------------------------------- the look into structures

INK = """(() => {
  const c = document.querySelector("#look canvas");
  look.viewer.drawNow();
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [c.width, c.height];
  const context = copy.getContext("2d");
  context.drawImage(c, 0, 0);
  const data = context.getImageData(0, 0, c.width, c.height).data;
  let ink = 0, sum = 0;
  for (let k = 0; k < data.length; k += 4) {
    ink += data[k + 3] > 0;
    sum = (sum * 31 + data[k] + 7 * data[k + 1] + 13 * data[k + 3]) % 1000003;
  }
  return [ink / (c.width * c.height), sum];
})()"""
HIT = "a usual hit"


@pytest.fixture(scope="module")
def looks(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Walk]]:
    """Write the page with what its viewer loads; return it and the walks of one ray."""
    folder = tmp_path_factory.mktemp("looks")
    bench = Bench("accelerators", folder=folder)
    looked = Looks(teapot(5))
    rows = [bench.file(INSIDE, "scene", "scene.js", script("scene", looked.scene()))]
    walks = {}
    for one in looked.structures():
        content = script(one.name, one.data)
        rows.append(bench.file(INSIDE, one.name, f"{one.name}.js", content))
        walks[one.name] = one.walks[[ray.title for ray in looked.rays].index(HIT)]
        for ray, walk in zip(looked.rays, one.walks, strict=True):
            rows += [
                Row(
                    case=INSIDE,
                    contender=one.name,
                    quantity=f"{ray.title}: {name}",
                    value=n,
                )
                for name, n in zip(COUNTS, walk.counts, strict=False)
            ]
    run = Run(run="r", created="2026-01-01T00:00:00", command="python -m reports")
    table = Table(tuple(replace(row, run="r") for row in rows), {"r": run})
    page = folder / "accelerators.html"
    page.write_text(accelerators_page("accelerators", STUDY, table), encoding="utf-8")
    return page, walks


def viewer(browser: Browser, file: Path, width: int, drawer: str = "webgl") -> Page:
    """Return the page of the structures with the BVH drawn, not turning by itself."""
    if drawer == "2d":
        plain = file.with_name("plain.html")
        text = file.read_text(encoding="utf-8")
        plain.write_text(text.replace('id="look"', 'id="look" data-drawer="2d"'), "utf-8")
        file = plain
    browser.events.clear()  # what pages before this one complained of
    page = browser.open(file, width)
    page.wait_for("!!document.querySelector('#look').dataset.drawn")
    page.evaluate("look.viewer.change({})")
    return page


def slide(page: Page, name: str, value: int) -> None:
    page.evaluate(
        f"(() => {{ const s = document.querySelector('[data-part={name}]');"
        f"s.value = {value}; s.dispatchEvent(new Event('input')); }})()"
    )


@pytest.mark.parametrize(("drawer", "width"), [("webgl", 1000), ("2d", 400)])
def test_structures_are_drawn_and_the_slider_changes_them(
    browser: Browser, looks: tuple[Path, dict[str, Walk]], drawer: str, width: int
) -> None:
    """With WebGL and without: some of the canvas is inked, and differently by depth."""
    page = viewer(browser, looks[0], width, drawer)
    slide(page, "depth", 1)
    ink, shallow = page.evaluate(INK)
    assert 0.05 < ink < 0.9
    assert page.evaluate(INK) == [ink, shallow]  # nothing turns any more
    slide(page, "depth", 3)
    _, deep = page.evaluate(INK)
    assert deep != shallow
    left, top, across, down = page.box("#look canvas")
    middle = left + across / 2, top + down / 2
    page.drag(middle, (middle[0] + across / 4, middle[1]))
    assert page.evaluate(INK)[1] != deep
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    said = page.evaluate("document.querySelector('[data-part=cells]').textContent")
    assert said.startswith("depth 3 of ")
    software = "software WebGL", "GPU stall"  # how Chromium draws where there is no GPU
    assert not [c for c in page.complaints() if not any(word in c for word in software)]
    requests = page.requests()
    assert any(address.endswith("look-inside-bvh.js") for address in requests)
    assert not any(address.startswith("http") for address in requests)


STEPPED = ("bvh", "wide", "kd-sah", "octree", "bsp", "grid", "boxes")


@pytest.fixture(scope="module")
def stepped(browser: Browser, looks: tuple[Path, dict[str, Walk]]) -> Page:
    """Return the page of the structures, opened once."""
    return viewer(browser, looks[0], 1000)


@pytest.mark.parametrize("name", STEPPED)
def test_steps_reach_the_hit_with_the_counts_of_the_walk(
    stepped: Page, looks: tuple[Path, dict[str, Walk]], name: str
) -> None:
    """Next, until the last step: nodes, boxes, triangles as the kernel counts them."""
    walk, page = looks[1][name], stepped
    page.evaluate(f"look.viewer.change({{name: '{name}', step: 0}})")
    page.wait_for(f"look.dataset.drawn.startsWith('{name} ')")
    before = page.evaluate(INK)[1]
    for _ in range(len(walk.steps) + 2):  # two clicks beyond the end do nothing
        page.evaluate("document.querySelector('[data-part=next]').click()")
    shown = page.evaluate(
        "[0, 1, 2, 3].map(k => +document.querySelector(`[data-part=count${k}]`)"
        ".textContent.replace(/,/g, ''))"
    )
    assert tuple(shown) == walk.counts
    said = page.evaluate("document.querySelector('[data-part=said]').textContent")
    assert said.endswith(f"The nearest hit is triangle {walk.prim} at {walk.t:.2f}.")
    place = page.evaluate("document.querySelector('[data-part=place]').textContent")
    assert place == f"step {len(walk.steps)} of {len(walk.steps)}"
    assert page.evaluate(INK)[1] != before
    cells = page.evaluate(
        "[...document.querySelectorAll('.totals .chosen td.num')].map(c => c.textContent)"
    )
    assert [int(cell.replace(",", "")) for cell in cells] == list(walk.counts[:3])
