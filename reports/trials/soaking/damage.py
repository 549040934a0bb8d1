"""Damage that knows nothing of a format: bits, bytes, numbers of any width, words."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable

Damage = Callable[[random.Random, bytes], bytes]

INTEGERS = (
    *(0, 1, 2, 3, 4, 7, 8, 127, 128, 255, 256, 1000, 32767, 32768, 65535, 65536),
    *(2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**48, 2**62, 2**63 - 1, 2**63),
    *(-1, -2, -128, -32768, -(2**31), -(2**63)),
)
FLOATS = (
    *(0.0, -0.0, 1e-45, 1e-38, 1e-30, 1e-12, 1e-6, 0.5, 1.0, -1.0, 1e6, 1e12, 1e18, 1e30),
    *(-1e18, 3.4e38, -3.4e38, 1e39, 1e308, float("inf"), float("-inf"), float("nan")),
)
WORDS = (
    *("", "0", "-0", "1", "-1", "2", "255", "65536", "2147483647", "2147483648"),
    *("4294967296", "99999999999999999999", "1e-45", "1e-38", "1e-30", "1e-9", "0.5"),
    *("1e9", "1e18", "1e30", "3.4e38", "-3.4e38", "1e39", "1e308", "1e400", "nan", "inf"),
    *(
        "-inf",
        "0x10",
        "1.5.2",
        "1e",
        "-",
        "true",
        "\N{ARABIC-INDIC DIGIT THREE}",
        "a" * 300,
    ),
)
_NUMBER = re.compile(rb"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?")


def flip_bits(rng: random.Random, content: bytes) -> bytes:
    """Turn over one to eight bits."""
    wrong = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 8)) if wrong else 0):
        wrong[rng.randrange(len(wrong))] ^= 1 << rng.randrange(8)
    return bytes(wrong)


def cut(rng: random.Random, content: bytes) -> bytes:
    """Leave the beginning, as a full disk does."""
    return content[: rng.randrange(len(content) + 1)]


def take_out(rng: random.Random, content: bytes) -> bytes:
    """Leave out some bytes, so that all that follow are in another place."""
    start = rng.randrange(len(content) + 1)
    return content[:start] + content[start + rng.choice((1, 2, 4, 16, 100)) :]


def repeat(rng: random.Random, content: bytes) -> bytes:
    """Write a piece of it many times."""
    start = rng.randrange(len(content) + 1)
    piece = content[start : start + rng.choice((1, 4, 12, 100))]
    return content[:start] + piece * rng.choice((2, 3, 50, 1000)) + content[start:]


def overwrite(rng: random.Random, content: bytes) -> bytes:
    """Put an extreme number somewhere, of any width and byte order."""
    return poke(rng, content, rng.randrange(len(content) + 1))


def poke(rng: random.Random, content: bytes, place: int) -> bytes:
    """Put an extreme number at a place."""
    order = rng.choice("<>")
    if rng.random() < 0.6:
        width = rng.choice((1, 2, 4, 4, 8))
        number = rng.choice(INTEGERS) % (1 << 8 * width)
        new = number.to_bytes(width, "little" if order == "<" else "big")
    else:
        double = rng.random() < 0.2
        value = rng.choice(FLOATS)
        if not double and 3.5e38 < abs(value) < float("inf"):
            value = 3.4e38
        new = struct.pack(order + ("d" if double else "f"), value)
    return content[:place] + new[: len(content) - place] + content[place + len(new) :]


def replace_number(rng: random.Random, content: bytes) -> bytes:
    """Put an extreme number, or what is none, in the place of a number in a text."""
    found = list(_NUMBER.finditer(content))
    if not found:
        return flip_bits(rng, content)
    one = rng.choice(found)
    return content[: one.start()] + rng.choice(WORDS).encode() + content[one.end() :]


def change_lines(rng: random.Random, content: bytes) -> bytes:
    """Leave out a line of a text, exchange two, or write one many times."""
    lines = content.splitlines(keepends=True) or [b""]
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(3):
        case 0:
            del lines[a]
        case 1:
            lines[a], lines[b] = lines[b], lines[a]
        case _:
            lines[a:a] = [lines[b]] * rng.choice((1, 2, 1000))
    return b"".join(lines)


BINARY: tuple[Damage, ...] = (flip_bits, cut, take_out, repeat, overwrite, overwrite)
TEXT: tuple[Damage, ...] = (
    *(flip_bits, cut, take_out, repeat, change_lines),
    *(replace_number,) * 6,
)


def head(length: int) -> Damage:
    """Return the damage that overwrites a number in the first bytes of a file."""

    def damage(rng: random.Random, content: bytes) -> bytes:
        return poke(rng, content, rng.randrange(min(length, len(content)) + 1))

    return damage
