"""What shadow rays need not be tested against: walls, floors, lamps.

A shadow ray is a segment from a surface to a light. It crosses the plane of a flat
primitive only if the two lie on different sides of it. So the walls of a room, which have
all of it on one side, block no lamp in the room; and a flat lamp that is the only light
blocks none of its own rays, which end in its plane.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.choice import choose_structures
from renderer.accelerators.cost_model import RayCounts
from renderer.accelerators.extents import ROUNDING
from renderer.kernels.records.kernel_scene import EMIT
from renderer.kinds.lights.registry import plugin_of
from renderer.kinds.shapes.registry import SHAPES
from renderer.scene.light_order import light_order
from renderer.scene.scene import Scene

MOST = 1024  # primitives of a kind that are looked at one by one; of more, the scene's box


class Balls(NamedTuple):
    """Balls in whose hull something lies."""

    centers: NDArray[np.float64]  # (3, n) world
    radii: NDArray[np.float64]  # (n,)


def never_in_the_way(
    scene: Scene, accel: str, rays: RayCounts, lights: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Return which primitives shadow rays to some lights are not tested against.

    Under `auto` these are those of `never_between` that would be tested one after the
    other: a tree hardly looks at the walls around it. A structure that is asked for by its
    name leaves nothing out.
    """
    chosen = choose_structures(scene, accel, rays)
    one_by_one = [k for k, choice in chosen.items() if choice.name in ("brute", "boxes")]
    kinds = one_by_one if accel == "auto" else []
    key = ("never in the way", *kinds, *lights.tolist())
    found: NDArray[np.bool_] = scene.once(key, never_between, scene, kinds, lights)
    return found


def never_between(
    scene: Scene, kinds: Iterable[str], lights: NDArray[np.int32]
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

    Returns
    -------
    (primitives,) bool
        By primitive id. A primitive that is not flat may always be in the way.
    """
    found = np.zeros(len(scene.stages), bool)
    kinds = [kind for kind in kinds if scene.starts[kind][0] <= MOST]
    shining = _around_lights(scene, lights)
    if shining is None or not kinds:
        return found
    everything = [*_around_surfaces(scene), shining]
    largest = max(np.abs(balls.centers).max() for balls in everything)
    slack = 2.0 * float(ROUNDING) * largest
    for kind in kinds:
        surfaces, count = scene.surfaces[kind], int(scene.starts[kind][0])
        corners, radius, normals = SHAPES[kind].hull(surfaces, np.arange(count))
        flat = (np.abs(normals).max(axis=0) > 0.0) & (np.asarray(radius) == 0.0)
        normals = np.asarray(normals, np.float64).T
        planes = (normals * corners[:, 0].T).sum(axis=1)
        sides = np.array([_sides(normals, planes, balls) for balls in everything])
        on_one = (sides[:, 0].min(axis=0) >= -slack) | (sides[:, 1].max(axis=0) <= slack)
        to_its_plane = np.abs(sides[-1]).max(axis=0) <= slack
        found[surfaces.first : surfaces.first + count] = flat & (on_one | to_its_plane)
    return found


def _sides(normals: Any, planes: Any, balls: Balls) -> NDArray[np.float64]:
    """Return how far balls reach to the lower and to the upper side of planes, (2, n)."""
    distance = normals @ balls.centers - planes[:, None]
    low, high = distance - balls.radii, distance + balls.radii
    return np.array([low.min(axis=1), high.max(axis=1)])


def _around_lights(scene: Scene, lights: NDArray[np.int32]) -> Balls | None:
    """Return balls around all of the lights; None if one is not in the world."""
    order = light_order(scene.description)
    found = []
    for kind, surfaces in scene.surfaces.items():
        end = surfaces.first + scene.starts[kind][0]
        emitting = np.flatnonzero(scene.stages[surfaces.first : end] & EMIT)
        if len(emitting):
            found.append(_around(scene, kind, emitting))
    for light, emitter in zip(order.of_emitters, scene.description.emitters, strict=True):
        if light not in lights:
            continue
        plugin = plugin_of(emitter)
        if plugin.at_infinity or plugin.bounds is None:
            return None
        bounds = plugin.bounds(emitter)
        center = np.reshape(np.asarray(bounds.center, np.float64), (3, 1))
        found.append(Balls(center, np.array([bounds.radius])))
    if not found:
        return None
    return Balls(
        np.concatenate([balls.centers for balls in found], axis=1),
        np.concatenate([balls.radii for balls in found]),
    )


def _around_surfaces(scene: Scene) -> list[Balls]:
    """Return balls around all primitives of each kind, and around the instances."""
    kinds = [(kind, int(starts[0])) for kind, starts in scene.starts.items()]
    found = [_around(scene, kind, np.arange(count)) for kind, count in kinds if count]
    return found if scene.placements is None else [*found, _around_all(scene)]


def _around(scene: Scene, kind: str, columns: NDArray[np.int64]) -> Balls:
    """Return balls around some primitives of a kind."""
    if len(columns) > MOST:
        return _around_all(scene)
    corners, radius, _ = SHAPES[kind].hull(scene.surfaces[kind], columns)
    radii = np.broadcast_to(np.asarray(radius, np.float64), corners.shape[1:])
    return Balls(np.asarray(corners, np.float64).reshape(3, -1), radii.reshape(-1))


def _around_all(scene: Scene) -> Balls:
    """Return the corners of the scene's box, which is larger than it by half the slack."""
    return Balls(np.array(list(product(*scene.bounds.T))).T, np.zeros(8))
