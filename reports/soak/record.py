"""What was soaked so far, soak.json: it grows from run to run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from reports.bench.without_paths import without_paths
from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json, write_json

SCHEMA = 1
FILE = "soak.json"
FAULTS_KEPT = 40  # sentences; all are counted


@dataclass(frozen=True)
class Step:
    """What one step of a trial did; steps are added up."""

    done: int  # in the trial's unit
    counts: Mapping[str, int] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()  # one sentence each
    curve: tuple[float, ...] = ()  # takes the place of the one before, if there is any


@dataclass(frozen=True)
class Session:
    """One run of the command, as far as it concerns one trial."""

    created: str
    commit: str
    cpu: str
    done: int = 0
    faults: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class Part:
    """One trial: all sessions together."""

    done: int = 0
    fault_count: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    largest: dict[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()  # the first ones
    sessions: tuple[Session, ...] = ()
    curve: tuple[float, ...] = ()

    @property
    def open_faults(self) -> int:
        """Those of the last session; a trial goes on when those before are mended."""
        return self.sessions[-1].faults if self.sessions else 0

    def begun(self, session: Session) -> Part:
        """Return the part with one more session."""
        return replace(self, sessions=(*self.sessions, session))

    def after(self, step: Step, seconds: float) -> Part:
        """Return the part with a step added to it and to its last session.

        Parameters
        ----------
        step
            What was done.
        seconds
            It took.
        """
        counts, largest = dict(self.counts), dict(self.largest)
        for name, count in step.counts.items():
            counts[name] = counts.get(name, 0) + count
        for name, value in step.largest.items():
            largest[name] = max(largest.get(name, value), value)
        last = self.sessions[-1]
        session = replace(
            last,
            done=last.done + step.done,
            faults=last.faults + len(step.faults),
            seconds=round(last.seconds + seconds, 3),
        )
        return Part(
            self.done + step.done,
            self.fault_count + len(step.faults),
            counts,
            largest,
            (*self.faults, *step.faults)[:FAULTS_KEPT],
            (*self.sessions[:-1], session),
            step.curve or self.curve,
        )


@dataclass(frozen=True, kw_only=True)
class Soak(Circumstances):
    """All trials by name; the circumstances are those of the last session."""

    parts: dict[str, Part] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """How long all sessions of all trials took."""
        parts = self.parts.values()
        return sum(session.seconds for part in parts for session in part.sessions)

    @property
    def fault_count(self) -> int:
        """The faults of all trials, those mended since included."""
        return sum(part.fault_count for part in self.parts.values())

    @property
    def open_faults(self) -> int:
        """The faults of the last session of each trial."""
        return sum(part.open_faults for part in self.parts.values())


def read_soak(path: Path) -> Soak:
    """Read soak.json; raise ReportError for what is wrong, and where."""
    return read_json(path, Soak, SCHEMA)


def write_soak(path: Path, soak: Soak) -> None:
    """Write soak.json in one step, without the paths of this machine in its texts."""
    write_json(path, without_paths(msgspec.to_builtins(soak)), SCHEMA)
