"""Files that are written whole or not at all: what was there before stays until then.

The content goes to a temporary file in the same folder, and that file takes the place of
the older one after it is flushed and on the disk. A full disk is often reported only by
`flush`, `fsync` or `close`, so all three come before the replacement.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import stat
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_WRITE_BITS = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


@contextlib.contextmanager
def whole_file(path: Path, *, older: Path | None = None) -> Iterator[BinaryIO]:
    """Open a file that takes the place of `path` when the block ends without an error.

    A symbolic link stays one: its target is replaced. The new file has the owner and the
    permissions of the one before it. What goes to a device or a pipe is gathered first, so
    that the block may seek.

    Parameters
    ----------
    path
        The file to write.
    older
        The name under which the file that is there now is kept.

    Raises
    ------
    OSError
        If the file cannot be written, with its name; `path` is then as it was.
    """
    if (reason := why_not_writable(path)) is not None:
        raise OSError(errno.EACCES, reason, str(path))
    try:
        with _open(path, older) as file:
            yield file
    except OSError as error:  # a full disk is reported without a name
        if error.filename is not None or error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextlib.contextmanager
def _open(path: Path, older: Path | None) -> Iterator[BinaryIO]:
    found = _status(path)
    if found is not None and not stat.S_ISREG(found.st_mode):
        with tempfile.TemporaryFile() as gathered:
            yield gathered
            gathered.seek(0)
            with open(os.open(path, os.O_WRONLY), "wb") as device:
                shutil.copyfileobj(gathered, device)
        return
    target = target_of(path)
    remove_parts(target)
    part = part_of(target, f"{os.getpid()}-{threading.get_ident()}")
    file = part.open("xb")
    try:
        if found is not None:
            _copy_owner_and_mode(found, file.fileno())
        yield file
        file.flush()
        os.fsync(file.fileno())
        file.close()
        if older is not None:
            os.replace(target, older)
        os.replace(part, target)
    finally:
        # On a full disk the rest of the buffer fails once more; one error is enough.
        with contextlib.suppress(OSError):
            file.close()
        part.unlink(missing_ok=True)  # also after Ctrl-C
    _sync_folder(target.parent)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; see `whole_file`."""
    with whole_file(path) as file:
        file.write(content)


def target_of(path: Path) -> Path:
    """Return the file that a symbolic link leads to, or the path itself if it is none."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def part_of(path: Path, writer: str) -> Path:
    """Return the name of the temporary file for `path`.

    Parameters
    ----------
    path
        The file. A long name is cut: file systems have a limit, often 255 bytes.
    writer
        The numbers of the process and of its thread, with a hyphen between them.
    """
    name = path.name.encode()[:200].decode(errors="ignore")
    return path.with_name(f".{name}.{writer}.part")


def remove_parts(path: Path) -> None:
    """Remove what processes that were killed have not written to the end of `path`."""
    name = re.escape(part_of(path, "#").name).replace(r"\#", r"(\d+)(?:-(\d+))?")
    for part in path.parent.glob(".*.part"):
        match = re.fullmatch(name, part.name)
        if match is not None and not _is_alive(int(match[1]), int(match[2] or 0)):
            with contextlib.suppress(OSError):
                part.unlink()


def _is_alive(process: int, thread: int) -> bool:
    """Return whether another process, or another thread of this one, has a number now."""
    if process == os.getpid():
        return thread in {one.ident for one in threading.enumerate()} - {
            threading.get_ident()
        }
    # elsewhere signal 0 is Ctrl-C, and what is open there cannot be removed
    if os.name != "posix":
        return False
    try:
        os.kill(process, 0)
    except PermissionError:
        return True
    except (ProcessLookupError, OverflowError):
        return False
    return True


def why_not_writable(path: Path) -> str | None:
    """Return why a file cannot be written, or None if nothing is known against it.

    A file without write permission counts as not writable for the superuser too.
    """
    try:
        found = _status(path)
        folder = target_of(path).parent
    except OSError as error:
        return error.strerror or str(error)
    except ValueError as error:  # a zero byte
        return str(error)
    if found is None or stat.S_ISREG(found.st_mode):
        if not folder.is_dir():
            return f"there is no folder {str(folder)!r} to write to"
        if not os.access(folder, os.W_OK):
            return f"the folder {str(folder)!r} is not writable"
    if found is None:
        return None
    if stat.S_ISDIR(found.st_mode):
        return "is a folder; a file name is needed"
    if stat.S_ISBLK(found.st_mode) or stat.S_ISSOCK(found.st_mode):
        return "is a disk or a socket; possible are files, pipes and character devices"
    if not found.st_mode & _WRITE_BITS or not os.access(path, os.W_OK):
        return "is read-only; make it writable or choose another name"
    return None


def is_stream(path: Path) -> bool:
    """Return whether a path is a device or a pipe, such as /dev/null."""
    try:
        found = _status(path)
    except (OSError, ValueError):
        return False
    return found is not None and (
        stat.S_ISCHR(found.st_mode) or stat.S_ISFIFO(found.st_mode)
    )


def _status(path: Path) -> os.stat_result | None:
    """Return the status of a file, or of a link's target; None if there is none."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _copy_owner_and_mode(found: os.stat_result, descriptor: int) -> None:
    if os.name != "posix":
        return
    with contextlib.suppress(OSError):  # for the superuser alone
        os.fchown(descriptor, found.st_uid, found.st_gid)
    with contextlib.suppress(OSError):  # not every file system has permissions
        os.fchmod(descriptor, stat.S_IMODE(found.st_mode))


def _sync_folder(folder: Path) -> None:
    """Let the name be on the disk too; not every system can open a folder."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
