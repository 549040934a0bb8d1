"""Quadrics and triangles in float32: far away, small, thin, grazed, hit at an edge."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.expected_failures.reference import edge_rays_lost
from mitsuba_ref.expected_failures.rounding import (
    far_spheres_wrong,
    rays_at_a_sphere,
    small_triangles_lost,
)
from renderer.plugins.shapes.cylinder import CylinderSurfaces
from renderer.plugins.shapes.sphere import SphereSurfaces
from reports.studies.limits.probes import (
    Floats,
    Shown,
    directions,
    dot,
    nearest_hits,
    side_by_side,
    single,
    unit,
)
from reports.trials.meshes import StudyMesh, displaced_icosphere, surfaces_of
from reports.trials.rays import camera_rays, pixel_order

RAYS = 4096
FAR_OFF = 0.1  # radii from the true place that count as wrong

# ---------------------------------------------------------------------- far from the origin


def _distances(mesh: StudyMesh, moved: float, side: int = 48) -> NDArray[np.float64]:
    """Return the distance seen at each pixel, infinite where nothing is hit."""
    origin, direction, _ = camera_rays(mesh.view, side, side).rows()
    shift = np.array([moved, 0.0, 0.0])
    surfaces = surfaces_of(single(mesh.vertices + shift), mesh.faces)
    t, prim = nearest_hits("triangles", surfaces, single(origin + shift), direction, "bvh")
    return np.where(prim < 0, np.inf, t.astype(np.float64))


def _off(distance: float) -> float:
    """Return the share of pixels whose distance is another by a thousandth of the ball."""
    ball = displaced_icosphere(6)  # of radius 1
    truth, found = _distances(ball, 0.0), _distances(ball, distance)
    same = truth == found  # also both infinite
    with np.errstate(invalid="ignore"):
        return float(1.0 - np.mean(same | (np.abs(found - truth) < 1e-3)))


def ball_far_away() -> Shown:
    """Show what the camera sees at 0, 10^6, 10^7 and 3 * 10^7: nearer is brighter."""
    side, shown = 144, []
    order = pixel_order(side, side)
    for moved in (0.0, 1e6, 1e7, 3e7):
        distances = _distances(displaced_icosphere(10), moved, side)
        nearness = np.clip((4.6 - distances) / 2.0, 0.0, 1.0)
        grey = np.zeros(side * side, np.uint8)
        grey[order] = np.where(np.isfinite(distances), 40.0 + 200.0 * nearness, 20.0)
        shown.append(grey.reshape(side, side))
    return side_by_side(shown)


# -------------------------------------------------------------------- spheres and cylinders

_FRAME = np.ascontiguousarray(np.eye(3, dtype=np.float32).reshape(9, 1))
HALF_HEIGHT = 1e9  # of the cylinder: the ends are beyond all rays


def _naive_quadratic(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the smaller root by the textbook; NaN where there is none."""
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - np.float32(4) * a * c)
        return np.asarray((-b - root) / (np.float32(2) * a))


def _wrong(t: Floats, truth: NDArray[np.float64], prim: Any = 0) -> float:
    return float(1.0 - np.mean((np.asarray(prim) >= 0) & (np.abs(t - truth) < FAR_OFF)))


def _sphere(distance: float) -> float:
    origin, direction, truth = rays_at_a_sphere(distance)
    centre, radius = np.zeros((3, 1), np.float32), np.ones(1, np.float32)
    surfaces = SphereSurfaces(0, 1, centre, radius, _FRAME)
    t, prim = nearest_hits("spheres", surfaces, origin, direction)
    return _wrong(t, truth, prim)


def _rays_at_a_cylinder(distance: float) -> tuple[Floats, Floats, NDArray[np.float64]]:
    """Return rays that pass within 0.9 of the z axis, and where they meet radius 1."""
    rng = np.random.default_rng(4)
    turn = rng.uniform(0.0, 2.0 * np.pi, RAYS)
    x, y = np.cos(turn), np.sin(turn)
    # at most 45 degrees off level: near the axis any form is ill conditioned
    away = unit(np.stack((x, y, rng.uniform(-1.0, 1.0, RAYS)), axis=1))
    across = np.stack((-y, x, np.zeros(RAYS)), axis=1)
    origin = single(0.9 * rng.uniform(-1.0, 1.0, (RAYS, 1)) * across + distance * away)
    direction = single(unit(single(-away)))
    o, d = origin.astype(np.float64), direction.astype(np.float64)
    o[:, 2] = d[:, 2] = 0.0
    a, b = dot(d, d), -dot(o, d)
    nearest = o + d * (b / a)[:, None]
    with np.errstate(invalid="ignore"):  # from 10^6 on rounding moves rays past it
        root = np.sqrt(a * (1.0 - dot(nearest, nearest)))
    return origin, direction, (b - root) / a


def _naive_cylinder(distance: float) -> float:
    origin, direction, truth = _rays_at_a_cylinder(distance)
    ox, oy, dx, dy = origin[:, 0], origin[:, 1], direction[:, 0], direction[:, 1]
    c = ox * ox + oy * oy - np.float32(1)
    t = _naive_quadratic(dx * dx + dy * dy, np.float32(2) * (ox * dx + oy * dy), c)
    return _wrong(t, truth)


def _cylinder(distance: float) -> float:
    origin, direction, truth = _rays_at_a_cylinder(distance)
    base, radius = single([[0.0], [0.0], [-HALF_HEIGHT]]), np.ones(1, np.float32)
    height = single([2.0 * HALF_HEIGHT])
    surfaces = CylinderSurfaces(0, 1, base, radius, height, _FRAME)
    t, prim = nearest_hits("cylinders", surfaces, origin, direction)
    return _wrong(t, truth, prim)


def _square_grid(side: int, half: float) -> tuple[NDArray[np.float64], ...]:
    """Return x and y of side^2 points from -half to half, row by row."""
    y, x = np.mgrid[-half : half : side * 1j, -half : half : side * 1j]
    return x.ravel(), y.ravel()


def ball_by_the_textbook() -> Shown:
    """Show a ball lit from the camera, at four distances, by the textbook's quadratic."""
    side, shown = 144, []
    x, y = _square_grid(side, 1.2)
    # along no axis, so that no component is free of rounding
    right, up = np.array([0.8, 0.0, -0.6]), np.array([-0.36, 0.8, -0.48])
    for distance in (1e2, 1e3, 3e3, 1e4):
        eye = np.cross(right, up) * distance
        target = x[:, None] * right - y[:, None] * up
        origin = single(np.broadcast_to(eye, target.shape))
        direction = single(unit(target - eye))
        b, c = np.float32(2) * dot(origin, direction), dot(origin, origin) - np.float32(1)
        t = _naive_quadratic(dot(direction, direction), b, c)
        hit = origin.astype(float) + t[:, None] * direction.astype(float)
        cosine = np.clip(hit @ eye / distance, 0.0, 1.0)
        grey = np.where(np.isnan(t), 25.0, 60.0 + 180.0 * np.nan_to_num(cosine))
        shown.append(grey.reshape(side, side).astype(np.uint8))
    return side_by_side(shown)


# ---------------------------------------------------------------------------- one triangle

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


def lost_triangles() -> Shown:
    """Show a ball of three sizes where a determinant must be above 1e-8."""
    side, shown = 144, []
    mesh, order = displaced_icosphere(6), pixel_order(side, side)
    origin, direction, _ = camera_rays(mesh.view, side, side).rows()
    surfaces = surfaces_of(mesh.vertices, mesh.faces)
    _, prim = nearest_hits("triangles", surfaces, origin, direction, "bvh")
    first, second, third = (mesh.vertices[mesh.faces[prim, k]] for k in range(3))
    normal = np.cross(second - first, third - first)
    determinant = np.abs(dot(direction, normal))
    bright = 60.0 + 180.0 * determinant / np.sqrt(dot(normal, normal))
    for size in (1.0, 8e-4, 6e-4):
        seen = (prim >= 0) & (determinant * size**2 > 1e-8)
        grey = np.zeros(side * side, np.uint8)
        grey[order] = np.where(seen, bright, 25.0)
        shown.append(grey.reshape(side, side))
    return side_by_side(shown)


def _needle(aspect: float) -> float:
    """Return the share of rays well inside a needle of width 1 / aspect that miss it."""
    rng = np.random.default_rng(7)
    along, other = directions(2, rng)
    across = unit(np.cross(along, other)[None])[0]
    corner = rng.uniform(-1.0, 1.0, 3)
    corners = single([corner, corner + along, corner + 0.5 * along + across / aspect])
    rng = np.random.default_rng(8)
    target = rng.dirichlet((4.0, 4.0, 4.0), RAYS) @ corners.astype(np.float64)
    origin = single(target + 2.0 * directions(RAYS, rng))
    surfaces = surfaces_of(corners, np.array([[0, 1, 2]]))
    _, prim = nearest_hits("triangles", surfaces, origin, single(unit(target - origin)))
    return float(np.mean(prim < 0))


def _grazing_off(strength: float) -> float:
    """Return the share of distances, all about 1, that are off by a hundredth.

    Of rays at the angle 1 / strength to a large triangle.
    """
    rng = np.random.default_rng(9)
    x, other = directions(2, rng)
    z = unit(np.cross(x, other)[None])[0]
    y = np.cross(z, x)
    corners = single([-4.0 * (x + y), 4.0 * (2 * x - y), 4.0 * (2 * y - x)])
    turn = rng.uniform(0.0, 2.0 * np.pi, RAYS)
    level = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y
    target = rng.uniform(-0.5, 0.5, (RAYS, 2)) @ np.stack((x, y))
    direction = single(np.cos(1.0 / strength) * level - np.sin(1.0 / strength) * z)
    origin = single(target - direction.astype(np.float64))
    surfaces = surfaces_of(corners, np.array([[0, 1, 2]]))
    t, prim = nearest_hits("triangles", surfaces, origin, direction)
    p, o, d = (rows.astype(np.float64) for rows in (corners, origin, direction))
    normal = np.cross(p[1] - p[0], p[2] - p[0])
    right = np.abs(t - ((p[0] - o) @ normal) / (d @ normal)) < 0.01
    return float(1.0 - np.mean(right & (prim >= 0)))


# -------------------------------------------------------------- edges of a closed mesh

EDGE_RAYS = 2048


def _rays_at_edges(strength: float) -> tuple[Floats, Floats]:
    """Return rays from inside that pass an edge at 1 / strength of the next vertex."""
    rng = np.random.default_rng(10)
    face = BALL.faces[rng.integers(0, BALL.triangles, EDGE_RAYS)]
    first, second, third = (BALL.vertices[face[:, k]].astype(float) for k in range(3))
    target = first + rng.random((EDGE_RAYS, 1)) * (second - first)
    target += (third - target) / strength
    origin = 0.1 * directions(EDGE_RAYS, rng)
    return single(origin), single(unit(target - origin))


def _hit_counts(origin: Floats, direction: Floats) -> NDArray[np.int64]:
    """Return how many triangles each ray meets by Moeller-Trumbore in float32."""
    origin, direction = origin[:, None], direction[:, None]
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


@functools.cache
def _counts_at_edges(strength: float) -> NDArray[np.int64]:
    return _hit_counts(*_rays_at_edges(strength))


def _passes(origin: Floats, direction: Floats) -> NDArray[np.bool_]:
    """Return which rays from inside pass this renderer's triangles."""
    surfaces = surfaces_of(BALL.vertices, BALL.faces)
    return nearest_hits("triangles", surfaces, origin, direction, "bvh")[1] < 0


def _lost_at_vertices(strength: float) -> float:
    """Return the share that ours loses of rays that pass 1 / strength from a vertex."""
    rng = np.random.default_rng(12)
    vertex = BALL.vertices[rng.integers(0, len(BALL.vertices), EDGE_RAYS)].astype(float)
    target = vertex + 0.3 / strength * directions(EDGE_RAYS, rng)
    origin = 0.1 * directions(EDGE_RAYS, rng)
    return float(np.mean(_passes(single(origin), single(unit(target - origin)))))


def at_an_edge() -> Shown:
    """Show the surroundings of an edge: which rays meet one triangle, none, or both."""
    side, half = 120, 4e-7
    first, second, third = BALL.vertices[BALL.faces[5]].astype(float)
    x, y = _square_grid(side, half)
    along = unit((second - first)[None])[0]
    across = unit(np.cross(along, np.cross(third - first, along))[None])[0]
    target = 0.6 * first + 0.4 * second + x[:, None] * along + y[:, None] * across
    origin = np.broadcast_to(np.array([0.05, 0.02, -0.03]), target.shape)
    rays = single(origin), single(unit(target - origin))
    colours = np.array([[236, 118, 44], [150, 150, 150], [63, 127, 196]], np.uint8)
    shown = []
    for count in (_hit_counts(*rays), 1 - _passes(*rays)):
        picture = colours[np.minimum(count, 2)].reshape(side, side, 3)
        shown.append(picture.repeat(2, axis=0).repeat(2, axis=1))
    return side_by_side(shown)


MEASURES = {
    "far-from-origin": _off,
    "sphere-naive-distance": far_spheres_wrong,
    "sphere-stable-distance": _sphere,
    "cylinder-naive-distance": _naive_cylinder,
    "cylinder-stable-distance": _cylinder,
    "triangle-absolute-determinant": lambda x: small_triangles_lost(1.0 / x),
    "triangle-small": lambda strength: _ball_scaled(1.0 / strength),
    "triangle-large": _ball_scaled,
    "triangle-needles": _needle,
    "triangle-grazing": _grazing_off,
    "edges-moeller-trumbore": lambda x: float(np.mean(_counts_at_edges(x) == 0)),
    "edges-counted-twice": lambda x: float(np.mean(_counts_at_edges(x) > 1)),
    "edges-ours": lambda x: float(np.mean(_passes(*_rays_at_edges(x)))),
    "vertices-ours": _lost_at_vertices,
    "edges-embree-default": lambda strength: edge_rays_lost(aside=1.0 / strength),
}
PICTURES = {
    "far-from-origin": ball_far_away,
    "quadric-distance": ball_by_the_textbook,
    "triangle-size": lost_triangles,
    "edges": at_an_edge,
}
