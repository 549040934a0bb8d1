"""Light that goes round: furnaces, whose sums over bounces are known on paper.

A furnace alone cannot see a wrong distribution of directions (Smits and Jensen, "Global
Illumination Test Scenes"): the sphere with a lamp off its centre and the lights of
test_closed_forms.py complement it.
"""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import (
    assert_mean,
    box,
    diffuse,
    floor,
    glass,
    pixels,
    point_light,
    scene,
    sensor,
    sphere,
    white_furnace,
)

import renderer


def furnace(albedo, **settings):
    camera = sensor(
        (0.2, 0.1, -0.1), (1, 0, 0.2), fov=90, size=(16, 16), spp=16, jitter=True
    )
    return scene(camera, "path", *box(albedo, shine=1.0), **settings)


@pytest.mark.parametrize(
    ("albedo", "terms", "expected"),
    [(0.5, 1, 1.0), (0.5, 2, 1.5), (0.5, 3, 1.75), (0.8, 8, 4.16114), (0.8, 16, 4.85926)],
)
def test_furnace_of_finite_depth_is_a_partial_sum(albedo, terms, expected):
    """K segments give Le (1 - a^K) / (1 - a), one term for each segment of the path."""
    assert (1 - albedo**terms) / (1 - albedo) == pytest.approx(expected, abs=1e-5)
    content = furnace(albedo, max_depth=terms, rr_depth=terms)
    assert_mean(content, expected, within=3e-3, integrator="path")


@pytest.mark.parametrize(("albedo", "expected"), [(0.2, 1.25), (0.5, 2.0), (0.8, 5.0)])
def test_russian_roulette_keeps_the_furnace_at_its_limit(albedo, expected):
    """With roulette and no depth limit the sum is Le / (1 - a): nothing is lost or gained.

    Roulette that forgets to divide by the survival probability ends at 2.95, not 5. At
    0.2 each path is dim after its first bounce, and may end before `rr_depth`.
    """
    assert_mean(furnace(albedo, max_depth=-1, rr_depth=3), expected, within=3e-3)


@pytest.mark.parametrize("max_depth", [2, 3, 4, 9])
def test_lamp_in_the_middle_of_a_sphere(max_depth):
    """I = pi, R = 1, albedo 1/2: each bounce adds half of the last; 1/2, 3/4, 7/8, ...

    All of the wall has the same radiance, so every path has the same value, without noise.
    """
    content = scene(
        sensor((0.3, 0.2, 0.1), (-0.5, 0.8, 0.3), fov=90, size=(8, 8)),
        "path",
        sphere(diffuse(0.5), inward=True),
        point_light((0, 0, 0), np.pi),
        max_depth=max_depth,
        rr_depth=max_depth,
    )
    picture = pixels(content, integrator="path")
    assert picture == pytest.approx(1 - 0.5 ** (max_depth - 1), rel=2e-5)


def test_lamp_off_the_middle_of_a_sphere_lights_it_evenly_by_reflection():
    """Between any two patches of a sphere the form factor is dA / (4 pi R^2).

    So whatever the direct light looks like, the reflected light is the same everywhere:
    L = rho / pi * rho / (1 - rho) * I / R^2 = 0.1591549 for I = R = 1, rho = 1/2. Direct
    light uses the same random numbers in both renders, and cancels (Szirmay-Kalos et al.,
    "Testing Monte Carlo global illumination methods with analytically computable scenes").
    """
    depth, seeds = 18, 16  # the terms left out are 2^-16 of the sum
    camera = sensor(
        (0.3, 0.2, 0.1), (-1, 0.2, 0.1), fov=120, size=(16, 16), spp=64, jitter=True
    )
    parts = (sphere(diffuse(0.5), inward=True), point_light((0, 0.5, 0)))
    direct, full = (
        renderer.load_dict(scene(camera, "path", *parts, max_depth=d, rr_depth=depth))
        for d in (2, depth)
    )
    pictures = []
    for seed in range(seeds):
        sums = [
            np.asarray(renderer.render(loaded, seed=seed, integrator="path"))
            for loaded in (full, direct)
        ]
        assert sums[1].std() > 0.1 * sums[1].mean()  # the direct light is far from even
        pictures.append((sums[0] - sums[1])[..., 0].astype(np.float64))
    quarters = np.array(
        [[p[y : y + 8, x : x + 8].mean() for y in (0, 8) for x in (0, 8)] for p in pictures]
    )
    mean = quarters.mean(axis=0)
    error = quarters.std(axis=0, ddof=1) / np.sqrt(seeds)
    expected = 0.5 / np.pi
    assert (error < 3e-3 * expected).all()
    assert (np.abs(mean - expected) < 5.24 * error + 2e-5).all()  # t, 15 d.o.f.: 4e-4


def test_white_furnace_shows_nothing_at_all():
    """What absorbs nothing is invisible under an even sky: L = 1, glass and mirror too."""
    film = {"fov": 55, "size": (24, 8), "spp": 16, "jitter": True}
    assert_mean(white_furnace(**film), 1.0, within=1e-3)


@pytest.mark.parametrize("x", [0.0, 2.5], ids=["mirror", "glass"])
def test_white_furnace_without_noise(x):
    """Paths that meet mirrors and glass alone carry exactly 1, whichever way they go.

    Glass weighs 1 / eta^2 on entering and eta^2 on leaving. The diffuse ball, noisy in
    itself, is out of the way.
    """
    content = white_furnace()
    content["sensor"] = sensor(
        (x, -1.5, 0.1), (x, 0, 0), fov=60, size=(8, 8), spp=4, jitter=True
    )
    content["part0"]["center"] = [0, 0, 1e3]
    assert pixels(content) == pytest.approx(1.0, rel=2e-5)


def test_caustic_of_a_point_light_is_exactly_black():
    """Path tracing cannot find it: glass blocks shadow rays, and no path meets a point.

    The whole floor is in the shadow of the glass ball, so nothing is lit at all: a method
    that sees caustics (photons, light tracing) would put light here. Without the ball in
    between, L = rho / pi I / h^2.
    """
    camera = sensor((6, 0, 1), (0, 0, 0))
    lamp = point_light((0, 0, 5), 10.0)
    settings = {"max_depth": 12, "rr_depth": 12}
    ball = sphere(glass(), center=(0, 0, 1.5))
    shaded = scene(camera, "path", floor(0.5, half=1.0), lamp, ball, **settings)
    assert (pixels(shaded, spp=64) == 0).all()

    ball["center"] = [0, 0, 1e3]
    lit = scene(camera, "path", floor(0.5, half=1.0), lamp, ball, **settings)
    assert pixels(lit) == pytest.approx(0.5 / np.pi * 10 / 25, rel=2e-5)
