"""Kernels that only kernels call are linked into their callers, not compiled twice.

Numba optimises each function, turns it into machine code, and then copies the unoptimised
form into every caller, where it is optimised again. For a kernel that Python never calls
the first of these is wasted: here its module is kept as it is, for its callers, and only
what is called from outside (entries, and methods, which are called by address) becomes
machine code. Cornell box: 12.5 s of processor time without, 10 s with it; and a method is
compiled once instead of once for each caller (docs/decisions/compile-time.md). What was
linked is private to that machine code, so that LLVM puts a kernel of one caller into it:
calls hand over records field by field, up to 153 words on the stack.

And no interrupt falls into LLVM's work. This replaces private parts of Numba's code
generator, on versions that were tried (`versions`).
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core import codegen, cpu, targetconfig

from renderer.kernels.jit.compiler.versions import IS_TRIED
from renderer.process.signals import put_off_interrupts

SEPARATE: set[str] = set()  # names of functions that become machine code by themselves

_Library, _JitLibrary = codegen.CPUCodeLibrary, codegen.JITCodeLibrary
_LINKED = "linked only"  # how the cache names such a module


def _is_kernel(library: Any) -> bool:
    return getattr(library, "_is_kernel", False)


def _is_linked_only(library: Any) -> bool:
    """Return whether neither Python nor an address leads to a library's function."""
    known: bool | None = getattr(library, "_is_linked_only", None)
    if known is not None:
        return known
    if not _is_kernel(library) or library.name in SEPARATE:
        return False
    defined = (f.name for f in library._final_module.functions if not f.is_declaration)
    return not any(name.startswith("_ZN7cpython") for name in defined)


def _replace_parts_of_numba() -> None:
    finalize, optimize = _Library.finalize, _Library._optimize_final_module
    serialize, unserialize = (
        _Library.serialize_using_object_code,
        _Library._unserialize.__func__,
    )
    pointer_to, set_env = (
        _JitLibrary.get_pointer_to_function,
        codegen.JITCPUCodegen.set_env,
    )
    post_lowering = cpu.CPUContext.post_lowering
    finalize_module = _Library._finalize_final_module
    begin = codegen.CPUCodegen.__init__

    def begin_undisturbed(self: Any, name: str) -> None:
        with put_off_interrupts():  # engine, module and machine come to own one another
            begin(self, name)

    def finalize_undisturbed(self: Any) -> None:
        """Let no interrupt fall where LLVM asks for code in the cache, or hands some over.

        ctypes prints and forgets a KeyboardInterrupt there, LLVM goes on without the code,
        and `set_env` writes to the address of nothing: a segmentation fault in one of 800
        interrupts. LLVM works for long, and Python's handler runs as soon as it calls back.
        """
        with put_off_interrupts():
            finalize_module(self)

    def finalize_or_link(self: Any) -> None:
        if not _is_linked_only(self):
            finalize(self)
            return
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            module = library._get_module_for_linking()
            self._final_module.link_in(module, preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = self._is_linked_only = True

    def optimize_functions(self: Any, module: Any) -> None:
        """Make one pass manager a module, and none for mere declarations."""
        module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def optimize_once(self: Any) -> None:
        """Leave out the cheap passes that prepare the pruning of reference counts."""
        if not _is_kernel(self):
            optimize(self)
            return
        for function in self._final_module.functions:
            linked = function.linkage == llvm.Linkage.linkonce_odr
            if linked and not function.is_declaration:
                function.linkage = llvm.Linkage.private  # not a name that hides a method's
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)

    def without_runtime(self: Any, module: Any, library: Any) -> None:
        """Link no reference counting into what counts none, and note that it is ours."""
        flags = targetconfig.ConfigStack().top_or_none()
        if flags is not None and flags.is_set("nrt") and not flags.nrt:
            library._is_kernel = True
            return
        post_lowering(self, module, library)

    def pointer_or_null(self: Any, name: str) -> int:
        self._ensure_finalized()
        return 0 if _is_linked_only(self) else pointer_to(self, name)

    def set_env_if_defined(self: Any, name: str, env: Any) -> None:
        if self._engine.is_symbol_defined(name):
            set_env(self, name, env)

    def serialize_by_use(self: Any) -> Any:
        if _is_linked_only(self):
            return self.name, _LINKED, self._get_module_for_linking().as_bitcode()
        return serialize(self)

    def unserialize_by_use(cls: Any, generator: Any, state: Any) -> Any:
        name, use, data = state
        if use != _LINKED:
            with put_off_interrupts():  # objects of LLVM that are half made fail to go
                return unserialize(cls, generator, state)
        library = generator.create_library(name)
        library._final_module = library._shared_module = llvm.parse_bitcode(data)
        library._finalized = library._is_linked_only = library._is_kernel = True
        return library

    _Library.finalize = finalize_or_link
    _Library._finalize_final_module = finalize_undisturbed
    codegen.CPUCodegen.__init__ = begin_undisturbed
    _Library._optimize_functions = optimize_functions
    _Library._optimize_final_module = optimize_once
    _Library.serialize_using_object_code = serialize_by_use
    _Library._unserialize = classmethod(unserialize_by_use)
    _JitLibrary.get_pointer_to_function = pointer_or_null
    codegen.JITCPUCodegen.set_env = set_env_if_defined
    cpu.CPUContext.post_lowering = without_runtime


if IS_TRIED:
    _replace_parts_of_numba()
