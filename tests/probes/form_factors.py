"""Light on a floor with an answer on paper, and scenes that show it."""

from __future__ import annotations

import numpy as np
from small_scenes import area, diffuse, floor, placed, scene, sphere

# 1024 views of one point
SMALL = {"size": (32, 32), "fov": 1e-3, "spp": 25, "jitter": True}


def under_light(camera, light, tmp_path):
    """Return a grey floor under one light.

    The lights of other shapes lie below the floor, where they cannot be seen: with them all
    scenes are made of the same kinds of things, and their kernels are compiled once.
    """
    (tmp_path / "below.obj").write_text("v 0 0 -9\nv 1 0 -9\nv 0 1 -9\nf 1 2 3\n")
    flat = placed((0, 0, -9), (1, 0, 0), (0, -1, 0))
    black = {"bsdf": diffuse(0.0), "emitter": area(1.0)}
    kinds = [
        {"type": "obj", "filename": str(tmp_path / "below.obj")} | black,
        {"type": "disk", "to_world": flat} | black,
        {"type": "rectangle", "to_world": flat} | black,
        sphere(diffuse(0.0), center=(0, 0, -9)) | black,
    ]
    others = [kind for kind in kinds if kind["type"] != light["type"]]
    return scene(camera, "path", floor(0.5), light | black, *others, max_depth=2)


def corner_factor(a: float, b: float) -> float:
    """Return the form factor of a rectangle a x b at height 1 above one of its corners."""
    p, q = np.hypot(1, a), np.hypot(1, b)
    return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)


def lambert_irradiance(corners) -> float:
    """Return E / L at the origin, normal +z: half the sum of Theta_i Gamma_i . n [Lambert].

    Theta_i is the angle that edge i fills, Gamma_i the unit normal of its plane.
    """
    total = 0.0
    for p, q in zip(corners, [*corners[1:], corners[0]], strict=True):
        p, q = np.array(p) / np.linalg.norm(p), np.array(q) / np.linalg.norm(q)
        across = np.cross(p, q)
        sine = np.linalg.norm(across)
        total += np.arctan2(sine, p @ q) * across[2] / sine
    return abs(total) / 2
