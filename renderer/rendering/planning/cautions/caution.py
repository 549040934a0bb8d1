"""One caution, and how shapes are named in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from renderer.scene_file.description import Shape

MOST_NAMED = 3


class Caution(NamedTuple):
    """A sentence without a full stop, and where it is measured."""

    text: str
    row: str  # the name of a row of the atlas of failures

    def __str__(self) -> str:
        """Return both."""
        return f"{self.text} (atlas: {self.row})"


def name_of(shape: Shape) -> str:
    """Return a shape's id, or the line that it stands on."""
    kind = type(shape).__name__.lower()
    return repr(shape.id) if shape.id else f"the {kind} of line {shape.location.line}"


def listed(names: Sequence[str]) -> str:
    """Return the first few names, and how many more there are."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
