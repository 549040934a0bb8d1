"""The look into acceleration structures, in a real browser."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from headless_browser import Browser, Page

from reports.bench.rows import Row, Run, Table
from reports.bench.study import Bench
from reports.look.shared_files import write_shared_files
from reports.pages.accelerators_page import accelerators_page
from reports.studies.accelerators import COUNTS, INSIDE, STUDY
from reports.trials.inside import Looks, script
from reports.trials.meshes import teapot
from reports.trials.structure_walks import Walk

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
    write_shared_files(folder, [])
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
