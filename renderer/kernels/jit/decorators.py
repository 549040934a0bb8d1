"""The decorators of all kernels, and their one set of flags."""

from __future__ import annotations

from typing import Any

import numba
from numba.extending import intrinsic

from renderer.errors import SceneError
from renderer.kernels.jit.cache import keep
from renderer.kernels.jit.linking import Compiler, LinkedCompiler, MachineCodeCompiler

if numba.config.DISABLE_JIT:  # then kernels would be Python functions without lanes
    raise SceneError("NUMBA_DISABLE_JIT is set; unset it: kernels are always compiled")

_FLAGS = {"nogil": True, "error_model": "numpy", "_nrt": False}


def _dispatcher(function: Any, compiler: type, **flags: bool) -> Any:
    dispatcher = numba.njit(pipeline_class=compiler, **(_FLAGS | flags))(function)
    keep(dispatcher, function)
    return dispatcher


def builder_kernel(function: Any) -> Any:
    """Compile `function` as `entry_kernel` does, but let it allocate arrays."""
    return _dispatcher(function, Compiler, _nrt=True)


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
    return _dispatcher(function, MachineCodeCompiler)


def compiled_for(entry: Any, *arguments: Any) -> Any:
    """Return an entry kernel as it is for arguments like these, with which it was called.

    A call of it takes 0.7 microseconds, one of the kernel 6.5 and more: Numba looks up the
    type of each argument. Here types are not checked: arguments of other types are read as
    if they had these.
    """
    return entry.get_overload(tuple(map(numba.typeof, arguments)))


def kernel(function: Any) -> Any:
    """Compile `function` like `entry_kernel`, to be called by other kernels only.

    Without the wrapper that unpacks Python's arguments: the wrappers of the scene's records
    were two thirds of all compile time. A call from Python is a TypeError.
    """
    return _for_kernels(function, LinkedCompiler)


def method_kernel(function: Any) -> Any:
    """Compile `function` like `kernel`, into machine code of its own, see `methods`.

    Its first parameter is the record that it belongs to. It is compiled once for each type
    of that record, whatever other kinds of things a scene has.
    """
    return _for_kernels(function, MachineCodeCompiler)


def _for_kernels(function: Any, compiler: type) -> Any:
    without = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher = _dispatcher(function, compiler, **without)

    # Numba would register the missing wrapper as a null pointer and jump to it
    def add_overload(compiled: Any) -> None:
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise TypeError(f"{function.__name__} can be called inside kernels only")

    dispatcher.add_overload = add_overload
    dispatcher._compile_for_args = refuse
    return dispatcher


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
