"""A user's file of plugins (`--plugins FILE.py`), which registers them when it is imported.

Whoever compares with another renderer imports the same file in that one's process too.
"""

from __future__ import annotations

import functools
import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from renderer.errors import SceneError

imported: list[str] = []  # the files that were, as absolute paths


@contextmanager
def neighbours_importable(path: str) -> Iterator[None]:
    """Let a plugin file import modules beside it, as when Python runs it as a script."""
    folder = str(Path(path).resolve().parent)
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)


def module_name(file: Path) -> str:
    """Return the name in `sys.modules` of a plugin file."""
    return f"lightproof_plugins_{file.stem}"


@functools.cache
def import_plugin_file(path: str) -> ModuleType:
    """Return the module of a plugin file, run once in each process.

    Raises
    ------
    SceneError
        If it cannot be read, or raises; one line that names it.
    """
    file = Path(path)
    name = module_name(file)
    specification = importlib.util.spec_from_file_location(name, file)
    if specification is None or specification.loader is None:
        raise SceneError(f"{path}: expected a Python file of plugins, NAME.py")
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # dataclasses look up the module that they are in
    try:
        with neighbours_importable(path):
            specification.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise SceneError(f"{path}: {type(error).__name__}: {error}") from error
    imported.append(str(file.resolve()))
    return module
