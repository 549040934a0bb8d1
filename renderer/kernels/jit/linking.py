"""How kernels become machine code: by libraries of our own, given to `numba.njit`.

Numba optimises each function, turns it into machine code, and links its optimised form into
every caller, where other callers might call it too, so that LLVM seldom inlines it. For
kernels both differ:

- A kernel that only kernels call is kept as LLVM bitcode for its callers
  (`LinkedCompiler`). It is optimised inside of them, and has no machine code of its own.
- In a kernel that Python or an address leads to (`MachineCodeCompiler`) everything that was
  linked into it is private, so that LLVM inlines each function that has one caller.
  Without that kernels on meshes take 1.1 to 1.25 times as long: a call hands over records
  field by field, up to 153 words on the stack.

Both are subclasses of Numba's classes, and a dispatcher is given the compiler class that it
uses. So functions that are not kernels are compiled in Numba's own way. No interrupt falls
into LLVM's work on a kernel.
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

_LINKED = "linked only"  # what the cache calls the bitcode of a kernel


class _Library(JITCodeLibrary):  # type: ignore[misc]  # Numba has no types
    """The code of a kernel."""

    def _finalize_final_module(self) -> None:
        """Let no interrupt fall where LLVM calls Python back.

        ctypes prints and forgets a KeyboardInterrupt there, and LLVM goes on without the
        code that it needed: one of 800 interrupts became a segmentation fault.
        """
        with put_off_interrupts():
            super()._finalize_final_module()


class _KernelLibrary(_Library):
    """The code of a kernel that counts no references."""

    def add_linking_library(self, library: Any) -> None:
        """Link everything but Numba's reference counting, which 400 kernels would copy."""
        if library is not rtsys.library:
            super().add_linking_library(library)


class _MachineCode(_KernelLibrary):
    """The code of a kernel that is called from Python or by its address."""

    def _optimize_final_module(self) -> None:
        """Make linked functions private, and leave out passes for reference counts."""
        for function in self._final_module.functions:
            linked = function.linkage == llvm.Linkage.linkonce_odr
            if linked and not function.is_declaration:
                function.linkage = llvm.Linkage.private  # not a name that hides a method's
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class _Linked(_KernelLibrary):
    """The code of a kernel that only kernels call."""

    def finalize(self) -> None:
        """Link what the kernel calls, and leave all optimisation to its callers."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0, as for every function that has no machine code."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> _Linked:
        """What Numba gives the kernel's environment to, see `set_env`."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: there is no code yet that holds the environment's address."""

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return the bitcode, as `rebuilt` takes it."""
        self._ensure_finalized()
        return self.name, _LINKED, self._get_module_for_linking().as_bitcode()


def reduced(compiled: Any) -> Any:
    """Return a compiled kernel as the cache keeps it: without the listing of its types."""
    return compiled._replace(type_annotation="")._reduce()


def rebuilt(target_context: Any, kept: Any) -> Any:
    """Return the compiled kernel that `reduced` was given."""
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
    """Compiles kernels that allocate: as Numba does, but undisturbed by interrupts."""

    library_class = _Library

    def __init__(self, *given: Any) -> None:
        with put_off_interrupts():  # the first call compiles the counting of references
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
    """Compiles kernels that are called from Python or by their address."""

    library_class = _MachineCode
