"""The decorators of all kernels, and their one set of flags."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.extending import intrinsic

from renderer.errors import SceneError
from renderer.kernels.jit.cache import keep

# both replace parts of Numba
from renderer.kernels.jit.compiler import front_end, questions  # noqa: F401
from renderer.kernels.jit.compiler.linking import SEPARATE
from renderer.kernels.jit.compiler.passes import PIPELINE

if numba.config.DISABLE_JIT:  # then kernels would be Python functions without lanes
    raise SceneError("NUMBA_DISABLE_JIT is set; unset it: kernels are always compiled")

_FLAGS = {"nogil": True, "error_model": "numpy", "_nrt": False}

# objects made between two looks of Python's collector: it is 700 otherwise, and the three
# million objects of a scene's kernels hold almost nothing that it could free
_OBJECTS_BETWEEN_COLLECTIONS = 200_000
_MOST_UNSEEN = 1_000_000  # objects made by compiling that no look was at
_unseen = 0


@contextmanager
def rare_collections() -> Iterator[None]:
    """Let Python's collector of cycles look seldom while Numba compiles.

    It saves 1.0 of the 1.7 s that its looks take in a cold start of 13 s, and more in
    larger programs (docs/decisions/compile-time.md).
    """
    usual = gc.get_threshold()
    if not gc.isenabled() or usual[0] == 0 or usual[0] >= _OBJECTS_BETWEEN_COLLECTIONS:
        yield  # switched off, or another thread compiles already and will set it back
        return
    try:
        gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS, *usual[1:])
        yield
    finally:
        try:
            _look_later()
        finally:
            gc.set_threshold(*usual)


def _look_later() -> None:
    """Let what was made grow old unseen: a look at all of it would be due at once.

    Half of it is garbage, which stays for a while, 50 MB a scene: so for the first scenes
    only, whose pictures somebody waits for.
    """
    global _unseen
    # somebody's own frozen objects would be thawed with ours
    if _unseen < _MOST_UNSEEN and gc.get_freeze_count() == 0:
        _unseen += gc.get_count()[0]
        try:
            gc.freeze()
        finally:
            gc.unfreeze()


def _dispatcher(function: Any, **flags: bool) -> Any:
    dispatcher = numba.njit(**(_FLAGS | PIPELINE | flags))(function)
    keep(dispatcher, function)
    return dispatcher


def _called_from_python(function: Any, **flags: bool) -> Any:
    """Compile `function`, and all that it calls, when Python first calls it."""
    dispatcher = _dispatcher(function, **flags)
    compile_for = dispatcher._compile_for_args

    def compile_for_args(*args: Any, **kwargs: Any) -> Any:
        with rare_collections():
            return compile_for(*args, **kwargs)

    dispatcher._compile_for_args = compile_for_args
    return dispatcher


def builder_kernel(function: Any) -> Any:
    """Compile `function` as `entry_kernel` does, but let it allocate arrays."""
    return _called_from_python(function, _nrt=True)


def entry_kernel(function: Any) -> Any:
    """Compile `function` for the inner loops, callable from Python.

    `nogil` lets the tile threads run side by side. `error_model="numpy"` makes a
    division plain (otherwise each is a branch and an exception path: 1.44 s against
    0.82 s on the Cornell box). No `fastmath`: the order of sums and the absence of fused
    multiply-add (but in `lanes.mathematics.fused`, for tests with a margin) are part of
    what makes images bit-identical. No reference counts: kernels allocate nothing, and
    counting a record's arrays at each call was a sixth of all compile time
    (docs/decisions/compile-time.md).
    """
    return _called_from_python(function)


def compiled_for(entry: Any, *arguments: Any) -> Any:
    """Return an entry kernel as it is for arguments like these, with which it was called.

    A call of it takes 0.7 microseconds, one of the kernel 6.5 and more: Numba looks at the
    type of each argument, and asks Python about each record. Here nobody looks: other types
    than these are read as if they were these.
    """
    return entry.get_overload(tuple(map(numba.typeof, arguments)))


def kernel(function: Any) -> Any:
    """Compile `function` like `entry_kernel`, to be called by other kernels only.

    Without the wrapper that unpacks Python's arguments: the wrappers of the scene's records
    were two thirds of all compile time. A call from Python is a TypeError.
    """
    dispatcher = _dispatcher(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)

    # Numba would register the missing wrapper as a null pointer and jump to it
    def add_overload(compiled: Any) -> None:
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise TypeError(f"{function.__name__} can be called inside kernels only")

    dispatcher.add_overload = add_overload
    dispatcher._compile_for_args = refuse
    return dispatcher


def method_kernel(function: Any) -> Any:
    """Compile `function` like `kernel`, into machine code of its own, see `methods`.

    Its first parameter is the record that it belongs to. It is compiled once for each type
    of that record, whatever other kinds of things a scene has.
    """
    SEPARATE.add(function.__qualname__)
    return kernel(function)


@intrinsic
def always_inline(typingctx: Any) -> Any:
    """Put the kernel that calls this into its callers, whatever LLVM thinks of its size.

    LLVM counts what two halves of a vector take on AVX2 as twice the instructions.
    """

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.function.attributes.add("alwaysinline")
        return context.get_dummy_value()

    return numba.types.void(), codegen


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
