"""Says of which state of the source a record beside the results is, and how much of it.

`make proof` measures the scenes and the register. The mutation matrix and the study of
false alarms take long: the page shows those that were measured last, and must not let them
pass for today's.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from mitsuba_ref.mutations.defects.catalogue import CATALOGUE
from mitsuba_ref.records.results import Results
from reports.proof_page.record import Matrix
from reports.records.circumstances import Circumstances

UNKNOWN, CHANGED = "unknown", "-dirty"


@dataclass(frozen=True)
class Origin:
    """Where a record comes from, seen from the results on the same page."""

    sentence: str
    other: bool  # surely another commit


def origin(made: Circumstances, results: Results) -> Origin:
    """Compare the commit of a record with that of the results."""
    here, there = results.commit, made.commit
    when = f", {made.created}" if made.created else ""
    if UNKNOWN in (here, there) or not there:
        return Origin(f"Of which commit this is, or the scenes, is unknown{when}.", False)
    if there.removesuffix(CHANGED) != here.removesuffix(CHANGED):
        return Origin(
            f"Measured at another commit: {there}{when}. The scenes on this page are of "
            f"{here}.",
            True,
        )
    if there.endswith(CHANGED) or here.endswith(CHANGED):
        return Origin(
            f"Measured at {there}{when}, the scenes at {here}: with changes that no commit "
            "holds, so that these may not be the same ones.",
            False,
        )
    return Origin(f"Measured at the commit of the scenes, {there}{when}.", False)


def left_out(matrix: Matrix) -> int:
    """Return how many of today's mutations a matrix does not have."""
    there = {row.mutation for row in matrix.rows}
    return sum(mutation.name not in there for mutation in CATALOGUE)


def of_older_commits(matrix: Matrix) -> dict[str, int]:
    """Return how many rows of a matrix that went on from another are of which commit."""
    commits = (row.commit for row in matrix.rows)
    return dict(Counter(one for one in commits if one and one != matrix.commit))
