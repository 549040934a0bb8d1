"""The tree of elements that XML files and dictionaries are converted to.

An element is a plugin, such as `<bsdf type="diffuse">`, with its properties in the order of
the file. Numbers are already numbers and transforms matrices. The reader of the plugin
(`properties.Properties`) interprets them.
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
    """The value of `<point>` or `<vector>`, which are interchangeable as in Mitsuba."""

    xyz: tuple[float, float, float]


@dataclass(frozen=True)
class RgbValue:
    """The value of `<rgb>`, linear sRGB."""

    rgb: Rgb


@dataclass(frozen=True)
class SpectrumValue:
    """The value of `<spectrum>`: one number, or values over wavelengths [nm]."""

    values: tuple[float, ...]
    wavelengths: tuple[float, ...] = ()  # ascending, as many as values; empty: uniform


@dataclass(frozen=True)
class Function:
    """A Python function; only in dictionaries."""

    call: Callable[..., Any]


@dataclass(frozen=True, eq=False)
class Tensor:
    """An array of numbers that is neither transform nor image; only in dictionaries."""

    values: NDArray[np.generic]


@dataclass(frozen=True)
class Reference:
    """The value of `<ref>`, until `references.resolve` replaces it by the element."""

    id: str


@dataclass(eq=False)
class Element:
    """One plugin: its tag, type and properties."""

    tag: str  # "shape", "bsdf", "texture", ...; a <spectrum type=..> is a "texture"
    plugin: str  # the type attribute
    location: Location
    id: str = ""
    properties: dict[str, Property] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return `bsdf "diffuse"`, the form of all messages."""
        return self.plugin if self.tag == "scene" else f'{self.tag} "{self.plugin}"'

    def name_of(self, key: str) -> str:
        """Return Mitsuba's name of a property; it numbers unnamed ones."""
        if not key.startswith(UNNAMED):
            return key
        unnamed = [name for name in self.properties if name.startswith(UNNAMED)]
        return f"_arg_{unnamed.index(key)}"

    def add(self, name: str, value: Value, location: Location) -> None:
        """Add a property; a nested element without a name gets a generated one.

        Raises
        ------
        SceneError
            If a property of that name exists.
        """
        if not name:
            name = f"{UNNAMED}{len(self.properties)}"
        elif name in self.properties:
            raise SceneError(
                f'{location}: {self} has two properties "{name}"; '
                f"the other one is at {self.properties[name].location}"
            )
        self.properties[name] = Property(name, value, location)


UNNAMED = "#"  # no conflict: the character does not occur in property names

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
    | Image  # only in dictionaries
)


@dataclass(eq=False)
class Property:
    """A property of an element."""

    name: str
    value: Value
    location: Location

    @property
    def kind(self) -> str:
        """The name of this type of value in the file format."""
        if isinstance(self.value, Element):
            return self.value.tag
        return next(word for kind, word in _KINDS if isinstance(self.value, kind))


_KINDS: tuple[tuple[type, str], ...] = (
    (bool, "boolean"),  # before its base class int
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
    """A root element, and all elements with an id, for references."""

    root: Element
    elements: dict[str, Element]
