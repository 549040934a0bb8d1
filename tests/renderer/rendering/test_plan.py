"""No more than a scene needs: the plan takes the least method, says so, and is right.

First the decisions alone, then pictures: for three scenes the leaner set of stages gives
the same picture as a fuller one, bit for bit, and leaving out one thing more changes it.
"""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from small_scenes import (
    box,
    diffuse,
    floor,
    glass,
    mirror,
    point_light,
    rectangle,
    scene,
    sensor,
    sky,
    sphere,
    sun,
)

import renderer
from renderer.integrators.whitted import USUAL_DEPTH
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions

CAMERA = sensor((0, -3, 2), (0, 0, 0))
LAMP = rectangle((0, 0, 1), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=5.0)


def plan_of(integrator, *parts, **settings) -> Plan:
    return make_plan(renderer.load_dict(scene(CAMERA, integrator, *parts, **settings)))


def explained(plan: Plan) -> str:
    return "\n".join(" ".join(line.split()) for line in plan.lines)


# ------------------------------------------------------------------------ decisions


def test_a_path_of_two_segments_is_direct_light():
    """Camera to surface, surface to light: every light can be sampled, none at random."""
    plan = plan_of("path", floor(), point_light((0, 0, 1)), max_depth=2)
    assert (plan.method, plan.max_depth, plan.every_light) == ("direct", 2, True)
    assert "method direct: with max_depth <= 2 a path is direct light" in explained(plan)


def test_a_longer_path_stays_a_path():
    plan = plan_of("path", floor(), point_light((0, 0, 1)), max_depth=3)
    assert (plan.method, plan.max_depth, plan.follow) == ("path", 3, True)


@pytest.mark.parametrize(
    ("max_depth", "rr_depth", "roulette"),
    [(5, 5, None), (6, 5, 5), (-1, 7, 7), (4, 9, None)],
)
def test_roulette_only_where_a_path_gets_that_far(max_depth, rr_depth, roulette):
    plan = plan_of("path", floor(), LAMP, max_depth=max_depth, rr_depth=rr_depth)
    assert plan.roulette_depth == roulette
    text = explained(plan)
    assert ("left out Russian roulette" in text) == (roulette is None)
    assert ("roulette Russian, from segment" in text) == (roulette is not None)
    if roulette is not None:
        assert f"Russian, from segment {roulette} on" in text


def test_dim_paths_may_end_before_roulette_begins():
    """But not where paths are compared with others, or light is lost with them."""
    loaded = renderer.load_dict(scene(CAMERA, "path", floor(), LAMP))
    plan = make_plan(loaded)
    assert (plan.roulette_depth, plan.dim_depth, plan.survival_scale) == (5, 1, 4.0)
    assert "; a path of less throughput than 1/4 may end before" in explained(plan)
    for options in ({"integrator": "path"}, {"sampler": "mitsuba"}):
        whole = make_plan(loaded, **options)
        assert (whole.dim_depth, whole.survival_scale) == (None, 1.0)
    hole = rectangle((0, 0, 2), (0.3, 0, 0), (0, 0.3, 0), {"type": "null"})
    assert plan_of("path", floor(), LAMP, hole).dim_depth is None
    assert plan_of("path", floor(), LAMP, max_depth=5).dim_depth is None
    # the next segment may bring most of the light, if no light sample brings it
    sky = {"type": "constant"}
    assert plan_of("path", floor(), LAMP, sky).survival_scale == 8.0
    chosen_by_file = make_plan(
        renderer.load_dict(scene(CAMERA, "path", floor(), LAMP, sky)),
        light_choice="uniform",
    )
    assert chosen_by_file.survival_scale == 4.0


@pytest.mark.parametrize("max_depth", [2, 4])
def test_importance_sampling_of_two_kinds_needs_lights_that_can_be_hit(max_depth):
    """No ray meets a point: BSDF samples find no point lights, so nothing is weighed."""
    points = plan_of("path", floor(), point_light((0, 0, 1)), max_depth=max_depth)
    assert not points.weigh
    assert "left out multiple importance sampling" in explained(points)
    plan = plan_of("path", floor(), LAMP, sky(), max_depth=max_depth)
    assert plan.weigh
    assert plan.follow
    assert "weights multiple importance sampling: light samples" in explained(plan)
    assert "left out multiple importance sampling" not in explained(plan)


def test_what_shines_alone_needs_no_weights():
    """One segment: no light is sampled and none is met on the way back."""
    plan = plan_of("path", floor(), LAMP, max_depth=1)
    assert not plan.weigh
    assert "left out multiple importance sampling: with max_depth 1" in explained(plan)


def test_direct_with_point_lights_sends_no_rays_on():
    plan = plan_of("direct", floor(), point_light((0, 0, 1)))
    assert not plan.follow
    assert "left out scattering" in explained(plan)


def test_direct_without_bsdf_samples_weighs_nothing():
    plan = plan_of("direct", floor(), LAMP, bsdf_samples=0, emitter_samples=1)
    assert (plan.weigh, plan.follow) == (False, False)


def test_mirrors_alone_need_no_weights():
    """Where nothing is diffuse, lights are found by mirror reflection and never sampled."""
    shining = sphere(mirror(), center=(0, 0, 3)) | {
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
    }
    plan = plan_of("path", shining, max_depth=8)
    assert (plan.weigh, plan.follow) == (False, False)


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_without_light_there_are_no_bounces(integrator):
    plan = plan_of(integrator, floor(), sphere(mirror()))
    assert (plan.method, plan.max_depth) == ("direct", 1)
    assert "without a light every path is black" in explained(plan)


def test_whitted_without_mirrors_does_not_recurse():
    plan = plan_of("whitted", floor(), point_light((0, 0, 1)))
    assert (plan.method, plan.max_depth) == ("whitted", 2)
    for smooth in (mirror(), glass()):
        plan = plan_of("whitted", floor(), sphere(smooth), point_light((0, 0, 3)))
        assert (plan.method, plan.max_depth) == ("whitted", 8)
        unlimited = plan_of("whitted", sphere(smooth), point_light((0, 0, 3)), max_depth=-1)
        assert unlimited.max_depth == USUAL_DEPTH


@pytest.mark.parametrize("integrator", ["depth", "aov"])
def test_depth_and_aovs_sample_no_light(integrator):
    settings = {"aovs": "dd:depth"} if integrator == "aov" else {}
    plan = plan_of(integrator, floor(), LAMP, **settings)
    assert (plan.method, plan.max_depth) == (integrator, 1)
    assert not plan.weigh
    assert not plan.every_light
    assert not plan.follow
    assert "the first hit alone; no light, no BSDF is sampled" in explained(plan)
    assert "left out lights, shadow rays, bounces: the first hit" in explained(plan)


def test_a_fixed_pattern_is_one_sample_a_pixel_and_said_to_be_exact():
    """Pixel centres and point lights: nothing is random, and the plan says so."""
    plan = plan_of("path", floor(), point_light((0, 0, 1)), max_depth=2)
    assert plan.spp == 1
    assert "samples 1 per pixel, at its centre: nothing is random" in explained(plan)
    noisy = plan_of("path", floor(), LAMP, max_depth=2)
    assert "nothing is random" not in explained(noisy)


def test_an_explicit_integrator_is_taken_at_its_word():
    """`auto` may choose a lesser method; a requested name is what runs."""
    loaded = renderer.load_dict(
        scene(CAMERA, "path", floor(), point_light((0, 0, 1)), max_depth=2)
    )
    assert make_plan(loaded, integrator="auto").method == "direct"
    for name in ("path", "whitted", "direct", "depth", "aov"):
        assert make_plan(loaded, integrator=name).method == name


def test_the_explanation_lists_what_is_there_and_what_is_not():
    text = explained(plan_of("path", floor(), sphere(glass()), LAMP, max_depth=8))
    assert "file says path, max_depth 8, rr_depth 5" in text
    assert "geometry 2 rectangles, 1 sphere" in text
    assert "BSDFs diffuse, dielectric" in text
    assert "lights 1 area" in text
    assert re.search("left out conductor, .*: no shape has it; not compiled", text)
    assert "left out textures and uv" in text
    assert re.search(
        "left out triangles, disks, cylinders, .*instances: the scene has", text
    )
    assert re.search("left out point, spot, directional, .*: the scene has no such", text)
    assert "weights multiple importance sampling: light samples and BSDF samples" in text
    assert "roulette Russian, from segment 5 on" in text


def test_no_kind_is_both_there_and_left_out():
    """Every kind of shape and light is named once: with its number, or as left out."""
    shapes = [
        sphere(diffuse(0.5)),
        {"type": "disk"},
        {"type": "cylinder"},
        {"type": "cube"},
    ]
    lights = [LAMP, sky(), sun((0, 0, -1)), point_light((0, 0, 2)), {"type": "spot"}]
    everything = explained(plan_of("path", *shapes, *lights, max_depth=8))
    assert "geometry 12 triangles, 1 rectangle, 1 disk, 1 sphere, 1 cylinder" in everything
    assert "lights 1 point, 1 spot, 1 directional, 1 constant, 1 area" in everything
    assert re.search(r"left out (\w+, )*instances: the scene has none", everything)
    assert "left out envmap, sunsky, projector: the scene has no such light" in everything
    nothing = explained(plan_of("path", max_depth=8))
    assert "geometry nothing" in nothing
    assert "left out triangles, rectangles, disks, spheres, cylinders, " in nothing
    assert "left out lights of any kind: the scene has none" in nothing
    assert "left out Russian roulette: direct light" in nothing


def test_each_medium_is_described():
    """Where it is, 1 / sigma_t, the albedo, the phase function, and of grids their size."""
    scenes = Path(__file__).parents[3] / "scenes"
    mist = renderer.load_file(scenes / "mist" / "scene.xml")
    lines = explained(make_plan(mist)).splitlines()
    fog, smoke, ball = (line for line in lines if line.startswith("medium"))
    assert fog == (
        "medium homogeneous, around the camera, outside of 2 shapes: mean free path 16.7; "
        "albedo 0.95; hg of g 0.6"
    )
    assert ball == (
        "medium homogeneous, inside of 1 shape: mean free path 0.37 to 0.833; "
        "albedo 0.5, 0.8, 0.95; a blend of hg of g -0.3 (0.6) and rayleigh (0.4)"
    )
    values = mist.description.shapes[1].interior.sigma_t.values
    densest, mean = (1.0 / (7.0 * x) for x in (values.max(), values.mean()))
    assert smoke == (
        "medium heterogeneous, inside of 1 shape: "
        f"mean free path {densest:.3g} where densest, {mean:.3g} on average; "
        "albedo 0.75, 0.8, 0.9; isotropic; a grid of 28 x 28 x 28 (85.8 KiB)"
    )
    assert "medium " not in explained(make_plan(mist, integrator="path"))


def test_a_blend_by_a_grid_is_described():
    grid = {"type": "gridvolume", "grid": np.zeros((2, 3, 4, 3), np.float32)}
    blend = {"type": "blendphase", "weight": grid, "a": {"type": "hg"}}
    inside = {"type": "homogeneous", "phase": blend | {"b": {"type": "rayleigh"}}}
    ball = {"type": "sphere", "interior": inside}
    expected = "blend by a grid of 4 x 3 x 2 colours (288 bytes) of hg of g 0.8 and ray"
    assert expected in explained(plan_of("volpath", ball))


# ------------------------------------------------------------------------- pictures


def picture(loaded, plan: Plan, **changes) -> np.ndarray:
    changed = dataclasses.replace(plan, **changes)
    job = RenderJob(loaded, changed, RenderOptions(seed=3, threads=2))
    film = job.make_film()
    assert run(job, film).complete
    return film.develop()


def planned(integrator, *parts, **settings):
    camera = sensor(
        (0.1, -0.9, 0.2), (0, 0.5, -0.2), fov=80, size=(24, 20), spp=4, jitter=True
    )
    loaded = renderer.load_dict(scene(camera, integrator, *parts, **settings))
    return loaded, make_plan(loaded)


def test_point_lights_over_diffuse_surfaces():
    """Left out: weights, rays that go on, roulette. Not to be left out: any light."""
    lights = point_light((0.3, 0, 0.8)), point_light((-0.5, 0.2, 0.5), 0.3)
    loaded, plan = planned("path", *box(0.5), *lights, max_depth=2)
    lean = picture(loaded, plan)
    assert lean.min() > 0
    fuller = picture(loaded, plan, weigh=True, follow=True, roulette_depth=1)
    np.testing.assert_array_equal(lean, fuller)
    assert not np.array_equal(lean, picture(loaded, plan, every_light=False))
    assert not picture(loaded, plan, max_depth=1).any()


def test_closed_box_with_an_area_light():
    """Left out: roulette that is never played. Not to be left out: weights, a bounce."""
    loaded, plan = planned("path", *box(0.7), LAMP, max_depth=5, rr_depth=5)
    lean = picture(loaded, plan)
    np.testing.assert_array_equal(lean, picture(loaded, plan, roulette_depth=5))
    unweighted = picture(loaded, plan, weigh=False)
    assert unweighted.mean() > 1.2 * lean.mean()  # light counted twice
    assert not np.array_equal(lean, picture(loaded, plan, roulette_depth=2))
    assert not np.array_equal(lean, picture(loaded, plan, max_depth=4))


def test_mirrors_and_point_lights_by_whitted():
    """Left out: weights and any cut-off that no ray meets. Not: a generation of rays."""
    walls = box(0.5)
    walls[2]["bsdf"] = walls[3]["bsdf"] = mirror(0.8)  # ahead and behind the camera
    loaded, plan = planned(
        "whitted", *walls, point_light((0.3, 0, 0.5)), max_depth=4, cutoff=1e-3
    )
    lean = picture(loaded, plan)
    np.testing.assert_array_equal(lean, picture(loaded, plan, weigh=True, cutoff=0.0))
    assert not np.array_equal(lean, picture(loaded, plan, max_depth=3))
    assert not np.array_equal(lean, picture(loaded, plan, cutoff=0.7))
