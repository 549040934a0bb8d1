"""docs/ground_truth.md names tests that exist, and leaves no row out."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
PAGE = (TESTS.parent / "docs" / "ground_truth.md").read_text(encoding="utf-8")

IMPOSSIBLE = ["F", "K", "N", "O", "Q"]  # of F and K a part


def text_of(file):
    """Return the text of a file of tests, in whatever room it lies; "" of none."""
    return "".join(path.read_text(encoding="utf-8") for path in TESTS.rglob(file))


def test_every_test_that_the_page_names_exists():
    """A renamed or deleted test would leave a row without its proof."""
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", PAGE)
    assert len(named) > 50
    missing = [
        f"{file}::{name}"
        for file, name in named
        if not re.search(rf"^def {name}\(", text_of(file), re.MULTILINE)
    ]
    assert not missing


def rows_of(heading):
    """Return the rows of the table under a heading: letter and cells."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^\| ([A-T]) \| (.+) \|$", section, flags=re.MULTILINE)


def test_every_row_has_a_test():
    """A row of the first table is a promise: it names what keeps it."""
    without = [
        (letter, cells.split(" | ")[0])
        for letter, cells in rows_of("The rows")
        if not re.search(r"`test_\w+\.py::test_\w+`", cells)
    ]
    assert not without


def test_only_these_rows_are_impossible():
    """No row can be dropped by moving it to the second table."""
    assert [letter for letter, _ in rows_of("Rows that are impossible here")] == IMPOSSIBLE
    tested = {letter for letter, _ in rows_of("The rows")}
    assert tested == set("ABCDEFGHIJKLMNOPQRST") - {"N", "O", "Q"}
