"""Which kernels a program compiles, that is, does not find in the cache.

Run in processes of their own: whatever a process has compiled or loaded once, it has.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from numba.core import event

import renderer

ROOT = Path(renderer.__file__).parents[1]


class Compiled(NamedTuple):
    """One kernel for one list of argument types."""

    module: str | None  # None for what is written by a program: loaders of parameters
    name: str
    arguments: tuple[str, ...]


def recorded(run: Callable[[], Any]) -> list[Compiled]:
    """Return what is compiled while `run` runs."""
    with event.install_recorder("numba:compile") as recorder:
        run()
    started = [e.data for _, e in recorder.buffer if e.is_start]
    return [_compiled(data["dispatcher"].py_func, data["args"]) for data in started]


def _compiled(function: Any, arguments: Any) -> Compiled:
    return Compiled(function.__module__, function.__qualname__, tuple(map(str, arguments)))


def compiled_by(statement: str, cache: Path, root: Path = ROOT) -> list[Compiled]:
    """Return what a statement of Python compiles, in a new process with a given cache.

    Parameters
    ----------
    statement : str
        A call of a function in a module of `tests/`, such as "module.function(1)".
    cache : Path
        For `LIGHTPROOF_CACHE`.
    root : Path
        The folder whose `renderer` is used.
    """
    program = f"""
import json, compiled_kernels, {statement.partition(".")[0]}
print(json.dumps(compiled_kernels.recorded(lambda: {statement})))
"""
    paths = os.pathsep.join([str(root), str(Path(__file__).parent)])
    environment = os.environ | {"LIGHTPROOF_CACHE": str(cache), "PYTHONPATH": paths}
    environment["NUMBA_OPT"] = "1"  # which kernels they are is the question, not how fast
    command = [sys.executable, "-c", program]
    done = subprocess.run(
        command, env=environment, cwd=root, capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout.splitlines()[-1])
    return [Compiled(module, name, tuple(args)) for module, name, args in found]
