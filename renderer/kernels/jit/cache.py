"""Where compiled kernels are kept between runs, and what they are known by.

Numba's own cache looks only at the file that holds a function, by its path and time: an
edit in another file that the function calls would go unnoticed (Numba manual, "Notes on
Caching"), and a second clone would compile everything again. Here the folder is named by a
hash of all sources that kernels are made of, so that equal sources share their kernels
wherever they lie.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import logging
import os
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import llvmlite
import numba
from numba.core import types
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    _CacheLocator,
)

try:
    import fcntl
except ImportError:  # not on Windows: there, render one scene at a time for the first time
    fcntl = None  # type: ignore[assignment]

_PACKAGE = Path(__file__).parents[2]
# The folders whose files kernels are made of: all that is in them counts.
KERNEL_FOLDERS = (
    "accelerators",
    "integrators",
    "kernels",
    "kinds",
    "replay",
)


def _sources_hash() -> str:
    digest = hashlib.sha256()
    for folder in KERNEL_FOLDERS:
        for source in sorted((_PACKAGE / folder).rglob("*.py")):
            digest.update(source.relative_to(_PACKAGE).as_posix().encode())
            digest.update(source.read_bytes())
    digest.update(f"{numba.__version__} {llvmlite.__version__} {sys.version}".encode())
    return digest.hexdigest()[:16]


def cache_root() -> Path:
    """Folder for everything lightproof keeps between runs; `LIGHTPROOF_CACHE` moves it."""
    chosen = os.environ.get("LIGHTPROOF_CACHE")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "lightproof"


KERNEL_CACHE = cache_root() / "kernels" / _sources_hash()


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
        if file in found or (found and _PACKAGE in file.parents):
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


@functools.cache
def _is_kernel_source(source: str) -> bool:
    """Return whether the hash of all sources covers a file."""
    return any(_PACKAGE / folder in Path(source).parents for folder in KERNEL_FOLDERS)


@functools.cache  # asking makes a file
def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


class _ByContent(_CacheLocator):  # type: ignore[misc]  # Numba has no types
    """The folder of one module's kernels, named by what it is and not by where it lies."""

    def __init__(self, function: Any, source: str) -> None:
        self._py_file = source
        self._line = function.__code__.co_firstlineno
        module = function.__module__.replace(".", "_")
        if not _is_kernel_source(source):
            # a user's or a test's own kernels, or one that no other file has a part in
            module = f"{module}-{file_digest(source)}"
        self._folder = KERNEL_CACHE / module

    @classmethod
    def from_function(cls, function: Any, source: str) -> _ByContent | None:
        """Return None for what has no source file, which then is not kept."""
        if not Path(source).is_file() or not _is_writable(KERNEL_CACHE):
            return None
        return cls(function, source)

    def ensure_cache_path(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""  # the folder's name says it

    def get_disambiguator(self) -> str:
        return str(self._line)


# what an index raises that names classes of a program which is not this one, or is cut off
_UNREADABLE = (ImportError, AttributeError, EOFError, pickle.UnpicklingError)


class _Index(IndexDataCacheFile):  # type: ignore[misc]
    """Lets processes take turns when they save a kernel, and reads indices with care.

    Numba reads an index, takes a file name that is free, and writes the index: two
    processes at once would give one name to two kernels, and a later run would call the
    wrong one. An index that cannot be read is taken as empty, but never written over: it
    is in use by the program that can read it.

    To read an index is to import the modules of all classes in it. So kernels that work on
    classes of a user's have an index for his modules alone: nobody else's run would want
    to import them, with all that they do.
    """

    def __init__(self, folder: str, base: str, stamp: str) -> None:
        super().__init__(folder, base, stamp)
        self._base = base

    def _of_the_same_modules(self, key: Any) -> _Index:
        """Return the index for the classes of a key's signature."""
        modules = {m for numba_type in key[0] for m in _modules_of(numba_type)}
        foreign = sorted(m for m in modules if not m.startswith(f"{_PACKAGE.name}."))
        if not foreign:
            return self
        digest = hashlib.sha256(" ".join(foreign).encode()).hexdigest()[:12]
        return _Index(self._cache_path, f"{self._base}-{digest}", self._source_stamp)

    def load(self, key: Any) -> Any:
        return super(_Index, self._of_the_same_modules(key)).load(key)

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except _UNREADABLE:
            return {}

    def save(self, key: Any, data: Any) -> None:
        index = super(_Index, self._of_the_same_modules(key))
        with _turn(self._cache_path):
            try:
                index._load_index()
            except _UNREADABLE:
                return
            index.save(key, data)


def _modules_of(numba_type: Any) -> Iterator[str]:
    """Yield the modules of the named tuples in a type, through records as well."""
    inside = getattr(numba_type, "record", numba_type)
    if isinstance(inside, types.BaseNamedTuple):
        yield inside.instance_class.__module__
    if isinstance(inside, types.BaseTuple):
        for part in inside:
            yield from _modules_of(part)


class _Implementation(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_ByContent,)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """The kept variants of one kernel."""

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _Index(self._cache_path, self._impl.filename_base, "")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a kept variant; None if there is none, or none that may be read."""
        try:
            return super().load_overload(sig, target_context)
        except OSError as error:
            _warn_once(KERNEL_CACHE, error.strerror)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a variant; where the disk is full or not ours, go on without."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _warn_once(KERNEL_CACHE, error.strerror)


@functools.cache  # and not once for each of a scene's hundred kernels
def _warn_once(folder: Path, reason: str) -> None:
    text = "kernels cannot all be kept, and are compiled each time: %s: %s"
    logging.getLogger("renderer").warning(text, folder, reason)


@contextmanager
def _turn(folder: str) -> Iterator[None]:
    """Wait for the folder's lock, where the system has locks."""
    if fcntl is None:
        yield
        return
    with open(Path(folder) / "save.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def keep(dispatcher: Any, function: Any) -> None:
    """Let a dispatcher keep what it compiles, if its source can be told."""
    try:
        dispatcher._cache = KernelCache(function)
    except RuntimeError:  # no locator: written at a prompt, or the folder is not writable
        return
