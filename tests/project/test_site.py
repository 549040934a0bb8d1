"""The site builds without a warning, and each of its links leads somewhere."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

import renderer

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
needs_sphinx = pytest.mark.skipif(
    any(
        importlib.util.find_spec(name) is None for name in ("sphinx", "myst_parser", "furo")
    ),
    reason="needs the extra `docs`: pip install '.[docs]', or `make docs`",
)


class Links(HTMLParser):
    """Where a page leads to, what it loads, and which places in it can be led to."""

    def __init__(self):
        super().__init__()
        self.links, self.loaded, self.places = [], [], {""}

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.places |= {found[key] for key in ("id", "name") if found.get(key)}
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        self.loaded += [found[key] for key in ("src",) if found.get(key)]
        if tag == "link" and "stylesheet" in found.get("rel", ""):
            self.loaded.append(found["href"])


def read(path):
    page = Links()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def dead_links(site):
    """Links and pictures that lead nowhere, and all that is loaded from a network."""
    pages = {path: read(path) for path in site.rglob("*.html")}
    dead = []
    for path, page in pages.items():
        for target in page.links + page.loaded:
            address, _, place = target.partition("#")
            if re.match(r"\w+:", target):
                if target in page.loaded and not target.startswith("data:"):
                    dead.append((path.name, target))
                continue
            address = unquote(address.partition("?")[0])
            file = (path.parent / address).resolve() if address else path
            places = pages[file].places if file in pages else {""}
            if not file.is_file() or unquote(place) not in places:
                dead.append((str(path.relative_to(site)), target))
    return dead


@needs_sphinx
@pytest.mark.slow
def test_the_site_builds_strictly_and_its_links_lead_somewhere(tmp_path):
    """Warnings are errors: a page in no list, a link without target, a bad docstring."""
    words = ["-b", "html", "-E", "-n", "-W", "--keep-going", "-q", DOCS, tmp_path / "site"]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "-c", DOCS / "site", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    site = tmp_path / "site"
    assert len(list(site.rglob("*.html"))) > 100
    assert not dead_links(site)
    lecture = (site / "lecture.html").read_text(encoding="utf-8")
    assert 'href="source/renderer/simple/camera.py.html#L-' in lecture


def test_a_dead_link_is_found(tmp_path):
    """The check that the strict build rests on can fail."""
    (tmp_path / "a.html").write_text(
        '<a href="b.html#here">x</a><a href="b.html#gone">x</a><a href="c.html">x</a>'
        '<a href="https://example.org">x</a><script src="https://example.org/x.js">'
    )
    (tmp_path / "b.html").write_text('<p id="here">')
    assert [target for _, target in dead_links(tmp_path)] == [
        "b.html#gone",
        "c.html",
        "https://example.org/x.js",
    ]


def test_every_page_is_in_the_list_of_pages():
    """Without Sphinx too: a page that no list names would be a warning of the build."""
    lists = [(DOCS / name).read_text(encoding="utf-8") for name in PAGES_WITH_LISTS]
    named = set()
    for folder, text in zip(("", "decisions/"), lists, strict=True):
        for block in re.findall(r"```\{toctree\}\n(.*?)```", text, flags=re.DOTALL):
            lines = [line for line in block.splitlines() if line and line[0] != ":"]
            named |= {f"{folder}{line}" for line in lines}
    pages = {
        path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md")
    }
    assert named | {"index"} == pages


PAGES_WITH_LISTS = ("index.md", "decisions/index.md")


def test_the_reference_has_every_public_name():
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    named = re.findall(r"^\.\. auto\w+:: renderer\.(\w+)$", text, flags=re.MULTILINE)
    assert sorted(named) == sorted(renderer.__all__)
