"""A working directory that was deleted: absolute paths still work there."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from renderer.errors import SceneError


def leave_deleted_folder(options: argparse.Namespace) -> bool:
    """Go to the root folder if the working directory was deleted; for programs alone.

    Python and Numba ask for the working directory's name and fail without one.

    Parameters
    ----------
    options
        Of the command line. All paths in it must be absolute then.

    Returns
    -------
    bool
        Whether it was deleted.

    Raises
    ------
    SceneError
        Naming the first relative path.
    """
    try:
        os.getcwd()
        return False
    except FileNotFoundError:
        pass
    for value in vars(options).values():
        for path in value if isinstance(value, list | tuple) else [value]:
            if isinstance(path, Path) and not path.is_absolute():
                raise SceneError(
                    f"{path}: the working directory was deleted; give absolute paths"
                )
    os.chdir(os.sep)
    return True
