"""The simple renderer and the kernels: the same random numbers, the same light.

One works in double precision, on one ray, by brute force; the other in single precision on
lanes with trees. All that they share is the reader of scenes and the camera's vectors.
tests/renderer/bsdfs/test_simple_bsdfs.py compares their BSDFs number by number.
"""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pytest
from kernel_probes import key_of
from small_scenes import mirror, rectangle, rgb, sensor, sphere

import renderer
from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.plugins.sampling.numbers_and_warps import Independent, draw4
from renderer.scene.light_tables import alias_table
from renderer.scene.scene import build_scene
from renderer.scene_file import read_dict, read_file
from renderer.scene_file.description import ReconstructionFilter
from renderer.simple import lights
from renderer.simple.path_tracer import render

SCENES = Path(__file__).parents[3] / "scenes"
PLUGINS = Path(__file__).parents[2] / "plugins"

# Differences are relative to a pixel's largest channel plus a thousandth of the mean. In
# these scenes, at one sample, the median is 1e-8 to 5e-7 and 99 % of the pixels are within
# 6e-4; up to 3 of 384 pixels of a scene are beyond 1e-3: their paths have met an edge.
WITHIN = 1e-3
FEW = 0.01


def mix(a, b, c, d):
    a = a + b * d
    b = b + c * a
    c = c + a * b
    return a, b, c, d + b * c


def hashed_numbers(seed, pixel, sample, block):
    """Return what `draw4` draws for the sampler "independent" [Jarzynski2020, pcg4d]."""
    with np.errstate(over="ignore"):  # products modulo 2^32
        words = np.array([pixel, sample, block, seed], np.uint32)
        words = words * np.uint32(1664525) + np.uint32(1013904223)
        words = np.array(mix(*words))
        words = np.array(mix(*(words ^ (words >> 16))))
    return ((words >> 8) * 2.0**-24).tolist()


@entry_kernel
def run_draw4(sampler, pixels, sample, block, out):
    row = 0
    for number in draw4(sampler, key_of(load_row(pixels, 0, 0)), sample, block):
        store_row(out, row, 0, number)
        row += 1


@pytest.mark.parametrize(("sample", "block"), [(0, 0), (3, 1 + (5 << 20)), (70000, 2)])
def test_the_numbers_are_those_of_the_kernels(sample, block):
    """Bit for bit; else the comparison below would compare noise."""
    seed, pixels = 0xDEADBEEF, np.arange(16, dtype=np.uint32) * 7919
    out = np.zeros((4, 16), np.float32)
    run_draw4(Independent(seed), pixels, sample, block, out)
    expected = [hashed_numbers(seed, pixel, sample, block) for pixel in pixels]
    assert np.array_equal(out.T, expected)


def choose_face_by_alias(mesh, z):
    """Choose a face of a mesh light as the kernels do it: the same share, another order."""
    if len(mesh.a) == 1:
        return 0
    keep, alias = _alias_table(mesh)
    column = min(int(z * len(keep)), len(keep) - 1)
    return column if z * len(keep) - column < keep[column] else int(alias[column])


@functools.cache
def _alias_table(mesh):
    """Return the kernels' table: of equal areas their rounding decides what fills it."""
    e1, e2 = (mesh.A[:, :, k].astype(np.float32).astype(np.float64) for k in (0, 1))
    return alias_table(np.linalg.norm(np.cross(e1, e2), axis=1) / 2)


# name, integrator, ray offset, within
CASES = [
    *(
        (name, "path", "tight", WITHIN)
        for name in (
            "cornell-box",
            "caustic",
            "metals",
            "emitters",
            "grey-furnace",
            "white-furnace",
            "cropped-film",
            "thinlens",
            "orthographic",
            "plastic",
            "roughplastic",
            "principledthin",
            "thindielectric",
            "null",
            "mask",
            "blendbsdf",
            "normalmap",
            "bumpmap",
            "merl",
            "measured",
            "no_sky",
            "sunsky",
        )
    ),
    # new rays start 64 roundings of a primitive's size off it: of a floor 140 wide that
    # is 0.001, which moves the light on a ball of 0.3 by up to 0.7 %
    ("analytic-shapes", "path", "mitsuba", WITHIN),
    # from bounce to bounce curved surfaces magnify the rounding of vertices
    ("smooth-mesh", "path", "tight", 5e-3),
    ("textured-room", "path", "tight", 1e-2),  # from texel to texel colours change by half
    # where facets are nearly smooth, a rounded direction misses the peak of a highlight
    ("roughconductor", "path", "tight", 1e-2),
    ("principled", "path", "tight", 1e-2),
    ("roughdielectric", "path", "tight", 1e-2),
    ("nesting", "path", "tight", 1e-2),
    ("cornell-box", "direct", "tight", WITHIN),
    ("direct_samples", "direct", "tight", WITHIN),
    ("direct_samples", "whitted", "tight", WITHIN),
    ("thindielectric", "whitted", "tight", WITHIN),
    ("coats", "whitted", "tight", 1e-2),  # curved mirrors magnify the rounding of hits
    ("whitted-spheres", "whitted", "tight", WITHIN),  # without noise
    ("whitted-spheres", "direct", "tight", WITHIN),
]


def coats():
    """Return a scene of plastic balls on a mirror, whose coats a tree of rays follows."""
    balls = {
        f"ball{k}": sphere(
            {"type": "plastic", "nonlinear": bool(k), "int_ior": 1.5 + 0.4 * k},
            center=(2.4 * k - 1.2, 0.0, 0.9),
            radius=0.9,
        )
        for k in range(2)
    }
    floor = rectangle((0, 0, 0), (5, 0, 0), (0, 5, 0), mirror(0.8))
    lamp = {"type": "point", "position": [2.0, -3.0, 4.0], "intensity": rgb(40.0)}
    camera = sensor((0, -6, 3), (0, 0, 0.5), fov=40.0, size=(18, 12))
    return read_dict(scene(sensor=camera, floor=floor, lamp=lamp, **balls))


def small(name, integrator):
    """Return a description of a few hundred pixels, with the box filter."""
    folder = SCENES / name
    if name == "coats":
        description = coats()
    elif folder.is_dir():
        description = read_file(folder / "scene.xml", width=24, height=16)
    else:
        description = read_file(PLUGINS / f"{name}.xml")
    camera = description.camera
    film = dataclasses.replace(camera.film, rfilter=ReconstructionFilter("box", 0.5))
    if name in ("thinlens", "orthographic"):
        film = dataclasses.replace(film, crop_width=20, crop_height=14)
    elif not folder.is_dir():
        film = dataclasses.replace(film, width=18, height=12, crop_width=18, crop_height=12)
    return dataclasses.replace(
        description,
        camera=dataclasses.replace(camera, film=film),
        integrator=dataclasses.replace(description.integrator, name=integrator, refusal=""),
        instances=(),  # of bumpmap.xml
        groups=(),
    )


@pytest.mark.parametrize(("name", "integrator", "ray_offset", "within"), CASES)
def test_the_same_paths_find_the_same_light(
    name, integrator, ray_offset, within, monkeypatch
):
    """Pixel by pixel, at one sample: no mean hides what a path does."""
    monkeypatch.setattr(lights, "choose_face", choose_face_by_alias)
    description = small(name, integrator)
    seed = description.camera.sampler.seed
    mixed = np.random.SeedSequence([seed, 0]).generate_state(1)
    simple = render(description, 1, functools.partial(hashed_numbers, int(mixed[0])))
    fast = renderer.render(
        build_scene(description),
        spp=1,
        integrator=integrator,
        sampler="independent",
        light_choice="uniform",
        ray_offset=ray_offset,
    ).pixels.astype(np.float64)
    size = fast.max(axis=2) + 1e-3 * fast.mean()
    error = abs(simple - fast).max(axis=2) / size
    assert (error > within).mean() <= FEW, np.sort(error.ravel())[-8:]
    assert np.median(error) < within / 100
    assert simple.mean() == pytest.approx(fast.mean(), rel=2e-3)


def test_a_furnace_has_the_reflectance_of_its_ball():
    """With NumPy's own numbers too: a convex ball in a sky of 1 shows its albedo."""
    description = read_file(SCENES / "grey-furnace" / "scene.xml", width=8, height=6)
    ball = render(description, 16)[2:4, 3:5].mean(axis=(0, 1))
    assert ball == pytest.approx([0.5, 0.25, 0.125], rel=0.1)


def scene(**changes):
    film = {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}
    return {
        "type": "scene",
        "integrator": {"type": "path"},
        "sensor": {"type": "perspective", "film": film},
        "light": {"type": "constant", "radiance": rgb(1.0)},
        **changes,
    }


SKY = np.ones((4, 8, 3), np.float32)
GRID = np.float32([-1, 1]).repeat(4).reshape(2, 2, 2, 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"integrator": {"type": "depth"}},
            "integrator 'depth'; possible are 'path', 'direct', 'whitted' and 'volpath'",
        ),
        ({"integrator": {"type": "path", "hide_emitters": True}}, "hide_emitters"),
        ({"a": {"type": "implicit", "expression": "x"}}, "has no shape 'implicit'"),
        ({"a": {"type": "sdfgrid", "grid": GRID}}, "has no shape 'sdfgrid'"),
        ({"light": {"type": "envmap", "bitmap": SKY}}, "has no emitter 'envmap'"),
        (
            {
                "integrator": {"type": "whitted"},
                "ball": sphere({"type": "mask", "nested": mirror()}),
            },
            "branches for the bsdf 'mask'; possible are the integrators path and direct",
        ),
        (
            {
                "group": {"type": "shapegroup", "id": "g", "ball": {"type": "sphere"}},
                "copy": {"type": "instance", "of": {"type": "ref", "id": "g"}},
            },
            "instances; possible are shapes alone",
        ),
    ],
)
def test_what_it_does_not_cover_is_refused(changes, message):
    with pytest.raises(renderer.SceneError, match=message):
        render(read_dict(scene(**changes)), 1)


def test_another_filter_is_refused():
    sensor = {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}}
    with pytest.raises(renderer.SceneError, match="rfilter 'gaussian'; possible is 'box'"):
        render(read_dict(scene(sensor=sensor)), 1)
