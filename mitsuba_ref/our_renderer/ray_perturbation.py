"""A small change of one step of a path, to see what depends on it."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_ref.our_renderer.traced_path import BLACK, Vector


@dataclass(frozen=True)
class Moved:
    """Offsets that are added to one ray of a path, and to its hit."""

    segment: int  # 0: the camera ray
    by: Vector = BLACK  # added to the ray's unit direction: of the ray's length
    start: Vector = BLACK  # added to where the ray starts
    hit: Vector = BLACK  # added to the point that it hits, before that is shaded
    numbers: tuple[float, float] = (0.0, 0.0)  # to random numbers there, in turn
