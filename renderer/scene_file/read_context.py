"""What one reading of a scene shares: folders to look in, files read, the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from renderer.errors import UnsupportedPlugin, printable
from renderer.scene_file.description import Location
from renderer.scene_file.files import Bounds, find_regular_file
from renderer.scene_file.tree import Element

T = TypeVar("T")


@dataclass(eq=False)
class Reading:
    """State of one reading; every reader gets it."""

    folders: list[Path]  # searched in this order
    # what of all paths may be read
    bounds: Bounds = field(default_factory=lambda: Bounds.of(Path.cwd()))
    warnings: list[str] = field(default_factory=list)
    files: dict[str, None] = field(default_factory=dict)  # an ordered set
    # the shape that an emitter is in, by the id() of the emitter's element
    owners: dict[int, Element] = field(default_factory=dict)
    _built: dict[int, tuple[Element, Any]] = field(default_factory=dict)

    def find_file(self, name: str, location: Location, what: str) -> Path:
        """Return the path of a file that the scene names, and note that it is read.

        Raises
        ------
        SceneError
            If no folder has it, or it may not be read (`renderer.scene_file.files`).
        """
        path = find_regular_file(name, self.folders, self.bounds, location, what)
        self.files[str(path)] = None
        return path

    def warn(self, location: Location, message: str) -> None:
        """Keep a line for the log."""
        self.warnings.append(printable(f"{location}: {message}"))

    def read_unused(
        self, element: Element, read: Callable[[Element, Reading], T]
    ) -> T | None:
        """Read an element that no picture needs, so that its errors show.

        An unsupported plugin is not an error here, since Mitsuba may support it. It is a
        warning, and None is returned.
        """
        try:
            return read(element, self)
        except UnsupportedPlugin as error:
            self.warnings.append(f"{error}; nothing uses it, so it is left out")
            return None

    def once(self, element: Element, build: Callable[[], T]) -> T:
        """Build the record of an element, or return the one of the first time.

        Many references to one bitmap must load it once; the records are then the same
        object, by which `renderer.scene.scene` recognizes them.
        """
        if id(element) not in self._built:
            self._built[id(element)] = (element, build())
        built: T = self._built[id(element)][1]
        return built
