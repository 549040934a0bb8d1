"""Spectra of scene files: tables of the CIE, samples over wavelengths, and their text."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.description import Location, Rgb
from renderer.scene_file.images.image import SRGB_FROM_XYZ
from renderer.scene_file.numbers import parse_float, quoted, split_list
from renderer.scene_file.tree import SpectrumValue

# --------------------------------------------------------------------------- cie tables
# CIE data every 5 nm from 360 to 830 nm: the 1931 2-degree observer and illuminant D65.
#
# Columns: wavelength [nm], x-bar, y-bar, z-bar, D65 (relative). The numbers are CIE 15's,
# as published by colour-science (a test compares them; D65 beyond 780 nm, where
# colour-science ends, is checked by Mitsuba's conversions). They are copied here because
# importing colour-science takes longer than a render. Mitsuba's `scalar_rgb` uses the same
# step of 5 nm with linear interpolation.

_TABLE = """
360 0.0001299 3.917e-06 0.0006061 46.6383
365 0.0002321 6.965e-06 0.001086 49.3637
370 0.0004149 1.239e-05 0.001946 52.0891
375 0.0007416 2.202e-05 0.003486 51.0323
380 0.001368 3.9e-05 0.006450001 49.9755
385 0.002236 6.4e-05 0.01054999 52.3118
390 0.004243 0.00012 0.02005001 54.6482
395 0.00765 0.000217 0.03621 68.7015
400 0.01431 0.000396 0.06785001 82.7549
405 0.02319 0.00064 0.1102 87.1204
410 0.04351 0.00121 0.2074 91.486
415 0.07763 0.00218 0.3713 92.4589
420 0.13438 0.004 0.6456 93.4318
425 0.21477 0.0073 1.0390501 90.057
430 0.2839 0.0116 1.3856 86.6823
435 0.3285 0.01684 1.62296 95.7736
440 0.34828 0.023 1.74706 104.865
445 0.34806 0.0298 1.7826 110.936
450 0.3362 0.038 1.77211 117.008
455 0.3187 0.048 1.7441 117.41
460 0.2908 0.06 1.6692 117.812
465 0.2511 0.0739 1.5281 116.336
470 0.19536 0.09098 1.28764 114.861
475 0.1421 0.1126 1.0419 115.392
480 0.09564 0.13902 0.8129501 115.923
485 0.05795001 0.1693 0.6162 112.367
490 0.03201 0.20802 0.46518 108.811
495 0.0147 0.2586 0.3533 109.082
500 0.0049 0.323 0.272 109.354
505 0.0024 0.4073 0.2123 108.578
510 0.0093 0.503 0.1582 107.802
515 0.0291 0.6082 0.1117 106.296
520 0.06327 0.71 0.07824999 104.79
525 0.1096 0.7932 0.05725001 106.239
530 0.1655 0.862 0.04216 107.689
535 0.2257499 0.9148501 0.02984 106.047
540 0.2904 0.954 0.0203 104.405
545 0.3597 0.9803 0.0134 104.225
550 0.4334499 0.9949501 0.008749999 104.046
555 0.5120501 1 0.005749999 102.023
560 0.5945 0.995 0.0039 100
565 0.6784 0.9786 0.002749999 98.1671
570 0.7621 0.952 0.0021 96.3342
575 0.8425 0.9154 0.0018 96.0611
580 0.9163 0.87 0.001650001 95.788
585 0.9786 0.8163 0.0014 92.2368
590 1.0263 0.757 0.0011 88.6856
595 1.0567 0.6949 0.001 89.3459
600 1.0622 0.631 0.0008 90.0062
605 1.0456 0.5668 0.0006 89.8026
610 1.0026 0.503 0.00034 89.5991
615 0.9384 0.4412 0.00024 88.6489
620 0.8544499 0.381 0.00019 87.6987
625 0.7514 0.321 0.0001 85.4936
630 0.6424 0.265 4.999999e-05 83.2886
635 0.5419 0.217 3e-05 83.4939
640 0.4479 0.175 2e-05 83.6992
645 0.3608 0.1382 1e-05 81.863
650 0.2835 0.107 2.117582368e-22 80.0268
655 0.2187 0.0816 0 80.1207
660 0.1649 0.061 0 80.2146
665 0.1212 0.04458 0 81.2462
670 0.0874 0.032 0 82.2778
675 0.0636 0.0232 0 80.281
680 0.04677 0.017 0 78.2842
685 0.0329 0.01192 0 74.0027
690 0.0227 0.00821 0 69.7213
695 0.01584 0.005723 0 70.6652
700 0.01135916 0.004102 0 71.6091
705 0.008110916 0.002929 0 72.979
710 0.005790346 0.002091 0 74.349
715 0.004109457 0.001484 0 67.9765
720 0.002899327 0.001047 0 61.604
725 0.00204919 0.00074 0 65.7448
730 0.001439971 0.00052 0 69.8856
735 0.0009999493 0.0003611 0 72.4863
740 0.0006900786 0.0002492 0 75.087
745 0.0004760213 0.0001719 0 69.3398
750 0.0003323011 0.00012 0 63.5927
755 0.0002348261 8.48e-05 0 55.0054
760 0.0001661505 6e-05 0 46.4182
765 0.000117413 4.24e-05 0 56.6118
770 8.307527e-05 3e-05 0 66.8054
775 5.870652e-05 2.12e-05 0 65.0941
780 4.150994e-05 1.499e-05 0 63.3828
785 2.935326e-05 1.06e-05 0 63.8434
790 2.067383e-05 7.4657e-06 0 64.304
795 1.455977e-05 5.2578e-06 0 61.8779
800 1.025398e-05 3.7029e-06 0 59.4519
805 7.221456e-06 2.6078e-06 0 55.7054
810 5.085868e-06 1.8366e-06 0 51.959
815 3.581652e-06 1.2934e-06 0 54.6998
820 2.522525e-06 9.1093e-07 0 57.4406
825 1.776509e-06 6.4153e-07 0 58.8765
830 1.251141e-06 4.5181e-07 0 60.3125
"""

_ROWS = np.array([line.split() for line in _TABLE.split("\n") if line], dtype=np.float64)
WAVELENGTHS = _ROWS[:, 0]  # (95,) [nm]
OBSERVER = _ROWS[:, 1:4]  # (95, 3) x-bar, y-bar, z-bar
D65 = _ROWS[:, 4]  # (95,)


# ------------------------------------------------------------------------------ spectra
# Conversion of spectra to linear sRGB, as in Mitsuba's `scalar_rgb`.
#
# A list of wavelength:value pairs is interpolated linearly, is 0 outside of its range, and
# is integrated with the CIE 1931 observer by a sum over 1000 wavelengths from 360 to 830
# nm. Reflectances (and indices of refraction) are multiplied by D65, so a constant spectrum
# is nearly that grey. Emission is not, so a constant spectrum is the pinkish white of
# illuminant E.

_STEPS = 1000  # as in Mitsuba: 999 intervals of width 1 / 1000, so 0.1 % too dark
SPECTRUM_NODES = np.linspace(WAVELENGTHS[0], WAVELENGTHS[-1], _STEPS)  # [nm]
_Y_NORMALIZATION = 106.7502593994140625  # integral of y-bar over the 5 nm table
_D65_NORMALIZATION = 98.99741751876255  # gives D65 the luminance 1


def emission_of_uniform(value: float) -> Rgb:
    """Return the colour of an emitter with a constant spectrum."""
    return as_rgb(value * SRGB_FROM_XYZ.sum(axis=1))


def srgb_of_spectrum(
    wavelengths: Sequence[float], values: Sequence[float], *, under_d65: bool
) -> NDArray[np.float64]:
    """Integrate a spectrum; the result may be outside of the sRGB gamut.

    Parameters
    ----------
    wavelengths
        [nm], ascending, at least two.
    values
        One for each wavelength.
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
    """Return an array of three numbers as Python floats."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue


# ------------------------------------------------------------------------ spectrum text
# `<spectrum>`: one value, `wavelength:value` pairs, or an .spd file of such pairs.


def parse_spectrum(text: str, location: Location) -> SpectrumValue:
    """Parse `0.5` or `400:0.1, 500:0.9, 700:0.2`.

    Raises
    ------
    SceneError
        If an entry is malformed, or the wavelengths do not ascend.
    """
    entries = split_list(text)
    if len(entries) == 1 and ":" not in entries[0]:
        return SpectrumValue((parse_float(entries[0], location, "the spectrum's value"),))
    pairs = []
    for entry in entries:
        wavelength, colon, value = entry.partition(":")
        if not colon:
            raise SceneError(
                f"{location}: spectrum entry {quoted(entry)}; expected one value, or pairs "
                'like "400:0.1, 700:0.2"'
            )
        pairs.append(
            (
                parse_float(wavelength, location, "a wavelength"),
                parse_float(value, location, "a spectrum's value"),
            )
        )
    return spectrum_of_pairs(pairs, location)


def read_spd(path: Path) -> SpectrumValue:
    """Read a file with a wavelength and a value on each line; `#` starts a comment line.

    Raises
    ------
    SceneError
        If it cannot be read or a line is malformed.
    """
    try:
        memory.require(24 * path.stat().st_size, f"{path}: the spectrum")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeError) as error:
        raise SceneError(f"{path}: cannot read the spectrum: {error}") from None
    pairs = []
    for number, line in enumerate(lines, start=1):
        location = Location(str(path), number)
        numbers = line.split()
        if not numbers or line.startswith("#"):
            continue
        if len(numbers) != 2:
            raise SceneError(
                f"{location}: found {quoted(line)}; expected a wavelength and a value"
            )
        wavelength, value = (parse_float(n, location, "a number") for n in numbers)
        pairs.append((wavelength, value))
    return spectrum_of_pairs(pairs, Location(str(path), len(lines)))


def spectrum_of_pairs(
    pairs: Sequence[tuple[float, float]], location: Location
) -> SpectrumValue:
    """Check and return a spectrum of (wavelength [nm], value) pairs.

    Raises
    ------
    SceneError
        If there are fewer than two, or the wavelengths do not ascend.
    """
    if len(pairs) < 2:
        raise SceneError(
            f"{location}: a spectrum over wavelengths has {len(pairs)} entries; expected "
            "at least two"
        )
    for (before, _), (after, _) in itertools.pairwise(pairs):
        if not before < after:
            raise SceneError(
                f"{location}: the wavelengths {before:g} and {after:g} of a spectrum "
                "do not ascend"
            )
    return SpectrumValue(
        values=tuple(float(value) for _, value in pairs),
        wavelengths=tuple(float(wavelength) for wavelength, _ in pairs),
    )
