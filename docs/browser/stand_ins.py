"""Stand-ins for what a browser does not have: Numba, llvmlite, OpenEXR, Pillow.

The scene reader imports the files of the plugins, which hold kernels too. With these
stand-ins the decorators of kernels return the functions as they are. No kernel is called:
the readable renderer `renderer.simple` needs NumPy alone. Import this before `renderer`.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import sys
from types import ModuleType
from typing import Any, ClassVar

PACKAGES = ("numba", "llvmlite", "OpenEXR", "PIL")
# ours that compile, or that are made of what is compiled
COMPILED = tuple(
    f"renderer.kernels.{name}"
    for name in ("lanes", "jit.cache", "jit.decorators", "jit.interfaces", "jit.linking")
)
# functions that take arguments and return a decorator
MAKE_DECORATORS = ("overload", "register", "lower", "infer", "type_call", "unbox")


class Base:
    """What a class inherits whose base is a stand-in."""

    def __init__(self, *arguments: Any, **named: Any) -> None: ...


class StandIn:
    """Any function, class or decorator of a package that is not there."""

    def __init__(self, name: str = "") -> None:
        self.name = name

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Return a decorated function unchanged, else another stand-in."""
        if self.name.startswith(MAKE_DECORATORS):
            return lambda function: function
        if len(arguments) == 1 and callable(arguments[0]) and not named:
            function = arguments[0]
            if not isinstance(function, type):
                function.py_func = function  # which registration reads
            return function
        return StandIn(self.name)

    def __getattr__(self, name: str) -> Any:
        """Return a stand-in of that name."""
        if name.startswith("__"):
            raise AttributeError(name)
        return StandIn(name)

    def __getitem__(self, key: Any) -> StandIn:
        """Stand in for an array type or a signature."""
        return StandIn(self.name)

    def __or__(self, other: Any) -> StandIn:
        """Stand in for a union of types."""
        return self

    __ror__ = __or__

    def __mro_entries__(self, bases: tuple[Any, ...]) -> tuple[type, ...]:
        """Let a class inherit from a stand-in."""
        return (Base,)


class StandInModule(ModuleType):
    """A module whose every name is a stand-in."""

    __version__ = "0"
    __path__: ClassVar[list[str]] = []

    def __getattr__(self, name: str) -> Any:
        """Return a stand-in of that name."""
        if name.startswith("__"):
            raise AttributeError(name)
        return _interface if name == "interface" else StandIn(name)


def _interface(function: Any) -> Any:
    """Take the place of `renderer.kernels.jit.interface`."""
    function.by = lambda *classes, **named: lambda implementation: implementation
    function.has = lambda cls: False
    return function


class Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds stand-ins before Python looks for packages."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        """Return the stand-in of a package, None for any other."""
        if name.partition(".")[0] in PACKAGES or name.startswith(COMPILED):
            return importlib.machinery.ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec: Any) -> ModuleType:
        """Return an empty module."""
        return StandInModule(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Leave it empty."""


sys.meta_path.insert(0, Finder())
