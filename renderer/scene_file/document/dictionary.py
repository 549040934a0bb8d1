"""Scenes as dictionaries, in the form of Mitsuba's `load_dict`, to trees of elements.

Each nested dictionary has a "type". Its key is the name of the property, at the top level
also its id. Matrices are arrays, or Mitsuba's transform objects, which have an attribute
`matrix`.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from renderer.errors import SceneError
from renderer.scene_file.colors.spectra import parse_spectrum, read_spd, spectrum_of_pairs
from renderer.scene_file.description import Location
from renderer.scene_file.files import Reading
from renderer.scene_file.images.image import SRGB_FROM_XYZ, Image, linear_values
from renderer.scene_file.numbers import check_float, check_integer, quoted
from renderer.scene_file.plugins import every_plugin, tag_of_plugin
from renderer.scene_file.tree import (
    Element,
    Function,
    Reference,
    RgbValue,
    SpectrumValue,
    Tensor,
    Tree,
    Value,
    Vector,
)

_DEEPEST = 100  # also stops at a dictionary that contains itself
_VALUE_TYPES = ("rgb", "spectrum", "ref")
# Supported pixel types, by kind and bytes. Tensors may have any type, and are linear.
_PIXEL_TYPES = ("u1", "u2", "f2", "f4", "f8")
_TENSOR_TYPES = (*_PIXEL_TYPES, "i1", "i2", "i4", "i8", "u4", "u8")


def read_dictionary(content: Mapping[str, Any], reading: Reading) -> Tree:
    """Return the tree of a dictionary.

    Raises
    ------
    SceneError
        If a value has an unsupported type, or a plugin does not exist.
    """
    elements: dict[str, Element] = {}
    if not isinstance(content, Mapping):
        raise SceneError(f"<dictionary>: found a {_type(content)}, expected a dictionary")
    root = _element("scene", content, ("scene",), elements, reading)
    return Tree(root, elements)


def _element(
    key: str,
    content: Mapping[str, Any],
    path: tuple[str, ...],
    elements: dict[str, Element],
    reading: Reading,
) -> Element:
    location = Location(f"<dictionary> {'.'.join(path)}", 0)
    if len(path) > _DEEPEST:
        raise SceneError(
            f"<dictionary>: more than {_DEEPEST} dictionaries inside each other"
        )
    plugin = content.get("type")
    if not isinstance(plugin, str):
        raise SceneError(f'{location}: the dictionary lacks a "type"')
    tag = tag_of_plugin(plugin)
    if tag is None and key == "integrator":  # the options may select another integrator
        tag = "integrator"
    if tag is None:
        supported = ", ".join(every_plugin())
        raise SceneError(
            f"{location}: type {quoted(plugin)} is not supported; supported: {supported}, "
            + ", ".join(_VALUE_TYPES)
        )
    element_id = content.get("id", key if len(path) == 2 else "")
    if not isinstance(element_id, str):
        raise SceneError(f"{location}: the id is a {_type(element_id)}, expected a string")
    element = Element(tag, plugin, location, element_id)
    if element_id:
        if element_id in elements:
            raise SceneError(f"{location}: id {quoted(element_id)} is taken already")
        elements[element_id] = element
    for name, value in content.items():
        if not isinstance(name, str):
            raise SceneError(f"{location}: the key {name!r} is not a string")
        if name not in ("type", "id"):
            element.add(
                name, _value(name, value, (*path, name), elements, reading), location
            )
    return element


def _value(
    name: str,
    value: Any,
    path: tuple[str, ...],
    elements: dict[str, Element],
    reading: Reading,
) -> Value:
    location = Location(f"<dictionary> {'.'.join(path)}", 0)
    if isinstance(value, np.generic):
        value = value.item()
    match value:
        case bool() | str():
            return value
        case int():
            return check_integer(value, location, quoted(name))
        case float():
            return check_float(value, location, quoted(name))
        case Mapping():
            kind = value.get("type")
            if kind == "rgb":
                return RgbValue(_triple(value.get("value"), location, "the rgb value"))
            if kind == "spectrum":
                return _spectrum(value, location, reading)
            if kind == "ref":
                return Reference(str(value.get("id", "")))
            return _element(name, value, path, elements, reading)
    if inspect.isroutine(value):
        return Function(value)
    if name in ("bitmap", "data"):
        image = _image(name, value, location)
        if image is not None:
            return image
    if name in ("grid", "data") and (
        hasattr(value, "__array__") or hasattr(value, "__array_interface__")
    ):
        tensor = np.asarray(value)
        if tensor.dtype.kind in "fiu":
            return Tensor(tensor)
    array = _array(getattr(value, "matrix", value))
    if array is not None and array.shape == (4, 4):
        return array
    if array is not None and array.shape == (3, 3):  # a transform of uv
        matrix = np.eye(4)
        matrix[np.ix_((0, 1, 3), (0, 1, 3))] = array
        return matrix
    if array is not None and array.shape == (3,):
        return Vector(_triple(value, location, quoted(name)))
    shape = "" if array is None else f" of shape {array.shape}"
    raise SceneError(
        f"{location}: found a {_type(value)}{shape}; "
        "expected a number, string, boolean, three "
        "numbers, a 4 x 4 or 3 x 3 matrix, or a dictionary"
    )


def _image(name: str, value: Any, location: Location) -> Image | None:
    """Return an array of pixels, or a Mitsuba bitmap, as an image.

    As in Mitsuba, bytes are sRGB encoded, but a tensor ("data") is linear. A grey
    `mi.Bitmap` has two dimensions.

    Raises
    ------
    SceneError
        If the type of its numbers or the meaning of its channels is not supported.
    """
    if not hasattr(value, "__array__") and not hasattr(value, "__array_interface__"):
        return None
    pixels = np.asarray(value)
    if pixels.ndim == 2:
        pixels = pixels[:, :, None]
    if pixels.ndim != 3:
        return None
    kinds = _TENSOR_TYPES if name == "data" else _PIXEL_TYPES
    if pixels.dtype.kind + str(pixels.dtype.itemsize) not in kinds:
        raise SceneError(
            f"{location}: the pixels are of type {pixels.dtype}; expected uint8, uint16, "
            "float16, float32 or float64"
        )
    if name == "data" and pixels.shape[2] in (2, 4):
        raise SceneError(
            f"{location}: the tensor has {pixels.shape[2]} channels; expected 1 or 3 (a "
            '"bitmap" may have alpha)'
        )
    said = getattr(value, "srgb_gamma", None)
    srgb = said() if said else name == "bitmap" and pixels.dtype == np.uint8
    if pixels.dtype not in (np.uint8, np.uint16, np.float16):
        with np.errstate(over="ignore"):  # infinite values are reported later
            pixels = pixels.astype(np.float32)
    if (meant := getattr(value, "pixel_format", None)) is not None:
        layout = str(meant()).rpartition(".")[2].upper()
        if srgb and layout.startswith("XYZ") and pixels.dtype.kind == "f":
            # decoded before the matrix is applied, as in Mitsuba
            pixels, srgb = linear_values(pixels, True), False
        pixels = _as_rgb(pixels, layout, location)
    return Image(pixels, bool(srgb))


def _as_rgb(pixels: np.ndarray, meant: str, location: Location) -> np.ndarray:
    """Return the pixels of a `mi.Bitmap` with its `pixel_format` as grey or RGB."""
    if meant in ("Y", "YA", "RGB", "RGBA"):
        return pixels
    if meant in ("XYZ", "XYZA") and pixels.dtype.kind == "f":
        colors = pixels[:, :, :3].astype(np.float32) @ SRGB_FROM_XYZ.astype(np.float32).T
        return np.asarray(colors.astype(pixels.dtype))
    raise SceneError(
        f"{location}: the bitmap's pixel format is {meant} of {pixels.dtype}; expected Y, "
        "YA, RGB or RGBA, or XYZ or XYZA of floats"
    )


def _spectrum(
    content: Mapping[str, Any], location: Location, reading: Reading
) -> SpectrumValue:
    """Read {"type": "spectrum"} with a "value" (number, text, pairs) or a "filename"."""
    if "filename" in content:
        return read_spd(
            reading.find_file(str(content["filename"]), location, "the spectrum file")
        )
    value = content.get("value")
    if isinstance(value, str):
        return parse_spectrum(value, location)
    array = _array(value)
    if array is not None and array.ndim == 0:
        number = check_float(float(array), location, "the spectrum's value")
        return SpectrumValue((number,))
    if array is None or array.ndim != 2 or array.shape[1] != 2:
        raise SceneError(
            f'{location}: a spectrum needs a "value": a number, or (wavelength, value) '
            "pairs"
        )
    for number in array.ravel():
        check_float(float(number), location, "a spectrum's value")
    return spectrum_of_pairs([(float(w), float(v)) for w, v in array], location)


def _triple(value: Any, location: Location, what: str) -> tuple[float, float, float]:
    """Return three finite numbers; one number stands for all three."""
    array = _array(value)
    if array is None or array.shape not in ((), (1,), (3,)):
        raise SceneError(f"{location}: {what} is a {_type(value)}; expected 1 or 3 numbers")
    x, y, z = np.broadcast_to(array, 3)
    return (
        check_float(float(x), location, what),
        check_float(float(y), location, what),
        check_float(float(z), location, what),
    )


def _array(value: Any) -> np.ndarray | None:
    """Return numbers as an array, or None for anything else."""
    if isinstance(value, str | bytes | Mapping) or value is None:
        return None
    if not isinstance(value, Sequence | np.ndarray | int | float) and not hasattr(
        value, "__array__"
    ):
        return None
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None


def _type(value: Any) -> str:
    return type(value).__name__
