"""Laws fitted to measurements: a power of the size, and a multiple of its logarithm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Fit(NamedTuple):
    """Two coefficients, and how far the law is off."""

    first: float
    second: float
    error: float  # root mean square of value / law - 1


def power_fit(sizes: Sequence[float], values: Sequence[float]) -> Fit:
    """Fit values = c sizes^p by least squares on the logarithms; first is c, second p."""
    p, log_c = np.polyfit(np.log(sizes), np.log(values), 1)
    law = np.exp(log_c) * np.asarray(sizes, float) ** p
    return Fit(float(np.exp(log_c)), float(p), _error(values, law))


def logarithm_fit(sizes: Sequence[float], values: Sequence[float]) -> Fit:
    """Fit values = a + b log2(sizes) by least squares; first is a, second b."""
    b, a = np.polyfit(np.log2(sizes), values, 1)
    return Fit(float(a), float(b), _error(values, a + b * np.log2(sizes)))


def _error(values: Sequence[float], law: np.ndarray) -> float:
    return float(np.sqrt(np.mean((law / np.asarray(values, float) - 1.0) ** 2)))
