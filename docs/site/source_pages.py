"""Pages of source: each file that a page links to becomes one, with its lines numbered.

Pages link to files of the repository by relative paths, `../renderer/errors.py#L12`, which
work on a hosting page and in an editor. Here such a link leads to a page of the site, and
the site needs no network. Folders become lists of their files. CONTRIBUTING.md and
CHANGELOG.md are pages.
"""

from __future__ import annotations

import html
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from posixpath import relpath
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx.application import Sphinx
from sphinx.util import logging

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SCHEME = "source:"  # of links between reading a page and writing it
FOLDER = "source"  # of the site
# documents outside of docs/ that are pages, by the page
PAGES = {"contributing": "CONTRIBUTING.md", "changelog": "CHANGELOG.md"}
# documents that the site shows in another way
ELSEWHERE = {"README.md": "index.md", "scenes/README.md": "gallery.md"} | {
    document: f"{page}.md" for page, document in PAGES.items()
}
LINK = re.compile(r"(?<!!)\[(?P<text>(?:[^\[\]]|\[[^\]]*\])*)\]\((?P<target>[^)\s]+)\)")
PAGE_NAME = re.compile(r"\bdocs/([\w/-]+)\.md\b")  # in docstrings

logger = logging.getLogger(__name__)


def on_the_site(target: str, document: Path, page: str) -> str:
    """Return where a link of a document leads on the site.

    Parameters
    ----------
    target
        As the document has it, relative to itself.
    document
        The file that holds the link.
    page
        Under which name the document is a page, without the ending.
    """
    path, mark, fragment = target.partition("#")
    if "://" in target or not path or target.startswith("mailto:"):
        return target
    file = (document.parent / path).resolve()
    try:
        name = file.relative_to(ROOT).as_posix()
    except ValueError:
        return target
    if not file.exists():
        return target  # Sphinx warns
    if name in ELSEWHERE:
        name = f"docs/{ELSEWHERE[name]}"
    if name.startswith("docs/") and name.endswith(".md"):
        here = relpath(name.removeprefix("docs/"), Path(page).parent.as_posix() or ".")
        return f"{here}{mark}{fragment}"
    line = f"#L-{fragment[1:]}" if re.fullmatch(r"L\d+", fragment) else ""
    return f"{SCHEME}{name}{line}"


def rewrite_links(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace the links of a page; the text of `PAGES` comes from their documents."""
    document = DOCS / f"{page}.md"
    if page in PAGES:
        document = ROOT / PAGES[page]
        source[0] = document.read_text(encoding="utf-8")

    def replaced(link: re.Match[str]) -> str:
        return f"[{link['text']}]({on_the_site(link['target'], document, page)})"

    source[0] = LINK.sub(replaced, source[0])


def lead_to_pages(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Make links to source relative to the page that has them."""
    for link in doctree.findall(nodes.reference):
        target = link.get("refuri", "")
        if target.startswith(SCHEME):
            name, mark, line = target.removeprefix(SCHEME).partition("#")
            link["refuri"] = app.builder.get_relative_uri(page, page_of(name)) + mark + line
            link["internal"] = True


def page_of(name: str) -> str:
    """Return the page of a file or folder of the repository."""
    return f"{FOLDER}/{name}"


def linked_files(app: Sphinx) -> list[str]:
    """Return the files and folders that pages link to."""
    found: set[str] = set()
    for page in app.env.found_docs:
        for link in app.env.get_doctree(page).findall(nodes.reference):
            target = link.get("refuri", "")
            if target.startswith(SCHEME):
                found.add(target.removeprefix(SCHEME).partition("#")[0])
    return sorted(found)


def source_pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Yield a page for each file that is linked to, and put the file next to it."""
    files = linked_files(app)
    for name in files:
        path = ROOT / name
        title = html.escape(name)
        if path.is_dir():
            body = listed(path, set(files))
        else:
            copy = app.outdir / page_of(name)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
            own = html.escape(path.name)
            body = f'<p><a href="{own}" download>Download {own}</a></p>{shown(path)}'
        context = {"title": name, "body": f"<h1>{title}</h1>{body}"}
        yield page_of(name), context, "page.html"
    logger.info("%d pages of source", len(files))


def shown(path: Path) -> str:
    """Return a file as HTML with numbered lines, which have the ids `L-1` and so on."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return f"<p>{path.stat().st_size} bytes that are no text.</p>"
    try:
        lexer = get_lexer_for_filename(path.name, stripnl=False)
    except ClassNotFound:
        lexer = TextLexer(stripnl=False)
    formatter = HtmlFormatter(linenos="inline", linespans="L", cssclass="highlight source")
    return str(highlight(text, lexer, formatter))


def listed(path: Path, pages: set[str]) -> str:
    """Return the files of a folder, with links to those that are pages."""
    rows = []
    for file in sorted(path.iterdir()):
        if file.name.startswith((".", "__pycache__")):
            continue
        name = file.relative_to(ROOT).as_posix()
        shown_name = html.escape(file.name)
        if name in pages:
            address = relpath(name, path.parent.relative_to(ROOT).as_posix() or ".")
            shown_name = f'<a href="{html.escape(address)}.html">{shown_name}</a>'
        rows.append(f"<li>{shown_name}</li>")
    return f"<ul>{''.join(rows)}</ul>"


def mend_docstring(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Make the bars of |cos| plain text, and the names of pages links."""
    lines[:] = [PAGE_NAME.sub(r":doc:`\1`", line.replace("|", r"\|")) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("source-read", rewrite_links)
    app.connect("doctree-resolved", lead_to_pages)
    app.connect("autodoc-process-docstring", mend_docstring)
    app.connect("html-collect-pages", source_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
