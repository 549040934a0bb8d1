"""docs/verdicts.md says what the table of verdicts in the code says."""

from __future__ import annotations

from pathlib import Path

from mitsuba_ref.records.verdicts import CURRENT, VERDICTS

PAGE = Path(__file__).parents[2] / "docs" / "verdicts.md"


def test_the_page_lists_every_verdict_with_status_meaning_and_advice():
    """The rows of the one table, word by word; one without a row is not documented."""
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| ")][1:]
    written = [tuple(cell.strip() for cell in row.strip("| ").split("|")) for row in rows]
    facts = {verdict: VERDICTS[verdict] for verdict in CURRENT}
    wanted = [
        (str(known.status), verdict, known.meaning, known.advice)
        for verdict, known in facts.items()
    ]
    assert sorted(written) == sorted(wanted)
