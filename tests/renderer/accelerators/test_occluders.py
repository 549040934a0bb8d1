"""What shadow rays pass by untested: only what no segment to a light can cross."""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import (
    area,
    box,
    diffuse,
    glass,
    placed,
    point_light,
    rectangle,
    scene,
    sensor,
    sky,
    sphere,
    sun,
)

import renderer
from renderer.accelerators.choice import USUAL_RAYS
from renderer.accelerators.non_occluders import MOST, find_non_occluders, never_between
from renderer.rendering.planning.plan import offset_rule
from renderer.scene.light_properties import sampled_lights

FLAT = ("triangles", "rectangles", "disks")
CAMERA = sensor((0, -0.9, 0.2), (0, 0, 0), fov=80, size=(24, 16))
LAMP = rectangle((0, 0, 0.9), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=5.0)


def left_out(*parts, finds_sky=False):
    return left_out_of(scene(CAMERA, "path", *parts), finds_sky)


def left_out_of(content, finds_sky=False):
    """Return how many primitives of each kind shadow rays pass by, without the zeros."""
    loaded = renderer.load_dict(content)
    lights = sampled_lights(loaded.description, finds_sky)
    has = [kind for kind in FLAT if kind in loaded.surfaces]
    mask = never_between(loaded, has, lights, offset_rule("tight")[:2])
    assert mask.shape == loaded.stages.shape
    counts = {
        kind: int(mask[surfaces.first : surfaces.end].sum())
        for kind, surfaces in loaded.surfaces.items()
    }
    return {kind: count for kind, count in counts.items() if count}


def test_nothing_is_left_out_where_rounding_decides():
    """Far from the world's origin rays are blocked by walls that they only start at."""

    def room(shift, narrow):
        wall = rectangle((shift, 0, 0), (1, 0, 0), (0, 1, 0), diffuse(0.5))
        strip = rectangle((shift, 1.5, 0), (1, 0, 0), (0, narrow, 0), diffuse(0.5))
        return left_out(wall, strip, point_light((shift, 0, 1)))

    assert room(0.0, 0.1) == {"rectangles": 2}
    assert room(0.0, 1e-4) == {"rectangles": 1}
    assert room(100.0, 0.1) == {}


INSIDE, NEAR_THE_LAMP, ABOVE = (point_light((0, 0, z)) for z in (0.5, 0.95, 1.5))


@pytest.mark.parametrize(
    ("lights", "rectangles"),
    [
        ((), 0),
        ((INSIDE,), 6),
        ((LAMP,), 7),  # a flat lamp alone is not in its own way
        ((LAMP, NEAR_THE_LAMP), 6),  # but in that of another light
        ((ABOVE,), 5),  # the ceiling is in the way, and the floor is not
        ((INSIDE, sun((0, 0, -1))), 0),  # walls block what is infinitely far
        ((INSIDE, sky()), 0),
    ],
)
def test_what_is_left_out_of_a_room(lights, rectangles):
    assert left_out(*box(0.5), *lights) == (
        {"rectangles": rectangles} if rectangles else {}
    )


def test_a_sky_that_is_not_sampled_is_none_of_the_lights():
    assert left_out(*box(0.5), LAMP, sky(), finds_sky=True) == {"rectangles": 7}


@pytest.mark.parametrize(("height", "stays"), [(-0.05, True), (0.0, True), (0.01, False)])
def test_a_wall_stays_where_something_is_or_rays_start_beyond_it(height, stays):
    """Rays start a little off the ball, downwards where it meets the floor."""
    ball = sphere(diffuse(0.5), center=(0, 0, height - 0.75), radius=0.25)
    assert left_out(*box(0.5), LAMP, ball) == {"rectangles": 6 if stays else 7}


def test_instances_are_on_the_sides_that_their_boxes_are_on():
    def copy(z):
        cube = {"type": "cube", "bsdf": diffuse(0.5)}
        matrix = np.diag([0.2, 0.2, 0.2, 1.0])
        matrix[2, 3] = z
        content = scene(CAMERA, "path", *box(0.5), LAMP)
        content["group"] = {"type": "shapegroup", "id": "group", "shape": cube}
        group = {"type": "ref", "id": "group"}
        content["copy"] = {"type": "instance", "to_world": matrix, "group": group}
        return left_out_of(content)

    assert copy(-0.79) == {"rectangles": 7}
    assert copy(-0.9) == {"rectangles": 6}


def test_a_large_mesh_is_where_its_box_is(tmp_path):
    def fan(z):
        """A disk of more triangles than are looked at one by one."""
        angles = np.linspace(0.0, 2.0 * np.pi, MOST + 2)
        rim = [f"v {0.5 * np.cos(a)} {0.5 * np.sin(a)} {z}" for a in angles]
        faces = [f"f 1 {k} {k + 1}" for k in range(2, len(rim) + 1)]
        path = tmp_path / f"fan{z}.obj"
        path.write_text("\n".join([f"v 0 0 {z}", *rim, *faces]))
        return {"type": "obj", "filename": str(path), "bsdf": diffuse(0.5)}

    assert left_out(*box(0.5), LAMP, fan(-0.9)) == {"rectangles": 7}
    assert left_out(*box(0.5), LAMP, fan(-1.1)) == {"rectangles": 6}


def test_many_lights_are_where_their_box_is():
    def lights(highest):
        heights = np.linspace(-0.9, highest, MOST + 1)
        return [point_light((0, 0, z)) for z in heights]

    assert left_out(*box(0.5), *lights(0.9)) == {"rectangles": 6}
    assert left_out(*box(0.5), *lights(1.1)) == {"rectangles": 5}


def random_scene(rng: np.random.Generator) -> dict:
    """Return a room with a slanted roof, things in and around it, one to three lights."""
    parts = [*box(0.6)]
    for _ in range(rng.integers(1, 5)):
        center, x, y = rng.uniform(-0.7, 0.7, (3, 3)).round(1)
        if np.linalg.norm(np.cross(x, y)) > 0.01:
            shape = rectangle(center, 0.4 * x, 0.4 * y, diffuse(0.7))
            if rng.random() < 0.3:
                shape["emitter"] = area(3.0)
            parts.append(shape | {"type": str(rng.choice(["rectangle", "disk"]))})
    slanted = placed((0, 0, 0.5), (1, 0, 0), (0, 0.5, 0.5))
    parts.append({"type": "rectangle", "to_world": slanted, "bsdf": diffuse(0.4)})
    matrix = placed(rng.uniform(-0.5, 0.5, 3), (0.2, 0, 0), (0, 0.2, 0))
    matrix[:3, 2] *= 0.2
    parts.append({"type": "cube", "to_world": matrix, "bsdf": diffuse(0.6)})
    parts.append(sphere(glass(), center=(-0.3, 0.3, -0.6), radius=0.4))
    for _ in range(rng.integers(1, 3)):
        parts.append(point_light(rng.uniform(-1.2, 1.2, 3)))
    if rng.random() < 0.5:
        parts.append(LAMP)
    return scene(CAMERA, "path", *parts, max_depth=4)


def passed_by(loaded, accel="auto", offset="tight"):
    lights = sampled_lights(loaded.description, False)
    offsets = offset_rule(offset)[:2]
    return int(find_non_occluders(loaded, accel, USUAL_RAYS, lights, offsets).sum())


def assert_alike(loaded, offset="tight", seed=0, black=False):
    """Bit for bit: a method requested by its name is tested whole."""
    images = [
        renderer.render(loaded, spp=16, seed=seed, accel=accel, ray_offset=offset).pixels
        for accel in ("auto", "brute")
    ]
    np.testing.assert_array_equal(*images)
    assert images[0].any() != black


@pytest.mark.parametrize("offset", ["tight", "mitsuba"])
def test_pictures_are_those_of_brute_force(offset):
    rng = np.random.default_rng(5)
    left = 0
    for seed in range(24):
        loaded = renderer.load_dict(random_scene(rng))
        left += passed_by(loaded, offset=offset)
        assert passed_by(loaded, "brute", offset) == 0
        assert_alike(loaded, offset, seed)
    assert left > 40


def card(height, half=0.1):
    return rectangle((0, 0, height), (half, 0, 0), (0, half, 0), diffuse(0.7))


SMALL_FLOOR = rectangle((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), diffuse(0.5))
FAR_SPHERE = sphere(diffuse(0.0), center=(0, 0, 1e5), radius=500.0)
LARGE_GLASS = rectangle((0, 0, 0.02), (1e4, 0, 0), (0, 1e4, 0), glass())
SLANTED_GLASS = rectangle((0, 0, 0.02), (1e4, 0, 1e3), (0, 1e4, 0), glass())
FROM_ABOVE = sensor((0, -1.0, 1.0), (0, 0, 0), fov=50, size=(24, 16))
UNDER_GLASS = sensor((0, -0.4, 0.015), (0, 0, 0), fov=50, size=(24, 16))


@pytest.mark.parametrize(
    ("camera", "parts"),
    [
        (FROM_ABOVE, (card(0.3), point_light((0, 0, 1e5), 1e10))),
        (FROM_ABOVE, (card(0.02), point_light((3e3, 0, 1e4), 1e8))),
        (FROM_ABOVE, (card(0.3), FAR_SPHERE | {"emitter": area(1e5)})),
        (UNDER_GLASS, (LARGE_GLASS, point_light((0, 0, 1.0)))),
        (UNDER_GLASS, (SLANTED_GLASS, point_light((0, 0, 1.0)))),
    ],
)
def test_small_things_block_where_others_are_large_or_far(camera, parts):
    """Rounding is measured by the coordinates of both sides, not by the farthest of all."""
    loaded = renderer.load_dict(scene(camera, "path", SMALL_FLOOR, *parts, max_depth=2))
    assert_alike(loaded, black=camera is UNDER_GLASS)
    assert passed_by(loaded) < len(loaded.stages)


def test_rays_that_start_beyond_a_sharp_corner_are_blocked_there():
    """Mitsuba's offset is a tenth of the size of this scene."""
    small = 1e-3 * np.eye(3)
    x, y, z = small
    floor = rectangle((0, 0, 0), 0.5 * x, 0.5 * y, diffuse(0.5))
    roof = rectangle(0.2 * y + 0.1 * z, 0.3 * x, 0.1 * z - 0.2 * y, diffuse(0.5))
    light = point_light(0.1 * z - 0.3 * y, 1e-6)
    camera = sensor(0.1 * z - 1.2 * y, 0.2 * y + 0.05 * z, fov=40, size=(24, 16))
    loaded = renderer.load_dict(scene(camera, "path", floor, roof, light, max_depth=2))
    for offset in ("tight", "mitsuba"):
        assert_alike(loaded, offset)


def test_explain_says_it():
    loaded = renderer.load_dict(scene(CAMERA, "path", *box(0.5), LAMP))
    said = "pass by 7 rectangles: never between a surface and a light"
    assert said in " ".join(renderer.render(loaded, spp=1).explain.split())
    for other in ({"accel": "brute"}, {"integrator": "depth"}, {"sampler": "mitsuba"}):
        assert "pass by" not in renderer.render(loaded, spp=1, **other).explain, other
