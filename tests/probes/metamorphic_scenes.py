"""One still life, written so that it can be moved, scaled, mirrored and taken apart.

Every shape, lamp and camera has its place in a frame of its own; `world` is what is done
to that frame. Always the same kinds of things, so the kernels compile once for each
integrator.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from small_scenes import diffuse, glass, look_at, mirror, placed, rgb

Matrix = NDArray[np.float64]
SIZE = 32
EYE, TARGET = (1.0, -6.0, 3.0), (0.0, 0.0, 0.75)
LAMP = (2.0, -1.5, 4.0)


def moved(x: float, y: float, z: float) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scaled(s: float) -> Matrix:
    return np.diag([s, s, s, 1.0])


def turned(axis: Any, degrees: float) -> Matrix:
    """Return a rotation by Rodrigues' formula."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(a) * k + (1 - np.cos(a)) * k @ k
    return matrix


def shapes() -> dict[str, dict[str, Any]]:
    """Return a floor and a wall, a turned box, a mirror ball and a glass ball."""
    grey, red = diffuse(0.5), diffuse(0.7, 0.25, 0.125)
    box = moved(-1.5, 0.5, 0.75) @ turned((0, 0, 1), 30) @ scaled(0.75)
    return {
        "floor": {"type": "rectangle", "to_world": scaled(8.0), "bsdf": grey},
        "wall": {
            "type": "rectangle",
            "to_world": placed((0, 4, 0), (8, 0, 0), (0, 0, 8)),
            "bsdf": diffuse(0.25, 0.5, 0.75),
        },
        "box": {"type": "cube", "to_world": box, "bsdf": red},
        "mirror": {
            "type": "sphere",
            "to_world": moved(0.5, 1.5, 1) @ scaled(1.0),
            "bsdf": mirror(0.9),
        },
        "glass": {
            "type": "sphere",
            "to_world": moved(1.5, -1, 0.75) @ scaled(0.75),
            "bsdf": glass(),
        },
    }


def unseen() -> list[dict[str, Any]]:
    """Return a box, a mirror and a glass ball so far below that no path finds them.

    With them other scenes of squares have the kernels of the noisy still life.
    """
    flat = placed((0, 0, -900), (0, 1, 0), (0, 0, 1))
    far = moved(0, 0, -900) @ scaled(0.01)
    return [
        {"type": "cube", "to_world": far, "bsdf": diffuse(0.0)},
        {"type": "rectangle", "to_world": flat, "bsdf": mirror()},
        {"type": "sphere", "to_world": far @ moved(9, 0, 0), "bsdf": glass()},
    ]


def lamps(world: Matrix, *, power: float = 1.0, area: bool = False) -> dict[str, Any]:
    """Return a point light, or a square one above the scene; intensity follows scale^2."""
    if area:
        square = placed((0.5, -0.5, 5), (1, 0, 0), (0, -1, 0))
        return {
            "lamp": {
                "type": "rectangle",
                "to_world": world @ square,
                "bsdf": diffuse(0.0),
                "emitter": {"type": "area", "radiance": rgb(8 * power)},
            }
        }
    position = (world @ [*LAMP, 1.0])[:3]
    size = np.linalg.norm(world[:3, 0])  # exact for powers of two
    intensity = rgb(64 * power * size**2)
    return {"lamp": {"type": "point", "position": list(position), "intensity": intensity}}


def camera(world: Matrix, spp: int = 1, jitter: bool = False) -> dict[str, Any]:
    """Return the camera, whose own frame stays right-handed where `world` mirrors."""
    up = world[:3, :3] @ [0.0, 0.0, 1.0]
    eye, target = ((world @ [*p, 1.0])[:3] for p in (EYE, TARGET))
    size = np.linalg.norm(up)
    return {
        "type": "perspective",
        "to_world": look_at(eye, target, up),
        "fov": 45.0,
        "near_clip": 2.0**-10 * size,
        "far_clip": 2.0**10 * size,
        "film": {
            "type": "hdrfilm",
            "width": SIZE,
            "height": SIZE,
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "stratified", "sample_count": spp, "jitter": jitter},
    }


def still_life(
    world: Matrix | None = None,
    *,
    things: dict[str, Any] | None = None,
    lights: dict[str, Any] | None = None,
    noisy: int = 0,
) -> dict[str, Any]:
    """Return the scene in a frame: `path` with `noisy` samples, or `whitted` if it is 0.

    `things` and `lights` replace shapes and lamps; shapes are still moved by `world`.
    """
    world = np.eye(4) if world is None else world
    things = shapes() if things is None else things
    lights = lamps(world, area=noisy > 0) if lights is None else lights
    placed_things = {
        name: shape | {"to_world": world @ shape["to_world"]}
        for name, shape in things.items()
    }
    settings = {"rr_depth": 6} if noisy else {"cutoff": 2.0**-20}
    return {
        "type": "scene",
        "integrator": {"type": "path" if noisy else "whitted", "max_depth": 6, **settings},
        "sensor": camera(world, max(noisy, 1), noisy > 0),
        **placed_things,
        **lights,
    }
