"""Files of Mitsuba 0.x (version < 2): property names as they are called since.

Only names change, as in Mitsuba 3, which refuses what else is different in such files.
"""

from __future__ import annotations

import re

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.description import Location
from renderer.scene_file.numbers import quoted
from renderer.scene_file.tree import Element

# A lower-case letter, then capitals: toWorld, intIOR (int_ior).
_CAMEL_CASE = re.compile(r"(?<=[a-z])[A-Z]+")
_VERSION = re.compile(r"([0-9]{1,9})\.[0-9]{1,9}\.[0-9]{1,9}")


def is_version_1(version: str, location: Location) -> bool:
    """Tell whether a version attribute is below 2.0.0.

    Raises
    ------
    SceneError
        If it has not the form of a version.
    """
    match = _VERSION.fullmatch(version.strip())
    if not match:
        raise SceneError(
            f'{location}: version is {quoted(version)}; expected three numbers like "3.0.0"'
        )
    return int(match[1]) < 2


def upgrade(element: Element) -> None:
    """Rename the properties of an element in place, and fold the four old uv numbers."""
    old = list(element.properties.values())
    element.properties.clear()
    offset, factor = [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]
    place = None  # of the last of the old uv numbers
    for property_ in old:
        name = _CAMEL_CASE.sub(lambda capitals: "_" + capitals[0].lower(), property_.name)
        if element.plugin == "diffuse" and name == "diffuse_reflectance":
            name = "reflectance"
        if name in ("uoffset", "voffset", "uscale", "vscale"):
            if isinstance(property_.value, bool) or not isinstance(
                property_.value, int | float
            ):
                raise SceneError(
                    f'{property_.location}: {element}, property "{name}": found a '
                    f"{property_.kind}, expected a float"
                )
            numbers = offset if name.endswith("offset") else factor
            numbers["uv".index(name[0])] = float(property_.value)
            place = property_.location
        else:
            element.add(name, property_.value, property_.location)
    if place is not None:
        to_uv = transforms.scale(*factor) @ transforms.translate(*offset)
        element.add("to_uv", to_uv, place)
