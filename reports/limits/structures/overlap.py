"""Primitives that no structure can part: at one place, in a line, long and diagonal."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from reports.accelerator_trials.rays import RayBatches, in_batches
from reports.limits.row import Row
from reports.limits.structures.work import UNIT, soup_mesh, work_of_a_ray
from reports.limits.vectors import directions, unit

RAYS = 256
Corners = NDArray[np.float64]  # (n, 3 corners, 3)

NAMES = {
    "bvh": "BVH by surface area",
    "kd-sah": "k-d tree by surface area",
    "grid": "Uniform grid",
    "octree": "Octree",
}


def _at(targets: Corners, seed: int) -> RayBatches:
    """Return rays at points (n, 3) from all sides, 3 away."""
    rng = np.random.default_rng(seed)
    target = targets[rng.integers(0, len(targets), RAYS)]
    away = directions(RAYS, rng)
    return in_batches(target + 3.0 * away, -away, np.inf)


# ------------------------------------------------------------------------- coincident


def _coincident(count: float, name: str) -> float:
    """Return the work of rays at `count` triangles at one place, others around them."""
    rng = np.random.default_rng(20)
    one = 0.1 * rng.uniform(-1.0, 1.0, (1, 3, 3))
    around = rng.uniform(-1.0, 1.0, (64, 1, 3)) + 0.1 * rng.uniform(-1, 1, (64, 3, 3))
    corners = np.concatenate((np.repeat(one, int(count), axis=0), around))
    return work_of_a_ray(name, soup_mesh(corners), _at(one.mean(axis=1), 21))


# ----------------------------------------------------------------------------- a line


def _line(count: float, name: str) -> float:
    """Return the work of rays at a diagonal row of `count` small triangles."""
    n = int(count)
    rng = np.random.default_rng(22)
    place = np.linspace(-1.0, 1.0, n)[:, None, None] * np.ones(3)
    corners = place + (1.0 / n) * rng.uniform(-1.0, 1.0, (n, 3, 3))
    return work_of_a_ray(name, soup_mesh(corners), _at(corners.mean(axis=1), 23))


# ---------------------------------------------------------------------------- needles

NEEDLES = 1000


def _needles(length: float, name: str) -> float:
    """Return the work of rays through needles, `length` times their mean spacing long."""
    rng = np.random.default_rng(24)
    spacing = NEEDLES ** (-1.0 / 3.0)
    middle = rng.random((NEEDLES, 3))
    # diagonal, so that boxes of the axes fit them worst
    signs = rng.choice((-1.0, 1.0), (NEEDLES, 3))
    along = unit(signs + 0.2 * rng.standard_normal((NEEDLES, 3)))
    across = unit(np.cross(along, directions(NEEDLES, rng)))
    half = 0.5 * length * spacing * along
    corners = np.stack((middle - half, middle + half, middle + 0.02 * spacing * across), 1)
    return work_of_a_ray(name, soup_mesh(corners), _at(middle, 25))


# ------------------------------------------------------------------------------- rows


def _rows(
    title: str,
    what: str,
    stress: str,
    measure: Callable[..., float],
    strengths: tuple[float, ...],
    limits: dict[str, tuple[float, float | None, str]],
    instead: str,
) -> Iterator[Row]:
    """Yield a row for each structure; `limits` are (holds_at, fails_at, why) by name."""
    for name, (holds_at, fails_at, why) in limits.items():
        yield Row(
            name=f"{title}-{name}",
            method=f"{NAMES[name]}, {what}",
            stress=stress,
            measure=functools.partial(measure, name=name),
            quantity="cost",
            unit=UNIT,
            strengths=strengths,
            tolerance=300.0,
            holds_at=holds_at,
            fails_at=fails_at,
            why=why,
            instead="Nothing." if fails_at is None else instead,
            source="measured here",
            slow=max(holds_at, fails_at or 0.0) >= 1e6,  # seconds for building
        )


_SAME = "Copies at one place have one box, so that no cut parts them: each ray tests all."
_PARTED = "Cuts go where the triangles are, however little of the space that is."
_BOXES = "The box of a diagonal needle is a cube as long as it, and all cubes overlap."
_CELLS = "A diagonal needle is in many cells, and each cell holds many of them."

ROWS = (
    *_rows(
        "coincident",
        "copies at one place",
        "copies",
        _coincident,
        (1e0, 1e1, 1e2, 1e3, 1e4, 1e5),
        dict.fromkeys(NAMES, (100.0, 1000.0, _SAME)),
        "Leave out what is there twice before the scene is built.",
    ),
    *_rows(
        "line",
        "a diagonal row",
        "triangles in the row",
        _line,
        (1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
        {
            "bvh": (1e6, None, _PARTED),
            "kd-sah": (
                1e5,
                1e6,
                "Each piece takes cuts that part off empty corners before one that halves "
                "it, and at a depth of 8 + 1.3 log2 n all of them still hold hundreds.",
            ),
            "octree": (1e6, None, _PARTED),
            "grid": (
                1e3,
                1e5,
                "n cells are n^(1/3) a side, and the row is in as few: n^(2/3) triangles "
                "in each.",
            ),
        },
        "A BVH or an octree: the rows beside.",
    ),
    *_rows(
        "needles",
        f"{NEEDLES} diagonal needles",
        "length of a needle over the mean distance of needles",
        _needles,
        (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0),
        {
            "bvh": (3.0, 10.0, _BOXES),
            "kd-sah": (3.0, 10.0, _CELLS),
            "octree": (3.0, 10.0, _CELLS),
            "grid": (3.0, 10.0, _CELLS),
        },
        "Cut needles up, or bound them by boxes of their own direction.",
    ),
)
