"""Primitives that shadow rays need not be tested against: walls, floors, lamps.

A shadow ray is a segment from a surface to a light. It crosses the plane of a flat
primitive only if its ends lie on different sides of it. So the walls of a room, which have
the whole room on one side, block no lamp in the room. A flat lamp that is the only light
does not block its own shadow rays, which end in its plane.

A ray starts slightly off its surface, along the normal towards the light. At a wall
perpendicular to the surface this offset stays on the same side; where two surfaces meet at
a sharp angle it might not.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.choice import RayCounts, choose_structures
from renderer.kernels.records.kernel_scene import EMIT
from renderer.plugins.lights.registry import plugin_of
from renderer.plugins.shapes.extents import ROUNDING
from renderer.plugins.shapes.registry import SHAPES
from renderer.scene.light_order import light_order
from renderer.scene.scene import Scene

MOST = 1024  # primitives of a kind, or lights; of more only the common box is used
# Rounding of corners and normals in single precision, relative to both sides' coordinates
_SLACK = 4.0 * 2.0**-24
_FAR = 16.0  # times the scene's size: farther coordinates round too much
_NARROW = 1e-3  # of the largest coordinate: a narrower primitive's plane is uncertain
_LEVEL = 1.0 - 1e-6  # cosine of the angle between planes that count as parallel

Lengths = tuple[float, float]  # see `Settings.rounding_offset` and `fixed_offset`


class Balls(NamedTuple):
    """Balls whose convex hull contains some geometry."""

    centers: NDArray[np.float64]  # (3, n) world
    radii: NDArray[np.float64]  # (n,)
    normals: NDArray[np.float64]  # (3, n) of flat primitives, else 0


def find_non_occluders(
    scene: Scene,
    accel: str,
    rays: RayCounts,
    lights: NDArray[np.int32],
    offsets: Lengths,
) -> NDArray[np.bool_]:
    """Return the mask of primitives that shadow rays to some lights need not test.

    Under `auto` these are the primitives of `never_between` in structures that test them
    one after the other; a tree hardly visits the walls around it. If a structure is
    requested by name, the mask is empty.
    """
    chosen = choose_structures(scene, accel, rays)
    one_by_one = [k for k, choice in chosen.items() if choice.name in ("brute", "boxes")]
    kinds = one_by_one if accel == "auto" else []
    key = ("never in the way", offsets, *kinds, *lights.tolist())
    found: NDArray[np.bool_] = scene.once(key, never_between, scene, kinds, lights, offsets)
    return found


def never_between(
    scene: Scene, kinds: Iterable[str], lights: NDArray[np.int32], offsets: Lengths
) -> NDArray[np.bool_]:
    """Return the mask of primitives that no segment from a surface to a light can cross.

    Parameters
    ----------
    scene
        The surfaces.
    kinds
        Kinds to check. If a kind has more than `MOST` primitives, none is in the mask.
    lights
        Numbers of the lights that shadow rays go to.
    offsets
        How far off its surface a ray starts: in rounding errors, and a fixed part.

    Returns
    -------
    (primitives,) bool
        By primitive id. False for primitives that are not flat.
    """
    found = np.zeros(len(scene.stages), bool)
    kinds = [kind for kind in kinds if 0 < scene.starts[kind][0] <= MOST]
    shining = _around_lights(scene, lights) if kinds else None
    if shining is None:
        return found
    starting = _around_surfaces(scene)
    farthest = float(np.abs(scene.bounds).max())
    if farthest > _FAR * np.ptp(scene.bounds, axis=0).max():
        return found  # far from the world's origin, where rounding blocks many rays
    rounding, fixed = offsets
    off = rounding * float(ROUNDING) * farthest + fixed * (1.0 + farthest)
    for kind in kinds:
        surfaces, count = scene.surfaces[kind], int(scene.starts[kind][0])
        flat = _around(scene, kind, np.arange(count))
        walls = Balls(flat.centers[:, :count], flat.radii[:count], flat.normals[:, :count])
        low, high = _sides(walls, shining, 0.0)
        to_its_plane = (low >= 0.0) & (high <= 0.0)
        for balls in starting:
            sides = _sides(walls, balls, off)
            low, high = np.minimum(low, sides[0]), np.maximum(high, sides[1])
        is_flat = np.abs(walls.normals).max(axis=0) > 0.0
        is_flat &= _breadths(flat.centers.reshape(3, -1, count)) > _NARROW * farthest
        apart = (low >= 0.0) | (high <= 0.0) | to_its_plane
        found[surfaces.first : surfaces.first + count] = is_flat & apart
    return found


def _breadths(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least height of triangles or parallelograms, from corners (3, 4, n)."""
    edge1, edge2 = (corners[:, k] - corners[:, 0] for k in (1, 2))
    longest = np.maximum(np.linalg.norm(edge1, axis=0), np.linalg.norm(edge2, axis=0))
    area = np.linalg.norm(np.cross(edge1, edge2, axis=0), axis=0)
    return np.asarray(area / np.maximum(longest, 1e-300))


def _sides(walls: Balls, balls: Balls, off: float) -> tuple[Any, Any]:
    """Return how far balls reach below and above the planes of walls, (n,) each.

    Ray origins are `off` away from the balls' geometry, along its normal.
    """
    normals = walls.normals.T
    distance = normals @ balls.centers - (normals * walls.centers.T).sum(axis=1)[:, None]
    sizes = np.abs(balls.centers) + balls.radii
    own = (np.abs(normals) * np.abs(walls.centers.T)).sum(axis=1)[:, None]
    slack = _SLACK * (np.abs(normals) @ sizes + own)
    tilt = np.abs(normals @ balls.normals)
    tilt[:, np.abs(balls.normals).max(axis=0) == 0.0] = 1.0
    tilt[(tilt > _LEVEL) & (np.abs(distance) <= slack)] = 0.0  # offset is towards the light
    reach = balls.radii + off * tilt - slack
    return (distance - reach).min(axis=1), (distance + reach).max(axis=1)


def _around_lights(scene: Scene, lights: NDArray[np.int32]) -> Balls | None:
    """Return balls around all lights; None if there are none or one is at infinity."""
    order, sampled = light_order(scene.description), set(lights.tolist())
    found = []
    for kind, surfaces in scene.surfaces.items():
        end = surfaces.first + scene.starts[kind][0]
        emitting = np.flatnonzero(scene.stages[surfaces.first : end] & EMIT)
        if len(emitting):
            found.append(_around(scene, kind, emitting))
    centers, radii = [], []
    for light, emitter in zip(order.of_emitters, scene.description.emitters, strict=True):
        if light not in sampled:
            continue
        plugin = plugin_of(emitter)
        if plugin.at_infinity or plugin.bounds is None:
            return None
        bounds = plugin.bounds(emitter)
        centers.append(np.asarray(bounds.center, np.float64))
        radii.append(bounds.radius)
    if centers:
        points, around = np.array(centers).T, np.array(radii)
        if len(centers) > MOST:
            sides = (points - around).min(axis=1), (points + around).max(axis=1)
            found.append(_corners(*sides))
        else:
            found.append(Balls(points, around, np.zeros_like(points)))
    if not found:
        return None
    return Balls(*(np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True)))


def _around_surfaces(scene: Scene) -> list[Balls]:
    """Return balls around all primitives of each kind, and around the instances."""
    kinds = [(kind, int(starts[0])) for kind, starts in scene.starts.items()]
    found = [_around(scene, kind, np.arange(count)) for kind, count in kinds if count]
    if scene.instance_boxes is not None:
        low, high = scene.instance_boxes
        found.append(_corners(low.min(axis=1), high.max(axis=1)))
    return found


def _around(scene: Scene, kind: str, columns: NDArray[np.int64]) -> Balls:
    """Return balls around primitives of a kind; the first ball of each comes first."""
    surfaces = scene.surfaces[kind]
    if len(columns) > MOST:
        sides = [rows[:, columns] for rows in SHAPES[kind].corners(surfaces)]
        low = np.min([side.min(axis=1) for side in sides], axis=0)
        return _corners(low, np.max([side.max(axis=1) for side in sides], axis=0))
    corners, radius, normals = SHAPES[kind].hull(surfaces, columns)
    times = corners.shape[1]
    return Balls(
        np.asarray(corners, np.float64).reshape(3, -1),
        np.tile(np.asarray(radius, np.float64), times),
        np.tile(np.asarray(normals, np.float64), times),
    )


def _corners(low: NDArray[Any], high: NDArray[Any]) -> Balls:
    """Return a box's corners as balls of radius 0; normals are unknown, hence 0."""
    points = np.array(list(product(*zip(low, high, strict=True))), np.float64).T
    return Balls(points, np.zeros(8), np.zeros((3, 8)))
