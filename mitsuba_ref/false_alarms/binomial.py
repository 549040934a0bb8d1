"""How often something happens, from how often it was seen [Clopper1934]."""

from __future__ import annotations

from dataclasses import dataclass

from scipy import stats

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Rate:
    """A share of independent trials, with its exact confidence interval."""

    count: int
    trials: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The share itself."""
        return self.count / self.trials


def rate(count: int, trials: int, confidence: float = CONFIDENCE) -> Rate:
    """Return the share `count` / `trials` with the interval of Clopper and Pearson.

    It holds the true rate with at least this confidence, whatever that rate is.
    """
    tail = (1.0 - confidence) / 2.0
    low = stats.beta.ppf(tail, count, trials - count + 1) if count else 0.0
    high = stats.beta.isf(tail, count + 1, trials - count) if count < trials else 1.0
    return Rate(count, trials, float(low), float(high))
