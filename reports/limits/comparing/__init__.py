"""Comparing pictures: when two right ones differ, and when a wrong one looks right.

Each file is a family of methods and its rows.
"""

from reports.limits.comparing import (
    coincident_surfaces,
    heavy_tails,
    metrics_and_defects,
)
from reports.limits.row import Row

ROWS: tuple[Row, ...] = (
    *coincident_surfaces.ROWS,
    *heavy_tails.ROWS,
    *metrics_and_defects.ROWS,
)
