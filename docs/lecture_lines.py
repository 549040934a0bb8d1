"""Keep the links of lecture.md on the lines they mean.

A link there names a file and a symbol of it, [`fresnel.py::fresnel_dielectric`](...#L11).
The symbol is what counts. `python docs/lecture_lines.py` writes the line where it stands
now, and the file if it has moved to the only other one that defines it; what it cannot
find is an error. tests/project/test_lecture.py fails for what is missing or has moved.
"""

from __future__ import annotations

import ast
import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
LECTURE = ROOT / "docs" / "lecture.md"
FOLDERS = ("renderer", "mitsuba_ref", "reports", "scenes")

# [`any text.py::symbol`](path#L12), the line being optional
LINK = re.compile(r"\[`[^`\]]*?(?P<file>[^`/\]]+)::(?P<symbol>[\w.]+)`\]\((?P<path>[^)#]+)"
                  r"(?:#L\d+)?\)")  # fmt: skip


def symbols(path: Path) -> dict[str, int]:
    """Return the line of each function, class, method and constant of a file, from 1 on."""
    found: dict[str, int] = {}

    def visit(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found[prefix + node.name] = node.lineno
            if isinstance(node, ast.ClassDef):
                visit(node.body, f"{prefix}{node.name}.")
            targets = node.targets if isinstance(node, ast.Assign) else []
            if isinstance(node, ast.AnnAssign):
                targets = [node.target]
            for target in targets:
                if isinstance(target, ast.Name):
                    found[prefix + target.id] = node.lineno

    visit(ast.parse(path.read_text(encoding="utf-8")).body, "")
    return found


def find(path: Path, symbol: str) -> tuple[Path, int] | None:
    """Return where a symbol is: in `path`, or in the only other file that defines it."""
    if path.exists() and symbol in (lines := symbols(path)):
        return path, lines[symbol]
    sources = [source for folder in FOLDERS for source in (ROOT / folder).rglob("*.py")]
    places = [(source, symbols(source).get(symbol)) for source in sources]
    found = [(source, line) for source, line in places if line is not None]
    return found[0] if len(found) == 1 else None


def on_their_lines(text: str) -> tuple[str, list[str]]:
    """Return the page with its links mended, and those that lead nowhere."""
    missing = []

    def mended(link: re.Match[str]) -> str:
        path = (LECTURE.parent / link["path"]).resolve()
        found = find(path, link["symbol"])
        if found is None:
            missing.append(f"{link['path']}::{link['symbol']}")
            return link[0]
        target = Path(os.path.relpath(found[0], LECTURE.parent)).as_posix()
        shown = link[0].partition("](")[0].replace(link["file"], found[0].name)
        return f"{shown}]({target}#L{found[1]})"

    return LINK.sub(mended, text), missing


if __name__ == "__main__":
    page, missing = on_their_lines(LECTURE.read_text(encoding="utf-8"))
    LECTURE.write_text(page, encoding="utf-8")
    if missing:
        sys.exit("no such symbol: " + ", ".join(missing))
