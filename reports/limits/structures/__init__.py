"""Structures: scenes that an accelerator was not made for, in counts."""

from reports.limits.structures import (
    coherence,
    deep,
    every,
    mailboxes,
    moving,
    overlap,
    stadium,
    volumes,
    walls,
)

ROWS = (
    *every.ROWS,
    *stadium.ROWS,
    *walls.ROWS,
    *overlap.ROWS,
    *deep.ROWS,
    *mailboxes.ROWS,
    *coherence.ROWS,
    *moving.ROWS,
    *volumes.ROWS,
)
