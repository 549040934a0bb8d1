"""What of a scene went beyond its limit: one row for each number, for terminal and page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass

from mitsuba_ref.records.results import ReplayResult, SceneResult


@dataclass(frozen=True)
class Failure:
    """One number that was judged and is beyond its limit."""

    quantity: str  # a metric's key, or what was compared and how
    value: float | None  # None: it could not be measured
    floor: float | None  # the same between Mitsuba's own pictures; None: not measured
    limit: float | None  # None: there is no single one
    meaning: str


def failures(scene: SceneResult) -> list[Failure]:
    """Return all that failed, in the order in which it was compared.

    Empty if nothing did, and for a scene of which nothing was measured.
    """
    return list(_failures(scene))


def _failures(scene: SceneResult) -> Iterator[Failure]:
    if not scene.finite.passed:
        count = sum(astuple(scene.finite))
        yield Failure("NaN or infinite values", count, None, 0, "of both renderers")
    for name, metric in scene.metrics.items():
        if metric.passed is False:
            yield Failure(
                name, metric.value, metric.floor, metric.tolerance, metric.meaning
            )
    for aov in scene.aovs:
        if not aov.passed:
            where = f"{aov.compared_pixels} pixels compared, {aov.edge_pixels} on edges"
            yield Failure(
                f"AOV {aov.name}",
                aov.value,
                None,
                aov.tolerance,
                f"{aov.meaning} ({where})",
            )
    for replay in scene.replay:
        if not replay.passed:
            yield from _of_replay(replay)
    for rung in scene.rungs:
        if not rung.passed:
            yield Failure(
                f"rung {rung.name}", rung.statistic, None, rung.limit, rung.sentence
            )


def _of_replay(replay: ReplayResult) -> Iterator[Failure]:
    name = f"replay at {replay.spp} spp"
    same = "both renderers drew the same random numbers"
    rows = (
        Failure(
            f"{name}: diverged",
            replay.divergent,
            None,
            replay.divergent_allowed,
            f"pixels, of {replay.pixels}; {same}",
        ),
        Failure(
            f"{name}: RMSE",
            replay.rmse,
            None,
            replay.rmse_limit,
            f"of the pixels that did not diverge, in parts of the picture's mean; {same}",
        ),
    )
    beyond = [row for row in rows if _is_beyond(row)]
    # nothing was compared, or it is the file that says so
    yield from beyond or [Failure(name, None, None, None, replay.sentence)]


def _is_beyond(row: Failure) -> bool:
    return row.value is not None and row.limit is not None and row.value > row.limit
