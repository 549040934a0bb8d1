"""Small triangles, needles, and triangles seen at a grazing angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.expected_failures.rounding import small_triangles_lost
from reports.accelerator_trials.meshes import displaced_icosphere, surfaces_of
from reports.limits.our_hits import nearest_hits
from reports.limits.row import Row
from reports.limits.vectors import directions, single, unit

RAYS = 4096
BALL = displaced_icosphere(2)  # 80 triangles around the origin


def _ball_scaled(size: float) -> float:
    """Return the share of rays from inside a ball of this size that pass it."""
    rng = np.random.default_rng(6)
    # a power of two changes no digit, so that only the range of float32 can matter
    size = 2.0 ** round(np.log2(size))
    origin = single(0.2 * size * directions(RAYS, rng))
    surfaces = surfaces_of(single(BALL.vertices * size), BALL.faces)
    _, prim = nearest_hits("triangles", surfaces, origin, single(directions(RAYS, rng)))
    return float(np.mean(prim < 0))


# ----------------------------------------------------------------------------- needles


def _corners(aspect: float) -> NDArray[np.float32]:
    """Return a needle of length 1 and width 1 / aspect, (3 corners, 3), somewhere."""
    rng = np.random.default_rng(7)
    along, other = directions(2, rng)
    across = unit(np.cross(along, other)[None])[0]
    corner = rng.uniform(-1.0, 1.0, 3)
    return single([corner, corner + along, corner + 0.5 * along + across / aspect])


def _rays_at_a_needle(
    corners: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return rays from a distance of 2 that aim well inside the needle."""
    rng = np.random.default_rng(8)
    weights = rng.dirichlet((4.0, 4.0, 4.0), RAYS)
    target = weights @ corners.astype(np.float64)
    origin = single(target + 2.0 * directions(RAYS, rng))
    return origin, single(unit(target - origin))


def _needle(aspect: float) -> float:
    corners = _corners(aspect)
    origin, direction = _rays_at_a_needle(corners)
    surfaces = surfaces_of(corners, np.array([[0, 1, 2]]))
    _, prim = nearest_hits("triangles", surfaces, origin, direction)
    return float(np.mean(prim < 0))


# ----------------------------------------------------------------------- grazing angles


def _grazing(strength: float) -> tuple[NDArray[np.float32], ...]:
    """Return a large triangle's corners, and rays at the angle 1 / strength to it."""
    rng = np.random.default_rng(9)
    x, other = directions(2, rng)
    z = unit(np.cross(x, other)[None])[0]
    y = np.cross(z, x)
    half = 4.0
    corners = single([-half * (x + y), half * (2 * x - y), half * (2 * y - x)])
    turn = rng.uniform(0.0, 2.0 * np.pi, RAYS)
    level = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y
    target = rng.uniform(-0.5, 0.5, (RAYS, 2)) @ np.stack((x, y))
    angle = 1.0 / strength
    direction = single(np.cos(angle) * level - np.sin(angle) * z)
    return corners, single(target - direction.astype(np.float64)), direction


def _true_distance(
    corners: NDArray[np.float32],
    origin: NDArray[np.float32],
    direction: NDArray[np.float32],
) -> NDArray[np.float64]:
    p, o, d = (rows.astype(np.float64) for rows in (corners, origin, direction))
    normal = np.cross(p[1] - p[0], p[2] - p[0])
    return np.asarray(((p[0] - o) @ normal) / (d @ normal))


def _grazing_off(strength: float) -> float:
    """Return the share of distances, all about 1, that are off by a hundredth."""
    corners, origin, direction = _grazing(strength)
    surfaces = surfaces_of(corners, np.array([[0, 1, 2]]))
    t, prim = nearest_hits("triangles", surfaces, origin, direction)
    right = np.abs(t - _true_distance(corners, origin, direction)) < 0.01
    return float(1.0 - np.mean(right & (prim >= 0)))


_ANGLES = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7)

ROWS = (
    Row(
        name="triangle-absolute-determinant",
        method="Moeller-Trumbore with |determinant| > 1e-8",
        stress="1 / edge length",
        measure=lambda strength: small_triangles_lost(1.0 / strength),
        quantity="error",
        unit="of hits lost",
        strengths=(1e0, 1e1, 1e2, 1e3, 3e3, 1e4, 1e5),
        tolerance=0.01,
        holds_at=1e2,
        fails_at=1e4,
        why="The determinant goes with the square of the edges, a fixed bound does not.",
        instead="Compare with 0, or with the edges' own size: the next two rows.",
        source="[Moeller1997]; register of expected failures, small triangles",
    ),
    Row(
        name="triangle-small",
        method="Triangle, as this renderer meets it",
        stress="1 / size of the mesh",
        measure=lambda strength: _ball_scaled(1.0 / strength),
        quantity="error",
        unit="of rays from inside that pass the closed mesh",
        strengths=(1e0, 1e3, 1e6, 1e9, 1e12, 1e13, 1e15),
        tolerance=1e-3,
        holds_at=1e12,
        fails_at=1e15,
        why="Products of three lengths fall below the smallest float32, 1e-38.",
        instead="Choose another unit of length: no scene needs 1e-10 of one.",
        source="measured here",
    ),
    Row(
        name="triangle-large",
        method="Triangle, as this renderer meets it",
        stress="size of the mesh",
        measure=_ball_scaled,
        quantity="error",
        unit="of rays from inside that pass the closed mesh",
        strengths=(1e0, 1e3, 1e6, 1e9, 1e12, 1e13, 1e15),
        tolerance=1e-3,
        holds_at=1e12,
        fails_at=1e15,
        why="Products of three lengths exceed the largest float32, 3.4e38.",
        instead="Choose another unit of length.",
        source="measured here",
    ),
    Row(
        name="triangle-needles",
        method="Triangle, as this renderer meets it",
        stress="length over width of a needle",
        measure=_needle,
        quantity="error",
        unit="of rays at its inside that miss",
        strengths=(1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7),
        tolerance=1e-2,
        holds_at=1e4,
        fails_at=1e6,
        why="A needle thinner than the rounding of a direction or of its own vertices "
        "cannot be aimed at.",
        instead="Split needles, or model hair by curves that have a width of their own.",
        source="measured here",
    ),
    Row(
        name="triangle-grazing",
        method="Triangle, as this renderer meets it",
        stress="1 / angle to its plane",
        measure=_grazing_off,
        quantity="error",
        unit="of distances off by 1 %",
        strengths=(1e1, 1e2, 1e3, 1e4, 3e4, 1e5, 1e6),
        tolerance=0.01,
        holds_at=1e4,
        fails_at=1e5,
        why="Edges are kept in float32, which tilts the plane by 10^-7; the distance "
        "moves by this over the angle.",
        instead="Nothing: few rays of a picture graze so much, and whether they hit is "
        "settled in float64.",
        source="measured here",
    ),
)
