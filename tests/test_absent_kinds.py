"""What a scene lacks is None in the kernels' record, and compiling it in changes nothing.

A None is a type of its own to Numba: the code that would read it is left out when the
kernels are compiled (`renderer.records.kernel_scene`). So a None is what "not compiled" means.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from metamorphic_scenes import unseen
from renderer.kernel_inputs import kernel_scene
from small_scenes import (
    box,
    diffuse,
    glass,
    mirror,
    placed,
    point_light,
    rectangle,
    rgb,
    scene,
    sensor,
    sphere,
    sun,
)

import renderer
from renderer.rendering.planning.plan import make_plan
from renderer.rendering.rendering import Rendering

LAMP = rectangle((0, 0, 1), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=5.0)
CAMERA = sensor((0.1, -0.9, 0.2), (0, 0.5, -0.2), fov=80, size=(24, 20), spp=4, jitter=True)
CHECKERBOARD = {
    "type": "diffuse",
    "reflectance": {"type": "checkerboard", "color0": rgb(0.1), "color1": rgb(0.9)},
}


def kernels_of(integrator: str, *parts: dict[str, Any], **settings: Any):
    loaded = renderer.load_dict(scene(CAMERA, integrator, *parts, **settings))
    return kernel_scene(loaded, make_plan(loaded), "auto", 0)


def absent(record: Any) -> set[str]:
    return {name for name, value in record._asdict().items() if value is None}


# --------------------------------------------------------------------------- records

SHAPES = {"triangles", "disks", "spheres", "cylinders"}


def test_a_box_has_rectangles_and_nothing_else():
    """Six diffuse walls and a lamp: every other kind of anything is None."""
    kernels = kernels_of("path", *box(0.7), LAMP, max_depth=5, rr_depth=5)
    assert absent(kernels.accelerators) == SHAPES | {"instances"}
    assert kernels.camera_accelerators is None
    assert absent(kernels.surfaces) == SHAPES | {"with_uv"}
    assert absent(kernels.bsdfs) == {"conductor", "dielectric"}
    assert absent(kernels.bsdfs.diffuse) == {"textures"}
    assert absent(kernels.lights) == {"points", "spots", "directionals", "constants"}
    assert absent(kernels.lights.areas) == SHAPES | {"replay"}
    assert absent(kernels.settings) == {"roulette_depth", "every_light", "replay"}
    assert kernels.replayed is None


@pytest.mark.parametrize(
    ("light", "kind"),
    [
        (point_light((0, 0, 0.5)), "points"),
        ({"type": "spot"}, "spots"),
        (sun((0, 0, -1)), "directionals"),
        ({"type": "constant"}, "constants"),
        (LAMP, "areas"),
    ],
)
def test_one_kind_of_light_leaves_the_others_out(light, kind):
    lights = kernels_of("direct", *box(0.7), light).lights
    kinds = {"points", "spots", "directionals", "constants", "areas"}
    assert absent(lights) == kinds - {kind}


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        (sphere(diffuse(0.5)), "spheres"),
        ({"type": "disk"}, "disks"),
        ({"type": "cylinder"}, "cylinders"),
        ({"type": "cube"}, "triangles"),
    ],
)
def test_one_kind_of_shape_leaves_the_others_out(shape, kind):
    kernels = kernels_of("direct", shape, point_light((0, 0, 3)))
    left_out = (SHAPES | {"rectangles"}) - {kind}
    assert absent(kernels.accelerators) == left_out | {"instances"}
    assert absent(kernels.surfaces) == left_out | {"with_uv"}


def test_without_lights_or_materials_asked_for_there_are_none():
    """Depth looks at shapes alone; a scene without lights has no table of them."""
    assert kernels_of("depth", *box(0.7), LAMP).lights is None
    assert kernels_of("path", *box(0.7)).lights is None
    direct = kernels_of("direct", *box(0.7), point_light((0, 0, 0.5)))
    assert {"weigh", "follow", "roulette_depth"} <= absent(direct.settings)


# -------------------------------------------------------------------------- pictures


def picture(*parts: dict[str, Any]) -> np.ndarray:
    content = scene(CAMERA, "path", *box(0.7), LAMP, *parts, max_depth=5, rr_depth=5)
    loaded = renderer.load_dict(content)
    rendering = Rendering(loaded, make_plan(loaded), accel="brute", seed=3, threads=2)
    assert rendering.run()
    return rendering.film.develop()


def one_of_each(y: float) -> list[dict[str, Any]]:
    """Return a tiny shape of every kind that the box lacks, with every BSDF it lacks."""
    small = 0.02
    place = placed((0.3, y, 0), (small, 0, 0), (0, 0, small))
    cube = np.diag([small, small, small, 1.0])
    cube[:3, 3] = (-0.3, y, 0)
    return [
        sphere(glass(), center=(0, y, 0), radius=small),
        {"type": "disk", "to_world": place, "bsdf": CHECKERBOARD},
        {
            "type": "cylinder",
            "p0": [0.1, y, 0],
            "p1": [0.1, y, small],
            "radius": small,
            "bsdf": mirror(),
        },
        {"type": "cube", "to_world": cube, "bsdf": diffuse(0.2)},
    ]


def test_kinds_that_no_ray_meets_change_no_bit():
    """The box is closed: what lies far below it is met by no ray.

    With it triangles, spheres, mirrors and glass are compiled in and searched; these
    kernels are those of the still life (`metamorphic_scenes.unseen`).
    """
    lean = picture()
    assert lean.min() > 0
    assert np.array_equal(lean, picture(*unseen()))
    assert not np.array_equal(lean, picture(*unseen(), sphere(glass(), radius=0.1)))


@pytest.mark.slow
def test_every_other_kind_of_shape_and_bsdf_changes_no_bit():
    """Far behind the camera: also disks, cylinders and textures (kernels of their own).

    The same shapes in the room change the picture, so they do work.
    """
    lean = picture()
    assert np.array_equal(lean, picture(*one_of_each(-9.0)))
    assert not np.array_equal(lean, picture(*one_of_each(0.3)))
