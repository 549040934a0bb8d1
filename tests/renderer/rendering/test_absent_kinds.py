"""What a scene lacks has no row in the kernels' tables, and having it changes nothing.

A row of a table holds the addresses of a kind's kernels (`records.kernel_scene`). Where
there is no row, or a 0 in it, nothing was compiled and nothing is called.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernel_probes import Inputs
from light_probes import light_kinds
from metamorphic_scenes import unseen
from small_scenes import (
    box,
    diffuse,
    glass,
    mirror,
    placed,
    rectangle,
    rgb,
    scene,
    sensor,
    sphere,
)

import renderer
from renderer.integrators.kind import NO_LIMIT
from renderer.kernels.records.kernel_scene import (
    CHOOSE_LIGHT,
    CLOSEST,
    CLOSEST_COHERENT,
    DRAW,
    DRAW_FILM,
    EMISSION,
    LOCATE,
    REFLECT_LIGHT,
    SAMPLE_LIGHT,
    SCATTER,
)
from renderer.plugins.lights.area import AreaLights
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions

LAMP = rectangle((0, 0, 1), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=5.0)
CAMERA = sensor((0.1, -0.9, 0.2), (0, 0.5, -0.2), fov=80, size=(24, 20), spp=4, jitter=True)
CHECKERBOARD = {
    "type": "diffuse",
    "reflectance": {"type": "checkerboard", "color0": rgb(0.1), "color1": rgb(0.9)},
}


def kernels_of(integrator: str, *parts: dict[str, Any], **settings: Any) -> Inputs:
    loaded = renderer.load_dict(scene(CAMERA, integrator, *parts, **settings))
    return Inputs(loaded, make_plan(loaded), "auto")


def lights_of(inputs: Inputs) -> list[type]:
    """The kinds of lights, as rows of the table."""
    return [type(kind.record.lights) for kind in light_kinds(inputs)]


def rows(methods: np.ndarray) -> list[list[int]]:
    """Which columns of a table of methods hold an address, row by row."""
    return [np.flatnonzero(row[1:]).tolist() for row in methods]


def columns(*names: int) -> list[int]:
    return [name - 1 for name in names]


# --------------------------------------------------------------------------- records


def test_a_box_has_rectangles_and_nothing_else():
    """Six diffuse walls and a lamp: every other kind of anything has no row."""
    inputs = kernels_of("path", *box(0.7), LAMP, max_depth=5, rr_depth=5)
    kernels = inputs.record
    assert rows(kernels.groups) == [columns(CLOSEST_COHERENT, CLOSEST)]
    assert rows(kernels.shadow_groups) == []  # walls around a lamp never block it
    np.testing.assert_array_equal(kernels.camera_groups, kernels.groups)
    assert list(inputs.tables.surfaces) == ["rectangles"]
    assert rows(kernels.surfaces) == [columns(LOCATE)]
    assert kernels.placements.group.size == 0
    assert rows(kernels.bsdfs.methods) == [columns(REFLECT_LIGHT, SCATTER)]
    assert kernels.bsdfs.look_ups.size == kernels.bsdfs.texture_methods.size == 0
    assert lights_of(inputs) == [AreaLights]
    assert light_kinds(inputs)[0].record.lights.choice is None
    assert rows(kernels.lights.methods) == [columns(SAMPLE_LIGHT, EMISSION)]
    assert rows(kernels.sampler) == [columns(DRAW_FILM, DRAW, CHOOSE_LIGHT)]
    assert rows(kernels.hooks) == [[], []]
    settings = kernels.settings
    assert settings.roulette_depth == NO_LIMIT
    assert settings.every_light == settings.with_uv == settings.with_tangents == 0
    assert settings.weigh == 1


# -------------------------------------------------------------------------- pictures


def picture(*parts: dict[str, Any]) -> np.ndarray:
    content = scene(CAMERA, "path", *box(0.7), LAMP, *parts, max_depth=5, rr_depth=5)
    loaded = renderer.load_dict(content)
    job = RenderJob(
        loaded, make_plan(loaded), RenderOptions(accel="brute", seed=3, threads=2)
    )
    film = job.make_film()
    assert run(job, film).complete
    return film.develop()


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
    np.testing.assert_array_equal(lean, picture(*unseen()))
    assert not np.array_equal(lean, picture(*unseen(), sphere(glass(), radius=0.1)))


@pytest.mark.slow
def test_every_other_kind_of_shape_and_bsdf_changes_no_bit():
    """Far behind the camera: also disks, cylinders and textures (kernels of their own).

    The same shapes in the room change the picture, so they do work.
    """
    lean = picture()
    np.testing.assert_array_equal(lean, picture(*one_of_each(-9.0)))
    assert not np.array_equal(lean, picture(*one_of_each(0.3)))
