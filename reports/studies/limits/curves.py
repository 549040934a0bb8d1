"""A B-spline curve that is thicker than its bend is round, compared with a fine mesh."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.plugins.shapes.bspline_pieces import segment_polynomials
from renderer.plugins.shapes.registry import SHAPES
from renderer.scene_file.description import BsplineCurve, Diffuse
from reports.studies.limits.probes import (
    Rows,
    Shown,
    directions,
    dot,
    nearest_hits,
    single,
    soup_mesh,
    unit,
)
from reports.trials.meshes import triangle_surfaces

RAYS = 20_000
_HAIRPIN = [(x, y, 0.2 * x) for x, y in ((-6, -0.5), (-3, -0.5), (0, -0.5))]
_HAIRPIN += [(x, -y, -z) for x, y, z in _HAIRPIN[::-1]]
_AROUND, _ALONG = 96, 1200  # points of the mesh


def _curve(radius: float) -> BsplineCurve:
    points = np.column_stack([_HAIRPIN, np.full(len(_HAIRPIN), radius)])
    return BsplineCurve(bsdf=Diffuse(), points=single(points), starts=np.zeros(1, int))


def _frames(places: Rows) -> tuple[Rows, Rows, Rows]:
    """Return points of the axis at places in segments, c' and c'', (n, 3) each."""
    powers = segment_polynomials(_curve(1.0))[:, :, :3]
    k = np.minimum(places.astype(int), len(powers) - 1)
    s, (a, b, c, d) = (places - k)[:, None], np.moveaxis(powers[k], 1, 0)
    point = a + s * (b + s * (c + s * d))
    return point, b + s * (2.0 * c + s * 3.0 * d), 2.0 * c + 6.0 * s * d


def tightest() -> float:
    """Return the smallest radius of curvature; the curvature is |c' x c''| / |c'|^3."""
    _, slope, bend = _frames(np.linspace(0.0, len(_HAIRPIN) - 3.0, 100_001))
    binormal = np.cross(slope, bend)
    return float(np.max(dot(binormal, binormal) / dot(slope, slope) ** 3)) ** -0.5


def _tube(radius: float) -> Rows:
    """Return triangles (n, 3 corners, 3) between circles, their fronts outside."""
    center, slope, _ = _frames(np.linspace(0.0, len(_HAIRPIN) - 3.0, _ALONG + 1))
    axis = unit(slope)
    x = unit(np.cross(axis, [0.1, 0.2, 1.0]))
    turn = np.linspace(0.0, 2.0 * np.pi, _AROUND + 1)[:, None, None]
    ring = center + radius * (np.cos(turn) * x + np.sin(turn) * np.cross(axis, x))
    a, b, c, d = ring[:-1, :-1], ring[1:, :-1], ring[:-1, 1:], ring[1:, 1:]
    faces = np.stack([np.stack([a, b, c], axis=2), np.stack([b, d, c], axis=2)])
    return faces.reshape(-1, 3, 3)


def lost_in_bend(thickness: float, seed: int = 0) -> float:
    """Return the share of rays at a hairpin bend that miss what they meet first.

    `thickness` is the radius over the smallest radius of curvature. Rays come from all
    sides but along the legs, whose ends are open.
    """
    radius, generator = thickness * tightest(), np.random.default_rng(seed)
    middle = (len(_HAIRPIN) - 3.0) / 2.0
    target, _, _ = _frames(middle + generator.uniform(-0.5, 0.5, RAYS))
    target = target + 0.7 * radius * directions(RAYS, generator)
    away = directions(RAYS, generator)
    usual = away[:, 0] > -0.9  # not out of the legs, which lie along -x
    origin = single(target[usual] + 20.0 * away[usual])
    direction = single(-away[usual])
    pieces = SHAPES["bspline_pieces"].surfaces([_curve(radius)], 0)
    t, _ = nearest_hits("bspline_pieces", pieces, origin, direction)
    faces = _tube(radius)
    mesh = triangle_surfaces(soup_mesh(faces))
    truth, face = nearest_hits("triangles", mesh, origin, direction, "bvh")
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    met = (face >= 0) & (dot(normal[face], direction) < 0.0)
    late = t > truth + 0.1 * radius  # a mesh is inside of its tube: hits are never later
    return float(np.mean(late[met]))


MEASURES = {"curve-in-a-bend": lost_in_bend}
PICTURES: dict[str, Callable[[], Shown]] = {}
