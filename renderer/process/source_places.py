"""Where in a user's own files something is: "FILE:LINE", for messages about plugins."""

from __future__ import annotations

import functools
import inspect
import linecache
import os
import sysconfig
import traceback
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).resolve().parents[1]


@functools.cache
def _installed() -> tuple[Path, ...]:
    """Return the folders of the renderer, its harness, Python and installed packages."""
    ours = [_PACKAGE, *(_PACKAGE.parent / name for name in ("mitsuba_ref", "reports"))]
    paths = sysconfig.get_paths()
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    return (*ours, *(Path(paths[name]).resolve() for name in names))


@functools.cache
def is_users_file(filename: str) -> bool:
    """Return whether a source file is neither the renderer's nor an installed package's."""
    if not filename or filename.startswith("<"):  # <string>, <frozen importlib>
        return False
    path = Path(filename).resolve()
    return not any(folder in path.parents for folder in _installed())


def shown_place(filename: str, line: int) -> str:
    """Return "FILE:LINE"; the file relative to the working directory if it is below it."""
    try:
        relative = os.path.relpath(filename)
    except (OSError, ValueError):  # the folder was deleted; another drive
        relative = os.pardir
    return f"{filename if relative.startswith(os.pardir) else relative}:{line}"


def definition_of(function: Any) -> str:
    """Return the place of a function's `def`, below its decorators; "" for no function."""
    code = getattr(getattr(function, "py_func", function), "__code__", None)
    if code is None:
        return ""
    first = code.co_firstlineno
    for line in range(first, first + (1 if code.co_name == "<lambda>" else 20)):
        if linecache.getline(code.co_filename, line).lstrip().startswith("def "):
            return shown_place(code.co_filename, line)
    return shown_place(code.co_filename, first)


def class_definition_of(cls: Any) -> str:
    """Return the place of a class; "" if it is not known."""
    try:
        filename = inspect.getsourcefile(cls)
        _, line = inspect.getsourcelines(cls)
    except (OSError, TypeError):
        return ""
    return shown_place(filename, line) if filename else ""


def place_of_error(error: BaseException) -> str:
    """Return the innermost line of a user's that an exception passed through; else "".

    Of a syntax error it is the line that cannot be read.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return shown_place(error.filename, error.lineno or 1)
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if is_users_file(frame.filename):
            return shown_place(frame.filename, frame.lineno or 1)
    return ""
