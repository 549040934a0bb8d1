"""How busy other programs kept the machine while this process measured.

The load average does not tell: it also counts what this command itself did a minute ago.
So the processor time of this process and its descendants is taken off that of the machine.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

KEY = "cores_of_other_programs"
"""Of a record's machine: cores that other programs kept busy, on average."""

LOAD = "load_average_before"
"""What files of older versions tell instead: of the minute before they began."""

BUSY = 0.1
"""Part of the cores from which on the seconds of a record are called rough."""

PROC = Path("/proc")


class _Times(NamedTuple):
    """Since any moment on, in seconds; of the processor over all cores."""

    clock: float
    machine: float
    own: float  # of this process, its descendants, and those of them that have ended


class BusyClock:
    """Measures how busy other programs keep the machine from now on."""

    def __init__(self) -> None:
        self._begin = _times()

    def others(self) -> float | None:
        """Return how many cores other programs kept busy since the clock was made.

        Time that a hypervisor gave to other machines counts as theirs. None where there is
        no /proc that tells, as outside of Linux.
        """
        now, begin = _times(), self._begin
        if begin is None or now is None or now.clock <= begin.clock:
            return None
        others = (now.machine - begin.machine) - (now.own - begin.own)
        return round(max(0.0, others) / (now.clock - begin.clock), 2)


def cores_of_other_programs() -> float | None:
    """Return how many cores other programs kept busy since this module was imported."""
    return _SINCE_IMPORT.others()


def busy_sentence(machine: Mapping[str, Any]) -> str:
    """Return a warning if a record's machine was busy with something else; else nothing.

    Parameters
    ----------
    machine
        From `describe_machine`, perhaps out of an older file that does not tell.
    """
    cores, load = (machine.get(key) for key in ("cores", LOAD))
    others = machine.get(KEY, load)
    if not isinstance(others, int | float) or not isinstance(cores, int | float):
        return ""
    if others <= BUSY * cores:
        return ""
    what = f"The machine was busy: other programs took {others:.2g} of its {cores} cores"
    if KEY not in machine:  # it may have been an earlier command of ours
        what = f"The machine may have been busy: its load was {others:.2g} at the beginning"
    return f"{what}. Seconds may be too long; ratios and counts are better than they."


def _times() -> _Times | None:
    try:
        ticks = os.sysconf("SC_CLK_TCK")
        user, nice, system, _, _, *interrupts = _numbers(
            (PROC / "stat").read_text().splitlines()[0].split()[1:9]
        )
        machine = user + nice + system + sum(interrupts)
        return _Times(time.monotonic(), machine / ticks, _own_ticks() / ticks)
    except (OSError, ValueError, IndexError, AttributeError):
        return None


def _own_ticks() -> int:
    """Return the ticks of this process and of all that descend from it."""
    children: dict[int, list[int]] = {}
    ticks: dict[int, int] = {}
    for entry in PROC.glob("[0-9]*/stat"):
        try:
            # a program's name may hold blanks and parentheses
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        pid = int(entry.parent.name)
        children.setdefault(int(fields[1]), []).append(pid)
        ticks[pid] = sum(_numbers(fields[11:15]))  # user, system, both of ended children
    total, waiting = 0, [os.getpid()]
    while waiting:
        pid = waiting.pop()
        total += ticks.get(pid, 0)
        waiting += children.get(pid, [])
    return total


def _numbers(words: list[str]) -> list[int]:
    return [int(word) for word in words]


_SINCE_IMPORT = BusyClock()
