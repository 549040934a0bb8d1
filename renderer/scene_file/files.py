"""Files that a scene may name: regular files in the tree of its own folder.

An untrusted scene can name any file, and the file is opened with the user's permissions.
This module is the only place where names become paths (docs/security.md). A file outside of
the folder, by `..`, an absolute path or a symbolic link, is read only if the caller allows
it. Anything but a regular file is refused: a named pipe would block.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from renderer.errors import (
    MissingFile,
    NotAllowed,
    SceneError,
    UnsupportedPlugin,
    printable,
)
from renderer.process import memory
from renderer.scene_file.description import Location
from renderer.scene_file.numbers import quoted
from renderer.scene_file.tree import Element

# These folders have views of the kernel and of processes, and no scene data.
_NEVER = (Path("/proc"), Path("/sys"))

_LONGEST_NAME = 4096  # characters in a message; the end of a path is kept

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


@dataclass(frozen=True)
class Bounds:
    """The folders that must contain all files of a scene; symbolic links are resolved."""

    own: Path  # folder of the scene
    others: tuple[Path, ...] = ()  # additional folders that the caller allows

    @classmethod
    def of(cls, own: Path, others: str | Path | Iterable[str | Path] = ()) -> Bounds:
        """Return the bounds of a scene in the folder `own`.

        Raises
        ------
        SceneError
            If one of the others is not a folder.
        """
        given = [others] if isinstance(others, (str, os.PathLike)) else list(others)
        for folder in given:
            if not Path(folder).is_dir():
                raise SceneError(f"allow_outside: {quoted(str(folder))} is not a folder")
        return cls(own.resolve(), tuple(Path(folder).resolve() for folder in given))

    def check(self, path: Path, what: str) -> None:
        """Refuse a path outside of the folders.

        Raises
        ------
        NotAllowed
            Tells where the path leads, and how to allow it.
        """
        try:
            real = path.resolve()
        except (OSError, RuntimeError) as error:  # a cycle of symbolic links
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
    MissingFile
        If no such path exists.
    NotAllowed
        If the path leads out of the bounds.
    """
    where = f"{location}: {what} {quoted(name, _LONGEST_NAME)}"
    try:
        path = next((f / name for f in folders if name and (f / name).exists()), None)
    except (OSError, ValueError) as error:  # too long a name, or a zero byte in it
        raise SceneError(f"{where}: {error}") from None
    if path is None:
        looked = ", ".join(dict.fromkeys(str(folder) for folder in folders))
        like = _path_like(name, folders, bounds)
        raise MissingFile(f"{where} not found; looked in: {looked}{like}")
    bounds.check(path, where)
    return path


def _path_like(name: str, folders: list[Path], bounds: Bounds) -> str:
    """Return "; did you mean ...?" with a path that is equal to `name` on other systems.

    Scenes written on Windows have backslashes in paths, or other upper and lower case.
    """
    parts = [p for p in name.replace("\\", "/").lower().split("/") if p not in ("", ".")]
    for folder in folders:
        found: Path | None = folder
        try:
            for part in parts:
                inside = found.iterdir() if found is not None and found.is_dir() else ()
                found = next((path for path in inside if path.name.lower() == part), None)
            if parts and found is not None:
                bounds.check(found, name)
                return f'; did you mean "{found.relative_to(folder)}"?'
        except (OSError, SceneError):
            continue
    return ""


def find_regular_file(
    name: str, folders: list[Path], bounds: Bounds, location: Location, what: str
) -> Path:
    """Return the path of a file that can be read whole: regular, and fitting in memory.

    Raises
    ------
    SceneError
        As `find`; and if it is not a regular file or is larger than the available memory.
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
    # in memory as bytes, as numbers, and as a copy for checks
    memory.require(3 * status.st_size, where)
    return path


# ------------------------------------------------------------------------- read context
# State of one reading of a scene: folders to search, files read, warnings.

T = TypeVar("T")


@dataclass(eq=False)
class Reading:
    """State of one reading, passed to every reader."""

    folders: list[Path]  # searched in this order
    # folders from which files may be read
    bounds: Bounds = field(default_factory=lambda: Bounds.of(Path.cwd()))
    warnings: list[str] = field(default_factory=list)
    files: dict[str, None] = field(default_factory=dict)  # an ordered set
    old_version: str = ""  # version of a document of Mitsuba 0.x
    # the shape of an emitter, by the id() of the emitter's element
    owners: dict[int, Element] = field(default_factory=dict)
    _built: dict[int, tuple[Element, Any]] = field(default_factory=dict)

    def find_file(self, name: str, location: Location, what: str) -> Path:
        """Return the path of a file that the scene names, and record it.

        Raises
        ------
        SceneError
            If no folder has it, or it must not be read (`renderer.scene_file.files`).
        """
        path = find_regular_file(name, self.folders, self.bounds, location, what)
        self.files[str(path)] = None
        return path

    def warn(self, location: Location, message: str) -> None:
        """Add a warning for the log."""
        self.warnings.append(printable(f"{location}: {message}"))

    def read_unused(
        self, element: Element, read: Callable[[Element, Reading], T]
    ) -> T | None:
        """Read an element that affects no picture, so that its errors are reported.

        An unsupported plugin is only a warning, since Mitsuba may support it; the result is
        then None.
        """
        try:
            return read(element, self)
        except UnsupportedPlugin as error:
            self.warnings.append(f"{error}; nothing uses it, so it is left out")
            return None

    def once(self, element: Element, build: Callable[[], T]) -> T:
        """Build the record of an element, or return the existing one.

        A bitmap that is referenced many times must be loaded once. Its records are then the
        same object, which `renderer.scene.scene` recognizes.
        """
        if id(element) not in self._built:
            self._built[id(element)] = (element, build())
        built: T = self._built[id(element)][1]
        return built
