"""Rows of measurements, and a table to pick them from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

LARGEST = "largest"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One measured value.

    Parameters
    ----------
    case
        What was measured on: a scene, a mesh, a stress.
    quantity
        What was measured: "seconds", "relative MSE". The quantities "fault" and "left out"
        (their values are sentences), "picture" and "file" (paths relative to the page) are
        shown in their own way.
        In a study that goes on, values of one quantity add up over its runs, but for
        "largest", of which the greatest counts.
    value
        A number, a text, or None for a number that is not finite.
    unit
        Of the value, "" for a pure number, "times" for a ratio.
    contender
        What was measured: a method, a structure, a renderer.
    at
        Place on the axis of the study: samples per pixel, strength of a stress. None if
        the study has no axis.
    interval
        95 % confidence interval of the value; of fewer than six repeats the least and the
        greatest (94 % for five, 75 % for three).
    study, run
        Name of the study, and identifier of the `Run` with the circumstances. The runner
        sets both.
    """

    case: str
    quantity: str
    value: float | str | None
    unit: str = ""
    contender: str = ""
    at: float | None = None
    interval: tuple[float, float] | None = None
    study: str = ""
    run: str = ""


@dataclass(frozen=True, kw_only=True)
class Run:
    """The circumstances of a command that measured: when, where, with what."""

    run: str  # identifier
    created: str  # ISO 8601
    command: str
    commit: str = "unknown"
    machine: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    quick: bool = False
    options: dict[str, str] = field(default_factory=dict)  # of the study

    @property
    def full(self) -> bool:
        """Whether the study was measured as it is by default."""
        return not (self.quick or self.options)


@dataclass(frozen=True, kw_only=True)
class Done:
    """A case that was measured to its end; rows without it belong to an interrupted run."""

    done: str  # the case
    run: str
    seconds: float
    cores_of_other_programs: float | None = None  # kept busy meanwhile
    inputs: str = ""  # what `Study.inputs` returned


@dataclass(frozen=True)
class Table:
    """Rows of a study, with the circumstances that they name."""

    rows: tuple[Row, ...] = ()
    runs: Mapping[str, Run] = field(default_factory=dict)
    done: Mapping[str, Done] = field(default_factory=dict)  # by case

    def __iter__(self) -> Iterator[Row]:
        """Iterate over the rows."""
        return iter(self.rows)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.rows)

    def where(self, **wanted: Any) -> Table:
        """Return the rows whose fields have the given values."""
        kept = tuple(
            row
            for row in self.rows
            if all(getattr(row, name) == value for name, value in wanted.items())
        )
        return Table(kept, self.runs, self.done)

    def distinct(self, name: str) -> list[Any]:
        """Return the values of a field, each once, in the order of the rows."""
        return list(dict.fromkeys(getattr(row, name) for row in self.rows))

    def value(self, **wanted: Any) -> Any:
        """Return the value of the only row with these fields; None if there is no row.

        Raises
        ------
        ValueError
            If several rows have these fields.
        """
        found = self.where(**wanted).rows
        if len(found) > 1:
            raise ValueError(f"{len(found)} rows with {wanted}; one was expected")
        return found[0].value if found else None

    def curve(self, **wanted: Any) -> list[Row]:
        """Return the rows with these fields that have a place, in its order."""
        found = [row for row in self.where(**wanted) if row.at is not None]
        return sorted(found, key=lambda row: row.at or 0.0)

    def sentences(self, quantity: str) -> list[str]:
        """Return the sentences of a quantity, each with its case and contender."""
        return [
            ", ".join(filter(None, (row.case, row.contender))) + f": {row.value}"
            for row in self.rows
            if row.quantity == quantity
        ]

    @property
    def faults(self) -> list[str]:
        """The sentences of the rows "fault"."""
        return self.sentences("fault")

    @property
    def measured(self) -> list[Run]:
        """The runs that measured these rows, the newest last; pictures may be of others."""
        used = {row.run for row in self.rows if row.quantity != "picture"}
        runs = [run for name, run in self.runs.items() if name in used]
        return sorted(runs, key=lambda run: run.created)

    @property
    def newest(self) -> Run | None:
        """The last of `measured`."""
        return next(reversed(self.measured), None)

    @property
    def cores_of_other_programs(self) -> float | None:
        """Cores that were kept busy meanwhile, in the worst case; None: unknown."""
        found = [done.cores_of_other_programs for done in self.done.values()]
        return max((cores for cores in found if cores is not None), default=None)


def added_up(rows: Iterable[Row]) -> list[Row]:
    """Return the rows of studies that go on with all of a run that add up in one.

    Texts and rows with a place stay as they are.
    """
    whole: dict[Any, Row] = {}
    for row in rows:
        key: Any = (row.run, row.case, row.contender, row.quantity, row.unit)
        if row.at is not None or not isinstance(row.value, int | float):
            key = len(whole)
        elif key in whole:
            both = whole[key].value, row.value
            total = max(both) if row.quantity == LARGEST else sum(both)  # type: ignore
            row = replace(row, value=total)
        whole[key] = row
    return list(whole.values())


def joined(tables: Iterable[Table]) -> Table:
    """Return the rows of several tables as one."""
    every: Sequence[Table] = tuple(tables)
    return Table(
        tuple(row for table in every for row in table.rows),
        {name: run for table in every for name, run in table.runs.items()},
        {name: done for table in every for name, done in table.done.items()},
    )
