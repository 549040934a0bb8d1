"""What Numba asks again and again while it compiles, answered from memory.

All registries are read again for each function that is resolved, what `a + b` means is
found anew for each addition, the size of a type by having LLVM parse it. The answers are
those of Numba's own functions.

This replaces private parts of Numba, on versions that were tried (`versions`).
"""

from __future__ import annotations

import functools
from typing import Any

from llvmlite.ir import types as llvm_types
from numba.core import base, codegen, errors, targetconfig, utils
from numba.core.target_extension import get_local_target
from numba.core.types import functions as function_types
from numba.core.typing import context as typing_context

from renderer.kernels.jit.compiler.versions import IS_TRIED


def _refresh_what_is_new(context: type) -> None:
    """Read again only those registries that have become longer.

    Numba reads all for each function that it compiles or looks up, and runs the imports of
    the forty modules that fill them.
    """
    refresh = context.refresh  # type: ignore[attr-defined]

    def refresh_what_is_new(self: Any) -> None:
        seen = getattr(self, "_lengths_seen", None)
        if seen is None:
            refresh(self)
            seen = self._lengths_seen = {}
        for registry, loader in list(self._registries.items()):
            lengths = [len(getattr(registry, name)) for name in loader.registry_items]
            if seen.get(registry) != lengths:
                self.install_registry(registry)
                seen[registry] = lengths
        if context is base.BaseContext:
            self.typing_context.refresh()

    context.refresh = refresh_what_is_new  # type: ignore[attr-defined]


def _ask_each_meaning_once() -> None:
    """Find the meaning of a call once, without writing down why the others do not fit.

    Numba finds it anew for each `a + b`, when types are inferred and again when code is
    made. It asks each meaning twice, with the values of constants and without, although
    most calls have no constant; and it lists the signatures of those that do not fit, for a
    message. Where none fits its own function is asked, for the message. A template's mark
    `may_change` keeps its answers from being remembered; a scene has a thousand others.
    """
    explain = function_types.BaseFunction.get_call_type
    without_value = function_types._unlit_non_poison
    orders: dict[Any, Any] = {}
    meanings: dict[Any, tuple[Any, Any]] = {}

    def in_order(self: Any, target: Any) -> Any:
        key = target, tuple(self.templates)
        if key not in orders:
            orders[key] = utils.order_by_target_specificity(target, self.templates)
        return orders[key]

    def find(self: Any, context: Any, target: Any, args: Any, kws: Any) -> Any:
        """Return the template that fits, and the signature; None if none does."""
        given = args, kws
        try:
            plain = (
                tuple(without_value(arg) for arg in args),
                {name: without_value(arg) for name, arg in kws.items()},
            )
        except errors.NumbaError:
            return None  # a type that only constants have
        several = (plain, given) if plain != given else (given,)
        for template_class in in_order(self, target):
            template = template_class(context)
            for attempt in several[::-1] if template.prefer_literal else several:
                try:
                    found = template.apply(*attempt)
                except errors.NumbaError:
                    continue
                if found is not None:
                    return template, found
        return None

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        target = get_local_target(context)
        # what a call compiles has the options of its caller, such as reference counts
        options = targetconfig.ConfigStack.top_or_none()
        key = self, context, target, options, tuple(args), tuple(kws.items())
        if key not in meanings:
            fitting = find(self, context, target, args, kws)
            if fitting is None:
                return explain(self, context, args, kws)
            template, found = fitting
            implementation = template.get_impl_key(found)
            if not getattr(template, "may_change", False):
                meanings[key] = found, implementation
        else:
            found, implementation = meanings[key]
        self._impl_keys[found.args] = implementation
        return found

    function_types.BaseFunction.get_call_type = get_call_type


def _measure_types_once() -> None:
    """Remember how large a type of LLVM is: to ask is to parse a module that has one.

    A type's text says all of it, but of a type with a name, which has the name alone.
    """
    size_of = base.BaseContext.get_abi_sizeof

    def get_abi_sizeof(self: Any, of: Any) -> Any:
        if isinstance(of, llvm_types.IdentifiedStructType):
            return size_of(self, of)
        sizes = self.__dict__.setdefault("_sizes_seen", {})
        text = str(of)
        if text not in sizes:
            sizes[text] = size_of(self, of)
        return sizes[text]

    base.BaseContext.get_abi_sizeof = get_abi_sizeof


def _replace_parts_of_numba() -> None:
    _refresh_what_is_new(base.BaseContext)
    _refresh_what_is_new(typing_context.BaseContext)
    _ask_each_meaning_once()
    _measure_types_once()
    # the processor's name, asked of LLVM for each kernel that is looked for in the cache
    codegen.JITCPUCodegen.magic_tuple = functools.cache(codegen.JITCPUCodegen.magic_tuple)
    # whether a function takes `loc`: asked of `inspect` each time that one is looked up
    base._has_loc = functools.lru_cache(maxsize=4096)(base._has_loc)


if IS_TRIED:
    _replace_parts_of_numba()
