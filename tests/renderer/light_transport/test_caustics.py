"""Light by way of a mirror or through glass: what a path tracer finds, and what it cannot.

Row P of docs/ground_truth.md, after the scenes of [Smits2000]: flat mirrors make an image
of the lamp, whose light adds to the lamp's own.
"""

from __future__ import annotations

import numpy as np
import pytest
from form_factors import corner_factor
from metamorphic_scenes import unseen
from small_scenes import (
    assert_mean,
    diffuse,
    floor,
    mirror,
    pixels,
    point_light,
    rectangle,
    scene,
    sensor,
)

RHO = 0.5
VIEWS = {"size": (32, 32), "fov": 1e-3, "spp": 128, "jitter": True}


def above(x, y, half):
    """Form factor of a level square at height 1 about (x, y), seen from the origin.

    Signed sum of the factors of four rectangles that have a corner above the origin.
    """
    total = 0.0
    for sx in (-1, 1):
        for sy in (-1, 1):
            a, b = x + sx * half, y + sy * half
            total += sx * sy * np.sign(a * b) * corner_factor(abs(a), abs(b))
    return total


def beside_mirrors(*walls, **settings):
    """Return a floor under a lamp of half width 1/2 at height 1, with upright mirrors."""
    lamp = rectangle((0, 0, 1), (0.5, 0, 0), (0, -0.5, 0), diffuse(0.0), shine=1.0)
    camera = sensor((0, -0.5, 0.1), (0, 0, 0), **VIEWS)
    parts = (floor(RHO), lamp, *walls, *unseen())
    return scene(camera, "path", *parts, rr_depth=64, **settings)


def wall(x, reflectance):
    """Return an upright mirror at x that looks at x = 0."""
    side = -np.sign(x)
    return rectangle((x, 0, 0), (0, side * 20, 0), (0, 0, 20), mirror(reflectance))


@pytest.mark.parametrize("reflectance", [1.0, 0.5])
def test_a_mirror_adds_the_light_of_the_lamp_s_image(reflectance):
    """L = rho (F(lamp) + r F(image)): a caustic of a flat mirror, 1 from the lamp's middle.

    Three segments: camera, floor, mirror, lamp; the fourth would be the floor's own light.
    """
    content = beside_mirrors(wall(1.0, reflectance), max_depth=3)
    expected = RHO * (above(0, 0, 0.5) + reflectance * above(2, 0, 0.5))
    assert_mean(content, expected, within=2e-3, integrator="path")


def test_two_mirrors_make_a_row_of_images():
    """Row S: images at +-2, +-4, ... with r, r^2, ...: 8 segments hold 6 reflections.

    Each further reflection adds its two images, from below, to the sum without end.
    """
    r, sums = 0.8, []
    for bounces in (0, 1, 2, 6):
        images = sum(r**k * above(2 * k, 0, 0.5) for k in range(1, bounces + 1))
        sums.append(RHO * (above(0, 0, 0.5) + 2 * images))
    assert sums == sorted(sums)
    for bounces, expected in zip((1, 2, 6), sums[1:], strict=True):
        # a floor of a thousandth: the mirrors see lamp and each other alone
        content = beside_mirrors(wall(1.0, r), wall(-1.0, r), max_depth=2 + bounces)
        content["part0"] = floor(RHO, half=1e-3)
        assert_mean(content, expected, within=2e-3, integrator="path")


def test_the_image_of_a_point_light_is_never_found():
    """No path meets a point by chance: the floor shows the lamp's own light and no more.

    L = rho / pi I h / d^3 = 0.159, without the 9 % that the image at (2, 0, 1) would add.
    """
    camera = sensor((0, -0.5, 0.1), (0, 0, 0))
    lamp = point_light((0, 0, 1))
    content = scene(camera, "path", floor(RHO), wall(1.0, 1.0), lamp, max_depth=3)
    seen = pixels(content, spp=64, integrator="path")
    assert seen == pytest.approx(RHO / np.pi, rel=1e-5)
