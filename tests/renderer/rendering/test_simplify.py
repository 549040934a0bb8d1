"""Simplifications: what each leaves out, that nothing else changes, and bad names."""

from __future__ import annotations

import numpy as np
import pytest
from environment_maps import write_map
from small_scenes import placed, rgb, sensor

import renderer
from renderer.advice.simplifications import differs, offered, simplified, words_of
from renderer.command.cli import main
from renderer.errors import SceneError
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene.scene import build_scene
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
        "caustics=off",
        "instances=flat",
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
        ("glas=straight", "; did you mean glass=straight?"),
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
    assert "What is simplified\n  - depth=2: paths of at most 2 segments" in page
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


def test_parts_of_each_bsdf():
    """Named after the first shape that shows it; one alone is not offered."""
    plastic = {"type": "plastic"}
    other = {"type": "sphere", "id": "other", "bsdf": {"type": "twosided", "p": plastic}}
    again = {"type": "sphere", "bsdf": {"type": "diffuse"}}
    before = scene(plastic, other=other, again=again)
    words = [w for w in words_of(before) if w.startswith("no-specular")]
    assert words == ["no-specular=ball", "no-specular=other"]
    assert set(words) < set(offered(before)[0])
    after = simplified(before, "no-specular=other")
    assert ball(after) is ball(before)
    assert isinstance(after.shapes[2].bsdf.front, Diffuse)
    alone = scene(plastic)
    assert not any("no-specular" in word for word in offered(alone)[0])
    assert isinstance(ball(simplified(alone, "no-specular=ball")), Diffuse)
    with pytest.raises(SceneError, match="no-diffuse: 'x' is not possible; possible: ball"):
        simplified(alone, "no-diffuse=x")


def test_leaving_one_thing_out_renames_no_other():
    """Four shapes of one line, without an id: all removals in any order leave nothing."""
    lamp = '<shape type="rectangle"><bsdf type="plastic"/><emitter type="area"/></shape>'
    dull = '<shape type="rectangle"><bsdf type="plastic"/></shape>'
    text = f'<scene version="3.0.0"><sensor type="perspective"/>{lamp}{dull}{lamp}{lamp}'
    before = renderer.load_string(text + "</scene>").description
    for kind, names in (
        ("no-light", ["", "''", "'''"]),
        ("no-specular", ["", "'", "''", "'''"]),
    ):
        words = [f"{kind}=rectangle:1{name}" for name in names]
        assert [word for word in words_of(before) if kind in word] == words
        for turn in range(len(words)):
            less = before
            rest = words[turn:] + words[:turn]
            while rest:
                less = simplified(less, rest.pop(0))
                left = {word for word in words_of(less) if kind in word}
                assert left == set(rest)
    names = [f"rectangle:1{name}" for name in ("", "'", "''")]
    second = simplified(simplified(before, f"no-light={names[0]}"), f"no-light={names[2]}")
    assert [shape.radiance is not None for shape in second.shapes] == [0, 0, 0, 1]


def test_principled_without_its_base():
    """Where the base colour shows nowhere else."""
    after = ball(simplified(scene({"type": "principled"}), "diffuse=off"))
    assert after.base_color == ConstantTexture((0.0, 0.0, 0.0))
    metal = scene({"type": "principled", "metallic": 0.5})
    assert ball(simplified(metal, "diffuse=off")) is ball(metal)


def mean_of(description, spp=4, seed=0, **options):
    """Return a picture."""
    return renderer.render(build_scene(description), spp, seed, **options).pixels


def room(target, depth, **more):
    """Return a floor under a lamp; the camera sees one spot of the world."""
    return read_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": depth, "rr_depth": 99},
            "sensor": sensor((0, -4, 2), target, fov=10, size=(8, 8), jitter=True),
            "floor": {"type": "rectangle", "bsdf": {"type": "diffuse"}},
            "lamp": {
                "type": "rectangle",
                "to_world": placed((0, 0, 3), (1, 0, 0), (0, -1, 0)),
                "emitter": {"type": "area", "radiance": rgb(5.0)},
            },
            **more,
        }
    )


MIRROR = {
    "type": "rectangle",
    "to_world": placed((0, 1.5, 1), (1, 0, 0), (0, 0, 1)),
    "bsdf": {"type": "conductor"},
}
BLACK = MIRROR | {"bsdf": {"type": "diffuse", "reflectance": rgb(0.0)}}
HOLE = {
    "type": "rectangle",
    "to_world": placed((0, 0, 2), (3, 0, 0), (0, 3, 0)),
    "bsdf": {"type": "null"},
}
SKY = {"type": "constant", "radiance": rgb(0.5)}


@pytest.mark.parametrize("more", [{}, {"sky": SKY}])
def test_without_caustics_a_mirror_beside_is_black(more):
    """With three segments it has nothing else to throw on the floor; bit for bit."""
    floor = (0, 0, 0)
    full = room(floor, 3, mirror=MIRROR, **more)
    without = mean_of(simplified(full, "caustics=off"))
    np.testing.assert_array_equal(without, mean_of(room(floor, 3, mirror=BLACK, **more)))
    assert without.mean() < 0.99 * mean_of(full).mean()
    plans = [make_plan(build_scene(d)) for d in (full, simplified(full, "caustics=off"))]
    assert [plan.caustics for plan in plans] == [True, False]
    assert "caustics" in " ".join(plans[1].lines)


@pytest.mark.parametrize(
    ("target", "depth", "more"),
    [
        ((0, 1.5, 1), 3, {"mirror": MIRROR}),  # camera, mirror, floor, lamp
        ((0, 0, 0), 4, {"hole": HOLE, "sky": SKY}),  # floor, hole, lamp: straight on
    ],
)
def test_what_is_no_caustic_stays(target, depth, more):
    """By the same samples: without caustics holes block those of lights."""
    full = room(target, depth, **more)
    assert "caustics=off" in offered(full)[0]
    pixels, whole = (
        mean_of(description, light_choice="uniform")
        for description in (simplified(full, "caustics=off"), full)
    )
    assert pixels.max() > 0.0
    np.testing.assert_array_equal(pixels, whole)


def test_light_through_a_hole_to_a_mirror_is_a_caustic():
    """Floor, hole, mirror, lamp: as if the mirror were black, up to four segments.

    Longer paths by the floor again, floor, mirror, floor, lamp, are five.
    """
    hole = HOLE | {"to_world": placed((0, 0.7, 1), (1, 0, 0), (0, 0, 1))}
    full = room((0, 0, 0), 4, mirror=MIRROR, hole=hole)
    black = room((0, 0, 0), 4, mirror=BLACK, hole=hole)
    pictures = [mean_of(simplified(full, "caustics=off")), mean_of(black)]
    # what leaves the floor goes up, after the mirror too: nothing of the mirror is left
    np.testing.assert_array_equal(*pictures)
    assert pictures[0].mean() < mean_of(full).mean()


def test_each_strategy_has_the_same_mean():
    """Three estimators of one picture, 8 pictures each; 5 standard errors of the mean.

    False alarms: once in a million runs. A strategy that counted what the other one finds
    would be bright by a third or more, 20 standard errors.
    """
    full = room((0, 0, 0), 3, mirror=MIRROR, sky=SKY)
    means = {}
    for word in ("", "sampling=lights", "sampling=bsdfs"):
        less = simplified(full, word) if word else full
        pictures = [mean_of(less, 16, seed).mean() for seed in range(8)]
        means[word] = np.mean(pictures), np.std(pictures, ddof=1) / np.sqrt(8)
    mean, error = means.pop("")
    for word, (other, other_error) in means.items():
        assert abs(other - mean) < 5 * np.hypot(error, other_error), word


def test_light_samples_alone_of_two_segments_trace_no_further():
    """Direct light without mirrors: rays into the blue find nothing that counts."""
    less = build_scene(simplified(room((0, 0, 0), 2), "sampling=lights"))
    plan = make_plan(less)
    assert not plan.follow and not plan.weigh
    assert "light samples alone" in " ".join(plan.lines)
    mirrored = build_scene(simplified(room((0, 0, 0), 2, m=MIRROR), "sampling=lights"))
    assert make_plan(mirrored).follow and make_plan(mirrored).light_share > 1e9


def test_what_light_samples_leave_out_bsdf_samples_find(tmp_path):
    """Direct light of a sky whose samples go to its bright part alone, 8 pictures each.

    The rest of the sky is three quarters of its light on the floor. 5 standard errors, as
    above; they are less than a tenth of what would be lost.
    """
    sky = np.full((8, 16, 3), 0.5, np.float32)
    sky[2, 4] = 6.0
    write_map(tmp_path / "sky.exr", sky)
    upright = np.eye(4)[[0, 2, 1, 3]]  # local y is the world's z
    full = read_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},
            "sensor": sensor((0, -4, 2), (0, 0, 0), fov=10, size=(8, 8), jitter=True),
            "floor": {"type": "rectangle", "bsdf": {"type": "diffuse"}},
            "sky": {
                "type": "envmap",
                "filename": str(tmp_path / "sky.exr"),
                "mis_compensation": True,
                "to_world": upright,
            },
        }
    )
    alone = simplified(full, "sampling=lights")
    plan = make_plan(build_scene(alone))
    assert plan.follow and plan.strategy == "lights"
    pictures = [
        [mean_of(one, 32, seed).mean() for seed in range(8)] for one in (full, alone)
    ]
    mean, other = np.mean(pictures, axis=1)
    error = np.hypot(*np.std(pictures, axis=1, ddof=1)) / np.sqrt(8)
    assert 5 * error < 0.05 * mean
    assert abs(other - mean) < 5 * error


def test_textured_lamps_are_looked_for_too():
    lamp = {
        "type": "rectangle",
        "to_world": placed((0, 0, 3), (1, 0, 0), (0, -1, 0)),
        "emitter": {"type": "area", "radiance": CHECKERBOARD},
    }
    less = simplified(room((0, 0, 0), 2, other=lamp), "sampling=lights")
    assert make_plan(build_scene(less)).follow


def test_bsdf_samples_alone_never_find_a_point():
    point = {"type": "point", "position": [0, 0, 2], "intensity": rgb(1.0)}
    full = read_dict(
        {
            "type": "scene",
            "sensor": sensor((0, -4, 2), (0, 0, 0), size=(4, 4)),
            "floor": {"type": "rectangle"},
            "light": point,
        }
    )
    assert "sampling=lights" in offered(full)[1]  # nothing is weighed
    assert mean_of(full).max() > 0.0
    assert mean_of(simplified(full, "sampling=bsdfs")).max() == 0.0


def test_simplified_methods_are_no_replays():
    for word in ("sampling=lights", "caustics=off"):
        less = build_scene(simplified(room((0, 0, 0), 4, mirror=MIRROR), word))
        with pytest.raises(SceneError, match="possible is the scene without"):
            renderer.render(less, 1, sampler="mitsuba")


# General: no axis is kept, and no two of these commute; the second and fourth mirror.
SHEARED = [
    np.array([[0.7, 0.5, -0.2, -1.1], [-0.1, 0.9, 0.4, 0.0], [0.3, -0.2, 0.5, -0.5]]),
    np.array([[-0.8, 0.3, 0.1, 1.0], [0.4, 0.5, -0.3, 0.4], [0.2, 0.6, 0.7, -0.4]]),
    np.array([[0.3, -0.6, 0.2, 0.9], [0.5, 0.4, 0.3, 0.1], [-0.2, 0.1, 0.8, 0.7]]),
    np.array([[0.2, 0.7, 0.1, -0.8], [0.9, 0.1, -0.3, 0.2], [0.1, 0.3, 0.6, 0.9]]),
]
PEBBLE = """
v 0.9 0.1 -0.1\nv -0.1 1.0 0.2\nv -0.8 -0.2 0.1\nv 0.2 -0.9 -0.2\nv 0.1 0.2 0.7\nv 0 0 -0.8
vn 1 0.2 0.1\nvn -0.2 1 0.3\nvn -1 -0.1 0.2\nvn 0.3 -1 -0.1\nvn 0.2 0.1 1\nvn -0.1 0.2 -1
vt 0.9 0.1\nvt 0.2 0.8\nvt 0.1 0.3\nvt 0.6 0.2\nvt 0.5 0.5\nvt 0.4 0.7
"""
PEBBLE += "".join(
    "f " + " ".join(f"{k}/{k}/{k}" for k in face) + "\n"
    for face in ((1, 2, 5), (2, 3, 5), (3, 4, 5), (4, 1, 5), (2, 1, 6), (3, 2, 6))
)


@pytest.mark.parametrize("inner", [np.eye(4), np.vstack([SHEARED[2], [0, 0, 0, 1]])])
def test_copies_that_are_sheared_and_stretched_have_the_normals_of_instances(
    tmp_path, inner
):
    """A mesh with uv and normals of its own, and the same one without the normals.

    Distance, place, normals, uv and index of what the camera's rays hit are equal to 1e-4,
    but for one in a hundred, at edges. An instance interpolates normals before it moves
    them: between vertices, too, the copy has to have the same one.
    """
    (tmp_path / "pebble.obj").write_text(PEBBLE)
    shrunk = np.diag([0.5, 0.5, 0.5, 1.0])
    pebble = {"type": "obj", "filename": str(tmp_path / "pebble.obj"), "to_world": inner}
    flat_one = pebble | {"face_normals": True, "to_world": shrunk @ inner}
    full, flat = written_out(SHEARED, {"pebble": pebble, "flat": flat_one})
    assert not flat.instances, "meshes can go anywhere"
    # one of each mesh, and one of it for the copies that are mirrored
    assert [len(shape.faces) for shape in flat.shapes] == [2 * 6] * 4
    assert_same_hits(full, flat)


def test_other_shapes_are_turned_moved_and_scaled_as_their_instances():
    """Two copies of four shapes, each with a place of its own; sheared copies stay."""
    turn, _ = np.linalg.qr(SHEARED[0][:, :3])
    turns = [turn * np.linalg.det(turn), turn.T * np.linalg.det(turn)]
    places = [
        np.column_stack([0.9 * turns[0], (-1.0, 0.2, 0.3)]),
        np.column_stack([0.6 * turns[1], (0.9, -0.3, -0.4)]),
    ]
    own = np.vstack([places[1], [0, 0, 0, 1]])
    stretched = np.vstack([SHEARED[2], [0, 0, 0, 1]])
    shapes = {
        "sphere": {"type": "sphere", "center": [0.3, 1.1, 0.2], "radius": 0.5},
        "rectangle": {"type": "rectangle", "to_world": stretched},
        "disk": {"type": "disk", "to_world": np.diag([1.0, 0.5, 1.0, 1.0]) @ own},
        "cylinder": {"type": "cylinder", "radius": 0.2, "to_world": own},
    }
    full, flat = written_out([*places, SHEARED[0]], shapes)
    assert len(flat.shapes) == 2 * len(shapes) and len(flat.instances) == 1
    assert_same_hits(full, flat)


def written_out(places, shapes):
    """Return a scene of a group's instances, and the same one without instances."""
    copies = {
        f"copy_{k}": {
            "type": "instance",
            "to_world": np.vstack([place, [0, 0, 0, 1]]),
            "group": {"type": "ref", "id": "group"},
        }
        for k, place in enumerate(places)
    }
    aovs = "d:depth,p:position,g:geo_normal,s:sh_normal,t:uv,i:prim_index"
    view = sensor((0.5, -6, 2), (0, 0, 0), fov=40, size=(48, 32))
    full = read_dict(
        {
            "type": "scene",
            "integrator": {"type": "aov", "aovs": aovs},
            "sensor": view,
            "g": {"type": "shapegroup", "id": "group", **shapes},
            **copies,
        }
    )
    return full, simplified(full, "instances=flat")


def assert_same_hits(full, flat):
    before, after = (renderer.render(build_scene(d), 1) for d in (full, flat))
    assert (before.aovs["d"] > 0.0).mean() > 0.1
    for name, picture in before.aovs.items():
        apart = np.abs(after.aovs[name] - picture).max(axis=-1)
        off = float((apart > 1e-4).mean())
        assert off < 0.01, (
            f"{name} differs in {off:.1%} of the pixels, by {apart.max():.3g}"
        )


def test_instances_of_very_many_faces_are_not_written_out(monkeypatch):
    monkeypatch.setattr("renderer.advice.simpler_shapes.MOST_FACES", 35)
    with pytest.raises(SceneError, match="36 faces in all; at most 35"):
        written_out(SHEARED[:3], {"cube": {"type": "cube"}})
