"""Which files a scene may name: regular ones in the tree below its own folder.

A scene from elsewhere can name any file, and the file is opened with the rights of the
user. This module is the only place where names become paths (docs/security.md). A file
outside of the folder, by `..`, an absolute path or a symbolic link, is read only if the
caller has allowed it. Anything but a regular file is refused: a named pipe would block.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from renderer.errors import NotAllowed, SceneError
from renderer.process import memory
from renderer.scene_file.description import Location
from renderer.scene_file.numbers import quoted

# Files there are views into the kernel and into processes, not what a scene is made of.
_NEVER = (Path("/proc"), Path("/sys"))

_LONGEST_NAME = 4096  # characters that a message repeats: of a path its end tells most

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


@dataclass(frozen=True)
class Bounds:
    """The folders in whose trees all files of a scene must lie, without symbolic links."""

    own: Path  # of the scene
    others: tuple[Path, ...] = ()  # further folders that the caller allows

    @classmethod
    def of(cls, own: Path, others: str | Path | Iterable[str | Path] = ()) -> Bounds:
        """Return the bounds of a scene in the folder `own`.

        Raises
        ------
        SceneError
            If one of the others is no folder.
        """
        given = [others] if isinstance(others, (str, os.PathLike)) else list(others)
        for folder in given:
            if not Path(folder).is_dir():
                raise SceneError(f"allow_outside: {quoted(str(folder))} is not a folder")
        return cls(own.resolve(), tuple(Path(folder).resolve() for folder in given))

    def check(self, path: Path, what: str) -> None:
        """Refuse a path that leads outside.

        Raises
        ------
        NotAllowed
            Saying where it leads, and how to allow it.
        """
        try:
            real = path.resolve()
        except (OSError, RuntimeError) as error:  # a circle of symbolic links
            raise SceneError(f"{what}: {error}") from None
        if any(real.is_relative_to(folder) for folder in _NEVER):
            raise NotAllowed(f"{what} is {real}, which no scene may read")
        if not any(real.is_relative_to(folder) for folder in (self.own, *self.others)):
            folder = real if real.is_dir() else real.parent
            raise NotAllowed(
                f"{what} is {real}, outside of the scene's folder {self.own}; if you trust "
                f"the scene, allow it: --allow-outside {folder}"
            )


def find(
    name: str, folders: list[Path], bounds: Bounds, location: Location, what: str
) -> Path:
    """Return the first existing path for `name`, which may be absolute.

    Raises
    ------
    SceneError
        If no such path exists.
    NotAllowed
        If the path leads out of the bounds.
    """
    where = f"{location}: {what} {quoted(name, _LONGEST_NAME)}"
    try:
        path = next((f / name for f in folders if name and (f / name).exists()), None)
    except (OSError, ValueError) as error:  # a name too long, a zero byte
        raise SceneError(f"{where}: {error}") from None
    if path is None:
        looked = ", ".join(dict.fromkeys(str(folder) for folder in folders))
        raise SceneError(f"{where} not found; looked in: {looked}")
    bounds.check(path, where)
    return path


def find_regular_file(
    name: str, folders: list[Path], bounds: Bounds, location: Location, what: str
) -> Path:
    """Return the path of a file that can be read whole: regular, and not too large.

    Raises
    ------
    SceneError
        As `find`, and for what is no regular file or has more bytes than there is memory.
    """
    path = find(name, folders, bounds, location, what)
    where = f"{location}: {what} {quoted(name, _LONGEST_NAME)}"
    try:
        status = path.stat()
    except OSError as error:
        raise SceneError(f"{where}: {error.strerror}") from None
    if not stat.S_ISREG(status.st_mode):
        kind = next((kind for is_, kind in _KINDS if is_(status.st_mode)), "something else")
        raise NotAllowed(f"{where} is not a file but {kind}; expected a regular file")
    # what is in it stands in memory as bytes, as numbers, and checked
    memory.require(3 * status.st_size, where)
    return path
