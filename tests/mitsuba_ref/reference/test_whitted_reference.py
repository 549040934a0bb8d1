"""Our Whitted recursion inside Mitsuba, against closed forms (facts: rows A, D, M, 22)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mitsuba_ref.reference.variant import load_mitsuba

# Fresnel at normal incidence for n = 1.5 and the series over a slab's two faces.
R = 0.04
SLAB = (1.0 - R) ** 2


def look(origin: list[float], target: list[float], up: list[float]) -> dict[str, Any]:
    """Return a camera of one pixel that samples its centre."""
    mi = load_mitsuba()
    return {
        "type": "perspective",
        "fov": 1.0,
        "to_world": mi.ScalarTransform4f().look_at(origin, target, up),
        "film": {
            "type": "hdrfilm",
            "width": 1,
            "height": 1,
            "rfilter": {"type": "box"},
            "component_format": "float32",
        },
        "sampler": {"type": "stratified", "jitter": False, "sample_count": 1},
    }


ALONG_Z = ([0.0, 0.0, 5.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0])


def value(content: dict[str, Any], sensor: dict[str, Any], **settings: Any) -> np.ndarray:
    """Return the pixel of the camera."""
    mi = load_mitsuba()
    spp = settings.pop("spp", 1)
    scene = mi.load_dict({"type": "scene", "sensor": sensor, **content})
    integrator = mi.load_dict({"type": "whitted", **settings})
    return np.array(mi.render(scene, integrator=integrator, spp=spp, seed=1))[0, 0]


def wall_light(z: float, radiance: float, *, towards: int = 1) -> dict[str, Any]:
    """Return an emitting square of side 20 at `z` that faces +z or -z."""
    mi = load_mitsuba()
    to_world = mi.ScalarTransform4f().translate([0, 0, z]).scale(10)
    return {
        "type": "rectangle",
        "to_world": to_world,
        "flip_normals": towards < 0,
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
    }


def glass_slab() -> dict[str, Any]:
    mi = load_mitsuba()
    return {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().scale([10, 10, 0.1]),
        "bsdf": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0},
    }


@pytest.mark.parametrize(
    ("max_depth", "expected"),
    [
        (1, 0.0),
        (2, 0.0),
        (3, SLAB),
        (4, SLAB),
        (5, SLAB * (1 + R**2)),
        (7, SLAB * (1 + R**2 + R**4)),
        (40, (1 - R) / (1 + R)),
    ],
)
def test_glass_slab_sums_the_series_of_inner_reflections(max_depth, expected):
    """A light behind a slab: two more segments for each more pair of reflections.

    The limit is (1 - r) / (1 + r) = 0.9230769. Both branches must be followed with their
    Fresnel weights, and the factor 1 / eta^2 on entering must be undone on leaving.
    """
    scene = {"slab": glass_slab(), "light": wall_light(-3.0, 1.0)}
    pixel = value(scene, look(*ALONG_Z), max_depth=max_depth, cutoff=0.0)
    np.testing.assert_allclose(pixel, expected, rtol=2e-6, atol=1e-9)


def test_glass_slab_reflects_what_it_does_not_transmit():
    """A light behind the camera instead: 2 r / (1 + r) = 0.0769231."""
    scene = {"slab": glass_slab(), "light": wall_light(8.0, 1.0, towards=-1)}
    pixel = value(scene, look(*ALONG_Z), max_depth=60, cutoff=0.0)
    np.testing.assert_allclose(pixel, 2 * R / (1 + R), rtol=2e-6)


@pytest.mark.parametrize(
    ("kind", "expected"), [("null", 1.0), ("thindielectric", (1 - R) / (1 + R))]
)
def test_what_goes_straight_on_is_followed(kind, expected):
    """A light behind a surface that is not there, and behind a pane."""
    pane = {"type": kind} | ({} if kind == "null" else {"int_ior": 1.5, "ext_ior": 1.0})
    scene = {"pane": {"type": "rectangle", "bsdf": pane}, "light": wall_light(-3.0, 1.0)}
    pixel = value(scene, look(*ALONG_Z), cutoff=0.0)
    np.testing.assert_allclose(pixel, expected, rtol=2e-6)


def test_cutoff_drops_rays_of_small_weight():
    """Above r^2 (1 - r) / eta^2 but below the first path's weights, one path is left."""
    scene = {"slab": glass_slab(), "light": wall_light(-3.0, 1.0)}
    pixel = value(scene, look(*ALONG_Z), max_depth=40, cutoff=0.1)
    np.testing.assert_allclose(pixel, SLAB, rtol=2e-6)


def test_tinted_mirror_shows_the_light_behind_the_camera():
    """`material` none reflects everything: radiance 3 times the tint."""
    mirror = {
        "type": "rectangle",
        "bsdf": {
            "type": "conductor",
            "material": "none",
            "specular_reflectance": {"type": "rgb", "value": [0.7, 0.5, 0.1]},
        },
    }
    scene = {"mirror": mirror, "light": wall_light(8.0, 3.0, towards=-1)}
    np.testing.assert_allclose(value(scene, look(*ALONG_Z)), [2.1, 1.5, 0.3], rtol=1e-6)
    assert np.all(value(scene, look(*ALONG_Z), max_depth=1) == 0.0)


@pytest.mark.parametrize("sides", [1, 2])
def test_two_sided_mirror_seen_from_behind(sides):
    """Mitsuba lists a wrapped BSDF's lobes twice or gives each side its own: both work."""
    mi = load_mitsuba()
    metal = {"type": "conductor", "material": "none"}
    other = {"second": {"type": "conductor", "material": "none"}} if sides == 2 else {}
    mirror = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().rotate([0, 1, 0], 180),
        "bsdf": {"type": "twosided", "first": metal, **other},
    }
    scene = {"mirror": mirror, "light": wall_light(8.0, 3.0, towards=-1)}
    np.testing.assert_allclose(value(scene, look(*ALONG_Z)), 3.0, rtol=1e-6)


@pytest.mark.parametrize(("r", "expected"), [(0.0, 0.1591549), (1.0, 0.0562698)])
def test_point_light_over_a_plane(r, expected):
    """Row A: rho / pi I h / (h^2 + r^2)^1.5 with rho = 0.5, I = 1, h = 1."""
    mi = load_mitsuba()
    plane = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().scale(10),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}},
    }
    light = {
        "type": "point",
        "position": [0, 0, 1],
        "intensity": {"type": "rgb", "value": 1},
    }
    camera = look([r, 0.0, 5.0], [r, 0.0, 0.0], [0.0, 1.0, 0.0])
    # The camera looks past the light: a point is no obstacle.
    pixel = value({"plane": plane, "light": light}, camera, max_depth=2)
    np.testing.assert_allclose(pixel, expected, rtol=1e-5)


def test_every_light_counts_and_a_blocked_one_does_not():
    """Two point lights add up; a disk over one of them takes its part away."""
    mi = load_mitsuba()
    plane = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().scale(10),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}},
    }
    lights = {
        name: {
            "type": "point",
            "position": [x, 0, 1],
            "intensity": {"type": "rgb", "value": 1},
        }
        for name, x in (("left", -1.0), ("right", 1.0))
    }
    blocker = {
        "type": "disk",
        "to_world": mi.ScalarTransform4f().translate([0.5, 0, 0.5]).scale(0.1),
    }
    camera = look(*ALONG_Z)
    both = value({"plane": plane, **lights}, camera)
    one = value({"plane": plane, "blocker": blocker, **lights}, camera)
    np.testing.assert_allclose(both, 2 * 0.0562698, rtol=1e-5)
    np.testing.assert_allclose(one, 0.0562698, rtol=1e-5)


def test_disk_light_on_axis_is_sampled_without_bias():
    """Row D: E = pi L R^2 / (R^2 + h^2), so R = h gives rho L / 2 = 0.25 on average."""
    mi = load_mitsuba()
    plane = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().scale(10),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}},
    }
    light = {
        "type": "disk",
        "to_world": mi.ScalarTransform4f().translate([0, 0, 1]),
        "flip_normals": True,
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
    }
    camera = look([6.0, 0.0, 0.5], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    camera["fov"] = 0.01
    camera["sampler"] = {"type": "independent", "sample_count": 1}
    pixel = value({"plane": plane, "light": light}, camera, max_depth=2, spp=4096)
    # One sample is I cos cos' / d^2 in [0.125, 0.5]: standard error under 0.2 / 64.
    np.testing.assert_allclose(pixel, 0.25, atol=0.01)


def test_hidden_emitters_are_transparent_to_the_camera_alone():
    """Behind a light that the camera must not see stands a mirror that shows another."""
    mirror = {"type": "rectangle", "bsdf": {"type": "conductor", "material": "none"}}
    scene = {
        "front": wall_light(2.0, 7.0),
        "mirror": mirror,
        "behind": wall_light(8.0, 3.0, towards=-1),
    }
    np.testing.assert_allclose(value(scene, look(*ALONG_Z)), 7.0, rtol=1e-6)
    # The mirrored ray meets the back of the first light, which is black.
    np.testing.assert_allclose(
        value(scene, look(*ALONG_Z), hide_emitters=True), 0.0, atol=1e-9
    )
    del scene["front"]
    np.testing.assert_allclose(
        value(scene, look(*ALONG_Z), hide_emitters=True), 3.0, rtol=1e-6
    )


def test_environment_is_seen_unless_hidden():
    sky = {"sky": {"type": "constant", "radiance": {"type": "rgb", "value": [1, 2, 3]}}}
    np.testing.assert_allclose(value(sky, look(*ALONG_Z)), [1, 2, 3], rtol=1e-6)
    assert np.all(value(sky, look(*ALONG_Z), hide_emitters=True) == 0.0)


def test_facing_mirrors_end():
    """A box of perfect mirrors, no cutoff, "no limit": the recursion stops by itself."""
    mi = load_mitsuba()
    room = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().scale(20),
        "flip_normals": True,
        "bsdf": {"type": "conductor", "material": "none"},
    }
    pixel = value({"room": room}, look(*ALONG_Z), max_depth=-1, cutoff=0.0)
    assert np.all(pixel == 0.0)


def test_a_side_without_mirror_follows_no_mirror():
    """`twosided` has the lobes of both sides; the BSDF in Python ignores which is sampled.

    It reflects no light that is sampled.
    """
    mi = load_mitsuba()

    class Rough(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
            self.m_flags = self.m_components[0]

        def sample(self, ctx: Any, si: Any, *_: Any) -> tuple[Any, Any]:
            chosen = mi.BSDFSample3f(mi.reflect(si.wi))
            chosen.pdf, chosen.eta = 1.0, 1.0
            chosen.sampled_type = int(mi.BSDFFlags.GlossyReflection)
            return chosen, mi.Color3f(1.0)

        def eval(self, *_: Any) -> Any:
            return mi.Color3f(0.0)

        def pdf(self, *_: Any) -> float:
            return 0.0

    mi.register_bsdf("rough_in_python", Rough)
    sides = {
        "type": "twosided",
        "a": {"type": "rough_in_python"},
        "b": {"type": "conductor"},
    }
    content = {
        "floor": {"type": "rectangle", "bsdf": sides},
        "lamp": wall_light(6.0, 3.0, towards=-1),
    }
    assert value(content, look(*ALONG_Z)) == pytest.approx(np.zeros(3))
