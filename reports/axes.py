"""Logarithmic and linear axes: from a value to a place in the picture, and the ticks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

# Label sets from sparse to dense; the first that gives enough labels is used.
_MANTISSAS = ((1,), (1, 3), (1, 2, 5), (1, 2, 3, 4, 5, 6, 7, 8, 9))
_ENOUGH_LABELS = 3


@dataclass(frozen=True)
class LogAxis:
    """Maps [low, high] to [start, stop] so that equal ratios are equal lengths."""

    low: float  # > 0
    high: float  # > low
    start: float  # [px]
    stop: float  # [px]

    @classmethod
    def around(
        cls, values: Iterable[float], start: float, stop: float, margin: float = 1.5
    ) -> LogAxis:
        """Return an axis that holds all `values` (> 0) with a factor `margin` to spare."""
        values = list(values)
        low, high = min(values) / margin, max(values) * margin
        if high / low < 4.0:  # one point, or a few close ones: room for two labels at least
            middle = math.sqrt(low * high)
            low, high = middle / 2.0, middle * 2.0
        return cls(low, high, start, stop)

    def position(self, value: float) -> float:
        """Return where `value` (> 0) is, in pixels."""
        part = math.log(value / self.low) / math.log(self.high / self.low)
        return self.start + part * (self.stop - self.start)

    def ticks(self) -> list[float]:
        """Return the values that carry a label: powers of ten, denser if they are few."""
        candidates: list[float] = []
        for mantissas in _MANTISSAS:
            candidates = self._multiples(mantissas)
            if len(candidates) >= _ENOUGH_LABELS:
                break
        return candidates

    def minor_ticks(self) -> list[float]:
        """Return the values that get a faint line only."""
        labelled = set(self.ticks())
        return [value for value in self._multiples(_MANTISSAS[-1]) if value not in labelled]

    def _multiples(self, mantissas: tuple[int, ...]) -> list[float]:
        lowest, highest = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
        values = [
            # From text, so that 0.3 is 0.3 and not 3 * 0.1.
            float(f"{mantissa}e{power}")
            for power in range(lowest, highest + 1)
            for mantissa in mantissas
        ]
        return [value for value in values if self.low <= value <= self.high]


@dataclass(frozen=True)
class LinearAxis:
    """Maps [0, high] to [start, stop]."""

    high: float  # > 0
    start: float  # [px]
    stop: float  # [px]

    def position(self, value: float) -> float:
        """Return where `value` is, in pixels."""
        return self.start + value / self.high * (self.stop - self.start)

    def ticks(self) -> list[float]:
        """Return 4 to 8 multiples of 1, 2 or 5 times a power of ten, from 0."""
        power = 10.0 ** math.floor(math.log10(self.high / 4.0))
        step = next(s * power for s in (1, 2, 5, 10) if self.high / (s * power) <= 8.0)
        return [count * step for count in range(math.floor(self.high / step) + 1)]


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def tick_text(value: float) -> str:
    """Return a short label: 0.02, 50, 3·10⁻⁵."""
    if value == 0.0 or 1e-3 <= value < 1e5:
        return f"{value:g}"
    mantissa, power = f"{value:.0e}".split("e")
    raised = "10" + str(int(power)).translate(_SUPERSCRIPTS)
    return raised if mantissa == "1" else f"{mantissa}·{raised}"
