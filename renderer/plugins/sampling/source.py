"""A source of random numbers, as the stages are handed it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from renderer.kernels.jit import Packed


@dataclass(frozen=True)
class Sampling:
    """Where random numbers come from, as methods of a record."""

    record: Packed
    film: Any  # kernels of `stages.film.draws`, or others with the same parameters
    draw: Any
    choose_light: Any
    aperture: Any
    by_pair: bool = False  # the first number of a draw is better spread than the fourth
    begin_bounce: Any = None  # None: numbers need not be drawn in order
