"""The plain tree that XML files and dictionaries become before anything is interpreted.

An element is a plugin to be: `<bsdf type="diffuse">` with its properties, in the order
of the file. Numbers are already numbers and transforms matrices; what a property *means*
is decided later, by the reader of the plugin (`properties.Properties`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.description import Location, Rgb
from renderer.scene_file.images.image import Image


@dataclass(frozen=True)
class Vector:
    """The value of `<point>` or `<vector>`; Mitsuba takes either for the other."""

    xyz: tuple[float, float, float]


@dataclass(frozen=True)
class RgbValue:
    """The value of `<rgb>`, linear sRGB."""

    rgb: Rgb


@dataclass(frozen=True)
class SpectrumValue:
    """The value of `<spectrum>`: one number, or a list over wavelengths in nm."""

    values: tuple[float, ...]
    wavelengths: tuple[float, ...] = ()  # ascending, as many as values; empty: uniform


@dataclass(frozen=True)
class Function:
    """A Python function, which only a dictionary can hold."""

    call: Callable[..., Any]


@dataclass(frozen=True, eq=False)
class Tensor:
    """An array of numbers that is no transform and no image; of dictionaries alone."""

    values: NDArray[np.generic]


@dataclass(frozen=True)
class Reference:
    """The value of `<ref>`, until `references.resolve` puts the element in its place."""

    id: str


@dataclass(eq=False)
class Element:
    """One plugin: its tag (what it is for), type and properties."""

    tag: str  # "shape", "bsdf", "texture", ...; a <spectrum type=..> is a "texture"
    plugin: str  # the type attribute
    location: Location
    id: str = ""
    properties: dict[str, Property] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return `bsdf "diffuse"`, the form of all messages."""
        return self.plugin if self.tag == "scene" else f'{self.tag} "{self.plugin}"'

    def name_of(self, key: str) -> str:
        """Return the name that Mitsuba has for a property; it numbers those without."""
        if not key.startswith(UNNAMED):
            return key
        unnamed = [name for name in self.properties if name.startswith(UNNAMED)]
        return f"_arg_{unnamed.index(key)}"

    def add(self, name: str, value: Value, location: Location) -> None:
        """Add a property; a nested element without a name gets a generated one.

        Raises
        ------
        SceneError
            If there is a property of that name already.
        """
        if not name:
            name = f"{UNNAMED}{len(self.properties)}"
        elif name in self.properties:
            raise SceneError(
                f'{location}: {self} has two properties "{name}"; '
                f"the other one is at {self.properties[name].location}"
            )
        self.properties[name] = Property(name, value, location)


UNNAMED = "#"  # cannot clash: it is no character of a property name that anyone uses

Value = (
    bool
    | int
    | float
    | str
    | Vector
    | RgbValue
    | SpectrumValue
    | Function
    | Tensor
    | Reference
    | Element
    | NDArray[np.float64]
    | Image  # of dictionaries
)


@dataclass(eq=False)
class Property:
    """A named value of an element."""

    name: str
    value: Value
    location: Location

    @property
    def kind(self) -> str:
        """The word that the file format has for this kind of value."""
        if isinstance(self.value, Element):
            return self.value.tag
        return next(word for kind, word in _KINDS if isinstance(self.value, kind))


_KINDS: tuple[tuple[type, str], ...] = (
    (bool, "boolean"),  # before int, its base class
    (int, "integer"),
    (float, "float"),
    (str, "string"),
    (Vector, "vector"),
    (RgbValue, "rgb"),
    (SpectrumValue, "spectrum"),
    (Function, "function"),
    (Tensor, "tensor"),
    (Reference, "ref"),
    (np.ndarray, "transform"),
    (Image, "image"),
)


@dataclass(eq=False)
class Tree:
    """A root element, and every element that has an id, for references."""

    root: Element
    elements: dict[str, Element]
