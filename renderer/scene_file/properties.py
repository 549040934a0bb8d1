"""Typed access to the properties of one plugin; a property that is not read is an error.

A reader gets each property by name and type, and ends with `finish`. As in Mitsuba, unknown
properties are errors; the names that were read are then listed as the possible ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError, UnsupportedPlugin
from renderer.scene_file import transforms
from renderer.scene_file.files import Reading
from renderer.scene_file.numbers import quoted
from renderer.scene_file.plugins import (
    UNSUPPORTED_TAGS,
    registered_by,
    supported_plugins,
    supported_tags,
)
from renderer.scene_file.tree import UNNAMED, Element, Property, Vector

T = TypeVar("T")


class Properties:
    """The properties of one element; each may be read more than once."""

    def __init__(self, element: Element, reading: Reading) -> None:
        self.element = element
        self.reading = reading
        self.location = element.location
        self._left = dict(element.properties)
        self._asked: dict[str, None] = {}  # an ordered set
        supported = supported_plugins(element.tag)
        if not supported:
            raise SceneError(
                f"{self.location}: {element} is not supported: this renderer has no "
                f"{element.tag}; supported: {', '.join(supported_tags())}"
            )
        if element.plugin not in supported:
            raise UnsupportedPlugin(
                f"{self.location}: {element} is not supported; supported {element.tag} "
                f"plugins: {', '.join(supported)}{_of_plugin_files(element)}"
            )

    # ------------------------------------------------------------- plain values

    def has(self, name: str) -> bool:
        """Tell whether the file has a property."""
        self._asked[name] = None
        return name in self.element.properties

    def number(
        self,
        name: str,
        default: float,
        *,
        above: float | None = None,
        at_least: float | None = None,
        at_most: float | None = None,
    ) -> float:
        """Return a float within bounds; an integer is accepted."""
        property_ = self._take(name)
        if property_ is None:
            return default
        value = property_.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._refuse_kind(property_, "float")
        self._check_bounds(property_, float(value), above, at_least, at_most)
        return float(value)

    def integer(
        self,
        name: str,
        default: int,
        *,
        at_least: int | None = None,
        at_most: int | None = None,
    ) -> int:
        """Return an integer within bounds; a float is refused, as in Mitsuba."""
        property_ = self._take(name)
        if property_ is None:
            return default
        value = property_.value
        if isinstance(value, bool) or not isinstance(value, int):
            self._refuse_kind(property_, "integer")
        self._check_bounds(property_, value, None, at_least, at_most)
        return value

    def boolean(self, name: str, default: bool) -> bool:
        """Return a boolean."""
        property_ = self._take(name)
        if property_ is None:
            return default
        if not isinstance(property_.value, bool):
            self._refuse_kind(property_, "boolean")
        return property_.value

    def string(self, name: str, default: str) -> str:
        """Return a string."""
        property_ = self._take(name)
        if property_ is None:
            return default
        if not isinstance(property_.value, str):
            self._refuse_kind(property_, "string")
        return property_.value

    def choice(
        self, name: str, default: str, choices: Sequence[str], *, any_case: bool = False
    ) -> str:
        """Return a string that is one of `choices`."""
        value = self.string(name, default)
        if any_case:
            value = value.lower()
        if value not in choices:
            self.fail(name, quoted(value), f"one of {', '.join(choices)}")
        return value

    def vector(
        self, name: str, default: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        """Return a point or vector."""
        property_ = self._take(name)
        if property_ is None:
            return default
        if not isinstance(property_.value, Vector):
            self._refuse_kind(property_, "point or vector")
        return property_.value.xyz

    def transform(self, name: str) -> NDArray[np.float64]:
        """Return an invertible (4, 4) affine transform; the default is the identity."""
        matrix = self._matrix(name)
        if (reason := transforms.why_unusable(matrix)) is not None:
            self.fail(
                name, f"a transform that cannot be used: {reason}", "an invertible one"
            )
        return matrix

    def uv_transform(self, name: str) -> NDArray[np.float64]:
        """Return an invertible (3, 3) affine transform of (u, v, 1)."""
        matrix = self._matrix(name)
        if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
            self.fail(name, "a last row that is not 0 0 0 1", "an affine transform")
        if matrix[0, 2] or matrix[1, 2]:  # a 3 x 3 <matrix> has no translation
            self.reading.warn(
                self.element.properties[name].location,
                f'{self.element}, property "{name}": the third column acts on z, which uv '
                "lacks; "
                "Mitsuba drops it too (translate with <translate> or a 4 x 4 matrix)",
            )
        uv = transforms.uv_part(matrix)
        if transforms.is_singular(uv[:2, :2]):
            self.fail(name, "a singular transform of u and v", "an invertible one")
        return uv

    # --------------------------------------------------------- nested elements

    def children(self, tag: str) -> list[tuple[str, Element]]:
        """Return the nested elements of a tag with their property names, in order."""
        self._asked[f"<{tag}>"] = None
        found = []
        for name, property_ in self.element.properties.items():
            if isinstance(property_.value, Element) and property_.value.tag == tag:
                self._left.pop(name, None)
                found.append((name, property_.value))
        return found

    def child(self, tag: str) -> Element | None:
        """Return the only nested element of a tag, or None."""
        found = self.children(tag)
        if len(found) > 1:
            second = self.element.properties[found[1][0]].location
            raise SceneError(f"{second}: a second <{tag}> in {self.element}; expected one")
        return found[0][1] if found else None

    def file(self, what: str, expected: str, read: Callable[[Path], T]) -> T:
        """Return the result of `read` for the file of the property "filename".

        Parameters
        ----------
        what
            The content of the file, for messages.
        expected
            Possible files, for the message if the property is missing.
        read
            Raises `SceneError` for an invalid file; the location in the scene is added.
        """
        if not self.has("filename"):
            self.fail("filename", "nothing", expected)
        name = self.string("filename", "")
        location = self.element.properties["filename"].location
        path = self.reading.find_file(name, location, what)
        try:
            return read(path)
        except SceneError as error:
            raise type(error)(f"{location}: {self.element}: {error}") from None

    def take(self, name: str) -> Property | None:
        """Return a property of any type, or None, for readers that accept several types."""
        return self._take(name)

    # ------------------------------------------------------------------ the end

    def finish(self) -> None:
        """Refuse properties that were not read.

        Raises
        ------
        SceneError
            Names the first unknown property and the possible ones.
        """
        for name, property_ in self._left.items():
            value = property_.value
            if isinstance(value, Element) and value.tag in UNSUPPORTED_TAGS:
                raise SceneError(
                    f"{property_.location}: {self.element} refers to {value}; this "
                    f"renderer has no {value.tag}"
                )
            shown = (
                f"<{property_.kind}>" if name.startswith(UNNAMED) else f'property "{name}"'
            )
            supported = ", ".join(self._asked) or "none"
            raise SceneError(
                f"{property_.location}: {self.element} has no {shown}; "
                f"supported: {supported}"
            )

    def fail(self, name: str, found: str, expected: str) -> NoReturn:
        """Raise the error for an invalid value of a property.

        Raises
        ------
        SceneError
            Always.
        """
        location = (
            self.element.properties[name].location
            if name in self.element.properties
            else self.location
        )
        raise SceneError(
            f'{location}: {self.element}, property "{name}": found {found}, expected '
            f"{expected}"
        )

    # ---------------------------------------------------------------- internal

    def _take(self, name: str) -> Property | None:
        self._asked[name] = None
        return self._left.pop(name, None) or self.element.properties.get(name)

    def _matrix(self, name: str) -> NDArray[np.float64]:
        property_ = self._take(name)
        if property_ is None:
            return np.eye(4)
        if not isinstance(property_.value, np.ndarray):
            self._refuse_kind(property_, "transform")
        return property_.value.copy()

    def _refuse_kind(self, property_: Property, expected: str) -> NoReturn:
        self.fail(property_.name, f"a value of type {property_.kind}", expected)

    def _check_bounds(
        self,
        property_: Property,
        value: float,
        above: float | None,
        at_least: float | None,
        at_most: float | None,
    ) -> None:
        expected = []
        if above is not None:
            expected.append(f"above {above:g}")
        if at_least is not None:
            expected.append(f"at least {at_least:g}")
        if at_most is not None:
            expected.append(f"at most {at_most:g}")
        if (
            (above is not None and value <= above)
            or (at_least is not None and value < at_least)
            or (at_most is not None and value > at_most)
        ):
            self.fail(property_.name, f"{value:g}", " and ".join(expected))


def _of_plugin_files(element: Element) -> str:
    """Return the names that plugin files have registered, for an unknown plugin."""
    if element.tag != "bsdf":
        return ""
    files = [
        f"; {Path(path).name} registers {', '.join(map(repr, names)) or 'no BSDF'}"
        + ("" if names else ", as it does not call renderer.register_bsdf")
        for path, names in registered_by.items()
    ]
    return "".join(files)
