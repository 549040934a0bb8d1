"""Small scenes as dictionaries, for the tests that render.

A sampler of one kind everywhere (`stratified`) and the box filter: each new kind of shape,
BSDF, light, sampler or filter in a scene is another set of kernels to compile.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import renderer

Vector = Sequence[float]


def look_at(origin: Vector, target: Vector, up: Vector = (0, 0, 1)) -> NDArray[np.float64]:
    """Return the camera's to_world: local +z looks at `target`, +x is left, +y is up."""
    o, forward = np.array(origin, float), np.subtract(target, origin).astype(float)
    forward /= np.linalg.norm(forward)
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([left, np.cross(forward, left), forward, o])
    return matrix


def placed(center: Vector, half_x: Vector, half_y: Vector) -> NDArray[np.float64]:
    """Return a to_world for flat shapes: centre, half edges, normal half_x x half_y."""
    normal = np.cross(half_x, half_y).astype(float)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([half_x, half_y, normal / np.linalg.norm(normal), center])
    return matrix


def rgb(*value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value) if len(value) == 3 else [value[0]] * 3}


def sensor(
    origin: Vector,
    target: Vector,
    *,
    up: Vector = (0, 0, 1),
    fov: float = 0.01,
    size: tuple[int, int] = (1, 1),
    spp: int = 1,
    jitter: bool = False,
    rfilter: str = "box",
    crop: tuple[int, int, int, int] | None = None,
) -> dict[str, Any]:
    """Return a pinhole camera; by default one pixel that looks exactly at `target`.

    `crop` is (x, y, width, height).
    """
    film: dict[str, Any] = {
        "type": "hdrfilm",
        "width": size[0],
        "height": size[1],
        "rfilter": {"type": rfilter},
    }
    if crop is not None:
        names = ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height")
        film |= dict(zip(names, crop, strict=True))
    return {
        "type": "perspective",
        "to_world": look_at(origin, target, up),
        "fov": float(fov),
        "near_clip": 1e-4,
        "film": film,
        "sampler": {"type": "stratified", "sample_count": spp, "jitter": jitter},
    }


def diffuse(*reflectance: float) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": rgb(*reflectance)}


def mirror(reflectance: float = 1.0) -> dict[str, Any]:
    """Return a metal that reflects this much at any angle."""
    return {
        "type": "conductor",
        "material": "none",
        "specular_reflectance": rgb(reflectance),
    }


def glass(index: float = 1.5) -> dict[str, Any]:
    return {"type": "dielectric", "int_ior": index, "ext_ior": 1.0}


def rectangle(
    center: Vector,
    half_x: Vector,
    half_y: Vector,
    bsdf: dict[str, Any],
    *,
    shine: Any = None,
) -> dict[str, Any]:
    """Return a rectangle with normal half_x x half_y; `shine` makes it an area light."""
    shape = {"type": "rectangle", "to_world": placed(center, half_x, half_y), "bsdf": bsdf}
    return shape if shine is None else shape | {"emitter": area(shine)}


def floor(reflectance: float = 0.5, half: float = 10.0) -> dict[str, Any]:
    """Return a diffuse square at z = 0 that faces up."""
    return rectangle((0, 0, 0), (half, 0, 0), (0, half, 0), diffuse(reflectance))


def sphere(
    bsdf: dict[str, Any],
    *,
    center: Vector = (0, 0, 0),
    radius: float = 1.0,
    inward: bool = False,
) -> dict[str, Any]:
    return {
        "type": "sphere",
        "center": list(center),
        "radius": float(radius),
        "flip_normals": inward,
        "bsdf": bsdf,
    }


def area(radiance: Any) -> dict[str, Any]:
    values = radiance if isinstance(radiance, Sequence) else (radiance,)
    return {"type": "area", "radiance": rgb(*values)}


def point_light(position: Vector, intensity: float = 1.0) -> dict[str, Any]:
    return {"type": "point", "position": list(position), "intensity": rgb(intensity)}


def sun(direction: Vector, irradiance: float = 1.0) -> dict[str, Any]:
    return {
        "type": "directional",
        "direction": list(direction),
        "irradiance": rgb(irradiance),
    }


def sky(radiance: float = 1.0) -> dict[str, Any]:
    return {"type": "constant", "radiance": rgb(radiance)}


def scene(
    camera: dict[str, Any],
    integrator: str | dict[str, Any],
    *parts: dict[str, Any],
    **settings: Any,
) -> dict[str, Any]:
    """Return a scene; `settings` are the integrator's properties."""
    kind = {"type": integrator, **settings} if isinstance(integrator, str) else integrator
    content = {"type": "scene", "integrator": kind, "sensor": camera}
    return content | {f"part{i}": part for i, part in enumerate(parts)}


def box(
    reflectance: float | Vector, *, shine: float | None = None, half: float = 1.0
) -> list[dict[str, Any]]:
    """Return six squares that face inwards; with `shine` each of them is a light."""
    colour = reflectance if isinstance(reflectance, Sequence) else (reflectance,)
    walls = []
    for axis in range(3):
        for side in (-half, half):
            center, x, y = np.zeros((3, 3))
            center[axis] = side
            x[(axis + 1) % 3] = half
            y[(axis + 2) % 3] = -np.sign(side) * half  # x cross y points inwards
            walls.append(rectangle(center, x, y, diffuse(*colour), shine=shine))
    return walls


def pixels(content: dict[str, Any], **arguments: Any) -> NDArray[np.float32]:
    """Render a scene; `arguments` are those of `renderer.render`."""
    return np.asarray(renderer.render(renderer.load_dict(content), **arguments))


def mean_and_error(content: dict[str, Any], *, seeds: int = 16, **arguments: Any) -> tuple:
    """Render with several seeds; return the pictures' mean, per channel, and its error.

    The standard error comes from the variance over seeds, never over pixels: pixels may
    share samples.
    """
    loaded = renderer.load_dict(content)
    pictures = (
        np.asarray(renderer.render(loaded, seed=seed, **arguments)) for seed in range(seeds)
    )
    means = np.array([picture.mean(axis=(0, 1), dtype=np.float64) for picture in pictures])
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(seeds)


# Student's t with 15 degrees of freedom passes this with probability 1e-4: the false alarm
# rate of one comparison with 16 seeds. The seeds are fixed, so a test that passes once
# passes always; a change of the random numbers draws again.
FALSE_ALARM_1E_4 = 5.24


def assert_mean(
    content: dict[str, Any], expected: float, *, within: float, **arguments: Any
) -> None:
    """Assert that the expectation of a picture's mean is a value known on paper.

    `within` is the relative standard error that the test must reach to mean anything.
    Single precision may add 2e-5 of the value. The false alarm rate is 1e-4, and a bias of
    8.5 standard errors is found with 99 % (Student's t with 15 degrees of freedom): at most
    8.5 x `within` of the value.
    """
    mean, error = mean_and_error(content, **arguments)
    assert (error < within * expected).all(), f"too noisy: {error} of {expected}"
    allowed = FALSE_ALARM_1E_4 * error + 2e-5 * expected
    assert (np.abs(mean - expected) <= allowed).all(), f"{mean} +- {error}, not {expected}"


def white_furnace(**film):
    """Return a white diffuse, a mirror and a glass ball under a white sky."""
    camera = sensor((0, -8, 0), (0, 0, 0), **film)
    balls = [diffuse(1.0), mirror(), glass()]
    parts = [sphere(b, center=(2.5 * (i - 1), 0, 0)) for i, b in enumerate(balls)]
    return scene(camera, "path", *parts, sky(1.0), max_depth=32, rr_depth=32)
