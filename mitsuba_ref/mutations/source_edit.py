"""A replacement inside one definition of the renderer's source, found by its name.

`Edit("diffuse.eval_pdf", "INV_PI * cos_i", "cos_i")` edits the function `eval_pdf` of the
module `diffuse`, in whatever folder that module lies. The old text is compared with the
function's source token by token: line breaks, comments and trailing commas do not matter.
"""

from __future__ import annotations

import ast
import difflib
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

_TOKEN = re.compile(r"(?P<comment>\#[^\n]*)|\"[^\"\n]*\"|'[^'\n]*'|\w+|[^\w\s]")
_CLOSING = {")", "]", "}"}


class AnchorError(ValueError):
    """What an edit names is not in the source, or not exactly once."""


@dataclass(frozen=True)
class Edit:
    """One replacement in one definition.

    Attributes
    ----------
    symbol
        The end of a dotted name: "module.function", "Class.method", "module.CONSTANT", or
        "module.py" for the whole file. If no name ends like that, a definition whose last
        part is unique in the package is taken: it has moved to another module.
    old
        Source text that occurs exactly once in the definition, compared by tokens.
    new
        The text to put in its place. Further lines get the indentation of the first.
    """

    symbol: str
    old: str
    new: str


@dataclass(frozen=True)
class Definition:
    """A function, class, constant or file of a package."""

    path: Path
    module: str  # "plugins.bsdfs.smooth.diffuse"
    name: str  # within the module: "eval_pdf", "Class.method", or "py" for the whole file

    @property
    def symbol(self) -> str:
        """The last two parts of the dotted name."""
        return ".".join(f"{self.module}.{self.name}".split(".")[-2:])


def find_definition(symbol: str, package: Path) -> Definition:
    """Return the definition that a symbol names.

    Raises
    ------
    AnchorError
        If no or several definitions fit, with the candidates or the most similar names.
    """
    known = _definitions(package)
    moved = symbol if symbol.endswith(".py") else symbol.split(".")[-1]
    for end in (f".{symbol}", f".{moved}"):
        found = [d for d in known if f".{d.module}.{d.name}".endswith(end)]
        if len(found) == 1:
            return found[0]
        if found:
            names = ", ".join(sorted(f"{d.module}.{d.name}" for d in found))
            raise AnchorError(f"{symbol}: several definitions have that name: {names}")
    near = difflib.get_close_matches(symbol, {d.symbol for d in known}, n=5, cutoff=0.5)
    raise AnchorError(f"{symbol}: no such definition; similar: {', '.join(near) or 'none'}")


def edited_text(source: str, edit: Edit, place: Definition) -> str:
    """Return a file's text with the replacement made.

    Parameters
    ----------
    source
        The text of the file, in which other edits may have been made already.
    edit
        What to replace.
    place
        The definition that `edit.symbol` names.

    Raises
    ------
    AnchorError
        If the old text is not exactly once in the definition, or nothing would change.
    """
    if _tokens(edit.old) == _tokens(edit.new):
        raise AnchorError(f"{edit.symbol}: {edit.old!r} is replaced by itself")
    first, last = _lines_of_definitions(source)[place.name]
    lines = source.splitlines(keepends=True)
    start, end = sum(map(len, lines[: first - 1])), sum(map(len, lines[:last]))
    spans = _occurrences(edit.old, source[start:end])
    if len(spans) != 1:
        raise AnchorError(
            f"{edit.symbol}: expected {edit.old!r} exactly once in {place.path}, lines "
            f"{first} to {last}, found it {len(spans)} times"
        )
    begin, stop = (start + offset for offset in spans[0])
    line = source[source.rfind("\n", 0, begin) + 1 : begin]
    indentation = line[: len(line) - len(line.lstrip())]
    return source[:begin] + edit.new.replace("\n", "\n" + indentation) + source[stop:]


def definitions_with(text: str, package: Path) -> list[str]:
    """Return the symbols of the definitions that contain a text, outer ones too."""
    found = []
    for path in sorted(package.rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        for begin, _ in _occurrences(text, source):
            line = source.count("\n", 0, begin) + 1
            for name, (first, last) in _lines_of_definitions(source).items():
                if name != "py" and first <= line <= last:
                    found.append(f"{path.stem}.{name}")
    return found


def _definitions(package: Path) -> tuple[Definition, ...]:
    sources = sorted(package.rglob("*.py"))
    return _definitions_in(package, tuple((s, s.stat().st_mtime_ns) for s in sources))


@lru_cache(maxsize=2)
def _definitions_in(
    package: Path, sources: tuple[tuple[Path, int], ...]
) -> tuple[Definition, ...]:
    """Return all definitions of a package in this state: its files and their times."""
    return tuple(
        Definition(path, ".".join(path.relative_to(package).with_suffix("").parts), name)
        for path, _ in sources
        for name in _lines_of_definitions(path.read_text(encoding="utf-8"))
    )


@cache
def _lines_of_definitions(source: str) -> dict[str, tuple[int, int]]:
    """Return the first and last line, from 1, of each definition in a file's text."""
    found = {"py": (1, source.count("\n") + 1)}

    def descend(prefix: str, body: list[ast.stmt], constants: bool) -> None:
        for node in body:
            names: list[str] = []
            first = node.lineno
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names = [node.name]
                first = min([first, *(d.lineno for d in node.decorator_list)])
                descend(f"{prefix}{node.name}.", node.body, isinstance(node, ast.ClassDef))
            elif constants and isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                names = [target.id for target in targets if isinstance(target, ast.Name)]
            last = node.end_lineno or first
            found.update({f"{prefix}{name}": (first, last) for name in names})

    descend("", ast.parse(source).body, constants=True)
    return found


def _occurrences(text: str, source: str) -> list[tuple[int, int]]:
    """Return the spans of characters of `source` that have the tokens of `text`."""
    wanted = [token for token, _, _ in _tokens_at(text)]
    there = _tokens_at(source)
    size = len(wanted)
    return [
        (there[k][1], there[k + size - 1][2])
        for k in range(len(there) - size + 1)
        if [token for token, _, _ in there[k : k + size]] == wanted
    ]


def _tokens(text: str) -> list[str]:
    return [token for token, _, _ in _tokens_at(text)]


def _tokens_at(text: str) -> list[tuple[str, int, int]]:
    """Return the tokens of a piece of source without comments and trailing commas."""
    found = [
        (match[0], match.start(), match.end())
        for match in _TOKEN.finditer(text)
        if match["comment"] is None
    ]
    following = [*(token for token, _, _ in found[1:]), ""]
    return [
        token
        for token, after in zip(found, following, strict=False)
        if not (token[0] == "," and after in _CLOSING)
    ]
