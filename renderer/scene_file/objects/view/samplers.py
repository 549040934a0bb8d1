"""Samplers by name; each has the number of samples that its pattern allows."""

from __future__ import annotations

import math

from renderer.scene_file.description import Sampler
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element

_LARGEST = 2**24


def read_sampler(element: Element | None, reading: Reading) -> Sampler:
    """Read a `<sampler>`; None is the default one, `independent` with 4 samples.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    if element is None:
        return Sampler()
    properties = Properties(element, reading)
    name = element.plugin
    asked = properties.integer("sample_count", 4, at_least=1, at_most=_LARGEST)
    count = round_sample_count(name, asked)
    if count != asked:
        reading.warn(
            element.location,
            f"{element} rounds {asked} samples up to {count}, as in Mitsuba",
        )
    seed = properties.integer("seed", 0, at_least=0, at_most=2**32 - 1)
    jitter = True
    if name in ("stratified", "multijitter", "orthogonal"):
        jitter = properties.boolean("jitter", True)
    strength = 2
    if name == "orthogonal":
        # Mitsuba divides by zero at 0 and hangs at 1
        strength = properties.integer("strength", 2, at_least=2, at_most=31)
    properties.finish()
    return Sampler(name, count, seed, jitter, strength)


def round_sample_count(sampler: str, count: int) -> int:
    """Return the number of samples per pixel that Mitsuba takes for a `count`.

    Parameters
    ----------
    sampler
        Name of the sampler: `stratified` needs a square, `multijitter` a rectangle,
        `orthogonal` the square of a prime, `ldsampler` a power of four.
    count
        At least 1.
    """
    root = math.isqrt(count - 1) + 1  # the square root, rounded up
    match sampler:
        case "stratified":
            return root * root
        case "multijitter":
            columns = math.isqrt(count)
            return columns * -(-count // columns)
        case "orthogonal":
            prime = max(root, 2)
            while any(prime % divisor == 0 for divisor in range(2, math.isqrt(prime) + 1)):
                prime += 1
            return prime * prime
        case "ldsampler":
            return 4 ** max(1, math.ceil((count - 1).bit_length() / 2))
        case _:
            return count
