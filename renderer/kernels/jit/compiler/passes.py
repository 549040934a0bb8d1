"""The passes of Numba's front end that kernels need, and nothing between them.

Numba runs 27 passes over each function. After each that may have changed it, it computes
anew which variables live where, and before each it describes the pass for listeners that
nobody has installed. Left out here are

- passes for what kernels do not have: functions inlined as Python (`inline="always"` of
  `numba.njit`), parallel loops, and, where a function has no function or comprehension
  inside of it, closures; where nothing is allocated, array expressions;
- the listing with types, which was written into the cache beside each kernel;
- the lifetimes between passes. Those that need them (the rewriting of variables to a
  single assignment, and the legalisation before the code is made) compute them themselves.

A sixth of the time of the first picture (docs/decisions/compile-time.md).
"""

from __future__ import annotations

from types import CodeType
from typing import Any

from numba.core import errors
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager

from renderer.kernels.jit.compiler.versions import IS_TRIED

_NEVER = {"InlineInlinables", "AnnotateTypes", "DumpParforDiagnostics"}
_OF_CLOSURES = {"InlineClosureLikes", "MakeFunctionToJitFunction"}
_OF_ARRAYS = {"NopythonRewrites"}  # and of strings


class _Passes(PassManager):  # type: ignore[misc]  # Numba has no types
    """Runs passes one after the other, and does nothing else."""

    @global_compiler_lock  # type: ignore[untyped-decorator]
    def _runPass(self, index: int, run: Any, state: Any) -> None:
        run.analysis = self._analysis
        with errors.new_error_context("Pass {name}", name=run.name()):
            run.run_initialization(state)
            run.run_pass(state)
            run.run_finalizer(state)


class KernelCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's compiler with the passes that kernels need."""

    def define_pipelines(self) -> list[Any]:
        """Return Numba's usual passes without those that a function can do without."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        left_out = set(_NEVER)
        constants = self.state.func_id.code.co_consts
        if not any(isinstance(constant, CodeType) for constant in constants):
            left_out |= _OF_CLOSURES
        if not self.state.flags.nrt:
            left_out |= _OF_ARRAYS
        passes = _Passes("kernel")
        for run, description in usual.passes:
            if run.__name__ not in left_out:
                passes.add_pass(run, description)
        passes.finalize()
        return [passes]


# given to `numba.njit`
PIPELINE: dict[str, Any] = {"pipeline_class": KernelCompiler} if IS_TRIED else {}
