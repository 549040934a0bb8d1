"""The page of what all scenes prove, and of how far a green check can be trusted."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from pathlib import Path

from mitsuba_ref.records.verdicts import VERDICTS
from mitsuba_ref.replay.replay_comparison import TOLERANCE
from reports.bench.rows import Row, Table
from reports.bench.store import Store
from reports.bench.study import Study, find_study, page_file
from reports.look.formatting import percent
from reports.look.template import fill
from reports.pages.scene_page import page_of, scene_pages

BESIDES = "mutations", "false-alarms", "register"  # studies of how good the tests are


@dataclass(frozen=True)
class SceneProof:
    """One row of the table."""

    case: str
    page: str
    title: str
    verdict: str
    replays: dict[float, tuple[Row, Row, Row]]  # by samples: divergent, of pixels, RMSE
    tests: int
    broken: str  # name of the test that broke; "": none
    smallest_bias: float | None  # that a test would have seen
    noise: bool


@dataclass(frozen=True)
class Trust:
    """What another study says about the tests."""

    title: str
    page: str
    question: str
    answer: str
    faults: int


def proof_pages(name: str, study: Study, table: Table, folder: Path) -> dict[str, str]:
    """Return proof.html and the pages of the scenes, by file name.

    Raises
    ------
    ReportError
        If a record cannot be read.
    """
    scenes = [_scene(case, table.where(case=case)) for case in table.distinct("case")]
    order = list(VERDICTS)
    scenes.sort(key=lambda scene: order.index(scene.verdict))  # type: ignore[arg-type]
    noisy = [scene.smallest_bias for scene in scenes if scene.noise]
    biases = [bias for bias in noisy if bias]
    page = fill(
        "proof.html",
        name=name,
        study=study,
        run=table.newest,
        faults=table.faults,
        answer=study.verdict(table),
        same=_same_share(table),
        bias=percent(statistics.median(biases)) if biases else "",
        hardest=percent(max(biases)) if biases else "",
        samples=sorted({spp for scene in scenes for spp in scene.replays}),
        scenes=scenes,
        divergent_from=TOLERANCE,
        trust=_trust(Store(folder / "data")),
    )
    return {page_file(name): page, **scene_pages(name, study, table, folder)}


def _scene(case: str, rows: Table) -> SceneProof:
    names = "divergent pixels", "pixels", "RMSE of the others"
    replays = {
        spp: tuple(rows.where(quantity=one, at=spp).rows[0] for one in names)
        for spp in rows.where(quantity="pixels").distinct("at")
    }
    tests = rows.where(quantity="rung")
    broken = tests.where(value="broken").distinct("contender")
    biases = [float(r.value or 0.0) for r in rows.where(quantity="detectable bias")]
    return SceneProof(
        case=case,
        page=f"{page_of(case)}#proof",
        title=rows.value(quantity="title") or case,
        verdict=rows.value(quantity="verdict") or "broken",
        replays=replays,  # type: ignore[arg-type]
        tests=len(tests),
        broken=", ".join(broken),
        smallest_bias=min(biases, default=None),
        noise=rows.value(quantity="noise") != "no",
    )


def _same_share(table: Table) -> str:
    """Return which share of pixels gets the same colour, rounded down."""
    pixels, divergent = (
        sum(int(row.value or 0) for row in table.where(quantity=name))
        for name in ("pixels", "divergent pixels")
    )
    if not pixels:
        return ""
    digits = 2 if divergent else 0
    step = 10 ** (2 + digits)
    return f"{(pixels - divergent) * step // pixels / 10**digits:.{digits}f}\u00a0%"


def _trust(store: Store) -> list[Trust]:
    found = []
    for name in BESIDES:
        study, table = find_study(name), store.read(name)
        if table:
            answer = study.verdict(table)
            faults = len(table.faults)
            found.append(
                Trust(study.title, page_file(name), study.sentence, answer, faults)
            )
    return found
