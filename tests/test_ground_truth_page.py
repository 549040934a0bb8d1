"""docs/ground_truth.md names tests that exist, and leaves no row out."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parent
PAGE = (TESTS.parent / "docs" / "ground_truth.md").read_text(encoding="utf-8")


def test_every_test_that_the_page_names_exists():
    """A renamed or deleted test would leave a row without its proof."""
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", PAGE)
    assert len(named) > 50
    missing = [
        f"{file}::{name}"
        for file, name in named
        if not re.search(rf"^def {name}\(", (TESTS / file).read_text("utf-8"), re.MULTILINE)
    ]
    assert not missing


def test_every_row_has_a_test_or_a_reason():
    """A to T, each in the first table or in that of the impossible ones."""
    rows = set(re.findall(r"^\| ([A-T]) \|", PAGE, flags=re.MULTILINE))
    assert rows == set("ABCDEFGHIJKLMNOPQRST")
