"""Which kernels a program needs, and which of them it does not find in the cache.

Asked in processes of their own: what a process has compiled or loaded once, it has.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from numba.core import event
from processes import run_python

import renderer
from renderer.kernels.jit.cache import KernelCache

ROOT = Path(renderer.__file__).parents[1]


class Needed(NamedTuple):
    """One kernel for one list of argument types."""

    module: str | None  # None for what is written by a program: loaders of parameters
    name: str
    arguments: tuple[str, ...]
    found: bool  # in the cache; if not, it was compiled
    caller: str  # for whose machine code it was compiled; empty: it has its own


class _Listener(event.Listener):  # type: ignore[misc]
    """Notes what is found in the cache, and what is compiled."""

    def __init__(self) -> None:
        self.kernels: list[Needed] = []
        self.under_way: list[str] = []  # what is being compiled, each for the one before

    def note(self, function: Any, arguments: Any, found: bool) -> None:
        types = tuple(map(str, arguments))
        name = function.__module__, function.__qualname__
        self.kernels.append(Needed(*name, types, found, (self.under_way or [""])[0]))

    def on_start(self, started: Any) -> None:
        function = started.data["dispatcher"].py_func
        self.note(function, started.data["args"], False)
        self.under_way.append(function.__qualname__)

    def on_end(self, ended: Any) -> None:
        self.under_way.pop()


def needed(run: Callable[[], Any], anew: str) -> list[Needed]:
    """Return what `run` needs, and all that goes into kernels of the name `anew`.

    These are compiled, in the cache or not, and so is all that they call.
    """
    listener, load = _Listener(), KernelCache.load_overload

    def noted(cache: Any, signature: Any, context: Any) -> Any:
        name = cache._py_func.__qualname__
        if anew in (name, *listener.under_way):
            return None
        compiled = load(cache, signature, context)
        if compiled is not None and not listener.under_way:
            listener.note(cache._py_func, signature, True)
        return compiled

    with (
        pytest.MonkeyPatch.context() as patch,
        event.install_listener("numba:compile", listener),
    ):
        patch.setattr(KernelCache, "load_overload", noted)
        run()
    return listener.kernels


def needed_by(statement: str, root: Path = ROOT, anew: str = "") -> list[Needed]:
    """Return what a statement of Python needs, in a new process.

    Parameters
    ----------
    statement : str
        A call of a function in a module of `tests/`, such as "module.function(1)".
    root : Path
        The folder whose `renderer` is used.
    anew : str
        The name of kernels that are compiled with all that they call; empty: of none.
    """
    program = f"""
import json, compiled_kernels, {statement.partition(".")[0]}
print(json.dumps(compiled_kernels.needed(lambda: {statement}, "{anew}")))
"""
    paths = os.pathsep.join([str(root), *sys.path])
    done = run_python(
        "-c",
        program,
        folder=root,
        environment=os.environ | {"PYTHONPATH": paths},
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    return [Needed(module, name, tuple(args), *of) for module, name, args, *of in found]
