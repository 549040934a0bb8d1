"""What a command of the harness says where a package of the harness cannot be imported.

`pip install lightproof` installs the commands and not what they need: the extra `harness`.
"""

from __future__ import annotations

import importlib.util
import sys
import traceback
from pathlib import Path
from types import FrameType, TracebackType

# What the extra `harness` of pyproject.toml installs, as it is imported.
HARNESS = (
    "colour",
    "drjit",
    "embreex",
    "flip_evaluator",
    "jinja2",
    "mitsuba",
    "msgspec",
    "plotly",
    "scipy",
    "skimage",
)
NEEDS = "needs: pip install 'lightproof[harness]'"
_LONGEST = 300  # characters of what an import failed with


def say_missing_packages_in_one_line() -> None:
    """Let this process say one line, and end with 1, where a package fails to be imported.

    Only in a process that a command of ours has started: `python -m` or `lightproof-...`.
    """
    program = Path(sys.argv[0]).name if sys.argv else ""
    # Python says "-m" while it looks for the module, and so while it imports its package
    if program == "-m" or program.startswith("lightproof-"):
        sys.excepthook = _say


def is_installed(package: str) -> bool:
    """Tell whether a package is there, without importing it."""
    try:
        return importlib.util.find_spec(package) is not None
    except (ImportError, ValueError):  # ValueError: its module has no __spec__
        return False


def failed_package(error: BaseException) -> str | None:
    """Return which package of the harness failed to be imported; None: it is no such error.

    It is missing, is another version without what we import, or fails by itself.
    """
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    modules = []
    if isinstance(error, ImportError):
        modules.append(error.name)
    # what a module of ours uses while it is imported
    elif isinstance(error, AttributeError) and frames and _is_import(frames[-1]):
        modules.append(getattr(error.obj, "__name__", None))
    for frame in frames:
        if _is_import(frame) or isinstance(error, ImportError):
            modules.append(frame.f_globals.get("__name__"))
    for module in modules:
        package = str(module).partition(".")[0]
        if package in HARNESS:
            return package
    return None


def _is_import(frame: FrameType) -> bool:
    return frame.f_code.co_name == "<module>"


def _say(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    package = failed_package(error)
    if package is None or sys.stderr is None:
        sys.__excepthook__(kind, error, trace)
        return
    what = " ".join(f"{kind.__name__}: {error}".split())[:_LONGEST]
    if not isinstance(error, ModuleNotFoundError):
        what = f"{package} cannot be imported: {what}"
    sys.stderr.write(f"error: {what.removeprefix('ModuleNotFoundError: ')}; {NEEDS}\n")
