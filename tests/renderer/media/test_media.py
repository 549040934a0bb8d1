"""Participating media against closed formulas, and against the simple path tracer.

False alarms: each comparison of a mean has a limit of five standard errors (6e-7), over all
of this file below 1e-4. What is found: a factor of 1.02 in most scenes.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from media_scenes import (
    LIMIT,
    NULL,
    assert_mean,
    described,
    homogeneous,
    parallel,
    pixels,
    scaled,
)

import renderer
from renderer.scene.scene import build_scene
from renderer.simple import path_tracer


def grid(values, to_world, sigma_scale=1.0, **more):
    volume = {"type": "gridvolume", "grid": np.asarray(values, np.float32)}
    volume["to_world"] = to_world
    return {"type": "heterogeneous", "sigma_t": volume, "scale": sigma_scale, **more}


CUBE = scaled(2.0, at=(-1.0, -1.0, -1.0))  # from the unit cube to [-1, 1]^3


# -------------------------------------------------------------------- Beer and Lambert


@pytest.mark.parametrize("sigma", [0.5, (0.9, 0.3, 0.0)])
def test_what_absorbs_lets_an_exponential_through(sigma):
    """A slab of thickness 2, seen head-on by an orthographic camera."""
    sensor = parallel(0.5, spp=256)
    scene = described(homogeneous(sigma), more={"sensor": sensor})
    assert_mean(pixels(scene), np.exp(-2.0 * np.broadcast_to(sigma, 3)))


@pytest.mark.parametrize("wrap", ["clamp", "repeat", "mirror"])
@pytest.mark.parametrize("filter_type", ["trilinear", "nearest"])
def test_a_grid_attenuates_by_its_integral(wrap, filter_type):
    """Along z the numbers 1 and 3; the integral by the rule of the grid, in NumPy.

    Of the lower 0.6 of the grid: over the whole of it both ends make up for one another.
    """
    values = np.array([1.0, 3.0]).reshape(2, 1, 1, 1)
    medium = grid(values, CUBE, 0.4, albedo=0.0)
    medium["sigma_t"] |= {"wrap_mode": wrap, "filter_type": filter_type}
    sensor = parallel(0.5, spp=256)
    part = {"type": "cube", "to_world": scaled(1.0, 1.0, 0.6, (0, 0, -0.4)), "bsdf": NULL}
    scene = described(medium, shape=part, more={"sensor": sensor})
    z = (np.arange(20000) + 0.5) / 20000 * 0.6
    place = z * 2 - 0.5
    outer = {"clamp": (1.0, 3.0), "repeat": (3.0, 1.0), "mirror": (1.0, 3.0)}[wrap]
    nodes = np.interp(place, [-1, 0, 1, 2], [outer[0], 1.0, 3.0, outer[1]])
    density = nodes if filter_type == "trilinear" else np.where(z < 0.5, 1.0, 3.0)
    assert_mean(pixels(scene), np.exp(-1.2 * 0.4 * density.mean()) * np.ones(3))


def test_smoke_far_away_is_as_thin_as_nearby():
    """At a distance of 50,000 a float32 has steps of 0.004: a ray still crosses cells."""
    values = np.linspace(0.0, 1.0, 64).reshape(4, 4, 4, 1) ** 2
    sensor = parallel(0.5, spp=512)
    scene = described(grid(values, CUBE, 1.5, albedo=0.0), more={"sensor": sensor})
    near = pixels(scene, seeds=96).mean(axis=0)
    sensor |= {"far_clip": 1e6}
    sensor["to_world"][2, 3] = 5e4
    scene = described(grid(values, CUBE, 1.5, albedo=0.0), more={"sensor": sensor})
    assert_mean(pixels(scene), near.mean(axis=(0, 1)))


def test_colours_of_a_grid_have_transmittances_of_their_own():
    values = np.array([0.2, 1.0, 0.0, 0.8, 0.4, 0.6]).reshape(2, 1, 1, 3)
    medium = grid(values, CUBE, albedo=0.0)
    medium["sigma_t"]["filter_type"] = "nearest"
    sensor = parallel(0.5, spp=512)
    scene = described(medium, more={"sensor": sensor})
    assert_mean(pixels(scene), np.exp(-values.reshape(2, 3).sum(axis=0)))


# -------------------------------------------------------------------------- furnaces


PHASES = {
    "isotropic": {"type": "isotropic"},
    "hg": {"type": "hg", "g": 0.7},
    "rayleigh": {"type": "rayleigh"},
    "tabphase": {"type": "tabphase", "values": ".2 .1 .4 1.5 6"},
    "blendphase": {
        "type": "blendphase",
        "weight": 0.3,
        "a": {"type": "hg", "g": -0.4},
        "b": {"type": "rayleigh"},
    },
    "blend-by-a-grid": {
        "type": "blendphase",
        "weight": {
            "type": "gridvolume",
            "grid": np.random.default_rng(2).random((2, 3, 2, 3), np.float32),
            "to_world": CUBE,
        },
        "a": {"type": "hg", "g": 0.7},
        "b": {"type": "hg", "g": -0.4},
    },
}


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("kind", ["homogeneous", "grid"])
def test_where_nothing_is_absorbed_all_is_as_bright_as_the_sky(phase, kind):
    if kind == "grid":
        values = np.random.default_rng(1).random((3, 4, 5, 1))
        medium = grid(values, CUBE, 3.0, albedo=1.0)
    else:
        medium = homogeneous((0.6, 0.5, 0.4), 1.0, scale=3.0)
    scene = described(medium | {"phase": PHASES[phase]}, spp=64)
    assert_mean(pixels(scene, seeds=12), np.ones(3))


def test_glass_around_a_medium_is_a_furnace_too():
    """What is inside is n^2 times as bright, and comes out as bright as it went in."""
    ball = {"type": "sphere", "bsdf": {"type": "dielectric", "int_ior": 1.5}}
    scene = described(homogeneous(0.8, 1.0), shape=ball, spp=64)
    assert_mean(pixels(scene, seeds=12), np.ones(3))


# ------------------------------------------------------------------ single scattering


@pytest.mark.parametrize("phase", ["isotropic", "hg", "rayleigh", "tabphase"])
def test_light_that_is_scattered_once(phase):
    """A point light in a medium: an integral along the camera's rays, by a fine sum.

    L = integral of sigma_s exp(-sigma_t (t + d)) p(cos) I / d^2 dt.
    """
    lamp = {"type": "point", "position": [0.0, 0.7, 0.0], "intensity": 2.0}
    medium = homogeneous(0.5, 0.8, phase=PHASES[phase])
    shape = {"type": "sphere", "radius": 4.0, "bsdf": NULL}
    sensor = {"fov": 10.0, "size": 2, "distance": 3.0, "medium": medium}
    scene = described(medium, depth=2, light=lamp, shape=shape, spp=4096, **sensor)
    assert_mean(pixels(scene), np.full(3, _scattered_once(phase)))


def _scattered_once(phase):
    rng = np.random.default_rng(0)
    n, half = 400, np.tan(np.radians(5.0))
    place = (np.stack(np.meshgrid(*[np.arange(n)] * 2), -1).reshape(-1, 2) + 0.5) / n
    d = np.column_stack((half * (2 * place - 1), -np.ones(n * n)))[rng.permutation(n * n)]
    d = d[:4000] / np.linalg.norm(d[:4000], axis=1, keepdims=True)
    origin, lamp = np.array([0.0, 0.0, 3.0]), np.array([0.0, 0.7, 0.0])
    t = (np.arange(2000) + 0.5) * 7.0 / 2000
    inside = origin + d[:, None] * t[:, None]
    inside_ball = (inside**2).sum(axis=-1) < 16.0
    to_lamp = lamp - inside
    distance = np.linalg.norm(to_lamp, axis=-1)
    cosine = (to_lamp * d[:, None]).sum(axis=-1) / distance
    g = 0.7
    table = np.interp(cosine, np.linspace(-1, 1, 5), [0.2, 0.1, 0.4, 1.5, 6.0])
    values = {
        "isotropic": np.full_like(cosine, 0.25 / np.pi),
        "hg": (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5),
        "rayleigh": 3.0 / (16.0 * np.pi) * (1.0 + cosine**2),
        "tabphase": table / (2 * np.pi * (0.15 + 0.25 + 0.95 + 3.75) * 0.5),
    }
    light = 0.4 * np.exp(-0.5 * (t + distance)) * values[phase] * 2.0 / distance**2
    return float((light * inside_ball).sum(axis=1).mean() * 7.0 / 2000)


def test_what_scatters_forward_alone_is_clear():
    """A lamp as wide as half the sky is in front; of a turn 0.002 goes back at g = 0.99."""
    lamp = {
        "type": "rectangle",
        "to_world": scaled(300.0, at=(0.0, 0.0, -2.0)),
        "emitter": {"type": "area", "radiance": 1.0},
    }
    medium = homogeneous(1.0, 1.0, phase={"type": "hg", "g": 0.99})
    seen = pixels(described(medium, light=lamp, spp=256), seeds=4).mean()
    assert 0.98 < seen < 1.005


# -------------------------------------------------------------------------- boundaries


@pytest.mark.parametrize(
    ("inner", "expected"),
    [
        ({}, 2.0),  # not a boundary: the medium goes on
        ({"interior": 0.0}, 0.5),  # behind it is vacuum: it has no exterior
        ({"interior": 0.0, "exterior": 1.0}, 1.0),  # a hole
        ({"exterior": 1.0}, 1.0),  # the same, said in another way
    ],
)
def test_the_boundary_that_was_crossed_last_decides(inner, expected):
    """A cube of thickness 2 around one of thickness 1; `expected` is the optical depth."""
    media = {name: homogeneous(sigma) for name, sigma in inner.items()}
    small = {"type": "cube", "to_world": scaled(0.5), "bsdf": NULL, **media}
    sensor = parallel(0.2, spp=64)
    scene = described(homogeneous(1.0), more={"sensor": sensor, "inner": small})
    assert_mean(pixels(scene), np.full(3, np.exp(-expected)))


def test_a_medium_without_an_end_is_black():
    """Behind the camera's far plane too, where nothing else is seen."""
    fog = homogeneous(0.1, 0.0)
    scene = described(fog, medium=fog, far_clip=20.0, shape={"type": "disk"}, fov=5.0)
    away = scene.description.camera.to_world @ np.diag([1.0, 1.0, -1.0, 1.0])
    camera_away = dataclasses.replace(scene.description.camera, to_world=away)
    turned = dataclasses.replace(scene.description, camera=camera_away)
    picture = renderer.render(build_scene(turned), spp=64).pixels
    np.testing.assert_array_equal(picture, 0.0)


def test_nothing_behind_the_far_plane_is_seen():
    """Of a fog that scatters all light, the first hundredth of a mean free path is."""
    means = []
    for far in (1e4, 0.011):
        fog, lamp = homogeneous(1.0, 1.0), {"type": "point", "position": [0.0, 0.0, 1.0]}
        sensor = {"near_clip": 0.001, "far_clip": far}
        scene = described(fog, medium=fog, more={"lamp": lamp}, fov=5.0, **sensor)
        means.append(renderer.render(scene, spp=256).pixels.mean())
    assert 0.0 < means[1] < 0.05 * means[0]


def test_a_grid_of_zeros_is_clear():
    medium = grid(np.zeros((2, 2, 2, 1)), CUBE, 5.0, albedo=0.0)
    np.testing.assert_array_equal(renderer.render(described(medium)).pixels, 1.0)


@pytest.mark.parametrize("sigma", [0.0, 0.1])
def test_hidden_lamps_are_not_seen_through_a_boundary(sigma):
    lamp = {
        "type": "rectangle",
        "to_world": scaled(3.0, at=(0.0, 0.0, -3.0)),
        "emitter": {"type": "area", "radiance": 5.0},
    }
    hidden = {"type": "volpath", "hide_emitters": True}
    more = {"lamp": lamp, "integrator": hidden}
    scene = described(homogeneous(sigma, 0.0), more=more, fov=5.0)
    np.testing.assert_array_equal(renderer.render(scene).pixels, 0.0)


def test_surfaces_that_are_not_there_cost_no_depth():
    """Five null boundaries in front of the sky, with two segments."""
    empty = homogeneous(0.0)
    balls = {
        f"ball{k}": {"type": "sphere", "radius": 1.2 + 0.2 * k, "bsdf": NULL}
        for k in range(5)
    }
    scene = described(empty, depth=1, more=balls)
    np.testing.assert_array_equal(renderer.render(scene).pixels, 1.0)


def test_roulette_from_the_first_segment_on_loses_nothing():
    medium = homogeneous(0.9, 1.0, 3.0, phase=PHASES["hg"])
    integrator = {"type": "volpath", "rr_depth": 1}
    scene = described(medium, more={"integrator": integrator}, spp=256)
    assert_mean(pixels(scene), np.ones(3))


def test_a_grid_of_albedos():
    """Half of the box absorbs, half scatters: the furnace is as dark as by an even mean."""
    albedo = {
        "type": "gridvolume",
        "grid": np.array([0.2, 0.9], np.float32).reshape(1, 1, 2, 1),
        "filter_type": "nearest",
        "to_world": CUBE,
    }
    varying = homogeneous(1.0) | {"albedo": albedo}
    same = grid(np.ones((2, 2, 2, 1)), CUBE, albedo=albedo)
    a, b = (pixels(described(m, spp=256)).mean(axis=(1, 2)) for m in (varying, same))
    error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / len(a))
    assert (np.abs(a.mean(axis=0) - b.mean(axis=0)) <= LIMIT * error).all()
    assert 0.3 < a.mean() < 0.9


def test_a_simplified_way_to_find_light_is_not_of_volpath():
    description = described(homogeneous(0.5), more={"floor": FLOOR}).description
    lights = dataclasses.replace(description.integrator, strategy="bsdfs")
    scene = build_scene(dataclasses.replace(description, integrator=lights))
    assert np.isfinite(renderer.render(scene, spp=4).pixels).all()


def test_paths_are_the_same_for_any_number_of_threads():
    scene = described(grid(np.ones((2, 2, 2, 1)), CUBE, albedo=0.9), size=40, spp=4)
    one = renderer.render(scene, threads=1).pixels
    np.testing.assert_array_equal(one, renderer.render(scene, threads=2).pixels)


# ---------------------------------------------------------------- against the slow truth

FLOOR = {
    "type": "rectangle",
    "to_world": scaled(3.0, at=(0.0, 0.0, -1.2)),
    "bsdf": {"type": "diffuse"},
}
LAMP = {
    "type": "rectangle",
    "to_world": np.array(
        [[1.0, 0, 0, 0], [0, 0, -1.0, 2.0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]]
    ),
    "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [8.0, 7.0, 6.0]}},
}


@pytest.mark.parametrize("shape", ["sphere", "cube"])
def test_the_simple_path_tracer_finds_the_same_light(shape):
    medium = homogeneous((0.9, 0.5, 0.2), (0.9, 0.8, 0.7), 2.0, phase=PHASES["hg"])
    boundary = {"type": shape, "bsdf": NULL}
    more = {"floor": FLOOR, "lamp": LAMP}
    scene = described(medium, depth=6, shape=boundary, more=more, size=4, spp=256)
    fast = pixels(scene, seeds=12)
    slow = np.array(
        [
            path_tracer.render(
                scene.description,
                16,
                lambda *key, seed=seed: path_tracer.numpy_numbers(*key[:2], key[2] + seed),
            )
            for seed in (10**12 * k for k in range(6))
        ]
    )
    both = [part.reshape(len(part), -1, 3).mean(axis=1) for part in (fast, slow)]
    error = np.sqrt(sum(m.var(axis=0, ddof=1) / len(m) for m in both))
    assert (np.abs(both[0].mean(axis=0) - both[1].mean(axis=0)) <= 6.0 * error).all()


def test_how_lights_are_chosen_changes_the_noise_alone():
    """Five lamps, one of which is seen through a boundary, and a sky; a floor and mist."""
    lamps = {
        f"lamp {k}": LAMP | {"to_world": scaled(0.3, at=(k - 2.0, 1.5, -1.0))}
        for k in range(4)
    }
    lamps["behind"] = LAMP | {"to_world": scaled(0.5, at=(0.0, 0.0, -3.0))}
    mist = homogeneous((0.9, 0.5, 0.2), 0.9, 2.0, phase=PHASES["hg"])
    boundary = {"type": "sphere", "bsdf": NULL}
    scene = described(mist, depth=6, shape=boundary, more={"floor": FLOOR, **lamps})
    one, other = (pixels(scene, 32, light_choice=way) for way in ("importance", "uniform"))
    means = [part.reshape(32, -1, 3).mean(axis=1) for part in (one, other)]
    error = np.sqrt(sum(part.var(axis=0, ddof=1) / 32 for part in means))
    assert (error < 0.02 * means[1].mean(axis=0)).all()
    apart = np.abs(means[0].mean(axis=0) - means[1].mean(axis=0))
    assert (apart <= LIMIT * error).all()


def test_a_colour_that_nothing_absorbs_sees_the_sky_in_the_simple_path_tracer():
    """Without an end of the medium the other two are black: closest to 0 times infinity."""
    fog = homogeneous((0.0, 0.5, 0.5), 0.5)
    scene = described(fog, medium=fog, shape=FLOOR, size=3)
    picture = path_tracer.render(scene.description, 96).reshape(-1, 3)
    assert np.isfinite(picture).all()
    # the floor reflects half; a sample is 0 or three times that: the mean of 864 is known
    # to 0.025
    assert picture.mean(axis=0)[0] == pytest.approx(0.5, abs=0.12)
    fast = pixels(scene, seeds=4).mean(axis=(0, 1, 2))
    np.testing.assert_allclose(picture.mean(axis=0), fast, atol=0.12)


def test_a_replay_is_finite_where_a_medium_is_thick():
    """What float32 cannot invert counts as 0 in a replay, as in Mitsuba.

    Flights that leave the slab of the grid are weighed by exp(-95) over the way to the box.
    """
    slab = {"type": "gridvolume", "grid": np.ones((2, 2, 2, 1), np.float32)}
    slab["to_world"] = scaled(4.0, 4.0, 0.02, at=(-2.0, -2.0, 0.98))
    scene = described({"type": "heterogeneous", "sigma_t": slab, "scale": 47.5})
    assert np.isfinite(renderer.render(scene, sampler="mitsuba").pixels).all()
