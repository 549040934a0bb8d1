"""Bounding volumes around a rod along (1, 1, 1) that gets longer."""

from __future__ import annotations

import functools

import numpy as np

from renderer.textbook.volume_fits import VOLUMES
from reports.limits.row import Row
from reports.limits.vectors import unit

AROUND = 64  # points of each end of the rod


def _let_through(aspect: float, name: str) -> float:
    """Return the random lines that meet the volume for each that meets the rod.

    Convex bodies are met in proportion to their surface areas (Cauchy).
    """
    radius = 0.5 / aspect
    along = np.full(3, 3.0**-0.5)
    x = unit(np.array([[1.0, -1.0, 0.0]]))[0]
    turn = 2.0 * np.pi * np.arange(AROUND) / AROUND
    ring = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * np.cross(along, x)
    ends = [radius * ring + side * 0.5 * along for side in (-1.0, 1.0)]
    points = np.ascontiguousarray(np.concatenate(ends).T)
    volume = VOLUMES[name]
    area = volume.area(volume.fit(points, 0.0))
    return area / (2.0 * np.pi * radius * (radius + 1.0))


def _row(name: str, method: str, holds_at: float, fails_at: float | None, why: str) -> Row:
    return Row(
        name=f"volume-{name}",
        method=f"{method} around a diagonal rod",
        stress="length over thickness of the rod",
        measure=functools.partial(_let_through, name=name),
        quantity="cost",
        unit="rays let through for each that hits",
        strengths=(1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0),
        tolerance=4.0,
        holds_at=holds_at,
        fails_at=fails_at,
        why=why,
        instead="Nothing." if fails_at is None else "A box of the rod's own direction.",
        source="measured here; the page of accelerators has a table of volumes",
    )


ROWS = (
    _row("sphere", "Sphere", 2.0, 10.0, "Its area goes with the length squared."),
    _row("AABB", "Box of the axes", 2.0, 10.0, "The rod is the diagonal of a cube."),
    _row(
        "14-DOP",
        "14-DOP",
        5.0,
        20.0,
        "Its four slabs across diagonals hold one rod well, not its ends.",
    ),
    _row("OBB", "Oriented box", 100.0, None, "It turns with the rod."),
)
