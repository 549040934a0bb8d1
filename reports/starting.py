"""Starts a command: says so first, because its imports take seconds."""

from __future__ import annotations

import importlib
import os
import sys

from mitsuba_ref.missing_packages import is_installed

NEEDED = ("msgspec", "jinja2", "plotly", "scipy")  # at once, by one command or another


def run(module: str) -> int:
    """Import a module and run its `main`; return the exit status.

    Parameters
    ----------
    module
        Its `main` reads the arguments of the process.
    """
    try:
        os.getcwd()
    except FileNotFoundError:  # pages go there, and a study of minutes would be lost
        raise SystemExit(
            "error: the working directory was deleted; change to another"
        ) from None
    # a missing package is said alone, in one line
    quiet = {"-h", "--help"} & set(sys.argv[1:]) or not all(map(is_installed, NEEDED))
    if not quiet:
        sys.stderr.write("starting\n")
        sys.stderr.flush()
    status: int = importlib.import_module(module).main()
    return status
