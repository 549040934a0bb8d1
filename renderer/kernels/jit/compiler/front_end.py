"""Small functions of Numba's front end that take most of its time, written to take less.

A scene's kernels are some hundred functions, and Numba spends two thirds of their time in
Python. Part of it is not work: options are compared by building dictionaries of all of
them, messages are written for errors that are caught and forgotten, events are made for
nobody. What is replaced here returns what Numba's own functions return; what is asked again
and again is in `questions`.

This replaces private parts of Numba, on versions that were tried (`versions`).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import llvmlite.binding as llvm
from numba.core import errors, event, ir, lowering, targetconfig, typeinfer
from numba.core.types import abstract
from numba.extending import overload
from numba.np import arrayobj, linalg

from renderer.kernels.jit.compiler.versions import IS_TRIED


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


class _ErrorContext:
    """What is being compiled, for the message of an error: Numba's own is a generator.

    Two are made for each statement.
    """

    __slots__ = ("_args", "_named", "_text")

    def __init__(self, text: str, /, *args: Any, **named: Any) -> None:
        self._text, self._args, self._named = text, args, named

    def __enter__(self) -> None:
        place = self._named.get("loc")
        if place is not None and not place.filename.startswith(errors._numba_path):
            errors.loc_info.update(self._named)

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if isinstance(error, errors.NumbaError):
            error.add_context(errors._format_msg(self._text, self._args, self._named))


def _tell_types_by_their_class() -> None:
    """Ask the class of a Numba type what it is, and not the registries of `abc`."""
    types = type(abstract.Type)
    types.__instancecheck__ = type.__instancecheck__
    types.__subclasscheck__ = type.__subclasscheck__


class _LinearAlgebra:
    """Whether kernels can have linear algebra, asked as soon as one wants it."""

    def __init__(self, ask: Callable[[], bool]) -> None:
        self._ask = ask

    def __bool__(self) -> bool:
        return self._ask()


def _import_scipy_late() -> None:
    """Import SciPy for a kernel with linear algebra, and not at the start: 0.15 s."""

    def not_yet() -> None:
        raise ImportError

    ensure_blas = linalg.ensure_blas
    linalg.ensure_blas = not_yet
    try:
        arraymath = importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = ensure_blas
    arraymath.ensure_blas = ensure_blas
    arraymath._HAVE_BLAS = _LinearAlgebra(arraymath._check_blas)


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
    _tell_types_by_their_class()
    for module in (errors, lowering, typeinfer):
        module.new_error_context = _ErrorContext
    _import_scipy_late()
    _name_no_shapes_in_errors()


if IS_TRIED:
    _replace_parts_of_numba()
