"""Rays against boxes: 0 times infinity, and a margin that is too small."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from reports.limits.row import Row
from reports.limits.vectors import directions, single, unit

RAYS = 8192
MARGIN = 2.0 * 3.0 * 2.0**-24 / (1.0 - 3.0 * 2.0**-24)  # 2 gamma(3): three roundings
LAST_PLACE = 2.0**-23  # of a float32 just above 1

Floats = NDArray[np.float32]


def _enters(origin: Floats, direction: Floats, margin: float, nan_is_inside: bool) -> float:
    """Return the share of rays that the slab test lets into the unit cube.

    The far ends are 1 + margin times as far [Ize2013].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.float32(1) / direction
        a, b = (np.float32(0) - origin) * inverse, (np.float32(1) - origin) * inverse
    far_end = np.float32(1.0 + margin)
    if nan_is_inside:  # which end is nearer goes by the sign, and NaN is passed over
        backwards = np.signbit(inverse)
        enter = np.fmax.reduce(np.where(backwards, b, a), axis=1)
        leave = np.fmin.reduce(np.where(backwards, a, b) * far_end, axis=1)
    else:
        enter = np.minimum(a, b).max(axis=1)
        leave = (np.maximum(a, b) * far_end).min(axis=1)
    return float(np.mean(np.fmax(enter, 0.0) <= leave))


def _rays_in_faces(zeros: int) -> tuple[Floats, Floats]:
    """Return rays that run in a face of the cube, with so many components 0 or -0."""
    rng = np.random.default_rng(13)
    direction = single(directions(RAYS, rng))
    origin = single(rng.uniform(0.25, 0.75, (RAYS, 3)) - direction)
    axes = rng.permuted(np.tile(np.arange(3), (RAYS, 1)), axis=1)[:, :zeros]
    rows = np.arange(RAYS)[:, None]
    direction[rows, axes] = np.where(rng.random(axes.shape) < 0.5, 0.0, -0.0)
    origin[rows, axes] = rng.integers(0, 2, axes.shape)
    return origin, direction


def _lost_in_faces(zeros: float, nan_is_inside: bool) -> float:
    return 1.0 - _enters(*_rays_in_faces(int(zeros)), MARGIN, nan_is_inside)


def _lost_near_edges(strength: float, margin: float) -> float:
    """Return the share lost of rays at points 1 / strength inside of the cube's edges."""
    rng = np.random.default_rng(14)
    target = rng.random((RAYS, 3))
    axes = rng.permuted(np.tile(np.arange(3), (RAYS, 1)), axis=1)[:, :2]
    # silhouette edges, seen from the outside of both faces
    side = rng.integers(0, 2, axes.shape)
    rows, inside = np.arange(RAYS)[:, None], 1.0 / strength
    target[rows, axes] = np.where(side == 0, inside, 1.0 - inside)
    away = directions(RAYS, rng)
    # over one face outwards, and over the other inwards: the ray only grazes the edge
    signs = np.where(side == 0, -1.0, 1.0) * (1.0, -1.0)
    away[rows, axes] = np.abs(away[rows, axes]) * signs
    away = unit(away)
    origin = single(target + 3.0 * away)
    direction = single(unit(target - origin))
    return 1.0 - _enters(origin, direction, margin, True)


def _lost_by_margin(missing: float) -> float:
    """Return the share lost at edges by a margin of two last places less so many."""
    return _lost_near_edges(1e10, (2.0 - missing) * LAST_PLACE)


_NEAR = (1e1, 1e3, 1e5, 1e6, 1e7)

ROWS = (
    Row(
        name="slabs-zero-times-infinity",
        method="Slab test whose NaN reaches the comparison",
        stress="components of the direction that are 0 or -0",
        measure=functools.partial(_lost_in_faces, nan_is_inside=False),
        quantity="error",
        unit="of rays in a face that miss the box",
        strengths=(0.0, 1.0, 2.0),
        tolerance=0.0,
        holds_at=0.0,
        fails_at=1.0,
        why="0 * inf is NaN, and no comparison with NaN is true.",
        instead="An order of comparisons that passes over NaN: the next row.",
        source="[Williams2005]; measured here",
    ),
    Row(
        name="slabs-nan-passed-over",
        method="Slab test that passes over NaN",
        stress="components of the direction that are 0 or -0",
        measure=functools.partial(_lost_in_faces, nan_is_inside=True),
        quantity="error",
        unit="of rays in a face that miss the box",
        strengths=(0.0, 1.0, 2.0),
        tolerance=0.0,
        holds_at=2.0,
        fails_at=None,
        why="A ray in a face counts as inside of that slab: boxes are closed.",
        instead="Nothing.",
        source="[Williams2005]; measured here",
    ),
    Row(
        name="slabs-without-margin",
        method="Slab test in float32, no margin",
        stress="size of the box / distance of the ray from its edge",
        measure=functools.partial(_lost_near_edges, margin=0.0),
        quantity="error",
        unit="of rays through the box that miss it",
        strengths=_NEAR,
        tolerance=0.0,
        holds_at=1e5,
        fails_at=1e7,
        why="Both ends of an interval are rounded, and where the ray is near an edge they "
        "change places.",
        instead="Widen the far end by 2 gamma(3): the next row.",
        source="[Ize2013]; measured here",
    ),
    Row(
        name="slabs-with-margin",
        method="Slab test with the far ends 1 + 2 gamma(3) farther",
        stress="size of the box / distance of the ray from its edge",
        measure=functools.partial(_lost_near_edges, margin=MARGIN),
        quantity="error",
        unit="of rays through the box that miss it",
        strengths=_NEAR,
        tolerance=0.0,
        holds_at=1e7,
        fails_at=None,
        why="The margin covers the rounding of both ends.",
        instead="Nothing; it lets in a few rays more.",
        source="[Ize2013]; measured here",
    ),
    Row(
        name="slabs-margin-too-small",
        method="Slab test with a smaller margin",
        stress="last places missing of a margin of two",
        measure=_lost_by_margin,
        quantity="error",
        unit="of rays through an edge of the box that miss it",
        strengths=(0.0, 1.0, 2.0),
        tolerance=0.0,
        holds_at=0.0,
        fails_at=1.0,
        why="One last place is less than what three roundings can do to two ends.",
        instead="Two, or 2 gamma(3), which is three.",
        source="[Ize2013]; measured here",
    ),
)
