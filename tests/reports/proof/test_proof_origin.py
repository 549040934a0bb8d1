"""The page "proof" with records of another day: they must not pass for today's."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import proof_samples as sample
import pytest

from mitsuba_ref.mutations.defects.catalogue import CATALOGUE
from mitsuba_ref.mutations.rungs import CLIMBED
from reports.proof_page.mutation_table import mutation_table
from reports.proof_page.origin import left_out
from reports.proof_page.page import proof_page
from reports.proof_page.sentences import headlines

OTHER = "Measured at another commit: fedcba9"
OLDER = "(measured at another commit)"


def with_commit(commit: str, content: dict[str, Any]) -> dict[str, Any]:
    return {**content, "commit": commit, "created": "2026-01-01T00:00:00Z"}


@pytest.mark.parametrize(
    ("commit", "said", "other"),
    [
        ("0123abc", "Measured at the commit of the scenes, 0123abc", False),
        ("fedcba9", OTHER, True),
        ("fedcba9-dirty", OTHER + "-dirty", True),
        ("0123abc-dirty", "with changes that no commit holds", False),
        ("unknown", "Of which commit this is, or the scenes, is unknown", False),
    ],
)
def test_a_record_says_of_which_commit_it_is(
    tmp_path: Path, commit: str, said: str, other: bool
) -> None:
    """The scenes are of 0123abc."""
    record = sample.record(
        tmp_path,
        matrix=with_commit(commit, sample.matrix()),
        false_alarms=with_commit(commit, sample.alarms()),
    )
    page = proof_page(record, tmp_path)
    assert page.count(said) == 2
    assert page.count(f"<strong>{said}") == 2 * other
    assert headlines(record)[2].count(OLDER) == 2 * other
    assert ("the matrix has no hole" in page) == (not other)


def test_a_part_of_the_matrix_is_called_one(tmp_path: Path) -> None:
    """An interrupted run, or one of before the newest mutations."""
    names = [mutation.name for mutation in CATALOGUE]
    for rows, missing in ((names[3:], 3), (names, 0)):
        matrix = sample.matrix(
            *[sample.mutation(n, sample.seen("replay", True)) for n in rows]
        )
        record = sample.record(tmp_path, matrix=matrix)
        assert record.matrix is not None
        assert left_out(record.matrix) == missing
        page = proof_page(record, tmp_path)
        assert (
            "3 of today&#39;s mutations are not in it" in page
            or "3 of today's mutations are not in it" in page
        ) == bool(missing)


def test_the_ladder_has_its_columns_and_its_lowest_broken_rung(tmp_path: Path) -> None:
    """Replay is first and takes 2.5 s; of the ladder "tiles" breaks first, after 4 s."""
    climbed = [
        sample.seen(name, name in CLIMBED[5:7], spp=32, seeds=8, seconds=k - 1.0)
        for k, name in enumerate(CLIMBED)
    ]
    row = sample.mutation("a", sample.seen("replay", True, spp=1), *climbed)
    record = sample.record(tmp_path, matrix=sample.matrix(row))
    assert record.matrix is not None
    table = mutation_table(record.matrix.rows)
    assert table.columns == ("replay", *CLIMBED)
    assert table.ladder == CLIMBED
    [drawn] = table.harmful
    assert (drawn.first.name, drawn.climbed.name) == ("replay", "ladder: tiles")
    page = proof_page(record, tmp_path)
    assert drawn.ladder.text == "✓ seen: tiles"
    assert page.count(">✓ seen: tiles</td>") == 1
    assert page.count('<th scope="col">noise-free mse</th>') == 1
    table_of_rungs = page[page.index("Lowest broken rung") :]
    table_of_rungs = table_of_rungs[: table_of_rungs.index("</table>")]
    said = re.findall(r">(no|✓ seen)</td>", table_of_rungs)
    assert said == ["no"] * 5 + ["✓ seen"] * 2 + ["no"] * 3
    assert '<td class="num">32 \N{MULTIPLICATION SIGN} 8</td>' in page
    assert "<dt>a, ladder: tiles</dt><dd>what ladder: tiles found" in page


def test_a_matrix_of_before_the_ladder_is_still_drawn(tmp_path: Path) -> None:
    record = sample.record(tmp_path)
    page = proof_page(record, tmp_path)
    assert "Lowest broken rung" not in page
