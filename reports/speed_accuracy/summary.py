"""From the pictures of all contenders to what is said of them: intervals, front, ratios."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from mitsuba_ref.statistics.equal_error import geometric_mean
from mitsuba_ref.statistics.hypothesis_tests.welch import critical_t
from reports.speed_accuracy.record import OURS, Curve, NoisyScene, SpeedAccuracy

ALPHA = 0.05  # of all intervals, two-sided
BEST = "the best of them in each scene"

Interval = tuple[float, float]


class Efficiency(NamedTuple):
    """How many times a way of ours is worth the best peer, over scenes."""

    name: str
    scenes: int
    mean: float  # geometric
    interval: Interval
    worst: float
    worst_scene: str
    ahead: int  # scenes in which it is worth more


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the interval of the mean of positive numbers, symmetric in the logarithm.

    By Student's t; never below 0, as an error bar on a logarithmic axis must not be.
    """
    mean = float(np.mean(values))
    if mean <= 0.0:
        return mean, mean
    error = float(np.std(values, ddof=1)) / (math.sqrt(len(values)) * mean)
    return around(mean, error, len(values) - 1)


def around(value: float, log_error: float, degrees: float) -> Interval:
    """Return the interval of a value whose logarithm has this standard error."""
    factor = math.exp(min(float(critical_t(ALPHA, 1, degrees)) * log_error, 700.0))
    return value / factor, value * factor


def degrees_of_sum(errors: Sequence[float], degrees: Sequence[int]) -> float:
    """Return the degrees of freedom of the sum of independent numbers.

    By Welch and Satterthwaite [Welch1947]: those of the number with the largest
    standard error if it is much larger than the others, all together if they are alike.
    """
    largest = max(errors)
    if not 0.0 < largest < math.inf:
        return min(degrees)
    squares = [(error / largest) ** 2 for error in errors]  # relative: none overflows
    each = zip(squares, degrees, strict=True)
    return sum(squares) ** 2 / sum(square**2 / own for square, own in each)


def pareto_front(places: Sequence[tuple[float, float]]) -> list[int]:
    """Return the numbers of the places that no other one beats, fastest first.

    One beats another if it takes no more seconds and has no larger error, and is not at
    the same place. Of several at one place the first counts.

    Parameters
    ----------
    places
        (seconds, error) of each.
    """
    front: list[int] = []
    for index in sorted(range(len(places)), key=lambda i: places[i]):
        if not front or places[index][1] < places[front[-1]][1]:
            front.append(index)
    return front


def scene_ratio(scene: NoisyScene, curve: Curve) -> tuple[float, Interval] | None:
    """Return how many times a curve is worth the best peer, with its interval."""
    beside = scene.beside_best_peer(curve)
    if beside is None:
        return None
    ratio, error = beside
    return ratio, around(ratio, error, len(curve.last.errors) - 1)


def efficiencies(record: SpeedAccuracy) -> list[Efficiency]:
    """Return our best way of each scene, then each of our samplers, over all scenes.

    Methods other than that of the file are left out of the samplers' rows: few scenes have
    any.
    """
    scenes = [scene for scene in record.noisy if scene.best_peer is not None]
    if not scenes:
        return []
    rows = [_over_scenes(BEST, [(scene, scene.best_of_ours) for scene in scenes])]
    found: dict[str, list[tuple[NoisyScene, Curve]]] = {}
    for scene in scenes:
        ours = [one for one in scene.curves if one.renderer == OURS]
        for curve in ours:
            if curve.method == ours[0].method:
                found.setdefault(curve.sampler, []).append((scene, curve))
    return rows + [_over_scenes(name, pairs) for name, pairs in found.items()]


def _over_scenes(name: str, pairs: Iterable[tuple[NoisyScene, Curve]]) -> Efficiency:
    ratios, errors, degrees, names = [], [], [], []
    for scene, curve in pairs:
        beside = scene.beside_best_peer(curve)
        if beside is None:
            continue
        ratios.append(beside[0])
        errors.append(beside[1])
        degrees.append(len(curve.last.errors) - 1)
        names.append(scene.scene)
    mean = geometric_mean(ratios)
    worst = int(np.argmin(ratios))
    return Efficiency(
        name,
        len(ratios),
        mean,
        around(mean, math.hypot(*errors) / len(errors), degrees_of_sum(errors, degrees)),
        ratios[worst],
        names[worst],
        sum(ratio > 1.0 for ratio in ratios),
    )
