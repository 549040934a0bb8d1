"""The store of measurements: one append-only file of lines a study.

A line is JSON: the circumstances of a run, a row, or the end of a case. What a killed
process left of its last line is dropped when the next one writes.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from typing import Any

import msgspec

from mitsuba_ref.records.json_files import write_atomically
from reports.bench.rows import Done, Row, Run, Table, added_up
from reports.bench.without_paths import without_paths
from reports.errors import ReportError

MEASURED = Path(__file__).resolve().parents[1] / "measured"
ENDING = ".jsonl"
FILES = "picture", "file"  # quantities whose values are paths, not kept

Line = Row | Run | Done


@dataclass(frozen=True)
class Store:
    """Reads and writes measurements.

    Parameters
    ----------
    folder
        Where lines are appended.
    measured
        Where the repository keeps measurements of whole studies; they are read, too.
    """

    folder: Path
    measured: Path = MEASURED

    def append(self, study: str, lines: Iterable[Line]) -> None:
        """Append lines to the file of a study.

        Numbers that are not finite become None, and paths of this machine short.
        """
        path = self.folder / f"{study}{ENDING}"
        path.parent.mkdir(parents=True, exist_ok=True)
        text = b"".join(_encoded(line) for line in lines)
        with path.open("ab+") as file:
            end = file.seek(0, os.SEEK_END)
            file.seek(max(0, end - 1))
            if file.read(1) not in (b"", b"\n"):  # a process was killed while it wrote
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)
            file.write(text)

    def read(self, study: str) -> Table:
        """Return the rows of a study: of each case those of its newest whole run.

        A run that is not `full` counts only for a case that has no other. Rows of a case
        that was interrupted are left out.

        Raises
        ------
        ReportError
            One line: file, line, what is wrong.
        """
        return newest(self.lines(study))

    def lines(self, study: str) -> list[Line]:
        """Return the lines of both files; what the repository keeps is not read twice."""
        kept = read_lines(self.measured / f"{study}{ENDING}")
        cases = {_case_of(line) for line in kept}
        own = read_lines(self.folder / f"{study}{ENDING}")
        return [*kept, *(line for line in own if _case_of(line) not in cases)]

    def everything(self, study: str) -> Table:
        """Return all rows of a study, of all runs, also of interrupted ones."""
        lines = self.lines(study)
        return Table(
            tuple(line for line in lines if isinstance(line, Row)),
            {line.run: line for line in lines if isinstance(line, Run)},
            {line.done: line for line in lines if isinstance(line, Done)},
        )

    def keep(self, study: str, goes_on: bool = False) -> str:
        """Copy what is worth it into the repository's file; return a sentence about it.

        Kept are whole cases that are not there yet, of full runs of a commit without
        changes. Pictures and files are left out.

        Parameters
        ----------
        study
            Its name.
        goes_on
            Whether its rows add up: then those of interrupted runs are kept too, and the
            sums of each run are kept instead of its rows.

        Raises
        ------
        ReportError
            If a file cannot be read.
        """
        path = self.measured / f"{study}{ENDING}"
        there = read_lines(path)
        known = {_case_of(line) for line in there}
        own = [
            line
            for line in read_lines(self.folder / f"{study}{ENDING}")
            if _case_of(line) not in known or isinstance(line, Run)
        ]
        good = {
            line.run
            for line in own
            if isinstance(line, Run)
            and line.full
            and line.commit != "unknown"
            and not line.commit.endswith("-dirty")
        }
        ended = {(line.run, line.done) for line in own if isinstance(line, Done)}
        rows = [
            line
            for line in own
            if isinstance(line, Row)
            and line.run in good
            and (goes_on or (line.run, line.case) in ended)
            and line.quantity not in FILES
        ]
        if goes_on:
            rows = added_up(rows)
        used = {row.run for row in rows}
        runs = {line.run for line in there if isinstance(line, Run)}
        circumstances = [
            line
            for line in own
            if line.run in used
            and (line.run not in runs if isinstance(line, Run) else isinstance(line, Done))
        ]
        kept: list[Line] = [*circumstances, *rows]
        if not rows:
            return f"{study}: nothing new of a commit, measured in full"
        write_atomically(path, b"".join(map(_encoded, [*there, *kept])))
        return f"{study}: {len(rows)} rows kept"


def _case_of(line: Line) -> tuple[str, str, bool]:
    """Return the run and case of a line, and whether it names a file, which is not kept."""
    if isinstance(line, Run):
        return line.run, "", False
    if isinstance(line, Done):
        return line.run, line.done, False
    return line.run, line.case, line.quantity in FILES


def newest(lines: Iterable[Line]) -> Table:
    """Return of each case the rows of its newest whole run, full runs before quick ones.

    The repository keeps no pictures: a case without any has those of its newest run that
    made some.
    """
    every = list(lines)
    runs = {line.run: line for line in every if isinstance(line, Run)}
    best: dict[str, Done] = {}

    def rank(done: Done) -> tuple[bool, str]:
        run = runs.get(done.run)
        return (run is not None and run.full, run.created if run else "")

    for line in every:
        if isinstance(line, Done) and (
            line.done not in best or rank(line) >= rank(best[line.done])
        ):
            best[line.done] = line
    ended = {(line.done, line.run) for line in every if isinstance(line, Done)}
    rows = [row for row in every if isinstance(row, Row) and (row.case, row.run) in ended]
    chosen = {case: done.run for case, done in best.items()}
    pictured = {
        row.case: row.run
        for row in sorted(rows, key=lambda row: row.run == chosen[row.case])
        if row.quantity == "picture"
    }
    return Table(
        tuple(
            row
            for row in rows
            if row.run == (pictured if row.quantity == "picture" else chosen).get(row.case)
        ),
        runs,
        best,
    )


def read_lines(path: Path) -> list[Line]:
    """Return the lines of a file, or nothing if it is not there.

    Raises
    ------
    ReportError
        One line: file, line, what is wrong.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise ReportError(f"{path}: cannot be read: {error.strerror}") from None
    whole = content[: content.rfind(b"\n") + 1]  # the rest was being written
    found = []
    for number, text in enumerate(whole.splitlines(), 1):
        try:
            found.append(_decoded(text, path.stem))
        except (ValueError, msgspec.ValidationError) as error:
            raise ReportError(f"{path}:{number}: {error}") from None
    return found


def _decoded(text: bytes, study: str) -> Line:
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError(f"expected an object, found {text[:40].decode(errors='replace')}")
    if "created" in content:
        return msgspec.convert(content, Run)
    if "done" in content:
        return msgspec.convert(content, Done)
    return msgspec.convert({**content, "study": study}, Row)


def _encoded(line: Line) -> bytes:
    """Return a line without the fields that have their defaults, and without the study.

    The file's name is that of the study.
    """
    if isinstance(line, Row):
        line = replace(line, study="")
        if isinstance(line.value, float | int):
            line = replace(line, value=finite(line.value))
        if line.interval and not all(map(math.isfinite, line.interval)):
            line = replace(line, interval=None)
    content: dict[str, Any] = without_paths(msgspec.to_builtins(line))
    required = {f.name for f in fields(line) if f.default is MISSING}
    left = {k: v for k, v in content.items() if k in required or not _is_default(v)}
    text = json.dumps(left, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode() + b"\n"


def _is_default(value: Any) -> bool:
    # 0.0 is a place on an axis, and equal to False
    return value is None or value is False or value in ("", {})


def finite(value: float) -> float | None:
    """Return the number as a float of Python, or None if it is not finite."""
    return float(value) if math.isfinite(value) else None
