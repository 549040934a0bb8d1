"""The cache of compiled kernels on disk: folders, files, checks, and kernels in a wheel."""

from __future__ import annotations

import ast
import functools
import glob
import hashlib
import json
import logging
import pickle
import re
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numba
from numba.core import config, types
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    _CacheLocator,
)

from renderer.kernels.jit.linking import rebuilt, reduced
from renderer.process.cache_folder import cache_folder, cache_root
from renderer.process.signals import put_off_interrupts
from renderer.process.whole_file import write_whole

# ------------------------------------------------------------------------ source files
# The source files that a kernel depends on: its own, and those that it imports.

PACKAGE = Path(__file__).parents[2]  # the renderer


@functools.cache
def file_digest(path: str) -> str:
    """Return a short hash of a source file and of its imports by `with_neighbours`."""
    digests = b"".join(_read(file)[0] for file in with_neighbours(path))
    return hashlib.sha256(digests).hexdigest()[:16]


def with_neighbours(path: str | Path) -> list[Path]:
    """Return a source file and, recursively, what it imports from its folder or package.

    A user's kernel may call kernels in another file, so edits there count as well. The
    renderer's own files are left out; the hash of all sources covers them.
    """
    found: dict[Path, None] = {}  # in the order of discovery
    looked_at: set[Path] = set()  # there are thousands of imports, but few modules
    waiting = [Path(path).resolve()]
    while waiting:
        file = waiting.pop()
        if file in found or (found and PACKAGE in file.parents):
            continue
        found[file] = None
        for module in _read(file)[1]:
            if module not in looked_at:
                looked_at.add(module)
                around = [module.parent / f"{module.name}.py", *module.rglob("*.py")]
                waiting += sorted(path for path in around if path.is_file())
    return list(found)


def _read(file: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Return a file's hash, and possible paths of the modules that it imports."""
    state = file.stat()
    return _read_version(file, state.st_mtime_ns, state.st_size)


@functools.cache  # forty files of this repository import one another
def _read_version(file: Path, written: int, size: int) -> tuple[bytes, tuple[Path, ...]]:
    content = file.read_bytes()
    return hashlib.sha256(content).digest(), _imported_by(file, content)


def _imported_by(file: Path, content: bytes) -> tuple[Path, ...]:
    """Return possible paths of the modules that a file imports, also inside functions.

    Only the first part of a dotted name counts: of a package all files are taken.
    """
    try:
        tree = ast.parse(content)
    except SyntaxError:
        return ()  # importing the file will raise the same error
    around = file.parent  # the folder that contains the outermost package
    while (around / "__init__.py").is_file():
        around = around.parent
    modules: dict[Path, None] = {}
    for statement in _statements_of(tree):
        names: list[str] = []
        folders: tuple[Path, ...] = (file.parent, around)
        if isinstance(statement, ast.Import):
            names = [alias.name for alias in statement.names]
        elif isinstance(statement, ast.ImportFrom):
            # `from . import a`: a file, or a name in the package's `__init__`
            own = [alias.name for alias in statement.names] + ["__init__"]
            names = [statement.module] if statement.module else own
            if statement.level:
                folders = (file.parents[statement.level - 1],)
        for name in names:
            first = name.partition(".")[0]
            modules.update(dict.fromkeys(folder / first for folder in folders))
    return tuple(modules)


def _statements_of(block: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements of a module, function, branch and so on, recursively.

    `ast.walk` would visit all expressions as well, ten times as many.
    """
    for part in ("body", "orelse", "handlers", "finalbody", "cases"):
        for statement in getattr(block, part, ()):
            yield statement
            yield from _statements_of(statement)


# ------------------------------------------------------------------------- used folders
# The programs that use a folder of compiled kernels. A folder without any is removed.
#
# A folder of kernels is named by a hash of their sources. After an edit the same program
# uses another folder, and the old one would stay forever: 8,580 files, 240 MB, after one
# test run.

_NAME = "used-by.json"
_OURS = re.compile(r"(.+-)?[0-9a-f]{16}")  # names of kernel folders end in a hash


def use_folder(folder: Path, user: tuple[str, ...], others: Iterable[Path]) -> None:
    """Record that `user` uses a folder, and remove other folders without any user.

    Nothing is raised if the disk is full or a folder belongs to another user: an old kernel
    does no harm. Links, folders with another kind of name, and folders with a damaged
    record of users are never removed.

    Parameters
    ----------
    folder
        The folder in use from now on; it exists.
    user
        Paths that identify a program, such as those of its sources.
    others
        Folders that `user` may have used before. A recorded user counts if all its paths
        still exist.
    """
    users = _users(folder)
    if user in users:
        return
    with suppress(OSError):
        for other in others:
            if other == folder or other.is_symlink() or not _OURS.fullmatch(other.name):
                continue
            noted = _users(other)
            if not noted and (other / _NAME).exists():  # damaged
                continue
            left = [one for one in noted if one != user and _exists(one)]
            if not left:
                shutil.rmtree(other, ignore_errors=True)
            elif left != noted:
                _note(other, left)
        _note(folder, [*users, user])


def _users(folder: Path) -> list[tuple[str, ...]]:
    """Return the recorded users; none if the file is missing or damaged."""
    try:
        found = json.loads((folder / _NAME).read_bytes())
        return [tuple(map(str, user)) for user in found if isinstance(user, list)]
    except (OSError, ValueError, TypeError, RecursionError):
        return []


def _exists(user: tuple[str, ...]) -> bool:
    return all(Path(path).exists() for path in user)


def _note(folder: Path, users: list[tuple[str, ...]]) -> None:
    write_whole(folder / _NAME, json.dumps(users).encode())


# ------------------------------------------------------------------------------ shipped
# Kernels in a wheel, compiled for levels of x86-64 instead of for one processor.
#
# `build_wheel.py` makes them, with Numba's environment variables set to a level. At run
# time these variables are not set. A kernel that is missing from the user's cache is
# searched under the highest level that this processor supports.

_V3 = (
    "+avx,+avx2,+bmi,+bmi2,+cx16,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sahf,"
    "+sse3,+sse4.1,+sse4.2,+ssse3,+xsave"
)
# LLVM's processor name -> its features, as in NUMBA_CPU_FEATURES; highest level first
LEVELS = {
    "x86-64-v4": f"{_V3},+avx512bw,+avx512cd,+avx512dq,+avx512f,+avx512vl",
    "x86-64-v3": _V3,
}
SHIPPED = PACKAGE / "kernels" / "compiled"


@functools.cache
def shipped_for_this_processor(sources: str) -> tuple[tuple[str, Path], ...]:
    """Return (level, folder of its kernels) for each level that this processor supports.

    `sources` is the hash of all kernel sources. The result is empty in a checkout, and if
    Numba was told to compile for another processor.
    """
    if config.CPU_NAME is not None or config.CPU_FEATURES is not None:
        return ()
    if SHIPPED.is_dir() and not (SHIPPED / sources).is_dir():
        logging.getLogger("renderer").warning(
            "kernels are compiled again: those in %s are for another version of Python or "
            "Numba",
            SHIPPED,
        )
    folders = ((level, SHIPPED / sources / level) for level in LEVELS)
    return tuple((level, path) for level, path in folders if path.is_dir() and runs(level))


def runs(level: str) -> bool:
    """Return whether this processor has all features of a level."""
    has = llvm.get_host_cpu_features()
    return all(has.get(name[1:], False) for name in LEVELS[level].split(","))


# -------------------------------------------------------------------------------- cache
# The cache of compiled kernels, and its keys.
#
# Numba's own cache checks only the path and time of the file that holds a function. It
# would miss an edit in another file that the function calls (Numba manual, "Notes on
# Caching"), and a second clone would compile everything again. Here the folder is named by
# a hash of all kernel sources, so equal sources share their kernels wherever they are.

try:
    import fcntl
except ImportError:  # not on Windows: there, compile new kernels in one process at a time
    fcntl = None  # type: ignore[assignment]

# Folders of kernel sources: all files in them are hashed.
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


@functools.cache  # the check creates a file
def is_kept_in(folder: Path) -> bool:
    """Return whether a folder of kernels can be used; remove this program's unused ones."""
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
    """The cache folder of one module's kernels, named by content instead of by path."""

    def __init__(self, function: Any, source: str) -> None:
        self._py_file = source
        self._line = function.__code__.co_firstlineno
        module = function.__module__.replace(".", "_")
        if not _is_kernel_source(source):
            # a user's or a test's kernels, or a file outside of the hash
            module = f"{module}-{file_digest(source)}"
        self._folder = KERNEL_CACHE / module
        self._source = source

    @classmethod
    def from_function(cls, function: Any, source: str) -> _ByContent | None:
        """Return None if there is no source file; the kernel is then not cached."""
        # "<string>" would be resolved relative to the working directory
        if not (Path(source).is_absolute() and Path(source).is_file()):
            return None
        if not is_kept_in(KERNEL_CACHE) and not shipped_for_this_processor(_SOURCES):
            return None
        return cls(function, source)

    def ensure_cache_path(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        if not _is_kernel_source(self._source):  # each edit of it gets another folder
            module = self._folder.name.rpartition("-")[0]
            older = list(KERNEL_CACHE.glob(f"{glob.escape(module)}-*"))
            use_folder(self._folder, (self._source,), older)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""  # the folder's name includes the hash

    def get_disambiguator(self) -> str:
        return str(self._line)


# raised by an index that names classes which this program lacks
_FOREIGN = (ImportError, AttributeError)
_CHECKSUM = 32  # bytes of SHA-256 before the content of each file


class _Damaged(OSError):
    """A file that differs from what was written; Numba treats an OSError as a cache miss.

    A wrong byte of machine code could crash the process, or give a wrong picture.
    """


class _Index(IndexDataCacheFile):  # type: ignore[misc]
    """A cache index with locking and checksums.

    Numba reads an index, takes a free file name, and writes the index. Two processes at
    once would give one name to two kernels, and a later run would call the wrong one. So
    processes take turns. A checksum detects an index or a kernel that is damaged, say by a
    full disk or a crash; the kernel is then compiled and written again.

    An index that names classes which this program lacks is read as empty but never
    overwritten: the program that has these classes uses it. Reading an index imports the
    modules of all its classes. So kernels on a user's classes have an index of their own,
    which other runs do not read, and the user's modules are not imported there.
    """

    def __init__(self, folder: str, base: str, stamp: str) -> None:
        super().__init__(folder, base, stamp)
        self._base = base

    def _of_the_same_modules(self, key: Any) -> _Index:
        """Return the index for the modules of the classes in a key's signature."""
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
            except _Damaged:  # a new index must not name another kernel's code
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
    """Yield the modules of the named tuples in a type, also inside records."""
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
    """The cached variants of one kernel."""

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _Index(self._cache_path, self._impl.filename_base, "")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a cached variant; None if there is none or it is unreadable."""
        for load, text in ((super().load_overload, EACH_TIME), (self._shipped, AGAIN)):
            try:
                with put_off_interrupts():  # or LLVM's objects could be incomplete
                    found = load(sig, target_context)
            except OSError as error:
                _warn_once(KERNEL_CACHE, error.strerror or str(error), text)
            else:
                if found is not None:
                    return found
        return None

    def _shipped(self, sig: Any, target_context: Any) -> Any:
        """Return a variant from the wheel, whose layout is that of the builder's cache."""
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
        """Save a variant; continue without if the disk is full or not writable."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _warn_once(KERNEL_CACHE, error.strerror, EACH_TIME)


EACH_TIME = "kernels cannot all be kept, and are compiled each time: %s: %s"
AGAIN = "kernels are compiled again: %s: %s"


_warned: set[str] = set()


def all_are_kept() -> bool:
    """Return whether the cache has every kernel that this process has compiled."""
    return EACH_TIME not in _warned


def _warn_once(folder: Path, reason: str, text: str) -> None:
    """Log a warning once per process, not for each of a scene's hundred kernels."""
    if text not in _warned:
        _warned.add(text)
        logging.getLogger("renderer").warning(text, folder, reason)


@contextmanager
def _turn(folder: str) -> Iterator[None]:
    """Hold the folder's lock, if the system has file locks."""
    if fcntl is None:
        yield
        return
    with open(Path(folder) / "save.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def keep(dispatcher: Any, function: Any) -> None:
    """Enable the cache of a dispatcher, if its source file is known."""
    try:
        dispatcher._cache = KernelCache(function)
    except RuntimeError:  # no locator: defined at a prompt, or the folder is not writable
        return
