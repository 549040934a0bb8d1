"""What was shown, and what was not, for readers who know no statistics."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from mitsuba_ref.false_alarms.alarm_counts import RungAlarms
from mitsuba_ref.records.results import ReplayResult, Rung, SceneResult
from mitsuba_ref.records.verdicts import COMPARED, VERDICTS
from mitsuba_ref.replay.replay_comparison import TOLERANCE
from reports.look.formatting import NOTHING, number
from reports.proof_page.origin import origin
from reports.proof_page.record import ProofRecord
from reports.records.circumstances import Circumstances

SHARED = "an error that both programs share cannot be seen this way"


def percent(share: float | None) -> str:
    """Return 0.0023 as "0.23 %", which no line break parts; a dash for None."""
    return NOTHING if share is None else number(100.0 * share, 2) + "\u00a0%"


def detectable(found: Rung | RungAlarms) -> str:
    """Return what a rung can see: relative quantities in percent, others as they are."""
    relative = "relative" in found.detectable
    return percent(found.detectable_bias) if relative else number(found.detectable_bias)


def smallest_bias(scene: SceneResult) -> Rung | None:
    """Return the passed rung that would have seen the smallest error of brightness."""
    found = [
        rung
        for rung in scene.rungs
        # Other rungs measure shifts in pixels or errors of depth.
        if rung.passed and "bias" in rung.detectable and rung.detectable_bias is not None
    ]
    return min(found, key=lambda rung: rung.detectable_bias or 0.0, default=None)


# ------------------------------------------------------------------------- one scene


def scene_sentence(scene: SceneResult) -> str:
    """Return the one sentence about a scene."""
    if scene.verdict not in COMPARED:
        return f"Nothing was shown: {VERDICTS[scene.verdict].meaning}."
    return f"{_replayed(scene)}; {_tested(scene)}; {SHARED}."


def _replayed(scene: SceneResult) -> str:
    if not scene.replay:
        return f"With the same random numbers nothing was shown ({why_no_replay(scene)})"
    where = _agreement(scene.replay)
    same = f"the same colour (to {percent(TOLERANCE)})"
    if all(one.passed for one in scene.replay):
        start = "With the same random numbers"
        if scene.deterministic:
            start = "Nothing is random here, and"
        return f"{start} the two programs give {same} {where}"
    start = "With the same random numbers the two programs"
    far = [one.rmse for one in scene.replay if one.rmse is not None and not one.passed]
    if not far or any(one.divergent > one.divergent_allowed for one in scene.replay):
        return f"{start} do NOT agree: they give {same} only {where}"
    return (
        f"{start} give {same} {where}, but there they differ by MORE than rounding "
        f"explains ({number(max(far), 2)} of the mean)"
    )


def why_no_replay(scene: SceneResult) -> str:
    """Return the refusal that the harness noted."""
    return scene.settings.get("replay", "there was no replay")


def _agreement(replays: Sequence[ReplayResult]) -> str:
    """Return in how many pixels; once, if it is the same at all sample counts."""
    shares = [_share(one) for one in replays]
    if len(set(shares)) == 1:
        counts = " and at ".join(_samples(one) for one in replays)
        return f"{shares[0]}, at {counts} each"
    return " and ".join(
        f"{share} at {_samples(one)} each"
        for share, one in zip(shares, replays, strict=True)
    )


def _share(one: ReplayResult) -> str:
    if not one.pixels or one.rmse is None:
        return f"in none ({one.sentence})"
    if not one.divergent:
        return f"in all {one.pixels:,} pixels"
    share = f"in {one.pixels - one.divergent:,} of {one.pixels:,} pixels"
    if one.passed and one.explained:
        share += f" (rounding explains all {one.traced} that were traced of those beyond)"
    return share


def _samples(one: ReplayResult) -> str:
    return "1 sample" if one.spp == 1 else f"{one.spp} samples"


def _tested(scene: SceneResult) -> str:
    if not scene.rungs:
        return "with different random numbers nothing was tested"
    broken = next((rung for rung in scene.rungs if not rung.passed), None)
    if broken is not None:
        return f"the ladder of tests broke at “{broken.name}”: {_inner(broken.sentence)}"
    seen = smallest_bias(scene)
    if scene.deterministic:
        start = "no test of the picture as a whole found a difference"
    else:
        start = "with different random numbers no test could tell their pictures apart"
    if seen is None:
        return start
    return (
        f"{start}, though an error of {percent(seen.detectable_bias)} in brightness would "
        "have been noticed 99 times in 100, and a smaller one perhaps not"
    )


def _inner(sentence: str) -> str:
    return sentence.rstrip(".")


# --------------------------------------------------------------------- the whole page


def headlines(record: ProofRecord) -> list[str]:
    """Return what was shown, in three sentences with the numbers."""
    scenes = record.results.scenes
    return [
        _replay_headline(scenes),
        _ladder_headline(scenes),
        _trust_headline(record),
    ]


def _replay_headline(scenes: Sequence[SceneResult]) -> str:
    replayed = [scene for scene in scenes if scene.replay]
    if not replayed:
        return "No scene was rendered with the same random numbers on both sides."
    runs = [one for scene in replayed for one in scene.replay]
    pixels, parted = sum(one.pixels for one in runs), sum(one.divergent for one in runs)
    samples = " and ".join(str(spp) for spp in sorted({one.spp for one in runs}))
    good = sum(all(one.passed for one in scene.replay) for scene in replayed)
    worst = max((one.rmse for one in runs if one.rmse is not None), default=None)
    return (
        f"Given the same random numbers, both programs trace the same light paths on "
        f"{good} of {len(scenes)} scenes: of {pixels:,} pixels (at {samples} samples "
        f"each) {parted:,} {'differs' if parted == 1 else 'differ'} by more than "
        f"{percent(TOLERANCE)}, and the rest of a picture differs by "
        f"{number(worst, 2)} of its mean at most (root mean square)."
    )


def _ladder_headline(scenes: Sequence[SceneResult]) -> str:
    if not any(scene.rungs for scene in scenes):
        return "No scene was tested with different random numbers."
    noisy = [scene for scene in scenes if not scene.deterministic]
    still = [scene for scene in scenes if scene.deterministic]
    said = (
        f"Given different ones, no test finds a difference beyond noise on {_held(noisy)}"
    )
    if still:
        said += f", and none at all on {_held(still)} without noise"
    found = (smallest_bias(scene) for scene in noisy)
    biases = [rung.detectable_bias for rung in found if rung and rung.detectable_bias]
    if not biases:
        return said + "."
    return (
        f"{said}; under noise an error in brightness of "
        f"{percent(statistics.median(biases))} would have been noticed on the median "
        f"scene, of {percent(max(biases))} on the hardest (99 times in 100)."
    )


def _held(scenes: Sequence[SceneResult]) -> str:
    """Return on how many scenes the ladder was climbed without a broken rung."""
    good = [s for s in scenes if s.rungs and all(rung.passed for rung in s.rungs)]
    return f"{len(good)} of {len(scenes)} scenes"


def _trust_headline(record: ProofRecord) -> str:
    matrix, alarms, register = record.matrix, record.alarms, record.register
    said = []
    if matrix is not None:
        harmful = [row for row in matrix.rows if row.harmful]
        caught = sum(row.caught_by is not None for row in harmful)
        neutral = [row for row in matrix.rows if not row.harmful]
        quiet = sum(row.caught_by is None for row in neutral)
        said.append(
            f"of {len(harmful)} defects that were built in on purpose the tests catch "
            f"{caught}, and of {len(neutral)} harmless changes they leave {quiet} alone"
            f"{_older(matrix, record)}"
        )
    else:
        said.append("which defects the tests would catch was not measured in this run")
    if alarms is not None:
        whole = [one.rungs[-1].alarms for one in alarms.comparisons]
        count, trials = sum(r.count for r in whole), sum(r.trials for r in whole)
        said.append(
            f"they alarm in {count} of {trials} comparisons in which nothing was changed"
            f"{_older(alarms, record)}"
        )
    if register is not None:
        still = sum(not entry.alarm for entry in register.entries)
        said.append(
            f"{still} of {len(register.entries)} known disagreements are still there"
        )
    sentence = "; ".join(said)
    return sentence[0].upper() + sentence[1:] + "."


def _older(made: Circumstances, record: ProofRecord) -> str:
    return " (measured at another commit)" if origin(made, record.results).other else ""
