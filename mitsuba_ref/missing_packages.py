"""What a command of the harness says where the machine lacks what it needs.

`pip install lightproof` installs the commands and not what they need: the extra `harness`.
"""

from __future__ import annotations

import errno
import importlib.util
import os
import sys
import traceback
from pathlib import Path
from types import FrameType, TracebackType

from renderer.errors import SceneError
from renderer.process.signals import make_streams_tolerant

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
# files that cannot be written: the disk, its quota, or the permissions
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM)


def prepare_command_process() -> None:
    """Prepare a process that a command has started: `python -m` or `lightproof-...`.

    It says one line, and ends with 1, where a package fails to be imported, a disk is full,
    the working directory was deleted or kernels cannot be compiled. Standard streams that
    are closed or full end nothing.
    """
    program = Path(sys.argv[0]).name if sys.argv else ""
    # Python says "-m" while it looks for the module, and so while it imports its package
    if program == "-m" or program.startswith("lightproof-"):
        sys.excepthook = _say
        make_streams_tolerant()


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


def _lack(error: BaseException) -> str | None:
    """Return what the machine lacks; None: the error may be a mistake of ours."""
    if isinstance(error, SceneError):
        return str(error)
    if not isinstance(error, OSError):
        return None
    try:
        os.getcwd()
    except FileNotFoundError:
        return "the working directory was deleted; change to one that is there"
    return str(error) if error.errno in _NO_ROOM else None


def _say(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    package = failed_package(error)
    if package is None:
        lack = _lack(error)
        if lack is None:
            sys.__excepthook__(kind, error, trace)
        else:
            sys.stderr.write(f"error: {lack}\n")
        return
    what = " ".join(f"{kind.__name__}: {error}".split())[:_LONGEST]
    if not isinstance(error, ModuleNotFoundError):
        what = f"{package} cannot be imported: {what}"
    sys.stderr.write(f"error: {what.removeprefix('ModuleNotFoundError: ')}; {NEEDS}\n")
