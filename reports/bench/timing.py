"""Timing: contenders take turns, and every time and ratio has an interval."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from scipy import stats

LEVEL = 0.95  # of all intervals
Interval = tuple[float, float]


def take_turns(
    contenders: Mapping[str, Callable[[int], float | None]],
    rounds: int,
    *,
    enough: float = math.inf,
    least: int = 2,
    show: Callable[[str], None] = lambda stage: None,
) -> dict[str, list[float]]:
    """Return the seconds of each contender, one of each round.

    All contenders take a turn in each round: what disturbs the machine for a while disturbs
    all of them alike, and a ratio within a round stands.

    Parameters
    ----------
    contenders
        Each is called with the number of the round and may return the seconds that it
        measured itself; the seconds of the call otherwise.
    rounds
        Most rounds.
    enough, least
        No round begins after so many seconds and at least so many rounds.
    show
        Called with the round and the name before each turn.
    """
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    end = time.perf_counter() + enough
    for turn in range(rounds):
        if turn >= least and time.perf_counter() > end:
            break
        for name, contender in contenders.items():
            show(f"round {turn + 1} of {rounds}: {name}")
            start = time.perf_counter()
            own = contender(turn)
            seconds[name].append(time.perf_counter() - start if own is None else own)
    return seconds


def median_interval(values: Sequence[float]) -> Interval:
    """Return an interval of the median without an assumption about the distribution.

    Its ends are two of the values, by the binomial distribution of how many lie below the
    median. With fewer than six values they are the least and the greatest, and the level is
    below `LEVEL` (94 % for five values, 75 % for three).
    """
    ordered = sorted(values)
    n = len(ordered)
    low = int(stats.binom.ppf((1.0 - LEVEL) / 2.0, n, 0.5))
    k = max(0, low - 1) if stats.binom.cdf(low, n, 0.5) > (1.0 - LEVEL) / 2.0 else low
    return ordered[k], ordered[n - 1 - k]


def median(values: Sequence[float]) -> dict[str, Any]:
    """Return the median of values and its interval, as fields of a row."""
    return {"value": statistics.median(values), "interval": median_interval(values)}


def ratio(first: Sequence[float], second: Sequence[float]) -> tuple[float, Interval]:
    """Return how many times as long the first took, with an interval.

    Parameters
    ----------
    first, second
        Seconds of two contenders, above 0, one of each round.

    Returns
    -------
    ratio, interval
        The geometric mean of the ratios of the rounds; Student's interval of its logarithm.
        With one round the interval is (0, infinity).
    """
    logs = [math.log(a / b) for a, b in zip(first, second, strict=True)]
    mean = statistics.fmean(logs)
    if len(logs) < 2:
        return math.exp(mean), (0.0, math.inf)
    half = float(stats.t.ppf(0.5 + LEVEL / 2.0, len(logs) - 1))
    half *= statistics.stdev(logs) / math.sqrt(len(logs))
    return math.exp(mean), (math.exp(mean - half), math.exp(mean + half))
