"""Where compiled kernels are kept between runs, and what they are known by.

Numba's own cache looks only at the file that holds a function, by its path and time: an
edit in another file that the function calls would go unnoticed (Numba manual, "Notes on
Caching"), and a second clone would compile everything again. Here the folder is named by a
hash of all sources that kernels are made of, so that equal sources share their kernels
wherever they lie.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import llvmlite
import numba
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

_PACKAGE = Path(__file__).parents[1]
# what no kernel calls: an edit there need not compile anything anew
_WITHOUT_KERNELS = (
    "__main__.py",
    "accelerators/grid_validation.py",
    "cli.py",
    "compilation.py",
    "explanation.py",
    "heat_map.py",
    "image",
    "interrupts.py",
    "light_order.py",
    "plan",
    "progress_display.py",
    "render.py",
    "rendering.py",
    "replay/instance_matrices.py",
    "replay/pixel_seeds.py",
    "replay/triangle_arithmetic.py",
    "scene_file/",
    "srgb.py",
    "threads.py",
)


def _is_hashed(source: Path) -> bool:
    """Return whether an edit of a file moves all kernels to another folder."""
    if not source.is_relative_to(_PACKAGE):
        return False
    return not source.relative_to(_PACKAGE).as_posix().startswith(_WITHOUT_KERNELS)


def _sources_hash() -> str:
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.rglob("*.py")):
        if not _is_hashed(source):
            continue
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
    """Return a short hash of a source file's content."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]


class _ByContent(_CacheLocator):  # type: ignore[misc]  # Numba has no types
    """The folder of one module's kernels, named by what it is and not by where it lies."""

    def __init__(self, function: Any, source: str) -> None:
        self._py_file = source
        self._line = function.__code__.co_firstlineno
        module = function.__module__.replace(".", "_")
        if not _is_hashed(Path(source)):  # a user's or a test's own, or one left out
            module = f"{module}-{file_digest(source)}"
        self._folder = KERNEL_CACHE / module

    @classmethod
    def from_function(cls, function: Any, source: str) -> _ByContent | None:
        """Return None for what has no source file, which then is not kept."""
        if not Path(source).is_file():
            return None
        locator = cls(function, source)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator

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
    """

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except _UNREADABLE:
            return {}

    def save(self, key: Any, data: Any) -> None:
        with _turn(self._cache_path):
            try:
                super()._load_index()
            except _UNREADABLE:
                return
            super().save(key, data)


class _Implementation(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_ByContent,)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """The kept variants of one kernel."""

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _Index(self._cache_path, self._impl.filename_base, "")


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
