"""The atlas: the rows of all chapters. A chapter is one line."""

from __future__ import annotations

from typing import NamedTuple

from reports.limits import comparing, light_transport, numbers, structures
from reports.limits.row import Row


class Chapter(NamedTuple):
    """Rows that belong together."""

    name: str
    title: str
    rows: tuple[Row, ...]


CHAPTERS = (
    Chapter("numbers", "Numbers: what float32 loses", numbers.ROWS),
    Chapter(
        "structures",
        "Structures: scenes that an accelerator was not made for",
        structures.ROWS,
    ),
    Chapter(
        "light", "Light: paths that are not found, or too seldom", light_transport.ROWS
    ),
    Chapter(
        "comparing",
        "Comparing: pictures that cannot be told apart, or should not be",
        comparing.ROWS,
    ),
)
ATLAS = tuple(row for chapter in CHAPTERS for row in chapter.rows)
