"""Light behind panes: light samples and BSDF samples share it, and lose none of it."""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import (
    area,
    assert_mean,
    diffuse,
    floor,
    glass,
    pixels,
    placed,
    rectangle,
    scene,
    sensor,
    sky,
    sphere,
)

import renderer
from renderer.rendering.planning.make_plan import make_plan

CAMERA = sensor((0, -4, 3), (0, 0, 0.4), fov=45, size=(16, 12), spp=64, jitter=True)
PANE = {"type": "thindielectric"}
LAMP = rectangle((0, 0, 3), (0.5, 0, 0), (0, -0.5, 0), diffuse(0.5), shine=(7, 5, 3))
SMALL = rectangle((0, 0, 3), (0.2, 0, 0), (0, -0.2, 0), diffuse(0.5), shine=40)
PLASTIC = {"type": "roughplastic", "alpha": 0.1}
BALL = sphere(PLASTIC, center=(0.6, 0, 0.4), radius=0.4)


def plate(height, half=2.0, thickness=0.2, tilt=0.0, bsdf=None):
    """Return a box of glass, tilted about x; it is thick, so that it displaces rays."""
    c, s = np.cos(tilt), np.sin(tilt)
    axes = np.array([[half, 0, 0], [0, half * c, half * s], [0, -s, c]]).T
    to_world = np.eye(4)
    to_world[:3, :3] = axes * [1, 1, thickness / 2]
    to_world[2, 3] = height
    return {"type": "cube", "to_world": to_world, "bsdf": bsdf or glass()}


def instance_of_a_ball():
    """Return a group, and an instance of it."""
    group = {"type": "shapegroup", "id": "group", "ball": sphere(diffuse(0.5))}
    return [group, {"type": "instance", "group": {"type": "ref", "id": "group"}}]


def fog():
    """Return a ball of a medium."""
    medium = {"type": "homogeneous", "sigma_t": 1.0}
    return sphere({"type": "null"}, radius=0.2) | {"interior": medium}


def uneven_sky():
    """Return a sky with a sun that fills 1 / 32 of it."""
    texels = np.full((8, 16, 3), 0.2, np.float32)
    texels[1:3, 3:5] = (9.0, 8.0, 6.0)
    return {"type": "envmap", "bitmap": texels}


def shining(shape, *radiance):
    """Return a shape that shines."""
    return shape | {"emitter": area(radiance)}


def lamp_with_squares():
    """Return a lamp with black and with white squares."""
    board = {
        "type": "checkerboard",
        "color0": {"type": "spectrum", "value": 0.0},
        "color1": {"type": "spectrum", "value": 1.0},
    }
    lamp = rectangle((0, 0, 3), (0.8, 0, 0), (0, -0.8, 0), diffuse(0.5))
    return lamp | {"emitter": {"type": "area", "radiance": board}}


# the longest path, and what is there
SCENES = {
    "plate": (8, [LAMP, plate(2.0)]),
    "plate, two segments behind it": (4, [LAMP, plate(2.0)]),
    "plate, no light arrives through it": (3, [LAMP, plate(2.0), sky(0.1)]),
    "thin pane, one segment behind it": (
        3,
        [LAMP, rectangle((0, 0, 2), (2, 0, 0), (0, 2, 0.5), PANE), sky(0.1)],
    ),
    "lamp in front of a lamp, which is a ball": (
        6,
        [
            LAMP,
            shining(sphere(diffuse(0.5), center=(0.1, 0.1, 3.6), radius=0.8), 2, 3, 3),
            plate(1.8, tilt=0.5),
        ],
    ),
    "lamp in front of a lamp, to which it shows its back": (
        6,
        [
            LAMP,
            rectangle((0.2, 0, 2.6), (0.4, 0, 0), (0, 0.4, 0), diffuse(0.5), shine=9),
            plate(1.8, tilt=0.5),
        ],
    ),
    "lamps that are closed": (
        6,
        [
            shining(plate(3.0, half=0.5, thickness=0.6, bsdf=diffuse(0.5)), 2, 1, 1),
            shining(
                {"type": "cylinder", "p0": [-1, 0.5, 3], "p1": [1, 1, 3.2], "radius": 0.3},
                *(1, 1, 2),
            ),
            plate(2.0),
        ],
    ),
    "thin pane, half in the way of a sky with a sun": (
        8,
        [uneven_sky(), rectangle((0.8, 0, 1.5), (0.8, 0, 0), (0, 0.8, 0.3), PANE)],
    ),
    "pane, ball of glass and a hole": (
        8,
        [
            LAMP,
            sky(0.1),
            plate(2.2, half=0.7),
            sphere(glass(), center=(0.3, 0.2, 1.4), radius=0.35),
            rectangle((-0.5, 0, 1.0), (0.5, 0, 0), (0, 0.8, 0), {"type": "null"}),
        ],
    ),
    "lamp with a texture": (6, [lamp_with_squares(), plate(2.0)]),
}


@pytest.mark.parametrize("name", list(SCENES))
def test_panes_lose_and_gain_no_light(name):
    """Relative to BSDF samples alone behind glass, which `integrator="path"` keeps.

    The mean of 24 pictures of each, of the whole picture and of four blocks, in three
    colours. They may be 6 standard errors apart, which Student's t with 23 degrees of
    freedom passes with probability 4e-6: 6e-4 for all scenes. Of the whole picture a bias
    of 9 % is seen for certain. Paths of BSDF samples need 16 times the samples, or a few
    bright ones would decide.
    """
    depth, parts = SCENES[name]
    content = scene(CAMERA, "path", floor(0.6), BALL, *parts, max_depth=depth)
    loaded = renderer.load_dict(content)
    assert make_plan(loaded).through_panes
    assert not make_plan(loaded, integrator="path").through_panes

    def means(integrator, spp):
        pictures = [
            renderer.render(loaded, seed=seed, integrator=integrator, spp=spp).pixels
            for seed in range(24)
        ]
        blocks = np.reshape(pictures, (24, 2, 6, 2, 8, 3)).mean((2, 4), np.float64)
        blocks = blocks.reshape(24, 4, 3)
        every = np.concatenate((blocks.mean(axis=1, keepdims=True), blocks), axis=1)
        return every.mean(axis=0), every.std(axis=0, ddof=1) / np.sqrt(24)

    (ours, our_error), (theirs, their_error) = means("auto", 128), means("path", 2048)
    error = np.hypot(our_error, their_error)
    assert (error[0] < 0.01 * theirs[0]).all()
    assert (np.abs(ours - theirs) <= 6 * error + 2e-5 * theirs).all()


def test_a_small_lamp_behind_a_thin_pane_has_the_light_of_paper():
    """A floor below a disc of radiance L: E = pi L r^2 / (r^2 + h^2), times what passes.

    Straight up a pane of index 1.5 lets 2 n / (n^2 + 1) = 12 / 13 through, and the lamp
    fills so small an angle that all its light arrives so.
    """
    radius, height, radiance = 0.05, 2.0, 1000.0
    lamp = {
        "type": "disk",
        "to_world": placed((0, 0, height), (radius, 0, 0), (0, -radius, 0)),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
    }
    camera = sensor((0, 0, 0.8), (0, 0.001, 0), up=(0, 1, 0), fov=0.01, spp=256)
    pane = rectangle((0, 0, 1.2), (3, 0, 0), (0, 3, 0), PANE)
    irradiance = np.pi * radiance * radius**2 / (radius**2 + height**2)
    expected = 0.5 / np.pi * irradiance * 12 / 13
    content = scene(camera, "path", floor(0.5), lamp, pane, sky(0.0), max_depth=4)
    assert make_plan(renderer.load_dict(content)).through_panes
    assert_mean(content, expected, within=3e-3)


def test_behind_a_pane_the_noise_is_that_of_the_open():
    """BSDF samples alone are five times as far from the truth, in most pixels."""
    content = scene(CAMERA, "path", floor(0.6), SMALL, plate(2.0), max_depth=6)
    loaded = renderer.load_dict(content)
    truth = renderer.render(loaded, spp=4096, seed=100).pixels

    def error(integrator):
        pictures = [
            renderer.render(loaded, seed=k, integrator=integrator).pixels for k in range(8)
        ]
        return np.median(np.abs(pictures - truth))

    assert error("auto") < 0.2 * error("path")


def test_panes_are_flat_or_thin_and_of_glass_alone():
    rough = {"type": "roughdielectric"}
    for shape, is_pane in [
        (plate(2.0), True),
        (plate(2.0, tilt=0.3), True),
        (rectangle((0, 0, 2), (1, 0, 0), (0, 1, 0), PANE), True),
        (sphere(PANE, center=(0, 0, 2)), True),
        (sphere(glass(), center=(0, 0, 2)), False),
        (plate(2.0, bsdf=rough), False),
        (plate(2.0, bsdf={"type": "mask", "opacity": 0.5, "nested": diffuse(0.5)}), False),
    ]:
        loaded = renderer.load_dict(scene(CAMERA, "path", floor(), LAMP, sky(0.1), shape))
        assert loaded.shapes.pane.tolist() == [0, 0, int(is_pane)]
        assert make_plan(loaded).through_panes == is_pane


@pytest.mark.parametrize(
    ("integrator", "parts", "settings", "options"),
    [
        ("path", [], {}, {"sampler": "mitsuba"}),
        ("path", [], {}, {"light_choice": "uniform"}),
        ("path", [], {}, {"integrator": "path"}),
        ("path", [], {"max_depth": 2}, {}),
        ("path", [plate(1.5, bsdf=PANE)], {}, {}),  # samples that meet holes are black
        ("path", [plate(1.5, bsdf=PANE), sky()], {"hide_emitters": True}, {}),
        ("path", instance_of_a_ball(), {}, {}),
        ("direct", [], {}, {}),
        ("volpath", [fog()], {}, {}),
        ({"type": "moment", "inner": {"type": "path"}}, [], {}, {}),
    ],
)
def test_where_panes_block_light_samples(integrator, parts, settings, options):
    loaded = renderer.load_dict(
        scene(CAMERA, integrator, floor(), LAMP, plate(2.0), *parts, **settings)
    )
    assert not make_plan(loaded, **options).through_panes


def test_an_even_sky_alone_is_not_sampled_behind_panes():
    content = scene(CAMERA, "path", floor(), plate(2.0), sky(1.0))
    assert not make_plan(renderer.load_dict(content)).through_panes


def test_any_number_of_threads_gives_the_same_bits_through_panes():
    content = scene(CAMERA, "path", floor(0.6), LAMP, sky(0.2), plate(2.0), BALL)
    one, two = (pixels(content, threads=threads, seed=3) for threads in (1, 2))
    assert np.array_equal(one, two)
