"""All that was found about a scene, and the one place where a verdict follows from it.

Evidence is collected piece by piece: numbers with their noise floors, AOVs, replays, rungs
of the ladder, and whatever kept something from being measured. What is judged says so
itself, with its limit; nothing else decides. Metrics without a limit are reported only.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder.aovs import NOTHING_SEEN, compare_aovs, sees_nothing
from mitsuba_ref.ladder.one_noisy_picture import (
    NOISY_RMSE_FACTOR,
    compare_filtered,
    judge_with_noise,
)
from mitsuba_ref.ladder.preconditions import (
    Incomparable,
    count_non_finite,
    find_obstacle,
)
from mitsuba_ref.ladder.without_noise import judge_without_noise
from mitsuba_ref.metrics import distances
from mitsuba_ref.records.results import (
    AovResult,
    Finite,
    Metric,
    ReplayResult,
    Rung,
    SceneResult,
)
from mitsuba_ref.records.verdicts import Verdict, most_severe
from renderer.integrators.kind import as_picture

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Evidence:
    """What was measured; its verdict and reasons follow."""

    finite: Finite = field(default_factory=Finite)
    metrics: dict[str, Metric] = field(default_factory=dict)
    aovs: tuple[AovResult, ...] = ()
    replays: tuple[ReplayResult, ...] = ()
    rungs: tuple[Rung, ...] = ()
    obstacles: tuple[Incomparable, ...] = ()  # what kept something from being measured
    background: str = ""  # why it passes although no AOV has a value
    fault: str = (
        ""  # how Mitsuba's own picture is known to be wrong, and that it was undone
    )

    @property
    def verdict(self) -> Verdict:
        """The most severe of what failed; "pass" if nothing did."""
        failures = list(self._failures())
        if not failures:
            return "reference-wrong" if self.fault else "pass"
        return most_severe(verdict for verdict, _ in failures)

    @property
    def reasons(self) -> tuple[str, ...]:
        """One sentence for each thing that failed; for a known fault of Mitsuba, that."""
        failures = tuple(sentence for _, sentence in self._failures())
        return failures or ((self.fault,) if self.fault else ())

    @property
    def notes(self) -> tuple[str, ...]:
        """What a pass rests on, where that is not the usual."""
        explained = [r for r in self.replays if r.passed and r.explained]
        return tuple(filter(None, [self.background, *map(_about, explained)]))

    def recorded(self, result: SceneResult) -> SceneResult:
        """Return the record of a scene with this evidence and what follows from it."""
        return replace(
            result,
            verdict=self.verdict,
            reasons=self.reasons,
            notes=self.notes,
            finite=self.finite,
            metrics=self.metrics,
            aovs=self.aovs,
            replay=self.replays,
            rungs=self.rungs,
        )

    def with_metric(self, name: str, metric: Metric | Incomparable) -> Evidence:
        """Return the evidence with one more metric, or why it could not be measured."""
        if isinstance(metric, Metric):
            return replace(self, metrics={**self.metrics, name: metric})
        unmeasured = Metric(None, None, None, False, f"not measured: {metric.what}")
        found = replace(self, obstacles=(metric, *self.obstacles))
        return found.with_metric(name, unmeasured)

    def _failures(self) -> Iterator[tuple[Verdict, str]]:
        """Yield all that failed: the verdict that follows, and a sentence."""
        for obstacle in self.obstacles:
            yield obstacle.verdict, obstacle.sentence
        for name, metric in self.metrics.items():
            # without a tolerance nothing was measured, and an obstacle says why
            if metric.passed is False and metric.tolerance is not None:
                floor = "" if metric.floor is None else f", floor {metric.floor:.3g}"
                beyond = f"{_shown(metric.value)} over {_shown(metric.tolerance)}"
                yield "fail", f"{name} {beyond}{floor}"
        for aov in self.aovs:
            if not aov.passed:
                yield (
                    "fail",
                    f"AOV {aov.name} {_shown(aov.value)} over {aov.tolerance:g} "
                    f"({aov.compared_pixels} pixels compared, {aov.edge_pixels} on edges): "
                    f"{aov.meaning}",
                )
        for replay in self.replays:
            if not replay.passed:
                yield replay.verdict, _about(replay)
        ended = [obstacle.rung for obstacle in self.obstacles]
        for rung in self.rungs:
            if not rung.passed and rung.name not in ended:
                yield "fail", f"rung {rung.name}: {rung.sentence}"


def _about(replay: ReplayResult) -> str:
    return f"replay at {replay.spp} samples per pixel: {replay.sentence}"


def _shown(value: float | None) -> str:
    return "unmeasured" if value is None else f"{value:.3g}"


def compare(
    ours: Array,
    references: Sequence[Array],
    ours_aovs: Mapping[str, Array] | None = None,
    reference_aovs: Mapping[str, Array] | None = None,
    *,
    deterministic: bool = False,
    rmse_factor: float | None = None,
) -> Evidence:
    """Compare our picture with Mitsuba's of the same scene.

    Parameters
    ----------
    ours
        (H, W, 3), linear.
    references
        Two or more pictures by Mitsuba with different seeds, at the same samples per
        pixel; the first is the one that is shown.
    ours_aovs, reference_aovs
        Kind to (H, W, C) at the pixel centres (see `compare_aovs`); None: not compared.
    deterministic
        The scene has no noise: compare pixel by pixel.
    rmse_factor
        How much larger than the noise floor, or without noise than 1e-4 relative, the
        RMSE may be.

    Notes
    -----
    Values that are not finite, a missing reference and a different size have separate
    verdicts (`find_obstacle`), and nothing else is measured then.
    """
    if rmse_factor is None:
        rmse_factor = 1.0 if deterministic else NOISY_RMSE_FACTOR
    aov_arrays = [*(ours_aovs or {}).values()], [*(reference_aovs or {}).values()]
    found = Evidence(
        count_non_finite([ours, *aov_arrays[0]], [*references, *aov_arrays[1]])
    )
    obstacle = find_obstacle([ours], references, ours_aovs, reference_aovs)
    if obstacle:
        return found.with_metric("rmse", obstacle)
    if reference_aovs is not None:
        found = replace(found, aovs=compare_aovs(ours_aovs or {}, reference_aovs))
    if deterministic:
        judged = judge_without_noise(ours, references, reference_aovs, rmse_factor)
    else:
        judged = judge_with_noise(ours, references, rmse_factor)
    background = ""
    if reference_aovs and sees_nothing(reference_aovs):
        pixels = ours.shape[0] * ours.shape[1]
        background = (
            f"{NOTHING_SEEN}: compared were the colours of {pixels} pixels of background, "
            "and that ours miss as well"
        )
    metrics = distances.reported(ours, *references[:2]) | judged
    return replace(found, metrics=metrics, background=background)


def compare_listed_aov(
    ours: Array, references: Sequence[Array | None], name: str
) -> Metric | Incomparable:
    """Compare an AOV that the file lists, its channels as a picture's.

    Parameters
    ----------
    ours, references
        (H, W, C) with C up to 3, of all samples; None: Mitsuba has none by this name. Equal
        ones have no noise, whatever the colours have.
    name
        As the file calls it.
    """
    shape = ours.shape
    if any(values is None or values.shape != shape for values in references):
        found = [None if values is None else values.shape for values in references]
        what = f"our {name} has shape {shape}, Mitsuba's {found[0]}"
        return Incomparable("size-mismatch", what)
    picture = as_picture(ours)
    theirs = [as_picture(values) for values in references if values is not None]
    obstacle = find_obstacle([picture], theirs)
    if obstacle:
        return obstacle
    if np.array_equal(theirs[0], theirs[1]):
        return judge_without_noise(picture, theirs, None, 1.0)["rmse"]
    return compare_filtered(picture, theirs)
