"""The choices of one scene: random, and steered to what was drawn least so far."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element

from mitsuba_ref.generate.coverage import Coverage

Vector = tuple[float, float, float]


class DrawnScene(NamedTuple):
    """A scene: the XML tree, and the files that it names."""

    root: Element
    files: dict[str, bytes]


class Drawing:
    """What the parts of one scene are drawn with.

    Parameters
    ----------
    name
        Of the scene: all choices follow from it and from the coverage.
    coverage
        Of the scenes before.

    Attributes
    ----------
    unit : float
        Size of the scene: what lies in the middle is about as large.
    files : dict
        Name -> content, of those that the scene names.
    present : list of str
        "tag plugin" of those that were drawn.
    attributes : bool
        Whether the shape whose BSDF is drawn has attributes of its mesh.
    opaque : bool
        Whether light may not go through the BSDF that is drawn.
    """

    def __init__(self, name: str, coverage: Coverage) -> None:
        self.rng = random.Random(name)
        self.coverage = coverage
        self.unit = self.rng.choice((1.0,) * 8 + (0.01, 100.0))
        self.files: dict[str, bytes] = {}
        self.present: list[str] = []
        self.attributes = False
        self.opaque = False

    def pick(self, tag: str, plugins: Sequence[str]) -> str:
        """Return one of the plugins of a tag, rather one that was drawn seldom."""
        keys = [f"{tag} {plugin}" for plugin in plugins]
        weights = [self.coverage.weight(key, self.present) for key in keys]
        (chosen,) = self.rng.choices(range(len(keys)), weights)
        if keys[chosen] not in self.present:
            self.present.append(keys[chosen])
        return plugins[chosen]

    def chance(self, share: float) -> bool:
        """Return True with this probability."""
        return self.rng.random() < share

    def direction(self) -> Vector:
        """Return a unit vector."""
        while True:
            x, y, z = (self.rng.uniform(-1.0, 1.0) for _ in range(3))
            if 0.1 < (size := (x * x + y * y + z * z) ** 0.5) <= 1.0:
                return x / size, y / size, z / size

    def point(self, reach: float) -> Vector:
        """Return a point of a cube around the origin, in units of the scene."""
        x, y, z = (self.unit * self.rng.uniform(-reach, reach) for _ in range(3))
        return x, y, z

    def keep_file(self, ending: str, content: bytes) -> str:
        """Add a file to the scene; return its name."""
        name = f"file{len(self.files)}.{ending}"
        self.files[name] = content
        return name


Value = Callable[[Drawing, str], list[Element]]
"""Draws the elements that give a property its value; most give one."""

Properties = Mapping[str, Value]
"""By name, with "!" at its end where the property must be given."""


def draw_plugin(
    drawing: Drawing, tag: str, plugin: str, properties: Properties, name: str = ""
) -> Element:
    """Return a plugin with some of its properties."""
    element = Element(tag, type=plugin)
    if name:
        element.set("name", name)
    for key, value in properties.items():
        feature = f"{tag} {plugin}.{key.rstrip('!')}"
        share = drawing.coverage.share(feature)
        if key.endswith("!") or drawing.chance(share):
            element.extend(value(drawing, key.rstrip("!")))
    return element


def number_text(x: float) -> str:
    """Return a number with six digits."""
    return f"{x:.6g}"


def numbers_text(numbers: Sequence[float]) -> str:
    """Return numbers with commas between them."""
    return ", ".join(map(number_text, numbers))


def plain(tag: str, name: str, value: str | float) -> Element:
    """Return `<tag name="name" value="value"/>`."""
    text = value if isinstance(value, str) else number_text(value)
    return Element(tag, name=name, value=text)


# ------------------------------------------------------------------------------- XML text

WIDTH = 110  # columns; an element that fits is one line


def scene_text(root: Element) -> str:
    """Return a scene as XML, with few lines."""
    return "\n".join(_lines(root, "")) + "\n"


def _lines(element: Element, indent: str) -> list[str]:
    whole = indent + _inline(element)
    if not len(element) or (len(whole) <= WIDTH and element.tag != "scene"):
        return [whole]
    inside = [line for child in element for line in _lines(child, indent + "  ")]
    return [f"{indent}<{_head(element)}>", *inside, f"{indent}</{element.tag}>"]


def _inline(element: Element) -> str:
    inside = "".join(map(_inline, element))
    head = _head(element)
    return f"<{head}>{inside}</{element.tag}>" if inside else f"<{head}/>"


def _head(element: Element) -> str:
    # values are numbers and names: nothing in them has to be escaped
    return element.tag + "".join(f' {key}="{v}"' for key, v in element.attrib.items())
