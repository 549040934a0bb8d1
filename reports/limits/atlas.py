"""The atlas: the rows of all chapters. A chapter is one line."""

from __future__ import annotations

from reports.limits import comparing, light_transport, numbers, structures
from reports.limits.row import Row

ATLAS: tuple[Row, ...] = (
    *numbers.ROWS,
    *structures.ROWS,
    *light_transport.ROWS,
    *comparing.ROWS,
)
