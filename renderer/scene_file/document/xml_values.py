"""Values and transforms of XML elements, with checks."""

from __future__ import annotations

import numpy as np

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.colors.spectra import parse_spectrum, read_spd
from renderer.scene_file.document.xml_elements import XmlElement, check_attributes, required
from renderer.scene_file.files import Reading
from renderer.scene_file.numbers import (
    parse_boolean,
    parse_float,
    parse_floats,
    parse_integer,
    quoted,
)
from renderer.scene_file.transforms import Matrix
from renderer.scene_file.tree import (
    Reference,
    RgbValue,
    SpectrumValue,
    Value,
    Vector,
)

# --------------------------------------------------------------------------- xml values
# The value of a property element: `<float>`, `<rgb>`, `<spectrum>`, `<transform>`, ...

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
    """Read an element with a tag in VALUE_TAGS, whose parameters are already replaced.

    Raises
    ------
    SceneError
        If its attributes do not match its tag, or its text is not a valid value.
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
    """Read a value that is the attribute "value" alone."""
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


# ----------------------------------------------------------------------- xml transforms
# The steps inside `<transform>`, multiplied to one matrix.

_ATTRIBUTES = {
    "translate": {"value", "x", "y", "z"},
    "scale": {"value", "x", "y", "z"},
    "rotate": {"value", "x", "y", "z", "angle"},
    "lookat": {"origin", "target", "up"},
    "matrix": {"value"},
}
STEPS = tuple(_ATTRIBUTES)


def fold_steps(steps: list[XmlElement], reading: Reading) -> Matrix:
    """Return the (4, 4) matrix that applies `steps` in order.

    Parameters
    ----------
    reading
        Gets a warning for an axis that does not have unit length.

    Raises
    ------
    SceneError
        If a step is unknown or malformed, or the product overflows.
    """
    matrix = np.eye(4)
    with np.errstate(over="ignore", invalid="ignore"):
        for step in steps:
            matrix = _step(step, reading) @ matrix
            if not np.isfinite(matrix).all():
                raise SceneError(
                    f"{step.location}: the transform is not finite after <{step.tag}>"
                )
    return matrix


def _step(step: XmlElement, reading: Reading) -> Matrix:
    known = _ATTRIBUTES.get(step.tag)
    if known is None:
        raise SceneError(
            f"{step.location}: unknown transform <{step.tag}>; "
            f"supported: {', '.join(STEPS)}"
        )
    check_attributes(step, (), known)
    if step.children:
        raise SceneError(
            f"{step.children[0].location}: <{step.tag}> takes no elements inside"
        )
    match step.tag:
        case "translate":
            return transforms.translate(*xyz(step, 0.0))
        case "scale":
            return transforms.scale(*xyz(step, 1.0))
        case "rotate":
            return _rotate(step, reading)
        case "lookat":
            return _look_at(step)
        case _:
            return _matrix(step)


def _rotate(step: XmlElement, reading: Reading) -> Matrix:
    axis = xyz(step, 0.0)
    if not any(axis):
        raise SceneError(
            f"{step.location}: the axis of <rotate> is 0; expected a direction"
        )
    if (warning := transforms.why_distorting(axis)) is not None:
        reading.warn(step.location, f"the axis of <rotate> {warning}")
    angle = parse_float(required(step, "angle"), step.location, "the angle")
    return transforms.rotate(axis, angle)


def _look_at(step: XmlElement) -> Matrix:
    vectors = {
        name: parse_floats(required(step, name), (3,), step.location, name)
        for name in ("origin", "target", "up")
        if name != "up" or step.attributes.get(name)
    }
    up = vectors.get("up")
    matrix = transforms.look_at(
        vectors["origin"], vectors["target"], up if up is not None and any(up) else None
    )
    if matrix is None:
        raise SceneError(
            f"{step.location}: <lookat> has no direction: target must differ from "
            "origin, and "
            "up must not be parallel to the view"
        )
    return matrix


def _matrix(step: XmlElement) -> Matrix:
    entries = parse_floats(required(step, "value"), (9, 16), step.location, "the matrix")
    matrix = np.eye(4)
    size = 4 if len(entries) == 16 else 3
    matrix[:size, :size] = np.reshape(entries, (size, size))
    return matrix


def xyz(element: XmlElement, missing: float | None) -> tuple[float, float, float]:
    """Read `value="1 2 3"`, `value="2"` (three times) or `x=".." y=".." z=".."`.

    Parameters
    ----------
    missing
        Value of an absent x, y or z; None: all three are required.

    Raises
    ------
    SceneError
        If both forms are mixed, or the form is incomplete.
    """
    attributes = element.attributes
    given = [name for name in ("x", "y", "z") if name in attributes]
    if "value" in attributes:
        if given:
            raise SceneError(
                f'{element.location}: <{element.tag}> has "value" and "{given[0]}"; '
                "expected "
                "one of the two forms"
            )
        numbers = parse_floats(attributes["value"], (1, 3), element.location, "value")
        x, y, z = numbers * 3 if len(numbers) == 1 else numbers
        return x, y, z
    if missing is None and len(given) < 3:
        raise SceneError(
            f"{element.location}: <{element.tag}> needs x, y and z, or value with three "
            "numbers"
        )
    x, y, z = (
        missing
        if missing is not None and name not in attributes
        else parse_float(attributes[name], element.location, name)
        for name in ("x", "y", "z")
    )
    return x, y, z
