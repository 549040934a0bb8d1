"""Environment maps as files, and directions that find what goes wrong in them."""

from __future__ import annotations

import numpy as np
from image_files import write_exr
from scene_file_samples import mi

LAMP = {"lamp": {"type": "rectangle"}}


def write_map(path, image):
    planes = {name: image[..., k].astype(np.float32) for k, name in enumerate("RGB")}
    return str(write_exr(path, planes))


def turned():
    axis = np.array([1, 2, 0.5]) / np.linalg.norm([1, 2, 0.5])
    spin = mi.ScalarTransform4f().rotate(list(axis), 40).rotate([0, 1, 0], 25)
    return spin.scale([1, 1, -1])


def directions(n):
    """Even over the sphere, and 1 in 200 within a hundredth of the poles."""
    rng = np.random.default_rng(20)
    d = rng.normal(size=(n, 3))
    d[: n // 200] *= 0.003, 1.0, 0.003
    return np.float32(d / np.linalg.norm(d, axis=1, keepdims=True)).astype(float)
