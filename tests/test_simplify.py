"""Simplifications: what each leaves out, that nothing else changes, and bad names."""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import rgb, sensor

import renderer
from renderer.command.cli import main
from renderer.errors import SceneError
from renderer.scene.simplifications.simplify import (
    differs,
    offered,
    simplified,
    words_of,
)
from renderer.scene_file import read_dict
from renderer.scene_file.description import (
    ConstantTexture,
    Diffuse,
    Mask,
    Null,
    TwoSided,
)

CHECKERBOARD = {"type": "checkerboard", "color0": rgb(0.2), "color1": rgb(0.6)}


def scene(bsdf=None, integrator=None, lights=2, **more):
    """Return a scene of one sphere, with point lights and a lamp."""
    points = {
        f"point_{k}": {"type": "point", "position": [k, 0, 9], "intensity": rgb(k + 1.0)}
        for k in range(lights)
    }
    lamp = {"type": "rectangle", "id": "lamp", "emitter": {"type": "area"}}
    return read_dict(
        {
            "type": "scene",
            "integrator": integrator or {"type": "path", "max_depth": 8},
            "sensor": sensor((0, 0, 5), (0, 0, 0), up=(0, 1, 0)),
            "ball": {"type": "sphere", "bsdf": bsdf or {"type": "diffuse"}},
            "lamp": lamp,
            **points,
            **more,
        }
    )


def ball(description):
    """Return the BSDF of the sphere."""
    return description.shapes[0].bsdf


@pytest.mark.parametrize(
    ("word", "depth"), [("depth=3", 3), ("depth=8", 8), ("depth=9", 8)]
)
def test_depth_is_never_raised(word, depth):
    before = scene()
    after = simplified(before, word)
    assert after.integrator.max_depth == depth
    assert differs(before, after) == (depth < 8)


def test_depth_within_an_aov():
    nested = {"type": "path", "max_depth": 8}
    before = scene(integrator={"type": "aov", "aovs": "d:depth", "image": nested})
    after = simplified(before, "depth=2").integrator
    assert after.nested is not None and after.nested.max_depth == 2
    assert after.aovs == before.integrator.aovs


def test_roulette_goes_only_where_paths_end():
    assert simplified(scene(), "roulette=off").integrator.rr_depth == 8
    endless = scene(integrator={"type": "path"})
    changing, absent = offered(endless)
    assert "roulette=off" not in [*changing, *absent]
    with pytest.raises(SceneError, match="no max_depth"):
        simplified(endless, "roulette=off")
    limited = simplified(endless, "depth=7")
    assert simplified(limited, "roulette=off").integrator.rr_depth == 7


def test_a_texture_is_its_mean_but_a_normal_map_stays():
    inner = {"type": "diffuse", "reflectance": CHECKERBOARD}
    height = {"type": "bitmap", "bitmap": np.eye(4, dtype=np.float32)[..., None]}
    bumps = {"type": "bumpmap", "height": height | {"raw": True}, "nested": inner}
    before = scene({"type": "twosided", "bsdf": bumps})
    after = ball(simplified(before, "textures=mean"))
    assert isinstance(after, TwoSided) and after.front is after.back
    assert after.front.height is ball(before).front.height
    assert after.front.nested.reflectance.rgb == pytest.approx((0.4, 0.4, 0.4))
    flat = ball(simplified(before, "normals=flat"))
    assert isinstance(flat.front, Diffuse)
    assert flat.front.reflectance is ball(before).front.nested.reflectance


def test_mean_of_a_bitmap():
    pixels = np.arange(24, dtype=np.float32).reshape(2, 4, 3) / 24
    bitmap = {"type": "bitmap", "bitmap": pixels, "raw": True}
    before = scene({"type": "diffuse", "reflectance": bitmap})
    mean = ball(simplified(before, "textures=mean")).reflectance
    assert isinstance(mean, ConstantTexture)
    assert mean.rgb == pytest.approx(tuple(pixels.mean(axis=(0, 1))))


@pytest.mark.parametrize("kind", ["dielectric", "thindielectric", "roughdielectric"])
def test_glass_is_nothing(kind):
    masked = {"type": "mask", "opacity": 0.5, "bsdf": {"type": kind}}
    after = ball(simplified(scene(masked), "glass=straight"))
    assert isinstance(after, Mask) and isinstance(after.nested, Null)


# of `roughplastic` with a base of 0.7, by 40000 pairs of directions in Mitsuba
ROUGH_ALBEDO = {False: 0.6177, True: 0.4396}  # nonlinear: albedo


def albedo(bsdf, count=400_000):
    """Return what a smooth coated base reflects of light from all sides, by Snell."""
    eta, generator = bsdf.eta, np.random.default_rng(0)
    cosine = np.sqrt(generator.random(count))
    inside = np.sqrt(1 - (1 - cosine**2) / eta**2)
    parallel = (eta * cosine - inside) / (eta * cosine + inside)
    across = (cosine - eta * inside) / (cosine + eta * inside)
    enters = 1 - np.mean(parallel**2 + across**2) / 2
    base, back = bsdf.diffuse_reflectance.rgb[0], bsdf.thrown_back
    series = 1 - base * back if bsdf.nonlinear else 1 - back
    return enters**2 / eta**2 * base / series


@pytest.mark.parametrize("nonlinear", [False, True])
def test_the_base_of_plastic_keeps_its_albedo(nonlinear):
    """To 1 %: the means over the directions are fits of that accuracy."""
    plastic = {"type": "plastic", "diffuse_reflectance": rgb(0.7), "nonlinear": nonlinear}
    before = scene(plastic)
    after = ball(simplified(before, "specular=off"))
    assert isinstance(after, Diffuse)
    assert after.reflectance.rgb[0] == pytest.approx(albedo(ball(before)), rel=0.01)
    rough = ball(simplified(scene(plastic | {"type": "roughplastic"}), "specular=off"))
    assert rough.reflectance.rgb[0] == pytest.approx(ROUGH_ALBEDO[nonlinear], rel=0.01)
    coat = ball(simplified(before, "diffuse=off"))
    assert coat.plugin == "plastic" and coat.diffuse_reflectance.rgb == (0, 0, 0)
    assert coat.specular_reflectance is ball(before).specular_reflectance


def test_metal_by_its_reflectance_at_normal_incidence():
    after = ball(simplified(scene({"type": "conductor"}), "metal=diffuse"))
    assert after.reflectance.rgb == pytest.approx((1, 1, 1))  # material "none"
    metal = {"type": "roughconductor", "eta": 1.5, "k": 2.0}
    metal["specular_reflectance"] = rgb(0.5)
    after = ball(simplified(scene(metal), "metal=diffuse"))
    assert after.reflectance.rgb == pytest.approx((0.5 * 4.25 / 10.25,) * 3)


def test_lights_keep_their_names_when_one_is_gone():
    before = scene(lights=3)
    assert [w for w in words_of(before) if "no-light" in w] == [
        "no-light=lamp",
        "no-light=point-1",
        "no-light=point-2",
        "no-light=point-3",
    ]
    after = simplified(simplified(before, "no-light=point-1"), "no-light=point-2")
    (left,) = after.emitters
    assert left is before.emitters[2] and len(after.emitter_places) == 1
    dark = simplified(after, "no-light=lamp")
    assert all(shape.radiance is None for shape in dark.shapes)
    assert len(dark.shapes) == len(before.shapes)
    with pytest.raises(SceneError, match=r"'point-1' is not possible; possible: .*point-3"):
        simplified(after, "no-light=point-1")


def test_what_the_scene_has_not_is_the_same_scene():
    changing, absent = offered(scene())
    assert set(changing) >= {"roulette=off", "no-light=lamp"}
    assert absent == [
        "textures=mean",
        "normals=flat",
        "glass=straight",
        "specular=off",
        "diffuse=off",
        "metal=diffuse",
        "filter=box",
    ]
    after = simplified(scene(), "glass=straight")
    assert "nothing changes" in after.simplified[0]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("glas=straight", "'glas=straight' is unknown; there are: depth=K, roulette=off"),
        ("glass", "'glass' is unknown"),
        ("", "'' is unknown"),
        ("glass=off", "glass: 'off' is not possible; possible: straight"),
        ("depth=0", "depth: '0' is not possible; possible: 1 to"),
        ("depth=-1", "depth: '-1' is not possible"),
        ("depth=²", "depth: '²' is not possible"),
        ("depth=99999999999", "is not possible; possible: 1 to 2147483647"),
        ("no-light=sun", "'sun' is not possible; possible: lamp, point-1, point-2"),
    ],
)
def test_names_that_do_not_exist(word, message):
    with pytest.raises(SceneError) as caught:
        simplified(scene(), word)
    assert message in str(caught.value)


def test_the_command_says_what_is_simplified(tmp_path, capsys):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.0.0"><integrator type="path"/><sensor type="perspective"/>'
        '<shape type="sphere"/></scene>'
    )
    words = [
        str(path),
        "--explain",
        "--simplify",
        "depth=2",
        "--simplify",
        "glass=straight",
    ]
    assert main(words) == 0
    page = capsys.readouterr().out
    assert "What is simplified, as asked\n  - depth=2: paths of at most 2 segments" in page
    assert "max_depth 2" in page
    assert main([str(path), "--explain", "--simplify", "depth=none"]) == 1
    assert "scene.xml: simplification depth: 'none'" in capsys.readouterr().err


def test_simplify_leaves_the_scene_as_it_is():
    built = renderer.load_dict(
        {"type": "scene", "sensor": sensor((0, 0, 5), (0, 0, 0), up=(0, 1, 0))}
    )
    less = renderer.simplify(built, "depth=2", "roulette=off")
    assert built.description.integrator.max_depth == -1
    assert less.description.integrator.max_depth == 2
    assert len(less.description.simplified) == 2
