"""The page of the long trials: faults that are open first, then what each trial did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from reports.bench.rows import Row, Run, Table
from reports.bench.steps import Sums, sums_of
from reports.bench.study import Study
from reports.charts.curves import line_chart
from reports.charts.figure import Point, Series
from reports.look.template import fill


@dataclass(frozen=True)
class Session:
    """One run of the command, as far as it concerns one trial."""

    run: Run
    sums: Sums


@dataclass(frozen=True)
class Trial:
    """One trial on the page."""

    name: str
    about: str
    unit: str
    aim: int
    sums: Sums
    sessions: list[Session]
    counts: list[tuple[str, int]]
    chart: Markup | None

    @property
    def open(self) -> list[str]:
        """The faults since the newest full session, and of that; a quick one mends none."""
        sessions = self.sessions[self._newest_full :]
        return [fault for one in sessions for fault in one.sums.faults]

    @property
    def mended(self) -> list[str]:
        """The faults of earlier sessions."""
        sessions = self.sessions[: self._newest_full]
        return [fault for one in sessions for fault in one.sums.faults]

    @property
    def _newest_full(self) -> int:
        full = [k for k, one in enumerate(self.sessions) if one.run.full]
        return full[-1] if full else 0


@dataclass(frozen=True)
class Soaked:
    """All trials."""

    trials: list[Trial]

    @property
    def faults(self) -> list[str]:
        """The faults that are open, each with its trial."""
        return [f"{trial.name}: {fault}" for trial in self.trials for fault in trial.open]

    @property
    def open(self) -> int:
        """How many faults are open."""
        return len(self.faults)

    @property
    def mended(self) -> int:
        """How many faults were found and mended."""
        return sum(len(trial.mended) for trial in self.trials)

    @property
    def unfinished(self) -> list[str]:
        """The trials that have not done what they aim at."""
        return [trial.name for trial in self.trials if trial.sums.done < trial.aim]

    @property
    def seconds(self) -> float:
        """How long all sessions took."""
        return sum(trial.sums.seconds for trial in self.trials)

    @property
    def verdict(self) -> str:
        """What the page says first."""
        faults = "1 fault" if self.open == 1 else f"{self.open} faults"
        return f"{faults} open, {self.mended} found and mended."


def soaked(study: Study, table: Table) -> Soaked:
    """Return what the rows of all runs say of each trial."""
    return Soaked(
        [_trial(name, study, table.where(case=name)) for name in study.chosen((), False)]
    )


def soak_page(name: str, study: Study, table: Table) -> str:
    """Return the page as HTML."""
    return fill(
        "soak.html",
        filters={"grouped": grouped},
        name=name,
        study=study,
        run=table.newest,
        soaked=soaked(study, table),
    )


def grouped(number: float) -> str:
    """Return 1000000 as 1 000 000."""
    return f"{number:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def _trial(name: str, study: Study, table: Table) -> Trial:
    runs = sorted(table.distinct("run"), key=lambda run: table.runs[run].created)
    sessions = [Session(table.runs[run], sums_of(table.where(run=run))) for run in runs]
    unit = next((row.unit for row in table.where(quantity="done")), "")
    return Trial(
        name,
        study.about.get(name, ""),
        unit,
        study.aims[name],
        sums_of(table),
        sessions,
        merged(sums_of(table).counts),
        _chart(table.where(quantity="memory")),
    )


def merged(counts: Mapping[str, int]) -> list[tuple[str, int]]:
    """Return counts by name; those of one kind ("kind: name") that are equal in one."""
    alike: dict[tuple[str, int], list[str]] = {}
    for name, count in sorted(counts.items()):
        kind, colon, _ = name.rpartition(": ")
        alike.setdefault((kind if colon else name, count), []).append(name)
    return [
        (names[0] if len(names) == 1 else _each(kind, names), count)
        for (kind, count), names in alike.items()
    ]


def _each(kind: str, names: list[str]) -> str:
    return f"{kind}, each of " + ", ".join(name.rpartition(": ")[2] for name in names)


def _chart(table: Table) -> Markup | None:
    """Return the curve of memory of the newest process that has one."""
    newest = table.newest
    if newest is None:
        return None
    rows = table.curve(run=newest.run)
    rows = rows[:: max(1, len(rows) // 60)]
    points = tuple(Point(row.at, _size(row)) for row in rows if row.at is not None)
    return line_chart(
        (Series("memory", points),),
        x_label="per cent of the run",
        y_label="MiB",
        description=f"Memory of the newest process: {points[0].y:.0f} MiB after its first "
        f"round, {points[-1].y:.0f} MiB after its last.",
    )


def _size(row: Row) -> float:
    return row.value if isinstance(row.value, float) else 0.0
