"""Direct light with an answer on paper: from points, spheres, disks, polygons, the sky.

A Lambert surface of albedo rho under irradiance E has radiance rho E / pi.
"""

from __future__ import annotations

import numpy as np
import pytest
from form_factors import SMALL, corner_factor, lambert_irradiance, under_light
from small_scenes import (
    assert_mean,
    box,
    diffuse,
    floor,
    glass,
    look_at,
    mirror,
    pixels,
    placed,
    point_light,
    rectangle,
    rgb,
    scene,
    sensor,
    sky,
    sphere,
    sun,
)

# ------------------------------------------------------- point, spot and parallel light


def spot_light(position, target, intensity=1.0):
    """Return a spot light of full intensity within 40 degrees, and none from 45 on."""
    return {
        "type": "spot",
        "to_world": look_at(position, target, up=(0, 1, 0)),
        "intensity": rgb(intensity),
        "cutoff_angle": 45.0,
        "beam_width": 40.0,
    }


def one_light(camera, shape, light):
    """Return a shape under one light without area.

    The other kinds of lights are black, and the other shape is where nothing sees it: so
    all scenes are made of the same kinds of things, and their kernels are compiled once.
    """
    shapes = [floor(0.0, half=0.1), sphere(diffuse(0.0), radius=0.1)]
    lights = [
        point_light((0, 0, 9), 0.0),
        spot_light((0, 0, 9), (0, 0, 0), 0.0),
        sun((0, 0, -1), 0.0),
    ]
    other = next(kind for kind in shapes if kind["type"] != shape["type"])
    away = np.eye(4)
    away[:3, 3] = 90.0
    other |= {"to_world": away}
    black = [kind for kind in lights if kind["type"] != light["type"]]
    return scene(camera, "path", shape, other, light, *black, max_depth=2)


@pytest.mark.parametrize(
    ("r", "expected"), [(0.0, 0.1591549), (1.0, 0.0562698), (3.0, 0.5 / np.pi / 10**1.5)]
)
def test_point_light_over_a_plane_falls_off_as_lambert_says(r, expected):
    """L = rho / pi I h / (h^2 + r^2)^(3/2): Lambert's cosine and the inverse square."""
    camera = sensor((r, -3, 5), (r, 0, 0))
    content = one_light(camera, floor(), point_light((0, 0, 1)))
    assert pixels(content) == pytest.approx(expected, rel=2e-5)


def square_from_above(light):
    """Return a white 2 x 2 square that fills the picture of a camera straight above it.

    The camera samples it evenly: 64 x 64 pixel centres are the midpoint rule, with an error
    of 1e-5.
    """
    fov = 2 * np.degrees(np.arctan(1 / 3))
    camera = sensor((0, 0, 3), (0, 0, 0), up=(0, 1, 0), fov=fov, size=(64, 64))
    return one_light(camera, floor(1.0), light)


SQUARE_FROM_TWO_ABOVE = 4 * np.arctan(1 / (2 * np.sqrt(6)))  # a solid angle [sr]


def test_mean_over_a_square_is_its_solid_angle():
    """Mean of L over a 2 x 2 square = rho I Omega / (pi A); seen from h = 2, 0.0640942.

    Omega = 4 arctan(a b / (d sqrt(a^2 + b^2 + d^2))) with a = b = 1, d = 2.
    """
    picture = pixels(square_from_above(point_light((0, 0, 2))))
    expected = SQUARE_FROM_TWO_ABOVE / (4 * np.pi)
    assert picture.mean() == pytest.approx(expected, rel=1e-4)
    assert expected == pytest.approx(0.0640942, abs=1e-7)


def test_a_spot_light_lights_a_square_as_a_point_light_would():
    """1 W in a cone of 45 degrees: I = 1 / (2 pi (1 - cos 45)), mean L = 0.03482809.

    The corners of the square are at 35.3 degrees, where the beam is at its full intensity
    (it fades from 40), so that the mean is that of a point light of this intensity.
    """
    intensity = 1 / (2 * np.pi * (1 - np.sqrt(0.5)))
    light = spot_light((0, 0, 2), (0, 0, 0), intensity)
    picture = pixels(square_from_above(light))
    expected = intensity * SQUARE_FROM_TWO_ABOVE / (4 * np.pi)
    assert picture.mean() == pytest.approx(expected, rel=1e-4)
    assert expected == pytest.approx(0.03482809, abs=1e-8)


def test_sphere_under_parallel_light_seen_along_it():
    """L = rho E / pi sqrt(1 - s^2) on the disc; its mean is 2 / 3 of the middle.

    From a distance d in radii the mean is 2/3 + 1/(2 d) to first order, as the camera
    sees less than a hemisphere.
    """
    d, n = 100.0, 192
    fov = 2 * np.degrees(np.arctan(1.05 / d))
    camera = sensor((0, 0, d), (0, 0, 0), up=(0, 1, 0), fov=fov, size=(n, n))
    picture = pixels(one_light(camera, sphere(diffuse(0.5)), sun((0, 0, -1), 2.0)))

    slope = (np.arange(n) + 0.5 - n / 2) * (2 * 1.05 / d / n)
    sx, sy = np.meshgrid(slope, slope)
    a, b = 1 + sx**2 + sy**2, -2 * d  # |t (sx, sy, -1) + (0, 0, d)| = 1
    root = b * b - 4 * a * (d * d - 1)
    with np.errstate(invalid="ignore"):
        cosine = d - (-b - np.sqrt(root)) / (2 * a)
    expected = np.where(root >= 0, np.pi**-1 * np.maximum(cosine, 0), 0)
    # the limb, where the cosine falls with infinite slope, is left to the mean below
    inner = sx**2 + sy**2 < (0.98 / d) ** 2
    assert picture[inner] == pytest.approx(
        np.repeat(expected[inner][:, None], 3, axis=1), rel=1e-3
    )
    disc_mean = picture[root >= 0].mean() * np.pi
    assert disc_mean == pytest.approx(2 / 3 + 1 / (2 * d), abs=1e-3)


# ---------------------------------------------------------------------- area lights


@pytest.mark.parametrize("tilt", [0.0, 60.0])
def test_sphere_light_gives_the_sine_squared_of_its_half_angle(tilt, tmp_path):
    """E = pi L (R / d)^2 cos(theta) for a sphere above the horizon: R = 1, d = 3."""
    t = np.radians(tilt)
    light = sphere(diffuse(0.0), center=(3 * np.sin(t), 0, 3 * np.cos(t)))
    content = under_light(sensor((0, -3, 0.5), (0, 0, 0), **SMALL), light, tmp_path)
    assert_mean(content, 0.5 * np.cos(t) / 9, within=1e-3)


@pytest.mark.parametrize(("radius", "height"), [(1.0, 1.0), (1.0, 0.25)])
def test_disk_light_on_its_axis(radius, height, tmp_path):
    """E = pi L R^2 / (R^2 + h^2)."""
    light = {
        "type": "disk",
        "to_world": placed((0, 0, height), (radius, 0, 0), (0, -radius, 0)),
    }
    content = under_light(sensor((0, -8, 0.1), (0, 0, 0), **SMALL), light, tmp_path)
    expected = 0.5 * radius**2 / (radius**2 + height**2)
    assert_mean(content, expected, within=1e-3)


@pytest.mark.parametrize(
    ("x", "factor"), [(0.0, 4 * corner_factor(1, 1)), (1.0, corner_factor(2, 2))]
)
def test_rectangle_light_parallel_to_the_plane(x, factor, tmp_path):
    """F = sums of arctangents (Howell); 2 x 2 at height 1: 0.5541264 in the middle."""
    assert 4 * corner_factor(1, 1) == pytest.approx(0.5541264, abs=1e-7)
    light = rectangle((0, 0, 1), (1, 0, 0), (0, -1, 0), diffuse(0.0))
    camera = sensor((x, x - 8, 0.1), (x, x, 0), **SMALL)
    content = under_light(camera, light, tmp_path)
    assert_mean(content, 0.5 * factor, within=1e-3)


@pytest.mark.parametrize(
    "corners",
    [
        [(-1, -1, 1), (0, 1, 1.5), (1, -1, 1)],
        [(0.5, 0.2, 0.1), (0.6, 0.9, 0.8), (1.5, -0.4, 0.3)],
        [(-3, -2, 0.2), (0, 4, 2.5), (2, -1, 0.4)],
    ],
    ids=["overhead", "steep", "wide"],
)
def test_triangle_light(corners, tmp_path):
    """E = L / 2 sum Theta_i Gamma_i . n: any polygon above the horizon, exactly."""
    if np.linalg.det(np.array(corners, float)) > 0:  # it shines away from the origin
        corners = corners[::-1]
    lines = [f"v {x} {y} {z}\n" for x, y, z in corners]
    (tmp_path / "light.obj").write_text("".join([*lines, "f 1 2 3\n"]))
    light = {"type": "obj", "filename": str(tmp_path / "light.obj")}
    camera = sensor((0, 0, 0.01), (0, 0, 0), up=(0, 1, 0), **SMALL)
    content = under_light(camera, light, tmp_path)
    assert_mean(content, 0.5 * lambert_irradiance(corners) / np.pi, within=2e-3)


@pytest.mark.parametrize("choice", ["importance", "uniform"])
def test_sky_over_a_convex_body(choice):
    """A constant sky gives E = pi L on whatever sees all of it: L_o = rho L.

    Found by the BSDF's samples, and by these and light samples together.

    The mirror and the glass ball are too far away to be seen; with them the kernels are
    those of the white furnace.
    """
    content = scene(
        sensor((0, 0, 5), (0, 0, 0), up=(0, 1, 0), **SMALL),
        "path",
        sphere(diffuse(0.3)),
        sphere(mirror(), center=(1e3, 0, 0)),
        sphere(glass(), center=(-1e3, 0, 0)),
        sky(2.0),
        max_depth=32,
        rr_depth=32,
    )
    assert_mean(content, 0.6, within=1e-3, light_choice=choice)


def test_a_pixel_on_a_light_shows_its_radiance():
    """A light is black to incoming light here, so the pixel holds the file's numbers."""
    cornell = (18.387, 13.9873, 6.75357)
    content = scene(
        sensor((0, 0, 0), (0, 0, 1), up=(0, 1, 0), fov=40, size=(4, 4)),
        "path",
        *box(0.5),
        rectangle((0, 0, 0.9), (0.9, 0, 0), (0, -0.9, 0), diffuse(0.0), shine=cornell),
        max_depth=6,
        rr_depth=6,
    )
    picture = pixels(content)
    assert (picture == np.array(cornell, np.float32)).all()
