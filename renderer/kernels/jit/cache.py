"""Where compiled kernels are kept between runs, and what they are known by.

Numba's own cache looks only at the file that holds a function, by its path and time: an
edit in another file that the function calls would go unnoticed (Numba manual, "Notes on
Caching"), and a second clone would compile everything again. Here the folder is named by a
hash of all sources that kernels are made of, so that equal sources share their kernels
wherever they lie.
"""

from __future__ import annotations

import functools
import glob
import hashlib
import logging
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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

from renderer.kernels.jit.linking import rebuilt, reduced
from renderer.kernels.jit.neighbours import PACKAGE, file_digest
from renderer.kernels.jit.shipped import LEVELS, shipped_for_this_processor
from renderer.kernels.jit.used_folders import use_folder
from renderer.process.cache_folder import cache_folder, cache_root
from renderer.process.signals import put_off_interrupts

try:
    import fcntl
except ImportError:  # not on Windows: there, render one scene at a time for the first time
    fcntl = None  # type: ignore[assignment]

# The folders whose files kernels are made of: all that is in them counts.
KERNEL_FOLDERS = (
    "accelerators",
    "integrators",
    "kernels",
    "plugins",
    "replay",
    "textbook",
)


def _sources_hash() -> str:
    digest = hashlib.sha256()
    for folder in KERNEL_FOLDERS:
        for source in sorted((PACKAGE / folder).rglob("*.py")):
            digest.update(source.relative_to(PACKAGE).as_posix().encode())
            digest.update(source.read_bytes())
    config = numba.config
    settings = config.OPT, config.BOUNDSCHECK, config.DEBUGINFO_DEFAULT, config.USING_SVML
    versions = numba.__version__, llvmlite.__version__, sys.implementation.cache_tag
    digest.update(" ".join(map(str, (*versions, *settings))).encode())
    return digest.hexdigest()[:16]


_SOURCES = _sources_hash()
KERNEL_CACHE = cache_root() / "kernels" / _SOURCES


@functools.cache
def _is_kernel_source(source: str) -> bool:
    """Return whether the hash of all sources covers a file."""
    return any(PACKAGE / folder in Path(source).parents for folder in KERNEL_FOLDERS)


@functools.cache  # the check makes a file
def is_kept_in(folder: Path) -> bool:
    """Return whether a folder of kernels can be used; older ones of this program go."""
    try:
        cache_folder("kernels")
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        _warn_once(folder, error.strerror or str(error), EACH_TIME)
        return False
    with suppress(OSError), _turn(str(folder.parent)):
        program = (sys.prefix, str(PACKAGE))
        use_folder(folder, program, list(folder.parent.iterdir()))
    return True


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
        self._source = source

    @classmethod
    def from_function(cls, function: Any, source: str) -> _ByContent | None:
        """Return None for what has no source file, which then is not kept."""
        # "<string>" would be looked for in the working directory
        if not (Path(source).is_absolute() and Path(source).is_file()):
            return None
        if not is_kept_in(KERNEL_CACHE) and not shipped_for_this_processor(_SOURCES):
            return None
        return cls(function, source)

    def ensure_cache_path(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        if not _is_kernel_source(self._source):  # each edit of it has another folder
            module = self._folder.name.rpartition("-")[0]
            older = list(KERNEL_CACHE.glob(f"{glob.escape(module)}-*"))
            use_folder(self._folder, (self._source,), older)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""  # the folder's name says it

    def get_disambiguator(self) -> str:
        return str(self._line)


# what an index raises that names classes which this program lacks
_FOREIGN = (ImportError, AttributeError)
_CHECKSUM = 32  # bytes of SHA-256 in front of each file's content


class _Damaged(OSError):
    """A file whose content is not what was written: Numba passes over what it cannot read.

    A wrong byte of machine code would end the process, or give a wrong picture.
    """


class _Index(IndexDataCacheFile):  # type: ignore[misc]
    """Lets processes take turns when they save a kernel, and reads indices with care.

    Numba reads an index, takes a file name that is free, and writes the index: two
    processes at once would give one name to two kernels, and a later run would call the
    wrong one. An index that names classes which this program lacks is taken as empty, but
    never written over: it is in use by the program that has them. A damaged index or
    kernel, as a full disk or a crash leaves it, is known by its checksum: the kernel is
    compiled again and written anew.

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
        foreign = sorted(m for m in modules if not m.startswith(f"{PACKAGE.name}."))
        if not foreign:
            return self
        digest = hashlib.sha256(" ".join(foreign).encode()).hexdigest()[:12]
        return _Index(self._cache_path, f"{self._base}-{digest}", self._source_stamp)

    def load(self, key: Any) -> Any:
        return super(_Index, self._of_the_same_modules(key)).load(key)

    def _load_index(self) -> Any:
        try:
            return pickle.loads(_read_checked(Path(self._index_path)))
        except (*_FOREIGN, FileNotFoundError, _Damaged):
            return {}

    def _save_index(self, overloads: Any) -> None:
        self._save_checked(self._index_path, overloads)

    def _load_data(self, name: str) -> Any:
        return pickle.loads(_read_checked(Path(self._data_path(name))))

    def _save_data(self, name: str, data: Any) -> None:
        self._save_checked(self._data_path(name), data)

    def _save_checked(self, path: str, content: Any) -> None:
        dumped = self._dump(content)
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(dumped).digest() + dumped)

    def save(self, key: Any, data: Any) -> None:
        index = self._of_the_same_modules(key)
        with _turn(self._cache_path):
            try:
                pickle.loads(_read_checked(Path(index._index_path)))
            except _FOREIGN:
                return
            except FileNotFoundError:
                pass
            except _Damaged:  # a name in a new index must not find the code of another
                for kernel in Path(index._cache_path).glob(f"{glob.escape(index._base)}.*"):
                    kernel.unlink()
            super(_Index, index).save(key, data)


def _read_checked(path: Path) -> bytes:
    content = path.read_bytes()
    checksum, dumped = content[:_CHECKSUM], content[_CHECKSUM:]
    if hashlib.sha256(dumped).digest() != checksum:
        _warn_once(KERNEL_CACHE, f"{path.name} is damaged", AGAIN)
        raise _Damaged(f"{path} is damaged")
    return dumped


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

    def reduce(self, compiled: Any) -> Any:
        return reduced(compiled)

    def rebuild(self, target_context: Any, kept: Any) -> Any:
        return rebuilt(target_context, kept)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """The kept variants of one kernel."""

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _Index(self._cache_path, self._impl.filename_base, "")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a kept variant; None if there is none, or none that may be read."""
        for load, text in ((super().load_overload, EACH_TIME), (self._shipped, AGAIN)):
            try:
                with put_off_interrupts():  # LLVM's objects must not stay half made
                    found = load(sig, target_context)
            except OSError as error:
                _warn_once(KERNEL_CACHE, error.strerror or str(error), text)
            else:
                if found is not None:
                    return found
        return None

    def _shipped(self, sig: Any, target_context: Any) -> Any:
        """Return a variant from the wheel, where files lie as in the builder's cache."""
        codegen = target_context.codegen()
        signature, (triple, *_), code = self._index_key(sig, codegen)
        module = Path(self._cache_path).name
        for level, folder in shipped_for_this_processor(_SOURCES):
            index = _Index(str(folder / module), self._impl.filename_base, "")
            kept = index.load((signature, (triple, level, LEVELS[level]), code))
            if kept is not None:
                return self._impl.rebuild(target_context, kept)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a variant; where the disk is full or not ours, go on without."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _warn_once(KERNEL_CACHE, error.strerror, EACH_TIME)


EACH_TIME = "kernels cannot all be kept, and are compiled each time: %s: %s"
AGAIN = "kernels are compiled again: %s: %s"


_warned: set[str] = set()


def _warn_once(folder: Path, reason: str, text: str) -> None:
    """Log a warning once a process, and not for each of a scene's hundred kernels."""
    if text not in _warned:
        _warned.add(text)
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
