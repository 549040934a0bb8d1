"""Which programs use a folder of compiled kernels; a folder without any is removed.

Kernels lie in a folder that is named by a hash of their sources. After an edit the same
program uses another folder, and the one before would stay for ever: 8,580 files, 240 MB,
after one test run.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from renderer.process.whole_file import write_whole

_NAME = "used-by.json"
_OURS = re.compile(r"(.+-)?[0-9a-f]{16}")  # names of folders of kernels end in a hash


def use_folder(folder: Path, user: tuple[str, ...], others: Iterable[Path]) -> None:
    """Note that `user` uses a folder, and remove others that have no user any more.

    Nothing is raised if the disk is full or a folder is not ours: an old kernel does no
    harm. Nothing is removed that is a link, has another kind of name than ours, or whose
    note of its users is damaged.

    Parameters
    ----------
    folder
        What is used from now on; it is there.
    user
        The paths that a program is known by, such as those of its sources.
    others
        Folders that `user` may have used before. Their users are those that were noted and
        whose paths all exist.
    """
    users = _users(folder)
    if user in users:
        return
    with suppress(OSError):
        for other in others:
            if other == folder or other.is_symlink() or not _OURS.fullmatch(other.name):
                continue
            noted = _users(other)
            if not noted and (other / _NAME).exists():  # damaged
                continue
            left = [one for one in noted if one != user and _exists(one)]
            if not left:
                shutil.rmtree(other, ignore_errors=True)
            elif left != noted:
                _note(other, left)
        _note(folder, [*users, user])


def _users(folder: Path) -> list[tuple[str, ...]]:
    """Return the noted users; none where the file is missing or damaged."""
    try:
        found = json.loads((folder / _NAME).read_bytes())
        return [tuple(map(str, user)) for user in found if isinstance(user, list)]
    except (OSError, ValueError, TypeError, RecursionError):
        return []


def _exists(user: tuple[str, ...]) -> bool:
    return all(Path(path).exists() for path in user)


def _note(folder: Path, users: list[tuple[str, ...]]) -> None:
    write_whole(folder / _NAME, json.dumps(users).encode())
