"""Images with numbers below 0: what they take away is taken away, as in Mitsuba.

Conversions from wide primaries and filters with lobes leave such pixels. Both renderers
keep them; a path that carries only negative light, or whose colours cancel out in a sum,
goes on as any other.
"""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from small_scenes import diffuse, floor, mirror, pixels, scene, sensor, sphere

import renderer

mi.set_variant("scalar_rgb")

# left to right; the mean of each image is positive
SLIDE = np.array([[[-0.5, -0.25, -0.125], [0.5, -0.5, 0.0], [2, 2, 2], [2, 2, 2]]], "f4")


def picture_of(texture: str, **more: Any) -> dict[str, Any]:
    return {texture: SLIDE, "type": "bitmap", "filter_type": "nearest", **more}


def looking_down(columns: int) -> dict[str, Any]:
    """Look at the square [-1, 1]^2 in z = 0 from above, a column for each of its parts."""
    fov = float(np.degrees(2 * np.arctan(1 / 100)))
    return sensor((0, 0, 100), (0, 0, 0), up=(0, 1, 0), fov=fov, size=(columns, 1), spp=16)


@pytest.mark.parametrize("max_depth", [2, 3])
def test_a_negative_reflectance_under_an_even_sky(max_depth: int) -> None:
    """A diffuse surface under radiance 1 shows its reflectance.

    Both strategies of the direct light must find it: with half of them the sum would be
    about half of what it is.
    """
    board = {"type": "rectangle", "bsdf": {"type": "diffuse"}}
    board["bsdf"]["reflectance"] = picture_of("bitmap")
    content = scene(looking_down(4), "path", board, {"type": "constant"})
    content["integrator"]["max_depth"] = max_depth
    found = pixels(content)[0]
    np.testing.assert_allclose(found, SLIDE[0], rtol=2e-3, atol=1e-5)


def test_a_negative_reflectance_is_seen_through_a_mirror() -> None:
    """The path's throughput is negative before it reaches what shines."""
    board = {"type": "rectangle", "bsdf": mirror()}
    board["bsdf"]["specular_reflectance"] = picture_of("bitmap")
    content = scene(looking_down(4), "path", board, {"type": "constant"})
    np.testing.assert_allclose(pixels(content)[0], SLIDE[0], rtol=1e-5, atol=1e-6)


def mitsubas(content: dict[str, Any]) -> np.ndarray:
    """Return Mitsuba's picture of a scene."""

    def converted(name: str, value: Any) -> Any:
        if isinstance(value, dict):
            return {key: converted(key, part) for key, part in value.items()}
        if isinstance(value, np.ndarray):
            kind = mi.ScalarTransform4f if name == "to_world" else mi.Bitmap
            return kind(value)
        return value

    content = converted("", content)
    content["sensor"]["sampler"] = {"type": "independent", "sample_count": 256}
    return np.array(mi.render(mi.load_dict(content)))


def test_a_slide_with_negative_pixels_is_that_of_mitsuba() -> None:
    """A projector's light is sampled alone, whatever its sign."""
    to_world = np.diag([1.0, -1.0, -1.0, 1.0])
    to_world[2, 3] = 2.0
    lamp = {"type": "projector", "irradiance": picture_of("bitmap"), "fov": 53.13}
    content = scene(looking_down(8), "path", floor(1.0), {**lamp, "to_world": to_world})
    found, theirs = pixels(content), mitsubas(content)
    assert theirs.min() < -0.01
    np.testing.assert_allclose(found, theirs, rtol=0.05, atol=2e-3)


def test_a_sky_with_negative_pixels_is_that_of_mitsuba() -> None:
    """A diffuse ball: what is below 0 is found by BSDF samples alone."""
    image = np.random.default_rng(4).random((8, 12, 3), np.float32)
    image[2:4, 3:5] = image[5, 7] = -2.0
    sky = {"type": "envmap", "bitmap": mi.Bitmap(image)}
    view = sensor((0, -5, 0), (0, 0, 0), fov=20.0, size=(6, 6), spp=1024)
    content = scene(view, "path", sphere(diffuse(0.8)), sky)
    (warning,) = renderer.load_dict(content).description.warnings
    assert "bitmap: 5 of 96 pixels are negative, down to -2" in warning
    found, theirs = pixels(content), mitsubas(content)
    np.testing.assert_allclose(found.mean(axis=(0, 1)), theirs.mean(axis=(0, 1)), rtol=0.03)
