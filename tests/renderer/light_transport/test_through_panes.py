"""Light behind panes: light samples and BSDF samples share it, and lose none of it."""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import (
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
LAMP = rectangle((0, 0, 3), (0.2, 0, 0), (0, -0.2, 0), diffuse(0.5), shine=(40, 30, 20))
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


def uneven_sky():
    """Return a sky with a sun that fills 1 / 32 of it."""
    texels = np.full((8, 16, 3), 0.2, np.float32)
    texels[1:3, 3:5] = (9.0, 8.0, 6.0)
    return {"type": "envmap", "bitmap": texels}


SCENES = {
    "plate": [LAMP, plate(2.0), BALL],
    "tilted plate, two lamps in line, one of them a ball": [
        LAMP,
        sphere(diffuse(0.5), center=(0.1, 0.1, 3.6), radius=0.3)
        | {"emitter": {"type": "area", "radiance": {"type": "rgb", "value": [5, 9, 9]}}},
        plate(1.8, tilt=0.5),
        BALL,
    ],
    "thin pane, half in the way of a sky with a sun": [
        uneven_sky(),
        rectangle((0.8, 0, 1.5), (0.8, 0, 0), (0, 0.8, 0.3), PANE),
        BALL,
    ],
    "pane, ball of glass and a hole": [
        LAMP,
        sky(0.1),
        plate(2.2, half=0.7),
        sphere(glass(), center=(0.3, 0.2, 1.4), radius=0.35),
        rectangle((-0.5, 0, 1.0), (0.5, 0, 0), (0, 0.8, 0), {"type": "null"}),
        BALL,
    ],
    "lamp with a texture of two colours": [
        rectangle((0, 0, 3), (0.4, 0, 0), (0, -0.4, 0), diffuse(0.5))
        | {
            "emitter": {
                "type": "area",
                "radiance": {
                    "type": "checkerboard",
                    "color0": {"type": "spectrum", "value": 0.0},
                    "color1": {"type": "spectrum", "value": 1.0},
                },
            }
        },
        plate(2.0),
        BALL,
    ],
}


@pytest.mark.parametrize("name", list(SCENES))
def test_panes_lose_and_gain_no_light(name):
    """Relative to BSDF samples alone behind glass, which `integrator="path"` keeps.

    The mean of 24 pictures of each, in four blocks and three colours; their standard error
    is below 4 % of the picture's mean. A block may be 6 of them off, which Student's t with
    23 degrees of freedom passes with probability 4e-6: 3e-4 for all scenes. Paths of BSDF
    samples need 16 times the samples, or a few bright ones would decide.
    """
    content = scene(CAMERA, "path", floor(0.6), *SCENES[name], max_depth=8)
    loaded = renderer.load_dict(content)
    assert make_plan(loaded).through_panes
    assert not make_plan(loaded, integrator="path").through_panes

    def blocks(integrator, spp):
        pictures = [
            renderer.render(loaded, seed=seed, integrator=integrator, spp=spp).pixels
            for seed in range(24)
        ]
        of_blocks = np.reshape(pictures, (24, 2, 6, 2, 8, 3)).mean((2, 4), np.float64)
        return of_blocks.mean(axis=0), of_blocks.std(axis=0, ddof=1) / np.sqrt(24)

    (ours, our_error), (theirs, their_error) = blocks("auto", 256), blocks("path", 4096)
    error = np.hypot(our_error, their_error)
    assert error.max() < 0.04 * theirs.mean()
    assert (np.abs(ours - theirs) <= 6 * error).all()


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
    assert_mean(content, expected, within=3e-3)


def test_behind_a_pane_the_noise_is_that_of_the_open():
    """BSDF samples alone are five times as far from the truth, in most pixels."""
    content = scene(CAMERA, "path", floor(0.6), LAMP, plate(2.0), max_depth=6)
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


def test_a_replay_and_samples_that_holes_blacken_have_no_light_through_panes():
    content = scene(CAMERA, "path", floor(), LAMP, plate(2.0))
    assert make_plan(renderer.load_dict(content)).through_panes
    assert not make_plan(renderer.load_dict(content), sampler="mitsuba").through_panes
    thin = scene(CAMERA, "path", floor(), LAMP, plate(2.0, bsdf=PANE))
    assert not make_plan(renderer.load_dict(thin)).through_panes
    short = scene(CAMERA, "path", floor(), LAMP, plate(2.0), max_depth=3)
    assert not make_plan(renderer.load_dict(short)).through_panes


def test_any_number_of_threads_gives_the_same_bits_through_panes():
    content = scene(CAMERA, "path", floor(0.6), LAMP, sky(0.2), plate(2.0), BALL)
    one, two = (pixels(content, threads=threads, seed=3) for threads in (1, 2))
    assert np.array_equal(one, two)
