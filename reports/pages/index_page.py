"""The page of all pages: the verdict, a card for each scene, then one for each study."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mitsuba_ref.records.verdicts import VERDICTS, Verdict
from reports.bench.rows import Row, Run, Table
from reports.bench.study import Study, page_file
from reports.look.template import fill
from reports.pages.scene_page import OURS, page_of
from reports.pages.soak_page import soaked
from reports.pages.study_page import circumstances_of

SCENES = "scenes"
SMALL = "small "  # before the names of small pictures


@dataclass(frozen=True)
class SceneCard:
    """A scene of the gallery, and a row of the table."""

    case: str
    page: str
    rows: Table

    def text(self, quantity: str) -> str:
        """Return a text; "" without a row."""
        return str(self.rows.value(quantity=quantity) or "")

    def number(self, quantity: str, contender: str = "") -> float | None:
        """Return a number; None without a row."""
        value: float | None = self.rows.value(quantity=quantity, contender=contender)
        return value

    @property
    def title(self) -> str:
        """Its name."""
        return self.text("title") or self.case

    @property
    def verdict(self) -> Verdict:
        """The harness's verdict; "broken" if the study itself failed."""
        return self.text("verdict") or "broken"  # type: ignore[return-value]

    @property
    def times(self) -> Row | None:
        """How many times as fast to the same error."""
        return next(iter(self.rows.where(quantity="times as fast")), None)

    @property
    def pictures(self) -> tuple[str, str] | None:
        """Small pictures: ours, and Mitsuba's."""
        ours, reference = (
            self.rows.value(quantity="picture", contender=SMALL + name)
            for name in (OURS, "Mitsuba")
        )
        return (ours, reference) if ours and reference else None

    def share(self, quantity: str) -> float:
        """Return RMSE or the noise floor as a share of the tolerance, which is 1."""
        value, tolerance = self.number(quantity), self.number("tolerance")
        return value / tolerance if value and tolerance else 0.0


@dataclass(frozen=True)
class StudyCard:
    """Another page: the question, the answer, a picture."""

    title: str
    page: str
    question: str
    answer: str
    picture: str  # path; "": it has none
    faults: int
    run: Run | None


def index_page(tables: Mapping[str, tuple[Study, Table]], folder: Path) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    tables
        All studies with their rows, by name, in the order of the page.
    folder
        Where the pages are; a study without a page has no card.
    """
    table = tables[SCENES][1] if SCENES in tables else Table()
    cards = [
        SceneCard(case, page_of(case), table.where(case=case))
        for case in table.distinct("case")
    ]
    cards.sort(key=lambda card: (list(VERDICTS).index(card.verdict), card.title))
    # a picture that is wrong may be fast
    timed = [card for card in cards if card.times and card.verdict == "pass"]
    times = [_times(card) for card in timed]
    slowest = min(timed, key=_times, default=None)
    return fill(
        "index.html",
        scenes=cards,
        passing=sum(card.verdict == "pass" for card in cards),
        times=statistics.geometric_mean(times) if times else None,
        measured=len(times),
        slowest=slowest,
        run=circumstances_of(table),
        studies=[
            _card(name, study, rows)
            for name, (study, rows) in tables.items()
            if name != SCENES and (folder / page_file(name)).exists()
        ],
    )


def _times(card: SceneCard) -> float:
    return float(card.times.value or 1.0) if card.times else 1.0


def _card(name: str, study: Study, table: Table) -> StudyCard:
    picture = next((str(row.value) for row in table.where(quantity="picture")), "")
    return StudyCard(
        study.title,
        page_file(name),
        study.sentence,
        study.verdict(table) if table else "",
        picture,
        len(soaked(study, table).faults if study.goes_on else table.faults),
        table.newest,
    )
