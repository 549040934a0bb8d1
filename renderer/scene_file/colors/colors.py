"""Colours of the file, in all their forms, as linear sRGB.

A colour property may be a float, an integer, `<rgb>`, `<spectrum>`, or a nested constant
spectrum plugin (uniform, srgb, d65). The meaning of a number depends on its use: as a
reflectance it is grey; as a `<spectrum>` of an emitter it is white of illuminant E.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.colors.spectra import (
    SPECTRUM_NODES,
    as_rgb,
    emission_of_uniform,
    spectrum_of_pairs,
    srgb_of_spectrum,
)
from renderer.scene_file.description import Rgb
from renderer.scene_file.files import Reading
from renderer.scene_file.numbers import parse_float, quoted, split_list
from renderer.scene_file.plugins import varying_textures
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element, RgbValue, SpectrumValue, Vector


class Use(Enum):
    """Use of a colour, which determines its conversion and its range."""

    REFLECTANCE = "a reflectance in [0, 1]"
    EMISSION = "an emission of at least 0 and at most 1e30"
    REFRACTION = "an index of refraction from -1e9 to 1e9"
    NUMBER = "numbers from -1e9 to 1e9"

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value of a component.

        Beyond these, the fourth power of a number or an index, and products of light with
        weights, overflow float32, and pictures are NaN, as in Mitsuba.
        """
        return {
            Use.REFLECTANCE: (0.0, 1.0),
            Use.EMISSION: (0.0, 1e30),
            Use.REFRACTION: (-1e9, 1e9),
            Use.NUMBER: (-1e9, 1e9),
        }[self]


def read_color(properties: Properties, name: str, default: float, use: Use) -> Rgb:
    """Return the colour of a property.

    Parameters
    ----------
    default
        Grey value for an absent property.

    Raises
    ------
    SceneError
        If it is not a colour, is a texture, or is out of the range of its use. (Mitsuba
        checks only the range of `<rgb>`; a reflectance above 1 violates energy conservation
        in any notation.)
    """
    property_ = properties.take(name)
    if property_ is None:
        return (default, default, default)
    value = property_.value
    match value:
        case bool():
            properties.fail(name, "a boolean", "a colour: rgb, spectrum or float")
        case int() | float():
            rgb = (float(value),) * 3
        case RgbValue():
            rgb = value.rgb
        case SpectrumValue():
            rgb = _from_spectrum(properties, name, value, use)
        case Element(tag="texture") if value.plugin in varying_textures():
            properties.fail(name, f"{value}, which varies over the surface", "one colour")
        case Element(tag="texture"):
            rgb = read_constant_plugin(value, properties.reading, use)
        case _:
            properties.fail(
                name,
                f"a value of type {property_.kind}",
                "a colour: rgb, spectrum or float",
            )
    lower, upper = use.limits
    if not all(lower <= component <= upper for component in rgb):
        shown = ", ".join(f"{component:g}" for component in rgb)
        properties.fail(name, f"the colour ({shown})", use.value)
    if use is Use.REFRACTION and min(rgb) < 0.0:
        # converters write such values for measured metals outside of the sRGB gamut
        shown = ", ".join(f"{component:g}" for component in rgb)
        properties.reading.warn(
            property_.location,
            f'{properties.element}, property "{name}": ({shown}) is below 0; Fresnel\'s '
            "equations take its square, as in Mitsuba",
        )
    return rgb


def _from_spectrum(
    properties: Properties, name: str, value: SpectrumValue, use: Use
) -> Rgb:
    if not value.wavelengths:
        number = value.values[0]
        return (
            emission_of_uniform(number) if use is Use.EMISSION else (number, number, number)
        )
    where = properties.element.properties[name].location
    what = f'{where}: {properties.element}, property "{name}"'
    return _linear_srgb(value, use, properties.reading, what)


def _linear_srgb(
    spectrum: SpectrumValue, use: Use | None, reading: Reading, what: str
) -> Rgb:
    """Return the colour of a spectrum over wavelengths; `what` names it in a warning."""
    raw = srgb_of_spectrum(
        spectrum.wavelengths, spectrum.values, under_d65=use is not Use.EMISSION
    )
    # too large a value is not clamped here: the caller refuses it
    lower = -np.inf if use in (None, Use.NUMBER) else 0.0
    clamped = np.clip(raw, lower, 1.0 if use is Use.REFLECTANCE else np.inf)
    # Bright white reflectances may exceed 1 slightly; no warning.
    if use is not None and np.abs(clamped - raw).max() > 1e-3 * np.abs(raw).max():
        shown = ", ".join(f"{component:.4g}" for component in raw)
        reading.warnings.append(
            f"{what}: the spectrum has the colour ({shown}), "
            "which is clamped to what linear sRGB can show",
        )
    return as_rgb(clamped)


def read_constant_plugin(element: Element, reading: Reading, use: Use | None = None) -> Rgb:
    """Return the colour of a constant spectrum plugin.

    Parameters
    ----------
    element, reading
        The plugin, and the state of the reader.
    use
        Use of the colour; None if it is not used.

    Raises
    ------
    SceneError
        If it is not supported, or has an error.
    """
    properties = Properties(element, reading)
    match element.plugin:
        case "uniform":
            grey = properties.number("value", 1.0)
        case "d65":  # relative to sRGB, D65 has the colour (1, 1, 1)
            grey = properties.number("scale", 1.0)
            tint = properties.take("color")
            if tint is not None:
                if not isinstance(tint.value, RgbValue):
                    properties.fail("color", f"a value of type {tint.kind}", "rgb")
                properties.finish()
                red, green, blue = (grey * component for component in tint.value.rgb)
                return (red, green, blue)
        case "rawconstant":
            raw = properties.take("value")
            properties.finish()
            match None if raw is None else raw.value:
                case float(number):
                    return (number, number, number)
                case Vector(xyz=xyz) if use is not Use.NUMBER:  # as in Mitsuba's eval_1
                    return xyz
            found = f"a value of type {raw.kind}" if raw else "nothing"
            properties.fail("value", found, "a float, or a vector where a colour is needed")
        case plugin if plugin in OVER_WAVELENGTHS:
            if plugin == "blackbody" and use not in (Use.EMISSION, None):
                raise SceneError(
                    f"{element.location}: {element} is no reflectance; expected a list of "
                    "wavelengths and values (a black body emits)"
                )
            spectrum = read_spectrum(properties)
            properties.finish()
            return _linear_srgb(spectrum, use, reading, f"{element.location}: {element}")
        case _:
            color = properties.take("color")
            if color is None or not isinstance(color.value, RgbValue):
                properties.fail("color", color.kind if color else "nothing", "rgb")
            properties.finish()
            return color.value.rgb
    properties.finish()
    return (grey, grey, grey)


# --------------------------------------------------------------------- spectrum plugins
# Spectra that are plugins: `regular`, `irregular` and `blackbody`.
#
# Mitsuba's `scalar_rgb` loads them but cannot evaluate them. Here they have the colour of
# a list of `wavelength:value` pairs, as in Mitsuba's spectral variants.

OVER_WAVELENGTHS = ("regular", "irregular", "blackbody")

_PLANCK = 6.62607015e-34  # [J s]
_LIGHT_SPEED = 299792458.0  # [m/s]
_BOLTZMANN = 1.380649e-23  # [J/K]


def read_spectrum(properties: Properties) -> SpectrumValue:
    """Read one of `OVER_WAVELENGTHS`.

    Raises
    ------
    SceneError
        If values are missing, are too few, or the wavelengths are not ascending.
    """
    match properties.element.plugin:
        case "regular":
            first, last = _range(properties, None, None)
            values = _numbers(properties, "values")
            wavelengths = np.linspace(first, last, max(len(values), 2)).tolist()
        case "irregular":
            wavelengths = _numbers(properties, "wavelengths")
            values = _numbers(properties, "values")
        case _:
            return _blackbody(properties)
    if len(values) != len(wavelengths):
        found = f"{len(values)} numbers for {len(wavelengths)} wavelengths"
        properties.fail("values", found, "one for each, at least two")
    pairs = list(zip(wavelengths, values, strict=True))
    return spectrum_of_pairs(pairs, properties.location)


def planck(temperature: float, wavelengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the black body radiance [W / (m^2 sr nm)] by Planck's law.

    Parameters
    ----------
    temperature
        [K]
    wavelengths
        [nm]
    """
    metres = wavelengths * 1e-9
    with np.errstate(over="ignore"):  # for low temperatures the radiance is 0
        exponential = np.expm1(_PLANCK * _LIGHT_SPEED / (_BOLTZMANN * temperature * metres))
    per_metre = 2.0 * _PLANCK * _LIGHT_SPEED**2 / (metres**5 * exponential)
    return np.asarray(1e-9 * per_metre)


def _blackbody(properties: Properties) -> SpectrumValue:
    if not properties.has("temperature"):
        properties.fail("temperature", "nothing", "a temperature in Kelvin")
    # up to the range of float32
    temperature = properties.number("temperature", 0.0, above=0.0, at_most=1e12)
    first, last = _range(properties, SPECTRUM_NODES[0], SPECTRUM_NODES[-1])
    inside = SPECTRUM_NODES[(SPECTRUM_NODES > first) & (SPECTRUM_NODES < last)]
    wavelengths = np.array([first, *inside, last])
    values = planck(temperature, wavelengths)
    return SpectrumValue(tuple(values.tolist()), tuple(wavelengths.tolist()))


def _range(
    properties: Properties, first: float | None, last: float | None
) -> tuple[float, float]:
    """Return the first and the last wavelength [nm]; a default of None: required."""
    ends = []
    for name, default in (("wavelength_min", first), ("wavelength_max", last)):
        if default is None and not properties.has(name):
            properties.fail(name, "nothing", "a wavelength in nm")
        ends.append(properties.number(name, default or 0.0, above=0.0))
    if not ends[0] < ends[1]:
        found = f"a range from {ends[0]:g} to {ends[1]:g}"
        properties.fail("wavelength_max", found, "one above wavelength_min")
    return ends[0], ends[1]


def _numbers(properties: Properties, name: str) -> list[float]:
    if not properties.has(name):
        properties.fail(name, "nothing", 'numbers like "0.1, 0.5, 0.2"')
    entries = split_list(properties.string(name, ""))
    location = properties.element.properties[name].location
    if len(entries) < 2:
        raise SceneError(
            f'{location}: {properties.element}, property "{name}": found {len(entries)} '
            "numbers, expected at least two"
        )
    return [parse_float(entry, location, quoted(name)) for entry in entries]
