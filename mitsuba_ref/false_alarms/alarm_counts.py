"""Counts of false alarms, rung by rung, over trials in which nothing is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.false_alarms.binomial import Rate, rate
from mitsuba_ref.ladder.climb import FALSE_ALARMS, climb
from mitsuba_ref.records.results import Rung

Pictures = NDArray[np.float32]

OFTEN = 0.05  # a p-value that is frequent enough to be counted in 200 pairs
WHOLE = "whole ladder"


@dataclass(frozen=True)
class RungAlarms:
    """One rung, or the whole ladder, over all pairs."""

    name: str
    alarms: Rate
    claimed: float | None
    below_often: Rate | None  # p-values of at most `OFTEN`
    detectable_bias: float | None  # median over the pairs


@dataclass(frozen=True)
class FalseAlarms:
    """One comparison of a scene with itself."""

    comparison: str
    rungs: tuple[RungAlarms, ...]


def count_alarms(
    first: Sequence[Pictures], second: Sequence[Pictures], alpha: float = FALSE_ALARMS
) -> tuple[RungAlarms, ...]:
    """Climb to the top for each pair; return how often each rung was broken.

    Parameters
    ----------
    first, second
        For each pair a set of pictures, (K, H, W, 3); no picture twice.
    alpha
        Claimed for each rung.
    """
    return count_broken(
        [
            climb(list(a), list(b), alpha=alpha, to_the_top=True)
            for a, b in zip(first, second, strict=True)
        ]
    )


def count_broken(
    climbs: Sequence[Sequence[Rung]], together: str = WHOLE
) -> tuple[RungAlarms, ...]:
    """Count over all trials, rung by rung and, in a last row, `together`."""
    found = [_count(rungs) for rungs in zip(*climbs, strict=True)]
    broken = sum(any(not rung.passed for rung in rungs) for rungs in climbs)
    claims = [rung.claimed for rung in found if rung.claimed is not None]
    whole = RungAlarms(together, rate(broken, len(climbs)), sum(claims), None, None)
    return (*found, whole)


def _count(rungs: Sequence[Rung]) -> RungAlarms:
    """Count over the same rung of all pairs."""
    p = [rung.p_value for rung in rungs if rung.p_value is not None]
    bias = [rung.detectable_bias for rung in rungs if rung.detectable_bias is not None]
    return RungAlarms(
        name=rungs[0].name,
        alarms=rate(sum(not rung.passed for rung in rungs), len(rungs)),
        claimed=rungs[0].false_alarm_rate,
        below_often=rate(sum(value <= OFTEN for value in p), len(p)) if p else None,
        detectable_bias=float(np.median(bias)) if bias else None,
    )


def exceeds(measured: FalseAlarms) -> bool:
    """Return whether the whole ladder surely alarms more often than it claims."""
    whole = measured.rungs[-1]
    return whole.claimed is not None and whole.alarms.low > whole.claimed
