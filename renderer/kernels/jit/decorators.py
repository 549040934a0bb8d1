"""The decorators of all kernels, with one common set of compiler flags."""

from __future__ import annotations

from typing import Any

import numba
from numba.extending import intrinsic

from renderer.errors import SceneError
from renderer.kernels.jit.cache import keep
from renderer.kernels.jit.linking import Compiler, LinkedCompiler, MachineCodeCompiler

if numba.config.DISABLE_JIT:  # Python functions have no lanes
    raise SceneError("NUMBA_DISABLE_JIT is set; unset it: kernels are always compiled")

_FLAGS = {"nogil": True, "error_model": "numpy", "_nrt": False}


def _dispatcher(function: Any, compiler: type, **flags: bool) -> Any:
    dispatcher = numba.njit(pipeline_class=compiler, **(_FLAGS | flags))(function)
    keep(dispatcher, function)
    return dispatcher


def builder_kernel(function: Any) -> Any:
    """Compile `function` as `entry_kernel` does, but allow it to allocate arrays."""
    return _dispatcher(function, Compiler, _nrt=True)


def entry_kernel(function: Any) -> Any:
    """Compile `function` as a kernel that can be called from Python.

    `nogil` lets tile threads run in parallel. `error_model="numpy"` makes divisions plain;
    otherwise each is a branch and an exception path: 1.44 s against 0.82 s on the Cornell
    box. There is no `fastmath`: images are bit-identical because the order of sums is
    fixed and multiply-add is not fused (except in `multiply_add` of `lanes.mathematics`,
    for tests with a margin). There is no reference counting: kernels allocate nothing, and
    counting a record's arrays at each call was a sixth of all compile time
    (docs/decisions/compile-time.md).
    """
    return _dispatcher(function, MachineCodeCompiler)


def compiled_for(entry: Any, *arguments: Any) -> Any:
    """Return the compiled entry kernel for arguments of these types.

    A call takes 0.7 microseconds, instead of 6.5 and more through the kernel's dispatcher,
    which looks up the type of each argument. Types are not checked: arguments of other
    types are misread.
    """
    return entry.get_overload(tuple(map(numba.typeof, arguments)))


def kernel(function: Any) -> Any:
    """Compile `function` like `entry_kernel`, for calls from other kernels only.

    It has no wrapper that unpacks Python's arguments: the wrappers for the scene's records
    were two thirds of all compile time. A call from Python raises a TypeError.
    """
    return _for_kernels(function, LinkedCompiler)


def method_kernel(function: Any) -> Any:
    """Compile `function` like `kernel`, to separate machine code, see `interfaces`.

    Its first parameter is a record. It is compiled once per type of that record,
    independently of the other plugins in a scene.
    """
    return _for_kernels(function, MachineCodeCompiler)


def _for_kernels(function: Any, compiler: type) -> Any:
    without = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher = _dispatcher(function, compiler, **without)

    # Numba would register the missing wrapper as a null pointer and call it
    def add_overload(compiled: Any) -> None:
        dispatcher.overloads[tuple(compiled.signature.args)] = compiled

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise TypeError(f"{function.__name__} can be called inside kernels only")

    dispatcher.add_overload = add_overload
    dispatcher._compile_for_args = refuse
    return dispatcher


@intrinsic
def always_inline(typingctx: Any) -> Any:
    """Inline the kernel that calls this into its callers, whatever LLVM's cost model says.

    On AVX2 a 16-lane vector is two halves, which LLVM counts as twice the instructions.
    """

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.function.attributes.add("alwaysinline")
        return context.get_dummy_value()

    return numba.types.void(), codegen


@intrinsic
def never_inline(typingctx: Any) -> Any:
    """Never inline the kernel that calls this: for rare cases in inner loops.

    Inlined, a rare case takes registers from the loop around it. A call that LLVM does not
    know to be rare costs registers too: 1.5 % of the time of a picture by brute force.
    """

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.function.attributes.add("noinline")
        builder.function.attributes.add("cold")
        return context.get_dummy_value()

    return numba.types.void(), codegen
