"""The atlas: the rows of all chapters. A chapter is one line."""

from __future__ import annotations

from reports.limits import numbers, structures
from reports.limits.row import Row

ATLAS: tuple[Row, ...] = (
    *numbers.ROWS,
    *structures.ROWS,
)
