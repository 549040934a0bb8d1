"""How every kernel is compiled: one decorator, one set of flags, one cache folder.

Numba's cache looks only at the file that holds a function, so an edit in another file
that the function calls would go unnoticed (Numba manual, "Notes on Caching"). The cache
folder is therefore named by a hash of all sources of this package.
"""

from __future__ import annotations

import gc
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
from numba.core.caching import IndexDataCacheFile
from numba.extending import intrinsic

try:
    import fcntl
except ImportError:  # not on Windows: there, render one scene at a time for the first time
    fcntl = None  # type: ignore[assignment]

_FLAGS = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
# what no kernel calls: an edit there need not compile anything anew
_WITHOUT_KERNELS = (
    "__main__.py",
    "accelerators/grid_validation.py",
    "cli.py",
    "compilation.py",
    "explanation.py",
    "heat_map.py",
    "image",
    "integrators/step_by_step.py",
    "interrupts.py",
    "light_order.py",
    "plan",
    "progress_display.py",
    "render.py",
    "rendering.py",
    "replay/instance_matrices.py",
    "replay/numbers_drawn.py",
    "replay/pixel_seeds.py",
    "replay/triangle_arithmetic.py",
    "scene_file/",
    "srgb.py",
    "threads.py",
    "traced_path.py",
)


def _sources_hash() -> str:
    digest = hashlib.sha256()
    package = Path(__file__).parent
    for source in sorted(package.rglob("*.py")):
        name = source.relative_to(package).as_posix()
        if name.startswith(_WITHOUT_KERNELS):
            continue
        digest.update(name.encode())
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
numba.config.CACHE_DIR = str(KERNEL_CACHE)  # read when a kernel is created


# what an index raises that names classes of a program which is not this one, or is cut off
_UNREADABLE = (ImportError, AttributeError, EOFError, pickle.UnpicklingError)


def _guard_indices() -> None:
    """Let processes take turns when they save a kernel, and read indices with care.

    Numba reads an index, takes a file name that is free, and writes the index: two
    processes at once would give one name to two kernels, and a later run would call the
    wrong one. An index that cannot be read is taken as empty, but never written over: it
    is in use by the program that can read it.
    """
    save, load_index = IndexDataCacheFile.save, IndexDataCacheFile._load_index

    def load_or_compile(self: Any) -> Any:
        try:
            return load_index(self)
        except _UNREADABLE:
            return {}

    def save_alone(self: Any, key: Any, data: Any) -> None:
        with _turn(self._cache_path):
            try:
                load_index(self)
            except _UNREADABLE:
                return
            save(self, key, data)

    IndexDataCacheFile._load_index = load_or_compile
    IndexDataCacheFile.save = save_alone


@contextmanager
def _turn(folder: str) -> Iterator[None]:
    """Wait for the folder's lock, where the system has locks."""
    if fcntl is None:
        yield
        return
    with open(Path(folder) / "save.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


_guard_indices()


# objects made between two looks of Python's collector: it is 700 otherwise, and the three
# million objects of a scene's kernels hold almost nothing that it could free
_OBJECTS_BETWEEN_COLLECTIONS = 200_000


@contextmanager
def _rare_collections() -> Iterator[None]:
    """Let Python's collector of cycles look seldom while Numba compiles.

    It saves 1.0 of the 1.7 s that its looks take in a cold start of 13 s, and more in
    larger programs (docs/decisions/compile-time.md); the price is 20 MB.
    """
    usual = gc.get_threshold()
    if usual[0] == 0 or usual[0] >= _OBJECTS_BETWEEN_COLLECTIONS:
        yield  # switched off, or another thread compiles already and will set it back
        return
    try:
        gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS, *usual[1:])
        yield
    finally:
        gc.set_threshold(*usual)


def _called_from_python(function: Any, flags: dict[str, bool]) -> Any:
    """Compile `function`, and all that it calls, when Python first calls it."""
    dispatcher = numba.njit(**flags)(function)
    compile_for = dispatcher._compile_for_args

    def compile_for_args(*args: Any, **kwargs: Any) -> Any:
        with _rare_collections():
            return compile_for(*args, **kwargs)

    dispatcher._compile_for_args = compile_for_args
    return dispatcher


def builder_kernel(function: Any) -> Any:
    """Compile `function` as `entry_kernel` does, but let it allocate arrays."""
    return _called_from_python(function, _FLAGS | {"_nrt": True})


def entry_kernel(function: Any) -> Any:
    """Compile `function` for the inner loops, callable from Python.

    `nogil` lets the tile threads run side by side. `error_model="numpy"` makes a
    division plain (otherwise each is a branch and an exception path: 1.44 s against
    0.82 s on the Cornell box). No `fastmath`: the order of sums and the absence of fused
    multiply-add are part of what makes images bit-identical. No reference counts: kernels
    allocate nothing, and counting a record's arrays at each call was a sixth of all compile
    time (docs/decisions/compile-time.md).
    """
    return _called_from_python(function, _FLAGS)


def kernel(function: Any) -> Any:
    """Compile `function` like `entry_kernel`, to be called by other kernels only.

    Without the wrapper that unpacks Python's arguments: the wrappers of the scene's records
    were two thirds of all compile time. A call from Python is a TypeError.
    """
    dispatcher = numba.njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **_FLAGS)(
        function
    )

    # Numba would register the missing wrapper as a null pointer and jump to it
    def add_overload(compiled: Any) -> None:
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise TypeError(f"{function.__name__} can be called inside kernels only")

    dispatcher.add_overload = add_overload
    dispatcher._compile_for_args = refuse
    return dispatcher


@intrinsic
def never_inline(typingctx: Any) -> Any:
    """Keep the kernel that calls this out of its callers: for rare cases in inner loops.

    Inlined, the rare case takes the registers of the loop around it. So does a call that is
    not known to be rare: 1.5 % of the time of a picture by brute force.
    """

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.function.attributes.add("noinline")
        builder.function.attributes.add("cold")
        return context.get_dummy_value()

    return numba.types.void(), codegen


def record_class(numba_type: Any) -> type | None:
    """Return the NamedTuple class behind a Numba type, None for any other type.

    Kernels that are chosen by the record they work on (`overload`) compare with this. A
    tuple of equal array types is a `NamedUniTuple`, so test the common base.
    """
    if isinstance(numba_type, numba.types.BaseNamedTuple):
        return numba_type.instance_class
    return None
