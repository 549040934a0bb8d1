"""From the record of the proof to what its page shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mitsuba_ref.records.results import ReplayResult, Rung, SceneResult
from reports.look.anchors import scene_anchors
from reports.proof_page.mutation_table import MutationTable, mutation_table
from reports.proof_page.origin import Origin, left_out, of_older_commits, origin
from reports.proof_page.pictures import (
    Mark,
    NoiseMaps,
    ReplayPictures,
    marks,
    noise_maps,
    replay_pictures,
)
from reports.proof_page.record import ProofRecord, RegisterEntry
from reports.proof_page.sentences import (
    headlines,
    scene_sentence,
    smallest_bias,
    why_no_replay,
)
from reports.records.results import worst_first


@dataclass(frozen=True)
class SceneProof:
    """One scene, ready to be drawn."""

    result: SceneResult
    anchor: str
    sentence: str
    no_replay: str  # why there is none; empty: there is one
    replays: dict[int, ReplayResult]  # by samples per pixel
    climbed: str  # how far the ladder was climbed
    smallest: Rung | None  # whose detectable bias is the smallest
    marks: tuple[Mark, ...]
    replayed: ReplayPictures | None
    maps: NoiseMaps | None
    seconds_ours: float | None  # of all replays together
    seconds_reference: float | None


@dataclass(frozen=True)
class ProofSection:
    """The whole page, ready to be drawn."""

    record: ProofRecord
    headlines: list[str]
    samples: tuple[int, ...]  # of the replays, over all scenes
    scenes: tuple[SceneProof, ...]
    mutations: MutationTable | None
    left_out: int  # mutations of today that the matrix does not have
    older_rows: dict[str, int]  # of the matrix, by their commit
    matrix_origin: Origin | None
    alarms_origin: Origin | None
    entries: tuple[RegisterEntry, ...]  # alarms first


def build_proof_section(record: ProofRecord, folder: Path) -> ProofSection:
    """Work out what the page shows; pictures are named relative to `folder`.

    Raises
    ------
    ReportError
        If a picture is missing or unusable.
    """
    ordered = worst_first(record.results)
    scenes = tuple(
        _scene(scene, anchor, folder)
        for scene, anchor in zip(ordered, scene_anchors(ordered), strict=True)
    )
    entries = record.register.entries if record.register else ()
    matrix, alarms, results = record.matrix, record.alarms, record.results
    return ProofSection(
        record=record,
        headlines=headlines(record),
        samples=tuple(sorted({one.spp for scene in ordered for one in scene.replay})),
        scenes=scenes,
        mutations=mutation_table(matrix.rows) if matrix else None,
        left_out=left_out(matrix) if matrix else 0,
        older_rows=of_older_commits(matrix) if matrix else {},
        matrix_origin=origin(matrix, results) if matrix else None,
        alarms_origin=origin(alarms, results) if alarms else None,
        entries=tuple(sorted(entries, key=lambda entry: not entry.alarm)),
    )


def _scene(scene: SceneResult, anchor: str, folder: Path) -> SceneProof:
    return SceneProof(
        result=scene,
        anchor=anchor,
        sentence=scene_sentence(scene),
        no_replay="" if scene.replay else why_no_replay(scene),
        replays={one.spp: one for one in scene.replay},
        climbed=_climbed(scene),
        smallest=smallest_bias(scene),
        marks=marks(scene),
        replayed=replay_pictures(scene, folder),
        maps=noise_maps(scene, folder),
        seconds_ours=_total(one.seconds_ours for one in scene.replay),
        seconds_reference=_total(one.seconds_reference for one in scene.replay),
    )


def _total(seconds: Iterable[float | None]) -> float | None:
    measured = [value for value in seconds if value is not None]
    return sum(measured) if measured else None


def _climbed(scene: SceneResult) -> str:
    if not scene.rungs:
        return "not climbed"
    broken = next((rung.name for rung in scene.rungs if not rung.passed), None)
    if broken is not None:
        return f"✗ broke at {broken}"
    return f"✓ {len(scene.rungs)} of {len(scene.rungs)}"
