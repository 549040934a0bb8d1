"""Spectra that are plugins: `regular`, `irregular` and `blackbody`.

Mitsuba's `scalar_rgb` loads them but cannot evaluate them. Here they get the colour that a
list of `wavelength:value` pairs gets, which Mitsuba's spectral variants show for them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.colors.spectra import SPECTRUM_NODES
from renderer.scene_file.colors.spectrum_text import spectrum_of_pairs
from renderer.scene_file.numbers import parse_float, quoted, split_list
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import SpectrumValue

OVER_WAVELENGTHS = ("regular", "irregular", "blackbody")

_PLANCK = 6.62607015e-34  # [J s]
_LIGHT_SPEED = 299792458.0  # [m/s]
_BOLTZMANN = 1.380649e-23  # [J/K]


def read_spectrum(properties: Properties) -> SpectrumValue:
    """Read one of `OVER_WAVELENGTHS`.

    Raises
    ------
    SceneError
        If values are missing, too few, or the wavelengths do not ascend.
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
    """Return the radiance of a black body [W / (m^2 sr nm)] by Planck's law.

    Parameters
    ----------
    temperature
        [K]
    wavelengths
        [nm]
    """
    metres = wavelengths * 1e-9
    with np.errstate(over="ignore"):  # a cold body: infinitely small
        exponential = np.expm1(_PLANCK * _LIGHT_SPEED / (_BOLTZMANN * temperature * metres))
    per_metre = 2.0 * _PLANCK * _LIGHT_SPEED**2 / (metres**5 * exponential)
    return np.asarray(1e-9 * per_metre)


def _blackbody(properties: Properties) -> SpectrumValue:
    if not properties.has("temperature"):
        properties.fail("temperature", "nothing", "a temperature in Kelvin")
    # up to what float32 can hold
    temperature = properties.number("temperature", 0.0, above=0.0, at_most=1e12)
    first, last = _range(properties, SPECTRUM_NODES[0], SPECTRUM_NODES[-1])
    inside = SPECTRUM_NODES[(SPECTRUM_NODES > first) & (SPECTRUM_NODES < last)]
    wavelengths = np.array([first, *inside, last])
    values = planck(temperature, wavelengths)
    return SpectrumValue(tuple(values.tolist()), tuple(wavelengths.tolist()))


def _range(
    properties: Properties, first: float | None, last: float | None
) -> tuple[float, float]:
    """Return the first and the last wavelength [nm]; None as a default: it is needed."""
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
