"""Every accelerator on every scene of scenes/, and through the renderer's own door."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from agreement import (
    NAMES,
    QUICK_KINDS,
    assert_agrees,
    brute_force,
    every_name,
    extents_for,
    one_of_each_family,
    proved,
    reach_of,
)
from kernel_probes import directions, float32, unit
from small_scenes import placed, sensor
from small_scenes import scene as small_scene
from soups import awkward_rays

import renderer
from renderer import SceneError
from renderer.command.cli import main

SCENES = sorted((Path(__file__).parents[3] / "scenes").glob("*/scene.xml"))
# What is new in these is no shape; `make test` has no time for them.
OF_MATERIALS = {
    "bumps",
    "evening-sky",
    "leaves",
    "measured-ball",
    "mist",
    "principled-gallery",
    "rough-materials",
}
SIDE = 24  # camera rays a side


def camera_rays(scene: renderer.Scene) -> tuple[np.ndarray, np.ndarray]:
    """SIDE x SIDE rays of a pinhole where the scene's camera is."""
    camera = scene.description.camera
    half = np.tan(np.radians(camera.fov_x) / 2)
    x, y = (np.indices((SIDE, SIDE)).reshape(2, -1) + 0.5) / SIDE * 2 - 1
    local = np.stack((half * x, half * y, np.ones(SIDE * SIDE)), axis=1)
    matrix = np.asarray(camera.to_world, float)
    direction = unit(local @ matrix[:3, :3].T)
    return float32(np.broadcast_to(matrix[:3, 3], direction.shape)), float32(direction)


def rays_of(scene: renderer.Scene, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Camera rays, random ones through the whole world, awkward ones at one kind."""
    rng = np.random.default_rng(len(kind))
    low, high = scene.bounds
    anywhere = rng.uniform(low, high + 1e-3, (SIDE * SIDE, 3))
    parts = [camera_rays(scene), (anywhere, directions(SIDE * SIDE, rng))]
    parts.append(awkward_rays(extents_for(kind, scene.surfaces[kind]), 64, rng))
    origin, direction = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    return float32(origin), float32(direction)


def scenes():
    """Return all scenes, those marked as slow that are of spheres and rectangles again."""
    return [
        pytest.param(
            path,
            id=path.parent.name,
            marks=pytest.mark.slow if path.parent.name in OF_MATERIALS else (),
        )
        for path in SCENES
    ]


@functools.cache
def loaded(path: Path) -> renderer.Scene:
    return renderer.load_file(path)


def check_scene(name, path, kinds):
    """Compare with brute force over some kinds of primitives, as the renderer builds."""
    scene = loaded(path)
    asked = [kind for kind in scene.surfaces if kind in kinds]
    if not asked:
        pytest.skip("the scene has no such primitives")
    found = 0
    for kind in asked:
        surfaces = scene.surfaces[kind]
        origin, direction = rays_of(scene, kind)
        truth = brute_force(kind, surfaces, origin, direction)
        start = scene.description.camera.to_world[:3, 3]
        reach = reach_of(np.array([*scene.bounds, start]))
        accel = proved(name, kind, surfaces, reach)
        label = f"{name}, {kind} of {path.parent.name}"
        assert_agrees(accel, truth, origin, direction, np.inf, label)
        found += (truth.prim >= 0).sum()
    assert found > 100


@every_name
@pytest.mark.parametrize("path", scenes())
def test_every_scene(name, path):
    check_scene(name, path, set(QUICK_KINDS[name]))


# ------------------------------------------------------------------ the renderer's own door


def rendered(name: str) -> np.ndarray:
    """Depth, normals and primitive numbers of a mesh and a ball."""
    cube = {"type": "cube", "to_world": placed((1, 1, 0.6), (0.4, 0.2, 0), (-0.2, 0.4, 0))}
    ball = {"type": "sphere", "center": [-0.7, 0, 1], "radius": 0.7}
    view = sensor((0, -6, 2), (0, 0, 0.5), fov=50, size=(48, 32))
    content = small_scene(view, "aov", cube, ball, aovs="t:depth,n:sh_normal,i:prim_index")
    image = renderer.render(renderer.load_dict(content), accel=name, spp=1, threads=1)
    return np.concatenate([*image.aovs.values()], axis=2)


@one_of_each_family
def test_first_hits_are_the_same_picture(name):
    """Bit for bit."""
    picture = rendered(name)
    assert np.ptp(picture) > 1
    np.testing.assert_array_equal(picture, rendered("brute"))


@every_name
def test_an_empty_scene_is_black(name):
    scene = renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": sensor((0, -6, 2), (0, 0, 0.5), fov=50, size=(8, 8)),
        }
    )
    image = renderer.render(scene, accel=name, spp=1, threads=1)
    assert image.pixels.shape == (8, 8, 3)
    assert not image.pixels.any()


def test_an_unknown_name_lists_what_there_is(capsys):
    scene = renderer.load_file(SCENES[0])
    with pytest.raises(SceneError) as caught:
        renderer.render(scene, accel="octopus")
    assert str(caught.value).endswith("there are: " + ", ".join(("auto", *NAMES)))
    assert main([str(SCENES[0]), "--accel", "octopus"]) != 0
    told = capsys.readouterr().err
    assert all(f"'{name}'" in told for name in ("auto", *NAMES))
