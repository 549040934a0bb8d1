"""Light transport: what path tracing cannot find, and what its samples are worth.

`one_point` measures; each of the other files is a family of methods and its rows.
"""

from reports.limits.light_transport import (
    caustics,
    depth,
    many_lamps,
    near_lamps,
    random_numbers,
    shading_normals,
    strategies,
)
from reports.limits.row import Row

ROWS: tuple[Row, ...] = (
    *caustics.ROWS,
    *many_lamps.ROWS,
    *strategies.ROWS,
    *depth.ROWS,
    *shading_normals.ROWS,
    *near_lamps.ROWS,
    *random_numbers.ROWS,
)
