"""The value of a property element: `<float>`, `<rgb>`, `<spectrum>`, `<transform>`, ..."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene_file.colors.spectrum_text import parse_spectrum, read_spd
from renderer.scene_file.document.xml.xml_elements import XmlElement, check_attributes
from renderer.scene_file.document.xml.xml_transforms import fold_steps, xyz
from renderer.scene_file.numbers import (
    parse_boolean,
    parse_float,
    parse_floats,
    parse_integer,
    quoted,
)
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import (
    Reference,
    RgbValue,
    SpectrumValue,
    Value,
    Vector,
)

VALUE_TAGS = (
    "boolean",
    "integer",
    "float",
    "string",
    "point",
    "vector",
    "rgb",
    "spectrum",
    "transform",
    "ref",
)


def read_value(xml: XmlElement, reading: Reading) -> Value:
    """Read an element whose tag is one of VALUE_TAGS, its parameters already replaced.

    Raises
    ------
    SceneError
        If its attributes are not those of its tag, or its text is no such value.
    """
    match xml.tag:
        case "point" | "vector":
            check_attributes(xml, ("name",), {"value", "x", "y", "z"})
            return Vector(xyz(xml, None))
        case "spectrum":
            return _spectrum(xml, reading)
        case "transform":
            check_attributes(xml, ("name",))
            return fold_steps(xml.children, reading)
        case "ref":
            check_attributes(xml, ("id",), {"name"})
            return Reference(xml.attributes["id"])
        case _:
            check_attributes(xml, ("name", "value"))
            return _plain(xml)


def _plain(xml: XmlElement) -> Value:
    """Read what stands in the attribute "value" alone."""
    text, where = xml.attributes["value"], xml.location
    what = f"{xml.tag} {quoted(xml.attributes['name'])}"
    match xml.tag:
        case "boolean":
            return parse_boolean(text, where, what)
        case "integer":
            return parse_integer(text, where, what)
        case "float":
            return parse_float(text, where, what)
        case "rgb":
            numbers = parse_floats(text, (1, 3), where, what)
            red, green, blue = numbers * 3 if len(numbers) == 1 else numbers
            return RgbValue((red, green, blue))
        case _:
            return text


def _spectrum(xml: XmlElement, reading: Reading) -> SpectrumValue:
    check_attributes(xml, ("name",), {"value", "filename"})
    text, filename = xml.attributes.get("value"), xml.attributes.get("filename")
    if text and not filename:
        return parse_spectrum(text, xml.location)
    if filename and not text:
        return read_spd(reading.find_file(filename, xml.location, "the spectrum file"))
    raise SceneError(f'{xml.location}: <spectrum> needs one of "value" and "filename"')
