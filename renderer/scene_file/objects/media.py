"""Participating media of a document: media, volumes and phase functions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.colors.colors import Use, read_color
from renderer.scene_file.files import Reading
from renderer.scene_file.media_description import (
    BlendedPhase,
    ConstantVolume,
    GridVolume,
    HenyeyGreenstein,
    IsotropicPhase,
    Medium,
    Phase,
    RayleighPhase,
    TabulatedPhase,
    Volume,
)
from renderer.scene_file.meshes.grid_file import check_distances, read_channels
from renderer.scene_file.numbers import parse_float
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element, SpectrumValue, Tensor

_DEEPEST = 16  # nested phase functions
_DENSEST = 1e9  # [1/length]
_LOST = 1e-3  # largest sum of negative values, relative to the sum of a grid


def read_medium(element: Element, reading: Reading) -> Medium:
    """Read a `<medium>`; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return reading.once(element, lambda: _read_medium(Properties(element, reading)))


def _read_medium(properties: Properties) -> Medium:
    plugin = properties.element.plugin
    sigma_t = _volume(properties, "sigma_t", 1.0)
    if plugin == "homogeneous" and isinstance(sigma_t, GridVolume):
        properties.fail("sigma_t", "a grid", "one colour; heterogeneous media take grids")
    albedo = _volume(properties, "albedo", 0.75)
    scale = properties.number("scale", 1.0, at_least=0.0, at_most=_DENSEST)
    if scale * sigma_t.maximum > _DENSEST:
        properties.fail("sigma_t", f"up to {scale * sigma_t.maximum:g}", "at most 1e9")
    samples = properties.boolean("sample_emitters", True)
    spectral = properties.boolean("has_spectral_extinction", True)
    nested = properties.child("phase")
    phase = IsotropicPhase() if nested is None else read_phase(nested, properties.reading)
    properties.finish()
    return Medium(plugin, sigma_t, albedo, scale, phase, samples, spectral)


# ------------------------------------------------------------------------------ volumes


def _volume(properties: Properties, name: str, default: float) -> Volume:
    """Return the volume of a property; a colour is a constant volume."""
    property_ = properties.take(name)
    value = None if property_ is None else property_.value
    if isinstance(value, Element) and value.tag == "volume":
        return read_volume(value, properties.reading)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    uniform = isinstance(value, SpectrumValue) and not value.wavelengths
    # Mitsuba refuses an rgb above 1; larger colours need a constvolume, or `scale`.
    use = Use.NUMBER if value is None or number or uniform else Use.REFLECTANCE
    rgb = read_color(properties, name, default, use)
    if min(rgb) < 0.0:
        properties.fail(name, f"{min(rgb):g}", "numbers of at least 0")
    return ConstantVolume(rgb)


def read_volume(element: Element, reading: Reading) -> Volume:
    """Read a `<volume>`; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return reading.once(element, lambda: _read_volume(Properties(element, reading)))


def _read_volume(properties: Properties) -> Volume:
    if properties.element.plugin == "constvolume":
        rgb = read_color(properties, "value", 1.0, Use.NUMBER)
        if min(rgb) < 0.0:
            properties.fail("value", f"{min(rgb):g}", "numbers of at least 0")
        volume: Volume = ConstantVolume(rgb, properties.transform("to_world"))
    else:
        volume = _read_grid(properties)
    properties.finish()
    return volume


def _read_grid(properties: Properties) -> GridVolume:
    name, values, box = _numbers(properties)
    if values.shape[3] not in (1, 3):
        properties.fail(name, f"{values.shape[3]} channels", "1 or 3")
    values = _not_negative(properties, name, values)
    filter_type = properties.choice("filter_type", "trilinear", ("trilinear", "nearest"))
    wrap_mode = properties.choice("wrap_mode", "clamp", ("clamp", "repeat", "mirror"))
    properties.boolean("raw", False)  # this and the next have no effect, as in Mitsuba
    properties.boolean("accel", True)
    # the bound is computed from the grid, and not taken from the file
    properties.number("max_value", 0.0)
    to_world = properties.transform("to_world")
    if properties.boolean("use_grid_bbox", False):
        size = box[1] - box[0]
        if not (np.isfinite(box).all() and size.min() > 0.0):
            properties.fail("use_grid_bbox", "a box without volume in the file", "a box")
        placed = np.eye(4)
        placed[:3, :3], placed[:3, 3] = np.diag(size), box[0]
        to_world = to_world @ placed
    return GridVolume(values, to_world, filter_type, wrap_mode)


def _not_negative(
    properties: Properties, name: str, values: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Replace negative values, of which a resampled grid may have a few, by 0."""
    below = values < 0.0
    if not below.any():
        return values
    lost = -values[below].sum(dtype=np.float64)
    if lost > _LOST * values[~below].sum(dtype=np.float64):
        properties.fail(name, f"the number {values.min():g}", "numbers of at least 0")
    properties.reading.warn(
        properties.element.properties[name].location,
        f"{properties.element}: {np.count_nonzero(below)} of {values.size} numbers are "
        f"below 0, the least is {values.min():g}; they count as 0",
    )
    return np.maximum(values, np.float32(0.0))


def _numbers(properties: Properties) -> tuple[str, NDArray[np.float32], NDArray[Any]]:
    """Return the property with the numbers, the numbers (z, y, x, channels) and a box."""
    given = [name for name in ("filename", "grid", "data") if properties.has(name)]
    if len(given) != 1:
        properties.fail(
            given[1] if given else "filename",
            f'a value in addition to "{given[0]}"' if given else "nothing",
            "the path of a .vol file; from Python, it may be an array instead",
        )
    (name,) = given
    if name == "filename":
        expected = "the path of a .vol file"
        return name, *properties.file("the grid", expected, read_channels)
    property_ = properties.take(name)
    value = None if property_ is None else property_.value
    expected = "an array of shape (z, y, x, channels)"
    if not isinstance(value, Tensor):
        kind = properties.element.properties[name].kind
        properties.fail(name, f"a value of type {kind}", expected)
    array = value.values
    if array.ndim == 3:
        array = array[..., None]
    if array.ndim != 4 or 0 in array.shape:
        properties.fail(name, f"one of shape {array.shape}", expected)
    with np.errstate(over="ignore", invalid="ignore"):  # reported below
        values = np.ascontiguousarray(array, np.float32)
    if (wrong := check_distances(values)) is not None:
        properties.fail(name, wrong, "finite numbers")
    return name, values, np.array([[0.0] * 3, [1.0] * 3])


# ---------------------------------------------------------------------- phase functions


def read_phase(element: Element, reading: Reading) -> Phase:
    """Read a `<phase>`; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return _phase(element, reading, 1)


def _phase(element: Element, reading: Reading, depth: int) -> Phase:
    properties = Properties(element, reading)
    if depth > _DEEPEST:
        properties.fail("phase", f"more than {_DEEPEST} inside of one another", "fewer")
    return reading.once(element, lambda: _read_phase(properties, depth))


def _read_phase(properties: Properties, depth: int) -> Phase:
    plugin = properties.element.plugin
    phase: Phase
    if plugin == "hg":
        g = properties.number("g", 0.8)
        if not abs(np.float32(g)) < 1.0:
            properties.fail("g", f"{g:.9g}", "a mean cosine between -1 and 1")
        phase = HenyeyGreenstein(g)
    elif plugin == "rayleigh":
        phase = RayleighPhase()
    elif plugin == "tabphase":
        phase = TabulatedPhase(_table(properties))
    elif plugin == "blendphase":
        phase = _blend(properties, depth)
    else:
        phase = IsotropicPhase()
    properties.finish()
    return phase


def _table(properties: Properties) -> tuple[float, ...]:
    expected = "two or more numbers of at least 0, not all 0"
    if not properties.has("values"):
        properties.fail("values", "nothing", expected)
    text = properties.string("values", "")
    where = properties.element.properties["values"].location
    words = text.replace(",", " ").split()
    values = tuple(parse_float(word, where, "values") for word in words)
    if len(values) < 2 or min(values) < 0.0 or max(values) == 0.0:
        properties.fail("values", f'"{text[:60]}"', expected)
    return values


def _blend(properties: Properties, depth: int) -> BlendedPhase:
    if not properties.has("weight"):
        properties.fail("weight", "nothing", "the share of the second phase function")
    volume = _volume(properties, "weight", 0.5)
    children = [element for _, element in properties.children("phase")]
    if len(children) != 2:
        properties.fail("phase", f"{len(children)} phase functions", "two")
    first, second = (_phase(child, properties.reading, depth + 1) for child in children)
    if isinstance(volume, GridVolume):
        return BlendedPhase(volume, first, second)
    weight = min(max(sum(volume.rgb) / 3.0, 0.0), 1.0)
    return BlendedPhase(weight, first, second)
