"""`hide_emitters` behind holes: each integrator has Mitsuba's own rule.

`path` hides lights behind holes too, and loses light that was sampled at a half-open
surface; `direct` shows them, and loses nothing.
"""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import in_mitsuba
from small_scenes import (
    diffuse,
    glass,
    point_light,
    rectangle,
    rgb,
    scene,
    sensor,
    sky,
)

import renderer
from mitsuba_ref.reference.plugins.whitted import register_whitted
from renderer.rendering.planning.make_plan import make_plan

NULL = {"type": "null"}
THIN = {"type": "thindielectric"}


def mask(opacity, inside):
    return {"type": "mask", "opacity": opacity, "bsdf": inside}


LEAF = mask(0.3, diffuse(0.5, 0.6, 0.7))
BLEND = {"type": "blendbsdf", "weight": 0.4, "a": NULL, "b": diffuse(0.5)}
HOLES = (NULL, THIN, LEAF, BLEND, glass(), mask(0.5, THIN), mask(0.0, diffuse(0.5)))


def mitsuba_replay(content, seed=0):
    """Mitsuba's picture, its film cut into blocks as a replay takes them."""
    mi.set_variant("scalar_rgb")
    register_whitted(mi)
    theirs = in_mitsuba(content)
    theirs["sensor"]["film"] |= {"component_format": "float32", "pixel_format": "rgb"}
    if theirs["integrator"]["type"] != "whitted":
        theirs["integrator"]["block_size"] = 32
    return np.array(mi.render(mi.load_dict(theirs, optimize=False), seed=seed))


# --------------------------------------------------------------- known on paper

BEHIND = {
    "sky": (sky(), 1.0),
    "lamp": (rectangle((0, 0, -2), (3, 0, 0), (0, 3, 0), NULL, shine=3.0), 3.0),
    "lamp of a sphere": (
        {
            "type": "sphere",
            "center": [0, 0, -4],
            "bsdf": NULL,
            "emitter": {"type": "area", "radiance": rgb(2.0)},
        },
        2.0,
    ),
}


@pytest.mark.parametrize("integrator", ["direct", "whitted", "path"])
@pytest.mark.parametrize("behind", BEHIND)
def test_lights_behind_a_hole_though_lights_are_hidden(integrator, behind):
    """`direct` and `whitted` show them, `path` does not; next to the hole all are black.

    (A lamp that scatters would make the sample of `path` opaque, and be seen.)
    """
    light, radiance = BEHIND[behind]
    through, past = (0, 0, 0), (0, 1.2, 0)
    for target, expected in ((through, radiance), (past, 0.0)):
        camera = sensor((0, 0, 3), target, up=(1, 0, 0))
        pane = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), NULL)
        content = scene(camera, integrator, pane, light, max_depth=4, hide_emitters=True)
        if integrator == "direct":
            del content["integrator"]["max_depth"]
        ours = np.asarray(renderer.render(renderer.load_dict(content)))
        expected = 0.0 if integrator == "path" else expected
        assert ours == pytest.approx(expected, rel=1e-6)
        assert mitsuba_replay(content) == pytest.approx(expected, rel=1e-6)


def test_a_mirror_with_holes_shows_lamps_though_they_are_hidden():
    """Half of the samples see a lamp of radiance 2 in the mirror, half a hidden one.

    The latter rays are traced again without lamps, in between those from the mirror; half
    of the light was lost when that erased the hits of their neighbours.
    """
    pane = mask(0.5, {"type": "conductor", "material": "none"})
    lamps = [
        rectangle((0, 0, -side), (9 * side, 0, 0), (0, 9, 0), NULL, shine=2.0)
        for side in (1, -5)
    ]
    camera = sensor((0, 0, 3), (0, 0, 0), up=(0, 1, 0), fov=40, size=(16, 16), spp=16)
    holes = rectangle((0, 0, 0), (9, 0, 0), (0, 9, 0), pane)
    content = scene(camera, "volpath", holes, *lamps, max_depth=2, hide_emitters=True)
    ours = np.asarray(renderer.render(renderer.load_dict(content)))
    assert ours.mean() == pytest.approx(1.0, abs=5 / 64)  # 5 standard deviations
    assert mitsuba_replay(content).mean() == pytest.approx(1.0, abs=5 / 64)


# ------------------------------------------------------- the same random numbers

LIGHTS = {
    "sky and lamp": (
        sky(0.7),
        rectangle((0, 0.5, -2), (1.5, 0, 0), (0, 1, 0), NULL, shine=(1.0, 2.0, 3.0)),
    ),
    # none behind it, so that light is lost to `path` even where lights are shown
    "lamps in front": (
        rectangle((0, 0, 1), (0.4, 0, 0), (0, 0.4, 0), NULL, shine=3.0),
        point_light((0.2, 0.5, 0.5)),
    ),
}
METHODS = {
    "direct": {"type": "direct"},
    # (several samples of a point light are a fault of its own in Mitsuba)
    "several": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 3},
    "path": {"type": "path", "max_depth": 4},
    "short path": {"type": "path", "max_depth": 2},
}


@pytest.mark.parametrize("lights", LIGHTS)
@pytest.mark.parametrize("hide", [False, True], ids=["shown", "hidden"])
@pytest.mark.parametrize("method", METHODS)
def test_pictures_through_holes_are_mitsubas(method, hide, lights):
    """Seven panes side by side, before and next to lights."""
    camera = sensor((0.3, 0.2, 3), (0, 0, 0), up=(0, 1, 0), fov=60, size=(28, 12), spp=4)
    camera["sampler"] = {"type": "independent", "sample_count": 4}
    panes = [
        rectangle((0.5 * k - 1.5, 0, 0), (0.2, 0, 0), (0, 0.6, 0), hole)
        for k, hole in enumerate(HOLES)
    ]
    integrator = METHODS[method] | {"hide_emitters": hide}
    content = scene(camera, integrator, *panes, *LIGHTS[lights])
    ours = np.asarray(renderer.render(renderer.load_dict(content), sampler="mitsuba"))
    theirs = mitsuba_replay(content)
    off = np.abs(ours - theirs).max(axis=2) / (theirs.max(axis=2) + 1e-2 * theirs.mean())
    assert theirs.any()
    assert (off > 3e-4).mean() < 0.01


# ---------------------------------------------------------------- the estimator


@pytest.mark.parametrize("hide", [False, True], ids=["shown", "hidden"])
def test_what_a_half_open_surface_loses_follows_from_mitsubas_densities(hide):
    """The share of the light that is sampled, and so can be lost, is an estimator's own.

    Under a hidden sky, found by BSDF samples alone, the picture was 1.75 times as bright.
    """
    camera = sensor((0, 0, 3), (0, 0, 0), up=(1, 0, 0), size=(8, 8), fov=20, spp=1024)
    camera["sampler"] = {"type": "independent", "sample_count": 1024}
    leaf = rectangle((0, 0, 0), (2, 0, 0), (0, 2, 0), LEAF)
    content = scene(camera, "path", leaf, sky(), max_depth=4, hide_emitters=hide)
    loaded = renderer.load_dict(content)
    plan = make_plan(loaded)
    assert plan.finds_sky != hide
    assert plan.light_choice == ("uniform" if hide else "importance")
    ours, theirs = np.asarray(renderer.render(loaded)).mean(), mitsuba_replay(content)
    assert ours == pytest.approx(theirs.mean(), rel=0.02)


# --------------------------------------------------------------- the first hit alone


@pytest.mark.parametrize("asked", ["file", "call"])
def test_aovs_are_of_lamps_too_where_lights_are_hidden(asked):
    """`hide_emitters` belongs to colours: Mitsuba's `aov` meets a lamp as any shape."""
    camera = sensor((0, 0, 3), (0, 0, 0), up=(0, 1, 0), size=(4, 4), fov=60)
    lamp = rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0), NULL, shine=3.0)
    aovs = {"type": "aov", "aovs": "depth:depth", "hide_emitters": True}
    content = scene(camera, aovs, lamp)
    theirs = mitsuba_replay(content)
    if asked == "call":
        content = scene(camera, "path", lamp, hide_emitters=True)
    image = renderer.render(renderer.load_dict(content), integrator="aov")
    assert (theirs > 1.9).any()
    np.testing.assert_allclose(image.aovs["depth"], theirs, rtol=1e-6)
