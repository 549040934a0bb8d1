"""Small scenes with participating media, and the means of their pictures."""

from __future__ import annotations

import numpy as np

import renderer

NULL = {"type": "null"}
SKY = {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
LIMIT = 5.0  # standard errors


def scaled(x, y=None, z=None, at=(0.0, 0.0, 0.0)):
    matrix = np.diag([x, x if y is None else y, x if z is None else z, 1.0])
    matrix[:3, 3] = at
    return matrix


def camera(fov=20.0, size=4, spp=64, distance=5.0, **more):
    to_world = np.diag([-1.0, 1.0, -1.0, 1.0])
    to_world[2, 3] = distance
    return {
        "type": "perspective",
        "fov": fov,
        "to_world": to_world,
        "film": {
            "type": "hdrfilm",
            "width": size,
            "height": size,
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "independent", "sample_count": spp},
        **more,
    }


def parallel(half, spp):
    """Return a camera that sees a square of twice `half`, head-on."""
    sensor = camera(spp=spp) | {"type": "orthographic"}
    del sensor["fov"]
    sensor["to_world"] = sensor["to_world"] @ np.diag([half, half, 1.0, 1.0])
    return sensor


def described(inside, *, depth=-1, light=SKY, shape=None, more=None, spp=64, **sensor):
    shape = shape or {"type": "cube", "bsdf": NULL}
    return renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": depth, "rr_depth": 50},
            "sensor": camera(spp=spp, **sensor),
            "light": light,
            "shape": shape | {"interior": inside},
            **(more or {}),
        }
    )


def pixels(scene, seeds=16, **options):
    """Return pictures of several seeds, (seeds, H, W, 3)."""
    return np.array(
        [renderer.render(scene, seed=k, **options).pixels for k in range(seeds)]
    )


def assert_mean(pictures, expected):
    """Compare the mean of all pixels of each channel."""
    means = pictures.reshape(len(pictures), -1, 3).mean(axis=1)
    error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    assert (error < 0.02 * expected).all()
    off = np.abs(means.mean(axis=0) - expected)
    assert (off <= LIMIT * error + 2e-6 * np.abs(expected)).all(), (
        means.mean(axis=0),
        expected,
        error,
    )


def homogeneous(sigma=1.0, albedo=0.0, scale=1.0, **more):
    def color(value):
        if isinstance(value, float):
            return value
        return {"type": "rgb", "value": list(value)}

    return {
        "type": "homogeneous",
        "sigma_t": color(sigma),
        "albedo": color(albedo),
        "scale": scale,
        **more,
    }
