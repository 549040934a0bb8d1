"""`<spectrum>`: one value, `wavelength:value` pairs, or an .spd file of such pairs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.description import Location
from renderer.scene_file.numbers import parse_float, quoted, split_list
from renderer.scene_file.tree import SpectrumValue


def parse_spectrum(text: str, location: Location) -> SpectrumValue:
    """Read `0.5` or `400:0.1, 500:0.9, 700:0.2`.

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
