"""Numbers: what float32 loses, and the forms that keep it."""

from reports.limits.numbers import (
    boxes,
    edges,
    far_from_origin,
    half_floats,
    offsets,
    quadratics,
    random_choice,
    small_angles,
    sums,
    triangles,
)

ROWS = (
    *offsets.ROWS,
    *far_from_origin.ROWS,
    *quadratics.ROWS,
    *triangles.ROWS,
    *edges.ROWS,
    *boxes.ROWS,
    *small_angles.ROWS,
    *sums.ROWS,
    *half_floats.ROWS,
    *random_choice.ROWS,
)
