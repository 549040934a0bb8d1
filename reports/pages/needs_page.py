"""The page of what scenes need: a card with picture and command for each, then a table."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

from reports.bench.rows import Row, Run, Table
from reports.bench.study import Study
from reports.look.template import fill

FULL = "full scene"  # contender of its picture
FULL_COLOUR = 0.1  # of the mean luminance, in pictures of differences
QUANTITIES = "loss", "mean", "worst tile", "FLIP", "time", "noise"


@dataclass(frozen=True)
class Simpler:
    """One simplification, or several at once."""

    words: str
    rows: dict[str, Row]  # by quantity
    picture: str  # of the difference; "": there is none

    @property
    def loss(self) -> float:
        """Upper end of the interval of its loss."""
        interval = self.rows["loss"].interval
        return interval[1] if interval else 0.0


@dataclass(frozen=True)
class Card:
    """One scene."""

    name: str
    setting: str
    seconds: float
    tolerance: float
    command: str
    picture: str  # "": there is none
    least: Simpler | None
    time: float  # of the least model, over that of the full scene
    simpler: list[Simpler]
    absent: str
    claims: list[Row]

    @property
    def shown(self) -> Simpler | None:
        """What the card shows the difference of: the least model, or what loses little."""
        little = sorted(self.simpler, key=lambda one: abs(one.loss - self.tolerance))
        every = [*([self.least] if self.least else []), *little]
        return next((one for one in every if one.picture), None)


def needs_page(name: str, study: Study, table: Table) -> str:
    """Return the page as HTML."""
    cases = [
        case for case in table.distinct("case") if table.where(case=case, quantity="loss")
    ]
    cards = sorted((_card(case, table.where(case=case)) for case in cases), key=_saved)
    return fill(
        "needs.html",
        filters={"percent": percent, "interval": interval},
        name=name,
        study=study,
        run=table.newest,
        faults=table.faults,
        cards=cards,
        verdict=verdict(table),
        quantities=QUANTITIES,
        full_colour=FULL_COLOUR,
        pictures_of=_other_run(table),
    )


def verdict(table: Table) -> str:
    """Return how many scenes need less than their file says, and the time that saves."""
    times = [
        row.value
        for row in table.where(quantity="time of the least model")
        if isinstance(row.value, float)
    ]
    if not times:
        return ""
    less = sum(bool(row.value) for row in table.where(quantity="least model"))
    return (
        f"{less} of {len(times)} scenes need less than their file says; on average the "
        f"least model takes {statistics.geometric_mean(times):.2f} of the time."
    )


def _saved(card: Card) -> float:
    return card.time if card.least else 2.0


def _card(case: str, table: Table) -> Card:
    pictures = {row.contender: row.value for row in table.where(quantity="picture")}
    measured = table.where(quantity="loss").distinct("contender")
    simpler = [_simpler(words, table, str(pictures.get(words, ""))) for words in measured]
    least = table.value(quantity="least model")
    return Card(
        case,
        table.value(quantity="setting"),
        table.value(quantity="seconds"),
        table.value(quantity="tolerance"),
        table.value(quantity="command"),
        str(pictures.get(FULL, "")),
        next((one for one in simpler if one.words == least), None),
        table.value(quantity="time of the least model"),
        sorted(simpler, key=lambda one: one.loss),
        table.value(quantity="without effect"),
        list(table.where(quantity="left out by the plan")),
    )


def _simpler(words: str, table: Table, picture: str) -> Simpler:
    found = {row.quantity: row for row in table.where(contender=words)}
    return Simpler(words, found, picture)


def _other_run(table: Table) -> Run | None:
    """Return the run that pictures are of, if another one measured the rest."""
    runs = {row.run for row in table.where(quantity="picture")}
    others = runs - {row.run for row in table.where(quantity="loss")}
    return table.runs[min(others)] if others else None


def percent(value: float | None) -> str:
    """Return 0.0123 as 1.2 %, and what is exactly 0 as 0."""
    if not value:
        return "0"
    if abs(value) < 1e-6:  # less than the rounding of pictures
        return "\N{ALMOST EQUAL TO} 0 %"
    return f"{100.0 * value:.0f} %" if abs(value) > 0.99 else f"{100.0 * value:.2g} %"


def interval(row: Row) -> str:
    """Return the ends of a row's interval."""
    low, high = row.interval or (0.0, 0.0)
    if max(abs(low), abs(high)) < 1e-6:
        return ""
    return f"{percent(low)} to {percent(high)}"
