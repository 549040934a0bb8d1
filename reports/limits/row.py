"""A row of the atlas: one method under one stress, and the place where it gives way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import NDArray

Quantity = Literal["error", "cost"]


@dataclass(frozen=True)
class Row:
    """One method under one stress. Strengths grow from harmless to harmful.

    `measure` is deterministic: random numbers in it have fixed seeds. What it returns is
    within `tolerance` up to the strength `holds_at`, and beyond it from `fails_at` on; the
    place where the method gives way lies between them. A method without a limit inside of
    `strengths`, the stable one beside the naive, has no `fails_at`, and is within
    `tolerance` at all of them.
    """

    name: str  # "sphere-naive-distance": the anchor on the page, and what warnings refer to
    method: str  # "Sphere, textbook quadratic"
    stress: str  # "distance over radius"
    measure: Callable[[float], float]
    quantity: Quantity
    unit: str  # of what is measured: "of rays missed", "box tests a ray"
    strengths: tuple[float, ...]  # of the curve on the page
    tolerance: float
    holds_at: float
    fails_at: float | None
    why: str  # one sentence
    instead: str  # one sentence
    source: str  # paper and section, or "measured here"
    picture: Callable[[], NDArray[Any]] | None = None  # (height, width, 3), sRGB bytes
    slow: bool = False  # more than a second for both sides of the boundary
    caption: str = ""  # what the picture shows


@dataclass(frozen=True)
class Sides:
    """What was measured on both sides of a row's boundary."""

    row: Row
    before: float
    behind: float | None

    @property
    def holds_before(self) -> bool:
        """Whether the method keeps its tolerance where the row says so."""
        return math.isfinite(self.before) and self.before <= self.row.tolerance

    @property
    def fails_behind(self) -> bool:
        """Whether it leaves it where the row says so; an alarm if not."""
        return self.behind is None or not self.behind <= self.row.tolerance


def measure_sides(row: Row) -> Sides:
    """Measure a row just before its boundary and just behind it."""
    behind = None if row.fails_at is None else row.measure(row.fails_at)
    return Sides(row, row.measure(row.holds_at), behind)
