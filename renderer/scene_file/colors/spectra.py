"""Spectra to linear sRGB, in the way of Mitsuba's `scalar_rgb`.

A list of wavelength:value pairs is interpolated linearly, is 0 outside its ends, and is
integrated against the CIE 1931 observer by a sum over 1000 wavelengths from 360 to
830 nm. Reflectances (and indices of refraction) are seen under D65, so that a constant
spectrum is nearly that grey; emission is taken as it is, so that a constant spectrum is
the pinkish white of illuminant E.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.colors.cie_tables import D65, OBSERVER, WAVELENGTHS
from renderer.scene_file.description import Rgb
from renderer.scene_file.images.image import SRGB_FROM_XYZ

_STEPS = 1000  # sets the result: 999 intervals but a width of 1/1000, so 0.1 % too dark
SPECTRUM_NODES = np.linspace(WAVELENGTHS[0], WAVELENGTHS[-1], _STEPS)  # [nm]
_Y_NORMALIZATION = 106.7502593994140625  # integral of y-bar over the 5 nm table
_D65_NORMALIZATION = 98.99741751876255  # makes the luminance of D65 one


def emission_of_uniform(value: float) -> Rgb:
    """Return the colour of an emitter whose spectrum is `value` at every wavelength."""
    return as_rgb(value * SRGB_FROM_XYZ.sum(axis=1))


def srgb_of_spectrum(
    wavelengths: Sequence[float], values: Sequence[float], *, under_d65: bool
) -> NDArray[np.float64]:
    """Integrate a spectrum; the result may lie outside of the gamut.

    Parameters
    ----------
    wavelengths
        [nm], ascending, at least two.
    values
        One for each.
    under_d65
        Multiply by D65: True for reflectances, False for emission.

    Returns
    -------
    rgb
        (3,) linear sRGB, negative where the colour is outside of the gamut.
    """
    x = SPECTRUM_NODES
    y = np.interp(x, wavelengths, values, left=0.0, right=0.0)
    if under_d65:
        y = y * np.interp(x, WAVELENGTHS, D65) / _D65_NORMALIZATION
    observer = np.stack([np.interp(x, WAVELENGTHS, OBSERVER[:, k]) for k in range(3)])
    width = (WAVELENGTHS[-1] - WAVELENGTHS[0]) / _STEPS
    xyz = observer @ y * width / _Y_NORMALIZATION
    rgb: NDArray[np.float64] = SRGB_FROM_XYZ @ xyz
    return rgb


def as_rgb(values: NDArray[np.float64]) -> Rgb:
    """Return three plain floats."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue
