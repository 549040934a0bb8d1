"""A sky of one radiance is left to the BSDFs' samples: where, and what it gives then.

What its pictures are is known elsewhere too: shares of the sky (test_sky_light.py),
furnaces (test_furnaces.py), the same choice of lights with and without it
(test_light_choice.py) and the same paths in the simple path tracer.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import Inputs
from small_scenes import (
    diffuse,
    floor,
    glass,
    mean_and_error,
    pixels,
    scene,
    sensor,
    sky,
    sphere,
    sun,
)

import renderer
from renderer.kernels.records.kernel_scene import ENVIRONMENT, SAMPLE_LIGHT
from renderer.rendering.planning.make_plan import make_plan

CAMERA = sensor((0, -2, 6), (0, 0, 0), fov=20, size=(12, 8), spp=1, jitter=True)
RHO, SKY, SUN = 0.5, 0.75, 2.0
DOWN = (0.0, 0.6, -0.8)
LAMP = {
    **sphere(diffuse(0.0), center=(3, 0, 3), radius=0.2),
    "emitter": {"type": "area", "radiance": 5.0},
}


def plan_of(*parts, asked="path", settings=None, **choices):
    loaded = renderer.load_dict(scene(CAMERA, asked, *parts, **(settings or {})))
    return loaded, make_plan(loaded, **choices)


@pytest.mark.parametrize("method", ["path", "direct"])
@pytest.mark.parametrize("order", [(sky, sun), (sun, sky)], ids=["sky first", "sun first"])
def test_an_open_floor_has_no_noise(method, order):
    """Each sample has rho (L + E cos / pi): the sun is always sampled, the sky never.

    `path` samples one light at a point, `direct` all. One sampled by a wrong number, or
    a sun sampled in half of the cases, is seen in the first sample.
    """
    made = {sky: sky(SKY), sun: sun(DOWN, SUN)}
    content = scene(CAMERA, "path", floor(RHO, half=1e3), *(made[k] for k in order))
    picture = pixels(content, integrator=method, sampler="sobol")
    expected = RHO * (SKY + SUN * 0.8 / np.pi)
    assert picture == pytest.approx(expected, rel=2e-5)


def test_three_lights_of_which_two_are_asked():
    """Two suns alike are each sampled in half of the cases, wherever the sky stands."""
    suns = sun(DOWN, SUN), sun((0.0, -0.6, -0.8), SUN)
    for parts in ((sky(SKY), *suns), (suns[0], sky(SKY), suns[1]), (*suns, sky(SKY))):
        content = scene(CAMERA, "path", floor(RHO, half=1e3), *parts, max_depth=3)
        expected = RHO * (SKY + 2 * SUN * 0.8 / np.pi)
        assert pixels(content) == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize(
    ("parts", "strategy", "weigh"),
    [
        ((sky(),), "bsdfs", False),
        ((sky(), sun(DOWN)), "both", False),
        ((sky(), LAMP), "both", True),
    ],
    ids=["alone", "with a sun", "with a lamp"],
)
def test_what_is_planned_and_compiled(parts, strategy, weigh):
    """No method samples it, and one finds it; weights are of the other lights alone."""
    loaded, plan = plan_of(floor(), *parts)
    assert (plan.finds_sky, plan.strategy, plan.weigh) == (True, strategy, weigh)
    assert any(line.startswith("sky ") for line in plan.lines)
    lights = Inputs(loaded, plan).record.lights
    (found,) = np.flatnonzero(lights.methods[:, ENVIRONMENT])
    assert lights.methods[found, SAMPLE_LIGHT] == 0
    assert found not in lights.kind[lights.sampled]
    others = np.delete(lights.methods[:, SAMPLE_LIGHT], found)
    assert (others != 0).all(), f"all other lights are sampled: {others}"
    assert len(lights.sampled) == len(others)


@pytest.mark.parametrize(
    ("asked", "settings", "choices"),
    [
        ("path", {}, {"light_choice": "uniform"}),
        ("path", {}, {"sampler": "mitsuba"}),
        ("path", {"max_depth": 1}, {}),
        ("whitted", {}, {}),
        ("direct", {"emitter_samples": 4, "bsdf_samples": 1}, {}),
        ("direct", {"bsdf_samples": 0}, {}),
    ],
    ids=["uniform", "replay", "no bounce", "whitted", "several", "lights alone"],
)
def test_who_samples_it_still(asked, settings, choices):
    """Mitsuba's estimator, and methods that follow no BSDF samples, or count on others."""
    parts = floor(), sky(), sun(DOWN)
    _, plan = plan_of(*parts, asked=asked, settings=settings, **choices)
    assert not plan.finds_sky
    assert not any(line.startswith("sky ") for line in plan.lines)


@pytest.mark.parametrize("rate", [0.0, 0.05])
def test_a_lobe_that_bsdf_samples_neglect_keeps_its_light_samples(rate):
    """At rate 0 no BSDF sample goes through the sheet: half of the light would be lost."""
    sheet = {"type": "principledthin", "diff_trans": 1.0, "roughness": 0.5}
    sheet["diffuse_transmittance_sampling_rate"] = rate
    _, plan = plan_of(floor() | {"bsdf": sheet}, sky(SKY))
    assert not plan.finds_sky
    sheet["diffuse_transmittance_sampling_rate"] = 0.5
    for around in (lambda bsdf: bsdf, lambda bsdf: {"type": "mask", "inside": bsdf}):
        _, plan = plan_of(floor() | {"bsdf": around(sheet)}, sky(SKY))
        assert plan.finds_sky


HALF_HOLE = {"type": "mask", "opacity": 0.5, "inside": diffuse(0.8)}


@pytest.mark.parametrize(
    ("bsdf", "settings"),
    [
        (diffuse(0.8), {"hide_emitters": True}),
        (HALF_HOLE, {}),
        (glass(), {}),
    ],
    ids=["hidden", "holes", "glass"],
)
def test_it_is_as_bright_as_when_light_samples_find_it(bsdf, settings):
    """The mean of a picture by both, with a lamp next to the sky.

    100 pictures of 8 samples by each: at 5 standard errors of the difference a false alarm
    has a chance of 2e-6 for each case and channel, and 2 % of the light would be seen.
    (Hidden behind holes it is sampled always: `test_hidden_lights`.)
    """
    ball = sphere(bsdf, center=(0, 0, 1), radius=0.7)
    content = scene(CAMERA, "path", floor(), ball, sky(SKY), LAMP, **settings)
    assert make_plan(renderer.load_dict(content)).finds_sky
    found, asked = (
        mean_and_error(content, seeds=100, spp=8, light_choice=choice)
        for choice in ("importance", "uniform")
    )
    error = np.hypot(found[1], asked[1])
    apart = np.abs(found[0] - asked[0]) / error
    assert (apart < 5).all(), f"{apart} standard errors apart"
    assert (error < 4e-3 * asked[0]).all(), f"too noisy to tell: {error / asked[0]}"
