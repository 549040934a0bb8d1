"""Rays at the edges of a closed mesh: what falls through, and what is counted twice."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.expected_failures.reference import edge_rays_lost
from reports.accelerator_trials.meshes import displaced_icosphere, surfaces_of
from reports.limits.our_hits import nearest_hits
from reports.limits.row import Row
from reports.limits.vectors import directions, dot, single, unit

RAYS = 2048
MANY = 10_000_000  # in the long run
BALL = displaced_icosphere(2)  # 80 triangles around the origin

Rays = tuple[NDArray[np.float32], NDArray[np.float32]]


def _rays_at_edges(aside: float, count: int = RAYS, seed: int = 10) -> Rays:
    """Return rays from inside that pass `aside` from an edge, 1 being the next vertex."""
    rng = np.random.default_rng(seed)
    face = BALL.faces[rng.integers(0, BALL.triangles, count)]
    first, second, third = (BALL.vertices[face[:, k]].astype(float) for k in range(3))
    target = first + rng.random((count, 1)) * (second - first)
    target += aside * (third - target)
    origin = 0.1 * directions(count, rng)
    return single(origin), single(unit(target - origin))


@functools.cache
def _hit_counts(aside: float) -> NDArray[np.int64]:
    """Return how many triangles each ray meets by Moeller-Trumbore in float32."""
    origin, direction = (rows[:, None] for rows in _rays_at_edges(aside))
    corners = BALL.vertices[BALL.faces]
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, e2)
    inverse = np.float32(1) / dot(e1[None], p)
    to_origin = origin - corners[:, 0]
    u = dot(to_origin, p) * inverse
    q = np.cross(to_origin, e1)
    v = dot(direction, q) * inverse
    hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (dot(e2[None], q) * inverse > 0)
    return np.asarray(hit.sum(axis=1))


def _lost(strength: float) -> float:
    return float(np.mean(_hit_counts(1.0 / strength) == 0))


def _counted_twice(strength: float) -> float:
    return float(np.mean(_hit_counts(1.0 / strength) > 1))


def _lost_by(origin: NDArray[np.float32], direction: NDArray[np.float32]) -> float:
    surfaces = surfaces_of(BALL.vertices, BALL.faces)
    _, prim = nearest_hits("triangles", surfaces, origin, direction, "bvh")
    return float(np.mean(prim < 0))


def _ours_lost(strength: float) -> float:
    return _lost_by(*_rays_at_edges(1.0 / strength))


def _random_rays_lost(count: float) -> float:
    """Return how many of so many rays from inside, aimed anywhere, pass."""
    rng = np.random.default_rng(11)
    lost, left = 0.0, int(count)
    while left > 0:
        part = min(left, 250_000)
        origin = single(0.1 * directions(part, rng))
        lost += part * _lost_by(origin, single(directions(part, rng)))
        left -= part
    return float(round(lost))


def lost_at_vertices(strength: float, seed: int = 12) -> float:
    """Return the share that ours loses of rays that pass 1 / strength from a vertex."""
    rng = np.random.default_rng(seed)
    vertex = BALL.vertices[rng.integers(0, len(BALL.vertices), RAYS)].astype(float)
    target = vertex + 0.3 / strength * directions(RAYS, rng)
    origin = 0.1 * directions(RAYS, rng)
    return _lost_by(single(origin), single(unit(target - origin)))


_NEAR = (1e1, 1e3, 1e5, 1e6, 1e7, 1e8, 1e10)

ROWS = (
    Row(
        name="edges-moeller-trumbore",
        method="Moeller-Trumbore in float32",
        stress="size of a triangle / distance of the ray from its edge",
        measure=_lost,
        quantity="error",
        unit="of rays from inside that pass a closed mesh",
        strengths=_NEAR,
        tolerance=0.0,
        holds_at=1e5,
        fails_at=1e8,
        why="Two neighbours round the same edge differently, so that a ray can be outside "
        "of both.",
        instead="A test that asks both neighbours the same question, or one that lets "
        "doubtful rays in: ours and Embree's robust mode.",
        source="[Woop2013]; measured here",
    ),
    Row(
        name="edges-counted-twice",
        method="Inside or outside by the parity of hits",
        stress="size of a triangle / distance of the ray from its edge",
        measure=_counted_twice,
        quantity="error",
        unit="of rays that count an edge twice",
        strengths=_NEAR,
        tolerance=0.0,
        holds_at=1e5,
        fails_at=1e8,
        why="On an edge both neighbours may say yes, and the parity turns.",
        instead="The nearest hit alone, whose side says what is inside.",
        source="measured here",
    ),
    Row(
        name="edges-ours",
        method="Triangle, as this renderer meets it",
        stress="size of a triangle / distance of the ray from its edge",
        measure=_ours_lost,
        quantity="error",
        unit="of rays from inside that pass a closed mesh",
        strengths=_NEAR,
        tolerance=0.0,
        holds_at=1e5,
        fails_at=1e8,
        why="Neighbours do not share their edge exactly here either; only grazing rays "
        "are decided in float64.",
        instead="Nothing for pictures: see the row after the next. Embree's robust mode "
        "where each ray counts.",
        source="measured here",
    ),
    Row(
        name="vertices-ours",
        method="Triangle, as this renderer meets it",
        stress="size of a triangle / distance of the ray from a vertex",
        measure=lost_at_vertices,
        quantity="error",
        unit="of rays from inside that pass a closed mesh",
        strengths=_NEAR,
        tolerance=5e-3,  # a rate: 0.001 are lost at 1e5, 0.05 at 1e7
        holds_at=1e4,
        fails_at=1e7,
        why="At a vertex five or six faces round their edges, each in its own way.",
        instead="As for edges.",
        source="measured here",
    ),
    Row(
        name="edges-random-rays",
        method="Triangle, as this renderer meets it, in a BVH",
        stress="rays from inside of a closed mesh, aimed anywhere",
        measure=_random_rays_lost,
        quantity="error",
        unit="rays lost",
        strengths=(1e3, 1e4, 1e5, 1e6),
        # 0.2 are expected of MANY: more than 3 are a false alarm of one in 17,000 seeds,
        # of one in 160 if the rate is what 2 of 10^8 only just do not rule out (7e-8)
        tolerance=3.0,
        holds_at=MANY,
        fails_at=None,
        why="The gaps are narrower than rounding, and hardly a ray comes so near to an "
        "edge: in a long run 2 of 10^8 passed.",
        instead="Nothing.",
        source="measured here",
        slow=True,
    ),
    Row(
        name="edges-embree-default",
        method="Embree's default mode, in Mitsuba",
        stress="size of a triangle / distance of the ray from its edge",
        measure=lambda strength: edge_rays_lost(aside=1.0 / strength),
        quantity="error",
        unit="of rays from inside that pass a closed mesh",
        strengths=(1e1, 1e3, 1e5, 1e6, 1e7, 1e9),
        tolerance=0.0,
        holds_at=1e5,
        fails_at=1e8,
        why="Edges are not shared exactly (Mitsuba issue 1149).",
        instead="embree_use_robust_intersections, as the harness does.",
        source="register of expected failures, Embree's default mode",
    ),
)
