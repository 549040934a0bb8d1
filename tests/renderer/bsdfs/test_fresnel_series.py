"""Reflection and refraction as `whitted` follows them: Fresnel's formulas, their series."""

from __future__ import annotations

import numpy as np
import pytest
from metamorphic_scenes import unseen
from small_scenes import (
    assert_mean,
    diffuse,
    glass,
    mirror,
    pixels,
    point_light,
    rectangle,
    scene,
    sensor,
)


def radiance(content):
    return pixels(content)[0, 0]


def lamp(position, radiance):
    """Return a small square light around `position` that faces the origin."""
    position = np.array(position, float)
    towards = -position / np.linalg.norm(position)
    x = np.cross((0, 1, 0), towards)
    x *= 0.05 / np.linalg.norm(x)
    y = 0.05 * np.cross(towards, x / 0.05)
    return rectangle(position, x, y, diffuse(0.0), shine=radiance)


def interface(degrees, index=1.5, *, from_inside=False):
    """Return (reflected, refracted) radiance of unit lamps at a glass surface.

    The camera looks at the origin of the plane z = 0, glass below; one lamp, red, is where
    the reflected ray goes (behind the camera, at normal incidence), the other, green, where
    the refracted one does.
    """
    angle = np.radians(degrees)
    side = -1.0 if from_inside else 1.0
    sine, cosine = np.sin(angle), np.cos(angle)
    eta = 1 / index if from_inside else index
    bent = sine / eta
    parts = [
        rectangle((0, 0, 0), (3, 0, 0), (0, 3, 0), glass(index)),
        lamp((2 * sine, 0, side * 2 * cosine), (1.0, 0.0, 0.0)),
    ]
    if bent < 1:
        under = (2 * bent, 0, -side * 2 * np.sqrt(1 - bent**2))
        parts.append(lamp(under, (0.0, 1.0, 0.0)))
    camera = sensor((-sine, 0, side * cosine), (0, 0, 0), up=(0, 1, 0))
    red, green, _ = radiance(scene(camera, "whitted", *parts, max_depth=2, cutoff=1e-7))
    return red, green


@pytest.mark.parametrize(
    ("degrees", "reflectance"),
    [
        (0, 0.04),
        (30, 0.0415226),
        (45, 0.0502399),
        (56.30993, 0.0739645),
        (60, 0.0891867),
        (80, 0.3877044),
        (85, 0.6127996),
    ],
)
def test_glass_reflects_as_fresnel_says(degrees, reflectance):
    """Unpolarized reflectance F of n = 1.5; the rest goes through, squeezed by 1 / n^2."""
    reflected, refracted = interface(degrees)
    assert reflected == pytest.approx(reflectance, rel=1e-4)
    assert refracted == pytest.approx((1 - reflectance) / 1.5**2, rel=1e-4)


@pytest.mark.parametrize("degrees", [0, 30, 41])
def test_fresnel_is_the_same_from_inside(degrees):
    """F(theta_t inside) = F(theta_i outside): light takes the same way back."""
    outside = np.degrees(np.arcsin(1.5 * np.sin(np.radians(degrees))))
    reflected, refracted = interface(degrees, from_inside=True)
    assert reflected == pytest.approx(interface(outside)[0], rel=2e-4)
    assert refracted == pytest.approx((1 - reflected) * 1.5**2, rel=1e-4)


@pytest.mark.parametrize("degrees", [41.9, 60, 85])
def test_total_internal_reflection(degrees):
    """Beyond 41.8103 degrees inside n = 1.5 everything is reflected, without a NaN."""
    assert interface(degrees, from_inside=True) == pytest.approx((1, 0), rel=1e-6)


@pytest.mark.parametrize("index", [1.5, 3.0])
def test_glass_slab_is_a_geometric_series_approached_from_below(index):
    """R = 2 r / (1 + r), T = (1 - r) / (1 + r) of a slab; 0.0769231, 0.9230769 at n = 1.5.

    Each further depth adds one term of r + r t^2 (1 + r^2 + ...) or t^2 (1 + r^2 + ...).
    """
    r = ((index - 1) / (index + 1)) ** 2
    t = 1 - r
    parts = [
        rectangle((0, 0, 0), (3, 0, 0), (0, 3, 0), glass(index)),
        rectangle((0, 0, -0.1), (3, 0, 0), (0, -3, 0), glass(index)),
        lamp((0, 0, 2), (1.0, 0.0, 0.0)),
        lamp((0, 0, -2), (0.0, 1.0, 0.0)),
    ]
    camera = sensor((0, 0, 1), (0, 0, 0), up=(0, 1, 0))
    seen = np.array(
        [
            radiance(scene(camera, "whitted", *parts, max_depth=d, cutoff=1e-7))[:2]
            for d in range(1, 13)
        ],
        np.float64,
    )
    reflected, through = np.zeros((2, 12))
    for d in range(2, 13):
        k = np.arange(max(d - 2, 0) // 2)  # two more surfaces for each further term
        reflected[d - 1] = r + r * t * t * (r ** (2 * k)).sum()
        k = np.arange((d - 1) // 2)
        through[d - 1] = t * t * (r ** (2 * k)).sum()
    assert seen == pytest.approx(np.column_stack([reflected, through]), rel=1e-5, abs=1e-9)
    limit = np.array([2 * r / (1 + r), (1 - r) / (1 + r)])
    assert (np.diff(seen, axis=0) >= 0).all()
    assert seen[-1] == pytest.approx(limit, rel=1e-4)
    assert (seen < limit * (1 + 1e-6)).all()


@pytest.mark.parametrize("depth", [3, 5, 12])
def test_path_finds_the_same_series_by_chance(depth):
    """The slab once more, where each surface reflects or lets through at random.

    Paths of 3, 5 and 12 segments hold 1, 2 and 5 terms of T.
    """
    r = (0.5 / 2.5) ** 2
    expected = (1 - r) ** 2 * (r ** (2 * np.arange((depth - 1) // 2))).sum()
    views = {"size": (32, 32), "fov": 1e-3, "spp": 16, "jitter": True}
    content = scene(
        sensor((0, 0, 1), (0, 0, 0), up=(0, 1, 0), **views),
        "path",
        rectangle((0, 0, 0), (3, 0, 0), (0, 3, 0), glass()),
        rectangle((0, 0, -0.1), (3, 0, 0), (0, -3, 0), glass()),
        lamp((0, 0, -2), (1.0, 1.0, 1.0)),
        *unseen(),
        max_depth=depth,
        rr_depth=64,
    )
    assert_mean(content, expected, within=1e-3, integrator="path")


def corridor(bounces, **settings):
    """Return a corridor of mirrors, whose end is seen after some reflections.

    Unfolded, the view is a straight line that crosses a wall each time; the lamp lights
    the middle of the end directly (mirrors throw no light on walls in Whitted's model).
    """
    return scene(
        sensor((0, 0, 0), (2 * bounces, 10, 0)),
        "whitted",
        rectangle((-1, 5, 0), (0, 6, 0), (0, 0, 2), mirror(0.5)),
        rectangle((1, 5, 0), (0, 6, 0), (0, 0, -2), mirror(0.5)),
        rectangle((0, 10, 0), (1, 0, 0), (0, 0, 1), diffuse(0.5)),
        point_light((0, 8, 0)),
        max_depth=8,
        **settings,
    )


@pytest.mark.parametrize("bounces", range(6))
def test_mirror_corridor_dims_by_its_reflectance_each_time(bounces):
    """L = r^k rho / pi I / h^2 after k reflections, whatever way the light has gone."""
    expected = 0.5**bounces * 0.5 / np.pi / 4
    assert radiance(corridor(bounces)) == pytest.approx(expected, rel=2e-5)


def test_weights_below_the_cutoff_are_dropped():
    """After k mirrors the weight is 0.5^k: with cutoff 0.2 the third is not followed."""
    assert (radiance(corridor(2, cutoff=0.2)) > 0).all()
    assert (radiance(corridor(3, cutoff=0.2)) == 0).all()
