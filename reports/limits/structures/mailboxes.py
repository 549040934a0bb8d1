"""One triangle in many cells: how often it is tested."""

from __future__ import annotations

import functools

import numpy as np

from renderer.kernels.records.batch import PRIMITIVES
from reports.accelerator_trials.rays import in_batches
from reports.limits.row import Row
from reports.limits.structures.work import counted, soup_mesh

RAYS = 256


def _tests(cells: float, name: str) -> float:
    """Return how many triangles a ray tests that stays within rounding of a large one.

    Dust far above the triangle gives the grid about so many cells a side.
    """
    n = int(cells) ** 3
    rng = np.random.default_rng(30)
    large = np.array([[(-1.0, -1.0, -1.0), (1.0, -1.0, -1.0), (0.0, 1.0, -1.0)]])
    dust = rng.uniform(-1.0, 1.0, (n // 4, 1, 3)) * (1.0, 1.0, 0.05) + (0.0, 0.0, 0.95)
    corners = np.concatenate((large, dust + 1e-4 * rng.uniform(-1, 1, (n // 4, 3, 3))))
    y = rng.uniform(-0.9, 0.0, RAYS)
    origin = np.stack((np.full(RAYS, -1.5), y, np.full(RAYS, -0.9999)), axis=1)
    direction = np.broadcast_to((1.0, 0.0, 0.0), (RAYS, 3))
    rays = in_batches(origin, direction, np.inf)
    return float(counted(name, soup_mesh(corners), rays)[PRIMITIVES].mean())


def _row(name: str, method: str, fails_at: float | None, why: str) -> Row:
    return Row(
        name=f"mailboxes-{name}",
        method=method,
        stress="cells along the ray that hold the same large triangle, about",
        measure=functools.partial(_tests, name=name),
        quantity="cost",
        unit="triangle tests a ray",
        strengths=(2.0, 4.0, 8.0, 16.0, 32.0),
        tolerance=3.0,  # between the 2 tests at 2 cells and the 16 at 16
        holds_at=32.0 if fails_at is None else 2.0,
        fails_at=fails_at,
        why=why,
        instead="Nothing." if fails_at is None else "Mailboxes: the next row.",
        source="[Amanatides1987]; measured here",
    )


ROWS = (
    _row(
        "grid-without-mailboxes",
        "Uniform grid without mailboxes",
        16.0,
        "Each cell has the triangle in its list, and each tests it.",
    ),
    _row(
        "grid",
        "Uniform grid with mailboxes",
        None,
        "A ray remembers what it tested.",
    ),
)
