"""Finds statements of Python that kernels do not support, in the source of a kernel.

Numba silently compiles some of them to something different: `print` of lanes hangs, `raise`
ends the render without a line of the file, and NumPy's random numbers ignore the seed of
the render. For the others its errors name no line, or refer to byte code.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import linecache
import random
import textwrap
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from renderer.errors import PluginError
from renderer.process.source_places import definition_of, is_users_file, shown_place

_ALLOCATES = "a kernel makes no {}; use tuples, or a name for each value"
_RAISES = (
    "a kernel cannot raise exceptions: it works on 16 points at once; a weight of 0 ends "
    "a path"
)
_STATEMENTS: dict[type[ast.AST], str] = {
    ast.Raise: _RAISES,
    ast.Assert: _RAISES.replace("raise exceptions", "assert"),
    ast.Try: "a kernel has no `try`: nothing in it raises",
    ast.With: "a kernel has no `with`",
    ast.Yield: "a kernel has no `yield`; return the values",
    ast.YieldFrom: "a kernel has no `yield`; return the values",
    ast.Await: "a kernel has no `await`",
    ast.Import: "a kernel cannot import; do it at the top of the file",
    ast.ImportFrom: "a kernel cannot import; do it at the top of the file",
    ast.ClassDef: "a kernel cannot define a class; do it outside, as a NamedTuple",
    ast.Global: "a kernel cannot set global names; return the values",
    ast.Nonlocal: "a kernel cannot set outer names; return the values",
    ast.Delete: "a kernel has no `del`",
    ast.List: _ALLOCATES.format("lists"),
    ast.ListComp: _ALLOCATES.format("lists"),
    ast.Set: _ALLOCATES.format("sets"),
    ast.SetComp: _ALLOCATES.format("sets"),
    ast.Dict: _ALLOCATES.format("dictionaries"),
    ast.DictComp: _ALLOCATES.format("dictionaries"),
    ast.GeneratorExp: "a kernel has no generators; write each value by itself",
    ast.JoinedStr: "a kernel has no texts, and so no f-strings",
    ast.Match: "a kernel has no `match`; use select(mask, yes, no)",
    ast.AsyncFunctionDef: "a kernel has no `async`",
}
_CALLS: dict[Any, str] = {
    print: "a kernel cannot print; return the value, and look at the picture",
    open: "a kernel cannot read files; do it outside, at the top of the file",
    map: "a kernel has no map(); write each value by itself",
    filter: "a kernel has no filter(); use select(mask, yes, no)",
    str: "a kernel has no texts",
    repr: "a kernel has no texts",
    list: _ALLOCATES.format("lists"),
    set: _ALLOCATES.format("sets"),
    dict: _ALLOCATES.format("dictionaries"),
}
_RANDOM = (
    "random numbers of {} have no seed of the render's; use numbers.x, numbers.y and "
    "numbers.choice"
)


def check_statements(kernel: Any, callers: tuple[Any, ...] = ()) -> None:
    """Refuse unsupported statements in a kernel and in the user's kernels that it calls.

    Raises
    ------
    PluginError
        Names the line.
    """
    function = kernel.py_func
    tree = tree_of(function)
    if tree is None:
        return
    filename = function.__code__.co_filename
    for node in ast.walk(tree):
        what = _STATEMENTS.get(type(node)) or _called_in_vain(node, function)
        if what and not isinstance(getattr(node, "ctx", None), ast.Store):
            line = getattr(node, "lineno", function.__code__.co_firstlineno)
            raise PluginError(f"{function.__name__}: {what}", shown_place(filename, line))
    for inner in _kernels_called(function):
        if inner is kernel or inner in callers:
            raise PluginError(
                f"{function.__name__}: a kernel cannot call itself"
                + ("" if inner is kernel else f", as it does through {inner.__name__}")
                + "; use a loop",
                definition_of(function),
            )
        check_statements(inner, (*callers, kernel))


def _called_in_vain(node: ast.AST, function: Any) -> str:
    """Return the error of a call whose compiled form differs from Python's."""
    if not isinstance(node, ast.Call):
        return ""
    called = resolve(node.func, function)
    if any(called is one for one in _CALLS):
        return _CALLS[called]
    module = getattr(called, "__module__", None) or ""
    owner = getattr(called, "__self__", None)
    if isinstance(owner, random.Random) or module == "random":
        return _RANDOM.format("Python")
    if isinstance(owner, np.random.RandomState) or module.startswith("numpy.random"):
        return _RANDOM.format("NumPy")
    return ""


def tree_of(function: Any) -> ast.AST | None:
    """Return the syntax tree of a function with its file's lines; None without file."""
    linecache.checkcache(function.__code__.co_filename)
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, SyntaxError, TypeError):  # defined at a prompt, or a lambda
        return None
    ast.increment_lineno(tree, max(first, 1) - 1)
    return next(
        (part for part in ast.walk(tree) if isinstance(part, ast.FunctionDef)), None
    )


def resolve(node: ast.AST, function: Any) -> Any:
    """Return the value of a name or attribute in a function; None if unknown."""
    if isinstance(node, ast.Name):
        return names_in(function).get(node.id)
    if isinstance(node, ast.Attribute):
        owner = resolve(node.value, function)
        if isinstance(owner, ModuleType):
            return getattr(owner, node.attr, None)
    return None


def names_in(function: Any) -> dict[str, Any]:
    """Return the global and closure names of a function."""
    outer = inspect.getclosurevars(function).nonlocals
    return {**vars(builtins), **function.__globals__, **outer}


def _kernels_called(function: Any) -> Iterator[Any]:
    """Yield the user's kernels that a function refers to."""
    tree = tree_of(function)
    found = [] if tree is None else [resolve(node, function) for node in ast.walk(tree)]
    for kernel in dict.fromkeys(k for k in found if hasattr(k, "py_func")):
        if is_users_file(kernel.py_func.__code__.co_filename):
            yield kernel
