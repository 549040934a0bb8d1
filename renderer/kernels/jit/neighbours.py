"""The source files that a kernel is made of: its own, and those that it imports."""

from __future__ import annotations

import ast
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2]  # the renderer


@functools.cache
def file_digest(path: str) -> str:
    """Return a short hash of a source file's content, and of what it imports beside it."""
    digests = b"".join(_read(file)[0] for file in with_neighbours(path))
    return hashlib.sha256(digests).hexdigest()[:16]


def with_neighbours(path: str | Path) -> list[Path]:
    """Return a source file and those that it imports from its folder or package, and so on.

    A user's kernels may call others of his, in another file: its edit counts as well. The
    renderer's own files are in the hash of all sources.
    """
    found: dict[Path, None] = {}  # in the order in which they were met
    asked: set[Path] = set()  # thousands of imports, of a few modules
    waiting = [Path(path).resolve()]
    while waiting:
        file = waiting.pop()
        if file in found or (found and PACKAGE in file.parents):
            continue
        found[file] = None
        for module in _read(file)[1]:
            if module not in asked:
                asked.add(module)
                beside = [module.parent / f"{module.name}.py", *module.rglob("*.py")]
                waiting += sorted(path for path in beside if path.is_file())
    return list(found)


def _read(file: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Return a file's hash, and where modules may lie that it imports."""
    state = file.stat()
    return _read_version(file, state.st_mtime_ns, state.st_size)


@functools.cache  # forty files of this repository meet each other's imports
def _read_version(file: Path, written: int, size: int) -> tuple[bytes, tuple[Path, ...]]:
    content = file.read_bytes()
    return hashlib.sha256(content).digest(), _imported_by(file, content)


def _imported_by(file: Path, content: bytes) -> tuple[Path, ...]:
    """Return where modules may lie that a file imports, inside functions too.

    The first name counts: of a package all files are taken.
    """
    try:
        tree = ast.parse(content)
    except SyntaxError:
        return ()  # whoever imports it will say so
    around = file.parent  # of a package: the folder in which its name is looked up
    while (around / "__init__.py").is_file():
        around = around.parent
    modules: dict[Path, None] = {}
    for statement in _statements_of(tree):
        names: list[str] = []
        folders: tuple[Path, ...] = (file.parent, around)
        if isinstance(statement, ast.Import):
            names = [alias.name for alias in statement.names]
        elif isinstance(statement, ast.ImportFrom):
            # `from . import a`: a file, or a name in the package's own
            own = [alias.name for alias in statement.names] + ["__init__"]
            names = [statement.module] if statement.module else own
            if statement.level:
                folders = (file.parents[statement.level - 1],)
        for name in names:
            first = name.partition(".")[0]
            modules.update(dict.fromkeys(folder / first for folder in folders))
    return tuple(modules)


def _statements_of(block: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements in a module, function, branch, ..., and those within them.

    `ast.walk` would visit all expressions as well, ten times as many.
    """
    for part in ("body", "orelse", "handlers", "finalbody", "cases"):
        for statement in getattr(block, part, ()):
            yield statement
            yield from _statements_of(statement)
