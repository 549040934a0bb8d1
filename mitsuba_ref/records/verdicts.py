"""What can be said about a scene in the end, and the exit status for each answer."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

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


VERDICTS: dict[Verdict, VerdictFacts] = {
    "fail": VerdictFacts(
        1,
        "the pictures differ by more than noise explains",
        "look at the signed difference in the report",
    ),
    "not-finite": VerdictFacts(
        3,
        "a picture holds NaN or Inf, so nothing was measured",
        "look at the named pixel; the report paints such pixels magenta",
    ),
    "size-mismatch": VerdictFacts(
        4,
        "the pictures differ in size or in channels, or are empty",
        "check the film's size, crop window and pixel format",
    ),
    "broken": VerdictFacts(
        5,
        "a bug on our side, or a disk that cannot be written",
        "please report it with the scene file",
    ),
    "mitsuba-crashed": VerdictFacts(
        6,
        "Mitsuba's process ended without an answer",
        "run it again, and if it stays, give the file to Mitsuba alone",
    ),
    "mitsuba-timeout": VerdictFacts(
        7,
        "Mitsuba was silent until the time limit and was ended",
        "give it longer with --time-limit, or less to do with --spp or --size test",
    ),
    "refused-by-us": VerdictFacts(
        8,
        "Mitsuba renders the scene, we do not",
        "take out what the sentence names, or teach it to our renderer",
    ),
    "refused-by-mitsuba": VerdictFacts(
        9,
        "we render the scene, Mitsuba does not",
        "correct the file: it is not Mitsuba's format, although we took it",
    ),
    "refused-by-both": VerdictFacts(
        10,
        "neither renders the scene",
        "correct the file",
    ),
    "bad-request": VerdictFacts(
        11,
        "not compared: proof.toml, -D or the file of --plugins cannot be used",
        "correct proof.toml, -D or the file of --plugins",
    ),
    "error": VerdictFacts(
        1,
        "not rendered; only in a results.json of an older version",
        "compare again",
    ),
    "reference-wrong": VerdictFacts(
        12,
        "the reference is known to be wrong here; with its fault undone both agree",
        "nothing is to be done here; mind that Mitsuba alone shows another picture",
    ),
    "pass": VerdictFacts(0, "the pictures agree up to noise", "nothing is to be done"),
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
