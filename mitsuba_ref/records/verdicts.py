"""What can be said about a scene in the end, and the exit status for each answer."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

Verdict = Literal[
    "fail",
    "not-finite",
    "size-mismatch",
    "broken",
    "mitsuba-crashed",
    "mitsuba-timeout",
    "refused-by-us",
    "refused-by-mitsuba",
    "refused-by-both",
    "bad-request",
    "error",
    "reference-wrong",
    "pass",
]


@dataclass(frozen=True)
class VerdictFacts:
    """What stands behind a verdict."""

    status: int  # of `python -m mitsuba_ref`; 2 is a wrong command line, 130 is Ctrl-C
    meaning: str
    advice: str  # what can be done


_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
VERDICTS: dict[Verdict, VerdictFacts] = {
    verdict: VerdictFacts(**_TABLE[verdict]) for verdict in get_args(Verdict)
}
"""From the most severe to the best, which is the order of the page as well."""

CURRENT = tuple(verdict for verdict in VERDICTS if verdict != "error")
"""What this version writes."""

COMPARED: tuple[Verdict, ...] = ("fail", "reference-wrong", "pass")
"""With these, numbers were measured."""


def most_severe(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the first of `VERDICTS` that is there; of none at all "broken"."""
    there = set(verdicts)
    return next((verdict for verdict in VERDICTS if verdict in there), "broken")


def exit_status(verdicts: Iterable[Verdict]) -> int:
    """Return the status of several scenes: that of the most severe verdict.

    No scene at all is no pass.
    """
    return VERDICTS[most_severe(verdicts)].status


def statuses_in_words() -> str:
    """Return one line for each status, for --help."""
    lines = [
        f"  {VERDICTS[verdict].status:3}  {verdict + ':':20}{VERDICTS[verdict].meaning}"
        for verdict in sorted(CURRENT, key=lambda verdict: VERDICTS[verdict].status)
    ]
    lines.insert(2, "    2  the command line was wrong, or the report cannot be written")
    return "\n".join([*lines, "  130  interrupted"])
