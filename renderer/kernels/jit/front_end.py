"""Small functions of Numba's front end that take most of its time, written to take less.

A scene's kernels are some hundred functions, and Numba spends two thirds of their time in
Python. Part of it is not work: options are compared by building dictionaries of all of
them, all registries are read again for each function that is resolved, messages are
written for errors that are caught and forgotten, events are made for nobody. What is
replaced here returns what Numba's own functions return.

This replaces private parts of Numba, on the versions of `renderer.kernels.jit.versions`.
"""

from __future__ import annotations

import functools
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import llvmlite.binding as llvm
from numba.core import base, errors, event, ir, targetconfig, utils
from numba.core.target_extension import get_local_target
from numba.core.types import functions as function_types
from numba.core.typing import context as typing_context
from numba.extending import overload
from numba.np import arrayobj

from renderer.kernels.jit.versions import IS_TRIED


def _list_variables_fast() -> None:
    """Find the variables of a statement by the class of each part, known after one look.

    Numba asks `isinstance` up to six times, for strings and places in the source too.
    """
    variable, instruction = ir.Var, ir.Inst
    plain: set[type] = set()  # classes of parts that hold no variable

    def collect(parts: Any, found: list[Any]) -> None:
        for part in parts:
            cls = type(part)
            if cls in plain:
                continue
            if issubclass(cls, variable):
                found.append(part)
            elif issubclass(cls, instruction):
                found.extend(part.list_vars())
            elif issubclass(cls, list | tuple):
                collect(part, found)
            elif issubclass(cls, dict):
                collect(part.values(), found)
            else:
                plain.add(cls)

    def list_variables(self: Any, part: Any) -> list[Any]:
        found: list[Any] = []
        collect((part,), found)
        return found

    ir.Inst._rec_list_vars = list_variables


def _compare_options_fast() -> None:
    """Compare the options that are set, before all fifty with their defaults.

    Numba's hash sorts the dictionary of all options, that is their names: it is one
    number for all.
    """
    options = targetconfig.TargetConfig
    all_equal = options.__eq__

    def equal(self: Any, other: Any) -> Any:
        if type(self) is type(other) and self._values == other._values:
            return True
        return all_equal(self, other)

    def number(self: Any) -> int:
        return hash(len(self.options))

    def values(self: Any) -> dict[str, Any]:
        given = self._values
        return {
            name: given.get(name, option._default) for name, option in self.options.items()
        }

    options.__eq__, options.__hash__, options.values = equal, number, values


def _make_events_for_listeners_only() -> None:
    """Make no event that nobody listens to, and no timers of the locks.

    The timers, two for each function that is being compiled, fill the field of a compiled
    function that says how long the locks were held.
    """
    listeners = event._registered
    start, end, trigger = event.start_event, event.end_event, event.trigger_event

    def start_event(kind: str, data: Any = None) -> None:
        if listeners.get(kind):
            start(kind, data)

    def end_event(kind: str, data: Any = None, exc_details: Any = None) -> None:
        if listeners.get(kind):
            end(kind, data, exc_details)

    def trigger_event(kind: str, data: Any = None) -> AbstractContextManager[None]:
        return trigger(kind, data) if listeners.get(kind) else nullcontext()

    def install_timer(kind: str, callback: Any) -> AbstractContextManager[None]:
        return nullcontext()

    event.start_event, event.end_event = start_event, end_event
    event.trigger_event, event.install_timer = trigger_event, install_timer
    for acquired, released in list(llvm.ffi.lib._lock._cblist):
        llvm.ffi.unregister_lock_callback(acquired, released)


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
    """Find the meaning of a call without writing down why the others do not fit.

    Numba asks each meaning twice, with the values of constants and without, although most
    calls have no constant; and it lists the signatures of those that do not fit, for a
    message. Where none fits its own function is asked, for the message.
    """
    explain = function_types.BaseFunction.get_call_type
    without_value = function_types._unlit_non_poison
    orders: dict[Any, Any] = {}

    def in_order(self: Any, context: Any) -> Any:
        target = get_local_target(context)
        key = target, tuple(self.templates)
        if key not in orders:
            orders[key] = utils.order_by_target_specificity(target, self.templates)
        return orders[key]

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        given = args, kws
        plain = (
            tuple(without_value(arg) for arg in args),
            {name: without_value(arg) for name, arg in kws.items()},
        )
        several = (plain, given) if plain != given else (given,)
        for meaning in in_order(self, context):
            template = meaning(context)
            for attempt in several[::-1] if template.prefer_literal else several:
                try:
                    found = template.apply(*attempt)
                except errors.NumbaError:
                    continue
                if found is not None:
                    self._impl_keys[found.args] = template.get_impl_key(found)
                    return found
        return explain(self, context, args, kws)

    function_types.BaseFunction.get_call_type = get_call_type


def _name_no_shapes_in_errors() -> None:
    """Say of arrays that do not fit each other that they do not, and not their shapes.

    `a[:n] = b` compiles what writes the shapes into the message: strings and their `repr`,
    a third of the time of a builder. Numba has the short message for other targets.
    """

    def raise_without_shapes(src_shapes: Any, index_shape: Any) -> None:
        raise NotImplementedError

    overload(raise_without_shapes)(arrayobj.ol_raise_with_shape_context_generic)
    arrayobj.raise_with_shape_context = raise_without_shapes


def _replace_parts_of_numba() -> None:
    _list_variables_fast()
    _compare_options_fast()
    _make_events_for_listeners_only()
    _refresh_what_is_new(base.BaseContext)
    _refresh_what_is_new(typing_context.BaseContext)
    _ask_each_meaning_once()
    _name_no_shapes_in_errors()
    # whether a function takes `loc`: asked of `inspect` each time that one is looked up
    base._has_loc = functools.lru_cache(maxsize=4096)(base._has_loc)


if IS_TRIED:
    _replace_parts_of_numba()
