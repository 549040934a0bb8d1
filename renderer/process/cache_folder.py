"""Where lightproof keeps what it would otherwise make again, and how that is removed.

Each kind of content has a folder of its own: compiled kernels, Mitsuba's pictures, and so
on. All of it may be deleted at any time.
"""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from renderer.process.whole_file import write_whole

# "Cache Directory Tagging Specification": backup programs leave out a folder with this
# file, and `clear_caches` removes nothing without it.
_TAG = "CACHEDIR.TAG"
_SIGNATURE = (
    "Signature: 8a477f597d28d172789f06886806bc55\n"
    "# lightproof makes the content of this folder again when it is missing.\n"
)


_REMOVED = ".removed-"  # in the name of a folder that is being cleared


class Removed(NamedTuple):
    """One folder that `clear_caches` has removed."""

    name: str
    files: int
    size: int  # [bytes]


def cache_root() -> Path:
    """Return the folder of all caches: `$LIGHTPROOF_CACHE`, or `lightproof` in another.

    That is `$XDG_CACHE_HOME`, else `~/.cache`, else, where there is no home folder or it
    cannot be written, a folder in the temporary one that other users cannot write to.
    """
    chosen = os.environ.get("LIGHTPROOF_CACHE")
    if chosen:
        return Path(chosen)
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if base.is_absolute():  # the XDG specification: a relative one is ignored
        return base / "lightproof"
    try:
        root = Path.home() / ".cache" / "lightproof"
    except RuntimeError:  # no HOME, and a user without an entry in /etc/passwd
        return _temporary_root()
    return root if root.is_absolute() and _can_be_made(root) else _temporary_root()


def cache_folder(name: str) -> Path:
    """Return the folder of one kind of content, made and tagged if that is possible.

    A folder with other content that lies in a place of the user's choice may be his own: it
    gets no tag, and is never cleared. If none can be made, the first write will say why.
    """
    root = cache_root()
    folder = root / name
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        ours = root.name.startswith("lightproof") or not any(folder.iterdir())
        if ours and not (folder / _TAG).exists():
            write_whole(folder / _TAG, _SIGNATURE.encode())
    return folder


def clear_caches() -> list[Removed]:
    """Remove every cache folder, and return what was in it.

    A folder gets another name first: programs that run begin a new one meanwhile.

    Raises
    ------
    OSError
        If one cannot be removed; the next call goes on with what is left of it.
    """
    removed = []
    root = cache_root()
    for folder in sorted(root.iterdir()) if root.is_dir() else []:
        if folder.is_symlink() or not _is_tagged(folder):
            continue
        name = folder.name.partition(_REMOVED)[0]
        if name == folder.name:
            folder = folder.rename(folder.with_name(f"{name}{_REMOVED}{os.getpid()}"))
        contents = [path for path in folder.iterdir() if path.name != _TAG]
        files = [path for path in folder.rglob("*") if path.is_file()]
        size = sum(path.lstat().st_size for path in files)
        for path in contents:
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()
        shutil.rmtree(folder)  # with the tag, which is the last to go
        removed.append(Removed(name, len(files), size))
    return removed


def _is_tagged(folder: Path) -> bool:
    try:
        return (folder / _TAG).read_text(errors="replace") == _SIGNATURE
    except OSError:
        return False


def _can_be_made(folder: Path) -> bool:
    """Return whether a folder is there, or can be made, and can be written to."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


@functools.cache
def _temporary_root() -> Path:
    """Return a folder of this user's alone: kernels are read from it as code to be run."""
    user = os.getuid() if os.name == "posix" else "user"
    folder = Path(tempfile.gettempdir()) / f"lightproof-{user}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        others = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        own = os.name != "posix" or (found.st_uid == os.getuid() and not others)
        if stat.S_ISDIR(found.st_mode) and own:
            return folder
    folder = Path(tempfile.mkdtemp(prefix="lightproof-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
