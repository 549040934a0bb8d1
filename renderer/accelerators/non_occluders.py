"""What shadow rays need not be tested against: walls, floors, lamps.

A shadow ray is a segment from a surface to a light. It crosses the plane of a flat
primitive only if the two lie on different sides of it. So the walls of a room, which have
all of it on one side, block no lamp in the room; and a flat lamp that is the only light
blocks none of its own rays, which end in its plane.

Rays start a little off their surface, along its normal towards the light. That takes none
through a wall that stands upright on it, but it might where two meet at a sharp angle.
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

MOST = 1024  # primitives of a kind, or lights; of more only their box is looked at
# What corners and normals in single precision are off by, of the coordinates of both sides
_SLACK = 4.0 * 2.0**-24
_FAR = 16.0  # times the scene's size: coordinates whose rounding counts
_NARROW = 1e-3  # of the largest coordinate: the plane of a needle is not well known
_LEVEL = 1.0 - 1e-6  # cosine of the angle between planes that are one

Lengths = tuple[float, float]  # see `Settings.rounding_offset` and `fixed_offset`


class Balls(NamedTuple):
    """Balls in whose hull something lies."""

    centers: NDArray[np.float64]  # (3, n) world
    radii: NDArray[np.float64]  # (n,)
    normals: NDArray[np.float64]  # (3, n) of what is flat, else 0


def find_non_occluders(
    scene: Scene,
    accel: str,
    rays: RayCounts,
    lights: NDArray[np.int32],
    offsets: Lengths,
) -> NDArray[np.bool_]:
    """Return which primitives shadow rays to some lights are not tested against.

    Under `auto` these are those of `never_between` that would be tested one after the
    other: a tree hardly looks at the walls around it. A structure that is requested by
    name leaves nothing out.
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
    """Return which primitives no segment from a surface to a light can cross.

    Parameters
    ----------
    scene
        The surfaces.
    kinds
        Whose primitives are in question; of more than `MOST` none is.
    lights
        Numbers of the lights that shadow rays go to.
    offsets
        How far off its surface a ray starts, in rounding errors, and in addition to them.

    Returns
    -------
    (primitives,) bool
        By primitive id. A primitive that is not flat may always be in the way.
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
    """Return the least heights of triangles or parallelograms by corners (3, 4, n)."""
    edge1, edge2 = (corners[:, k] - corners[:, 0] for k in (1, 2))
    longest = np.maximum(np.linalg.norm(edge1, axis=0), np.linalg.norm(edge2, axis=0))
    area = np.linalg.norm(np.cross(edge1, edge2, axis=0), axis=0)
    return np.asarray(area / np.maximum(longest, 1e-300))


def _sides(walls: Balls, balls: Balls, off: float) -> tuple[Any, Any]:
    """Return how far balls reach below and above the planes of walls, (n,) each.

    They begin `off` away from what they hold, along its normal.
    """
    normals = walls.normals.T
    distance = normals @ balls.centers - (normals * walls.centers.T).sum(axis=1)[:, None]
    sizes = np.abs(balls.centers) + balls.radii
    own = (np.abs(normals) * np.abs(walls.centers.T)).sum(axis=1)[:, None]
    slack = _SLACK * (np.abs(normals) @ sizes + own)
    tilt = np.abs(normals @ balls.normals)
    tilt[:, np.abs(balls.normals).max(axis=0) == 0.0] = 1.0
    tilt[(tilt > _LEVEL) & (np.abs(distance) <= slack)] = 0.0  # a light is on its side
    reach = balls.radii + off * tilt - slack
    return (distance - reach).min(axis=1), (distance + reach).max(axis=1)


def _around_lights(scene: Scene, lights: NDArray[np.int32]) -> Balls | None:
    """Return balls around all lights; None if there is none, or one is at infinity."""
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
    """Return balls around some primitives of a kind, first one for each of them."""
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
    """Return the corners of a box; what is in it may be turned anyhow."""
    points = np.array(list(product(*zip(low, high, strict=True))), np.float64).T
    return Balls(points, np.zeros(8), np.zeros((3, 8)))
