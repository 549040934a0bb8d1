"""Which kernels a program needs, and which of them it does not find in the cache.

Asked in processes of their own: what a process has compiled or loaded once, it has.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from numba.core import event

import renderer
from renderer.kernels.jit.cache import KernelCache

ROOT = Path(renderer.__file__).parents[1]


class Needed(NamedTuple):
    """One kernel for one list of argument types, as machine code of its own."""

    module: str
    name: str
    arguments: tuple[str, ...]
    found: bool  # in the cache; if not, it and what it calls was compiled


class _Listener(event.Listener):  # type: ignore[misc]
    """Notes what is found in the cache, and what is compiled but for something else."""

    def __init__(self) -> None:
        self.kernels: list[Needed] = []
        self._depth = 0  # kernels that are being compiled, each for the one before

    def note(self, function: Any, arguments: Any, found: bool) -> None:
        if self._depth == 0:
            types = tuple(map(str, arguments))
            name = function.__module__, function.__qualname__
            self.kernels.append(Needed(*name, types, found))

    def on_start(self, started: Any) -> None:
        self.note(started.data["dispatcher"].py_func, started.data["args"], False)
        self._depth += 1

    def on_end(self, ended: Any) -> None:
        self._depth -= 1


def needed(run: Callable[[], Any]) -> list[Needed]:
    """Return what `run` needs, but not what is looked up to compile something else."""
    listener, load = _Listener(), KernelCache.load_overload

    def noted(cache: Any, signature: Any, context: Any) -> Any:
        compiled = load(cache, signature, context)
        if compiled is not None:
            listener.note(cache._py_func, signature, True)
        return compiled

    with (
        pytest.MonkeyPatch.context() as patch,
        event.install_listener("numba:compile", listener),
    ):
        patch.setattr(KernelCache, "load_overload", noted)
        run()
    return listener.kernels


def needed_by(statement: str, root: Path = ROOT) -> list[Needed]:
    """Return what a statement of Python needs, in a new process.

    Parameters
    ----------
    statement : str
        A call of a function in a module of `tests/`, such as "module.function(1)".
    root : Path
        The folder whose `renderer` is used.
    """
    program = f"""
import json, compiled_kernels, {statement.partition(".")[0]}
print(json.dumps(compiled_kernels.needed(lambda: {statement})))
"""
    paths = os.pathsep.join([str(root), str(Path(__file__).parent)])
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": paths},
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    return [Needed(module, name, tuple(args), f) for module, name, args, f in found]
