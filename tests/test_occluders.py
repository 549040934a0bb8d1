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
from renderer.accelerators.cost_model import USUAL_RAYS
from renderer.accelerators.occluders import MOST, never_between, never_in_the_way
from renderer.scene.light_order import asked_lights

FLAT = ("triangles", "rectangles", "disks")
CAMERA = sensor((0, -0.9, 0.2), (0, 0, 0), fov=80, size=(24, 16))
LAMP = rectangle((0, 0, 0.9), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=5.0)


def left_out(*parts, finds_sky=False):
    return left_out_of(scene(CAMERA, "path", *parts), finds_sky)


def left_out_of(content, finds_sky=False):
    """Return how many primitives of each kind shadow rays pass by, without the zeros."""
    loaded = renderer.load_dict(content)
    lights = asked_lights(loaded.description, finds_sky)
    has = [kind for kind in FLAT if kind in loaded.surfaces]
    mask = never_between(loaded, has, lights)
    assert mask.shape == loaded.stages.shape
    counts = {
        kind: int(mask[surfaces.first : surfaces.end].sum())
        for kind, surfaces in loaded.surfaces.items()
    }
    return {kind: count for kind, count in counts.items() if count}


def test_walls_of_a_room_with_a_point_light():
    assert left_out(*box(0.5), point_light((0, 0, 0.5))) == {"rectangles": 6}


def test_a_flat_lamp_alone_is_not_in_its_own_way():
    assert left_out(*box(0.5), LAMP) == {"rectangles": 7}


def test_a_lamp_is_in_the_way_of_another_light():
    behind = point_light((0, 0, 0.95))
    assert left_out(*box(0.5), LAMP, behind) == {"rectangles": 6}


def test_walls_stay_where_the_light_is_behind_them():
    """Of a light above the ceiling only the ceiling is in the way; the floor is not."""
    assert left_out(*box(0.5), point_light((0, 0, 1.5))) == {"rectangles": 5}


@pytest.mark.parametrize("far", [sun((0, 0, -1)), sky()])
def test_walls_block_what_is_infinitely_far(far):
    assert left_out(*box(0.5), point_light((0, 0, 0.5)), far) == {}


def test_a_sky_that_is_not_asked_is_none_of_the_lights():
    parts = (*box(0.5), LAMP, sky())
    assert left_out(*parts) == {}
    assert left_out(*parts, finds_sky=True) == {"rectangles": 7}


def test_nothing_is_left_out_where_nothing_shines():
    assert left_out(*box(0.5)) == {}


def test_a_wall_with_something_on_both_sides_stays():
    ball = sphere(diffuse(0.5), center=(0, 0, -0.8), radius=0.25)  # 0.05 below the floor
    assert left_out(*box(0.5), LAMP, ball) == {"rectangles": 6}
    ball = sphere(diffuse(0.5), center=(0, 0, -0.75), radius=0.25)  # on it
    assert left_out(*box(0.5), LAMP, ball) == {"rectangles": 7}


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

    assert copy(-0.8) == {"rectangles": 7}
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

    assert left_out(*box(0.5), LAMP, fan(-1.0)) == {"rectangles": 7}
    assert left_out(*box(0.5), LAMP, fan(-1.1)) == {"rectangles": 6}


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


def test_pictures_are_those_of_brute_force():
    """Bit for bit: what is named is tested whole, and `auto` leaves walls out."""
    rng = np.random.default_rng(5)
    passed_by = 0
    for seed in range(24):
        loaded = renderer.load_dict(random_scene(rng))
        lights = asked_lights(loaded.description, False)
        passed_by += int(never_in_the_way(loaded, "auto", USUAL_RAYS, lights).sum())
        assert not never_in_the_way(loaded, "brute", USUAL_RAYS, lights).any()
        images = [
            renderer.render(loaded, spp=16, seed=seed, accel=accel).pixels
            for accel in ("auto", "brute")
        ]
        np.testing.assert_array_equal(*images)
        assert images[0].any()
    assert passed_by > 50


def test_explain_says_it():
    loaded = renderer.load_dict(scene(CAMERA, "path", *box(0.5), LAMP))
    said = "pass by 7 rectangles: never between a surface and a light"
    assert said in " ".join(renderer.render(loaded, spp=1).explain.split())
    for other in ({"accel": "brute"}, {"integrator": "depth"}, {"sampler": "mitsuba"}):
        assert "pass by" not in renderer.render(loaded, spp=1, **other).explain, other
