"""Starts a command: says so first, because its imports take seconds."""

from __future__ import annotations

import importlib
import sys


def run(module: str) -> int:
    """Import a module and run its `main`; return the exit status.

    Parameters
    ----------
    module
        Its `main` reads the arguments of the process.
    """
    if not {"-h", "--help"} & set(sys.argv[1:]):
        sys.stderr.write("starting\n")
        sys.stderr.flush()
    status: int = importlib.import_module(module).main()
    return status
