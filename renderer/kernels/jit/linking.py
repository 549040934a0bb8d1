"""How kernels become machine code: code libraries of our own, passed to `numba.njit`.

Numba optimises each function, compiles it to machine code, and links its optimised form
into every caller. As other callers might exist, LLVM seldom inlines it. Kernels differ:

- A kernel that only kernels call is kept as LLVM bitcode (`LinkedCompiler`). It is
  optimised inside its callers and has no machine code of its own.
- In a kernel that is called from Python or by address (`MachineCodeCompiler`), all linked
  functions are private, so LLVM inlines each function that has one caller. Without that,
  kernels on meshes take 1.1 to 1.25 times as long: a call passes records field by field,
  up to 153 words on the stack.

Both are subclasses of Numba's classes, and each dispatcher gets its compiler class. So
functions that are not kernels are compiled in Numba's own way. Interrupts are put off while
LLVM compiles a kernel.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import (
    CompilerBase,
    CompileResult,
    DefaultPassBuilder,
    compile_result,
)
from numba.core.runtime import rtsys

from renderer.process.signals import put_off_interrupts

_LINKED = "linked only"  # the cache's name for the bitcode of a kernel


class _Library(JITCodeLibrary):  # type: ignore[misc]  # Numba has no types
    """The code of a kernel, finalised without interrupts."""

    def _finalize_final_module(self) -> None:
        """Finalise with interrupts put off, as LLVM calls Python back here.

        In a callback ctypes prints and drops a KeyboardInterrupt, and LLVM goes on without
        the code that it needed: one of 800 interrupts became a segmentation fault.
        """
        with put_off_interrupts():
            super()._finalize_final_module()


class _KernelLibrary(_Library):
    """The code of a kernel without reference counting."""

    def add_linking_library(self, library: Any) -> None:
        """Link all but Numba's reference counting, which 400 kernels would copy."""
        if library is not rtsys.library:
            super().add_linking_library(library)


class _MachineCode(_KernelLibrary):
    """The code of a kernel that is called from Python or by address."""

    def _optimize_final_module(self) -> None:
        """Make linked functions private, and skip the reference-count passes."""
        for function in self._final_module.functions:
            linked = function.linkage == llvm.Linkage.linkonce_odr
            if linked and not function.is_declaration:
                function.linkage = llvm.Linkage.private  # not a name that hides a method's
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class _Linked(_KernelLibrary):
    """The code of a kernel that only kernels call."""

    def finalize(self) -> None:
        """Link what the kernel calls, and leave the optimisation to its callers."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> _Linked:
        """The object on which Numba calls `set_env`."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: there is no code to hold the environment's address."""

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return the bitcode in the form that `rebuilt` takes."""
        self._ensure_finalized()
        return self.name, _LINKED, self._get_module_for_linking().as_bitcode()


def reduced(compiled: Any) -> Any:
    """Return a compiled kernel for the cache, without its type annotations."""
    return compiled._replace(type_annotation="")._reduce()


def rebuilt(target_context: Any, kept: Any) -> Any:
    """Return the compiled kernel from the result of `reduced`."""
    (name, kind, code), description, environment, signature, *_ = kept
    if kind != _LINKED:
        return CompileResult._rebuild(target_context, *kept)
    library = _Linked(target_context.codegen(), name)
    library._final_module = library._shared_module = llvm.parse_bitcode(code)
    library._finalized = True
    return compile_result(
        typing_context=target_context.typing_context,
        target_context=target_context,
        library=library,
        entry_point=target_context.get_executable(library, description, environment),
        environment=environment,
        fndesc=description,
        signature=signature,
    )


class Compiler(CompilerBase):  # type: ignore[misc]
    """Compiles kernels that may allocate: Numba's pipeline, with interrupts put off."""

    library_class = _Library

    def __init__(self, *given: Any) -> None:
        with put_off_interrupts():  # the first instance compiles the reference counting
            super().__init__(*given)

    def define_pipelines(self) -> list[Any]:
        """Return Numba's usual passes."""
        state = self.state
        name = state.func_id.func_qualname
        state.library = self.library_class(state.targetctx.codegen(), name)
        state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class LinkedCompiler(Compiler):
    """Compiles kernels that only kernels call."""

    library_class = _Linked


class MachineCodeCompiler(Compiler):
    """Compiles kernels that are called from Python or by address."""

    library_class = _MachineCode
