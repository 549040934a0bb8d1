"""What values options take: checks of arguments, and readers of words of a command line.

Checks raise SceneError or TypeError, readers ValueError; both name what is possible.
"""

from __future__ import annotations

import operator
import reprlib
from collections.abc import Callable
from numbers import Real
from typing import Any

from renderer.errors import SceneError

MOST_LOCAL = 256  # processes of a cluster on this machine
PROTOCOLS = ("tcp://", "tls://", "ucx://", "ws://", "wss://")
MOST_SEED = 2**32 - 1


def shown_value(value: object) -> str:
    """Return a value and its type on one line, cut if it is long."""
    shown = " ".join(reprlib.repr(value).split())
    return f"{shown} (of type {type(value).__name__})"


def whole(least: int, most: int) -> Callable[[str, Any], int]:
    """Return a check for integers, NumPy's included, from `least` to `most`."""

    def check(name: str, value: Any) -> int:
        try:
            number = operator.index(value)
        except TypeError:
            possible = f"whole numbers from {least} to {most} are possible"
            raise TypeError(f"{name} is {shown_value(value)}; {possible}") from None
        if not least <= number <= most:
            raise SceneError(f"{name} is {number}; {least} to {most} are possible")
        return number

    return check


def positive(name: str, value: Any) -> float:
    """Return a number that is more than 0 and finite."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {shown_value(value)}; positive numbers are possible")
    if not 0.0 < float(value) < float("inf"):
        raise SceneError(f"{name} is {value}; positive numbers are possible")
    return float(value)


def parse_count(text: str) -> int:
    """Read a whole number of at least 1."""
    if (value := parse_whole(text)) < 1:
        raise ValueError(f"{value} is less than 1")
    return value


def parse_whole(text: str) -> int:
    """Read a whole number."""
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{text!r} is no whole number") from None


def parse_seed(text: str) -> int:
    """Read a seed."""
    if not 0 <= (value := parse_whole(text)) <= MOST_SEED:
        raise ValueError(f"{value} is not in 0 to {MOST_SEED}")
    return value


def parse_error(text: str) -> float:
    """Read a relative error, such as 2% or 0.02."""
    number = parse_number(text.removesuffix("%"))
    if text.endswith("%"):
        return number / 100
    if number >= 1:
        raise ValueError(f"{text} is 100 % or more; is {text}% meant?")
    return number


def parse_seconds(text: str) -> float:
    """Read a time, such as 90 or 90s."""
    return parse_number(text.removesuffix("s"))


def parse_number(text: str) -> float:
    """Read a number that is more than 0 and finite."""
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{text!r} is no number") from None
    if not 0.0 < value < float("inf"):
        raise ValueError(f"{text} is not more than 0, and finite")
    return value


def parse_cluster(where: str) -> str:
    """Return the address of a cluster, or `local:N`."""
    kind, _, count = where.partition(":")
    if kind == "local":
        if not (count.isdecimal() and 1 <= int(count) <= MOST_LOCAL):
            raise ValueError(f"{where!r}: local:N starts N processes, 1 to {MOST_LOCAL}")
    elif not where.startswith(PROTOCOLS):
        raise ValueError(f"{where!r} is neither local:N nor an address tcp://host:8786")
    return where
