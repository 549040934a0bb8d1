"""A working directory that was deleted: absolute paths still work there."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from renderer.errors import SceneError


def leave_deleted_folder(
    options: argparse.Namespace, *, needs_output: bool = False
) -> None:
    """Go to the root folder if the working directory was deleted; for programs alone.

    Python and Numba ask for the working directory's name and fail without one.

    Parameters
    ----------
    options
        Of the command line. All paths in it must be absolute then.
    needs_output
        Whether a picture without `options.output` would go to the working directory.

    Raises
    ------
    SceneError
        Naming the first relative path, or the output that is missing.
    """
    try:
        os.getcwd()
        return
    except FileNotFoundError:
        pass
    for value in vars(options).values():
        for path in value if isinstance(value, list | tuple) else [value]:
            if isinstance(path, Path) and not path.is_absolute():
                raise SceneError(
                    f"{path}: the working directory was deleted; give absolute paths"
                )
    if needs_output and not options.output:
        raise SceneError("the working directory was deleted; name the picture with -o")
    os.chdir(os.sep)
