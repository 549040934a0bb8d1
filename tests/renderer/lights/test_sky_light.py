"""Under a sky of radiance 1: shares of the sky, furnaces of each BSDF, varnish.

Rows K and L of docs/ground_truth.md. What sees all of the sky and absorbs nothing has
radiance 1; what sees a part of it has its form factor. One set of kernels for all: squares,
three kinds of BSDF, an even sky.
"""

from __future__ import annotations

import numpy as np
import pytest
from form_factors import corner_factor
from small_scenes import (
    assert_mean,
    diffuse,
    glass,
    mirror,
    pixels,
    rectangle,
    scene,
    sensor,
    sky,
)

RHO = 0.5
VIEWS = {"size": (32, 32), "fov": 1e-3, "spp": 64, "jitter": True}


def under_sky(camera, *parts, depth=2):
    """Return parts under the sky; the two BSDFs they may lack are far below, edge on."""
    below = [
        rectangle((0, 0, -900), (0, 1, 0), (0, 0, 1), bsdf)
        for bsdf in (diffuse(0.0), mirror(), glass())
    ]
    return scene(camera, "path", *parts, *below, sky(1.0), max_depth=depth, rr_depth=64)


def square(height, half, bsdf, *, side=1):
    """Return a level square that looks up (1) or down (-1)."""
    return rectangle((0, 0, height), (half, 0, 0), (0, side * half, 0), bsdf)


# -------------------------------------------------------------------- shares of the sky


def test_an_open_plane():
    """E = pi L, so L_o = rho: all of the upper half is sky."""
    content = under_sky(sensor((0, -3, 2), (0, 0, 0), **VIEWS), square(0, 1, diffuse(RHO)))
    assert_mean(content, RHO, within=1e-3, integrator="path")


CHOICES = ["importance", "uniform"]  # an even sky is found alone, or sampled as well


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("degrees", [30, 60, 90])
def test_a_tilted_plane_over_a_black_floor(degrees, choice):
    """It sees (1 + cos(tilt)) / 2 of the sky, weighted by the cosine; the rest is floor.

    The floor reaches 500,000 times as far as the square is high: what is missing of it is
    less than 3e-6 of what an upright square sees.
    """
    tilt = np.radians(degrees)
    normal = np.array([0, -np.sin(tilt), np.cos(tilt)])
    up = np.array([0, np.cos(tilt), np.sin(tilt)])
    target = np.array([0, 0, 1.0])
    tilted = rectangle(target, (0.5, 0, 0), 0.5 * up, diffuse(RHO))
    camera = sensor(target + 0.25 * normal, target, up=up, **VIEWS)
    content = under_sky(camera, tilted, square(0, 5e5, diffuse(0.0)))
    expected = RHO * (1 + np.cos(tilt)) / 2
    assert_mean(content, expected, within=1e-3, integrator="path", light_choice=choice)


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("height", [0.25, 1.0, 4.0])
def test_a_roof_takes_its_form_factor_away(height, choice):
    """Under a black square the sky is 1 - F, with Howell's F of its four quarters."""
    camera = sensor((0, -height / 2, height / 8), (0, 0, 0), **VIEWS)
    roof = square(height, 1, diffuse(0.0), side=-1)
    content = under_sky(camera, square(0, 9, diffuse(RHO)), roof)
    free = 1 - 4 * corner_factor(1 / height, 1 / height)
    assert_mean(
        content, RHO * free, within=3e-3, spp=256, integrator="path", light_choice=choice
    )


# ---------------------------------------------------------------------- furnaces by angle

ANGLES = [0, 30, 60, 80, 89]


def seen_at(degrees, bsdf, *, depth=2, **film):
    """Return a large square with a BSDF, seen at an angle to its normal."""
    angle = np.radians(degrees)
    eye = (np.sin(angle), 0, np.cos(angle))
    camera = sensor(eye, (0, 0, 0), up=(0, 1, 0), **film)
    return under_sky(camera, square(0, 99, bsdf), depth=depth)


@pytest.mark.parametrize("degrees", ANGLES)
def test_furnace_of_a_mirror_and_of_glass(degrees):
    """Row K: a mirror that absorbs nothing is invisible at any angle, without noise.

    Of glass one surface is here, and no way out: F + (1 - F) / n^2, where path chooses one
    of the two, and the mean counts.
    """
    assert pixels(seen_at(degrees, mirror()), integrator="path") == pytest.approx(
        1, rel=1e-6
    )
    cosine = np.cos(np.radians(degrees))
    reflectance = unpolarized(cosine, 1.5)
    expected = reflectance + (1 - reflectance) / 1.5**2
    assert_mean(
        seen_at(degrees, glass(), **VIEWS), expected, within=1e-3, integrator="path"
    )


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("sides", ["one", "two", "behind"])
def test_furnace_of_a_diffuse_surface(degrees, sides):
    """Row K: rho at every angle; twosided too, and its second BSDF from behind."""
    front, back = diffuse(0.8), diffuse(0.3)
    bsdf = front if sides == "one" else {"type": "twosided", "front": front, "back": back}
    content = seen_at(degrees, bsdf, **VIEWS)
    if sides == "behind":
        content["part0"] = square(0, 99, bsdf, side=-1)
    assert_mean(content, 0.3 if sides == "behind" else 0.8, within=1e-3, integrator="path")


def unpolarized(cosine, index):
    """Fresnel's reflectance for a complex index, by complex square roots."""
    far = np.sqrt(index**2 - 1 + cosine**2 + 0j)
    s = (cosine - far) / (cosine + far)
    p = (index**2 * cosine - far) / (index**2 * cosine + far)
    return 0.5 * (np.abs(s) ** 2 + np.abs(p) ** 2)


@pytest.mark.parametrize("degrees", ANGLES)
def test_furnace_of_a_metal(degrees):
    """Row K: a metal shows its Fresnel reflectance; eta + i k = 0.2 + 3.9 i (a silver)."""
    metal = {"type": "conductor", "eta": 0.2, "k": 3.9}
    seen = pixels(seen_at(degrees, metal), integrator="path")
    expected = unpolarized(np.cos(np.radians(degrees)), 0.2 + 3.9j)
    assert 0.9 < expected < 1
    assert seen == pytest.approx(expected, rel=1e-5)


# -------------------------------------------------------------------------------- varnish


def diffuse_reflectance(n):
    """Return what share of diffuse light a flat surface of glass reflects [Walsh1926]."""
    m = n * n
    return (
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + m * (m - 1) ** 2 / (m + 1) ** 3 * np.log((n - 1) / (n + 1))
        - 2 * n**3 * (m + 2 * n - 1) / ((m + 1) * (m * m - 1))
        + 8 * m * m * (m * m + 1) / ((m + 1) * (m * m - 1) ** 2) * np.log(n)
    )


@pytest.mark.parametrize(("rho", "n"), [(0.5, 1.5), (0.9, 1.5), (0.5, 1.33)])
def test_varnish_over_a_diffuse_floor(rho, n):
    """Light enters glass, goes round in it, and leaves again [Saunderson1942].

    Outside reflects k1 of diffuse light, inside k2 = 1 - (1 - k1) / n^2 (mostly totally).
    Seen straight from above, F + (1 - F) / n^2 rho (1 - k1) / (1 - rho k2): a sky's light
    through a refracting surface, which only paths that go on through glass can find. It
    holds Fresnel inside and outside, n^2, total reflection and roulette together.
    """
    assert diffuse_reflectance(1.5) == pytest.approx(0.0917780, abs=1e-7)
    k1, straight = diffuse_reflectance(n), ((n - 1) / (n + 1)) ** 2
    k2 = 1 - (1 - k1) / n**2
    expected = straight + (1 - straight) / n**2 * rho * (1 - k1) / (1 - rho * k2)
    # 500 times as wide as thick: light that leaves at the rim is less than 1e-5
    parts = square(0, 50, diffuse(rho)), square(0.1, 50, glass(n))
    camera = sensor((0, 0, 2), (0, 0, 0), up=(0, 1, 0), **VIEWS)
    assert_mean(under_sky(camera, *parts, depth=-1), expected, within=2e-3)
