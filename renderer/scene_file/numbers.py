"""Numbers in scene files: finite decimal floats, integers, booleans.

Python's `float` also accepts `nan`, `inf`, `1_000` and digits of other scripts; these are
errors here. A value beyond float32 would become infinite in a kernel, so it is refused
here, where its line is known.
"""

from __future__ import annotations

import re

from renderer.errors import SceneError
from renderer.scene_file.description import Location

_FLOAT = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_INTEGER = re.compile(r"-?[0-9]+")
LARGEST = 3.4028234663852886e38  # of float32
_SHOWN = 60  # characters of an invalid value in a message


def quoted(text: str, longest: int = _SHOWN) -> str:
    """Return `text` in quotes on one line, cut if it is long."""
    line = " ".join(text.split())
    return f'"{line}"' if len(line) <= longest else f'"{line[:longest]}..."'


def parse_float(text: str, location: Location, what: str) -> float:
    """Parse one finite number; `what` names it in messages.

    Raises
    ------
    SceneError
        If `text` is not a decimal number, or is NaN, infinite, or beyond float32.
    """
    stripped = text.strip()
    if not _FLOAT.fullmatch(stripped):
        raise SceneError(f"{location}: {what} is {quoted(text)}; expected a finite number")
    return check_float(float(stripped), location, what)


def check_float(value: float, location: Location, what: str) -> float:
    """Return `value` if it is in the range of float32.

    Raises
    ------
    SceneError
        If it is NaN, infinite or too large.
    """
    if not abs(value) <= LARGEST:  # written so that NaN fails too
        raise SceneError(
            f"{location}: {what} is {value}; expected a finite number up to {LARGEST:.3g}"
        )
    return value


def parse_integer(text: str, location: Location, what: str) -> int:
    """Parse an integer of 64 bits.

    Raises
    ------
    SceneError
        If `text` is anything else, such as a fraction.
    """
    stripped = text.strip()
    # The length is checked first: Python refuses to convert thousands of digits.
    if not _INTEGER.fullmatch(stripped) or len(stripped) > 20:
        raise SceneError(f"{location}: {what} is {quoted(text)}; expected an integer")
    return check_integer(int(stripped), location, what)


def check_integer(value: int, location: Location, what: str) -> int:
    """Return `value` if it fits into 64 bits.

    Raises
    ------
    SceneError
        If it is too large.
    """
    if not -(2**63) <= value < 2**63:
        raise SceneError(f"{location}: {what} is too large for a 64-bit integer")
    return value


def parse_boolean(text: str, location: Location, what: str) -> bool:
    """Parse `true` or `false`, in upper or lower case.

    Raises
    ------
    SceneError
        If `text` is anything else.
    """
    word = text.lower()
    if word not in ("true", "false"):
        raise SceneError(f"{location}: {what} is {quoted(text)}; expected true or false")
    return word == "true"


def split_list(text: str) -> list[str]:
    """Split at commas and white space, as Mitsuba does in vectors, colours and lists."""
    return text.replace(",", " ").split()


def parse_floats(
    text: str, counts: tuple[int, ...], location: Location, what: str
) -> tuple[float, ...]:
    """Parse a list of numbers whose length is one of `counts`.

    Raises
    ------
    SceneError
        If it has another length, or an entry is not a finite number.
    """
    entries = split_list(text)
    if len(entries) not in counts:
        expected = " or ".join(str(count) for count in counts)
        raise SceneError(
            f"{location}: {what} is {quoted(text)}, {len(entries)} numbers; "
            f"expected {expected}"
        )
    return tuple(parse_float(entry, location, what) for entry in entries)
