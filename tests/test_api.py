"""The public interface: what goes in, what comes out, and what is refused."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from small_scenes import (
    diffuse,
    floor,
    mirror,
    point_light,
    rectangle,
    rgb,
    scene,
    sensor,
    sky,
)

import renderer
from renderer import Image, SceneError

XML = """<scene version="3.0.0">
  <default name="spp" value="1"/>
  <default name="width" value="6"/>
  <integrator type="path"><integer name="max_depth" value="2"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="40"/>
    <transform name="to_world">
      <lookat origin="0, -3, 2" target="0, 0, 0" up="0, 0, 1"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="$width"/>
      <integer name="height" value="4"/>
      <rfilter type="box"/>
    </film>
    <sampler type="stratified">
      <integer name="sample_count" value="$spp"/>
      <boolean name="jitter" value="false"/>
    </sampler>
  </sensor>
  <shape type="rectangle"><bsdf type="diffuse"/></shape>
  <emitter type="point">
    <point name="position" x="0" y="0" z="1"/>
    <rgb name="intensity" value="1, 2, 3"/>
  </emitter>
</scene>
"""


def lit_floor(**film):
    camera = sensor((0, -3, 2), (0, 0, 0), fov=40, **film)
    return scene(camera, "path", floor(), point_light((0, 0, 1)), max_depth=2)


# ---------------------------------------------------------------------------- loading


def test_file_string_and_dictionary_give_the_same_picture(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(XML)
    from_file = renderer.render(renderer.load_file(path))
    from_string = renderer.render(renderer.load_string(XML))
    camera = sensor((0, -3, 2), (0, 0, 0), fov=40, size=(6, 4))
    light = point_light((0, 0, 1))
    light["intensity"] = rgb(1.0, 2.0, 3.0)
    content = scene(camera, "path", floor(half=1.0), light, max_depth=2)
    content["sensor"]["near_clip"] = 0.01
    from_dict = renderer.render(renderer.load_dict(content))
    assert from_file.pixels.max() > 0
    assert np.array_equal(from_file, from_string)
    assert np.array_equal(from_file, from_dict)


def test_parameters_replace_the_defaults_of_a_file(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(XML)
    assert renderer.render(renderer.load_file(path, width=9)).width == 9
    assert renderer.render(renderer.load_string(XML, spp=4, width=2)).spp == 4


# ---------------------------------------------------------------------------- images


def test_an_image_is_what_the_documentation_says():
    image = renderer.render(renderer.load_dict(lit_floor(size=(7, 5))), spp=4, threads=2)
    assert isinstance(image, Image)
    assert image.pixels.shape == (5, 7, 3)
    assert image.pixels.dtype == np.float32
    assert np.asarray(image) is not None
    assert (image.width, image.height, image.spp, image.threads) == (7, 5, 4, 2)
    assert (image.integrator, image.complete, dict(image.aovs)) == ("direct", True, {})
    assert image.seconds > 0
    assert "method" in image.explain


def test_samples_of_the_call_replace_those_of_the_file():
    loaded = renderer.load_dict(lit_floor(size=(4, 4), spp=4))
    assert renderer.render(loaded).spp == 4
    assert renderer.render(loaded, spp=9).spp == 9


def test_one_pixel():
    image = renderer.render(renderer.load_dict(lit_floor(size=(1, 1))))
    assert np.asarray(image) == pytest.approx(0.5 / np.pi, rel=2e-5)


def test_progress_counts_up_to_the_last_sample():
    seen = []
    loaded = renderer.load_dict(lit_floor(size=(40, 40)))
    renderer.render(loaded, spp=4, progress=seen.append)
    counts = [p.done for p in seen if p.stage == "render"]
    assert len(counts) > 2
    assert counts == sorted(counts)
    assert counts[-1] == seen[-1].total == 40 * 40 * 4


# --------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"spp": 0}, "spp is 0"),
        ({"spp": -4}, "spp is -4"),
        ({"threads": 0}, "threads is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 2**32}, "seed is 4294967296"),
        (
            {"integrator": "bidirectional"},
            "'bidirectional' is unknown; there are: auto, direct",
        ),
        ({"accel": "octopus"}, "'octopus' is unknown; there are: auto, brute"),
        ({"sampler": "dice"}, "'dice' is unknown; there are: independent, stratified"),
    ],
)
def test_bad_arguments_are_one_line_that_says_what_is_possible(arguments, words):
    loaded = renderer.load_dict(lit_floor())
    with pytest.raises(SceneError) as caught:
        renderer.render(loaded, **arguments)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bad_scenes_are_refused_when_they_are_loaded(tmp_path):
    with pytest.raises(SceneError, match="teapot"):
        renderer.load_dict(scene(sensor((0, 0, 0), (0, 1, 0)), "path", {"type": "teapot"}))
    with pytest.raises(SceneError, match="missing.xml"):
        renderer.load_file(tmp_path / "missing.xml")


# ---------------------------------------------------------------- almost empty scenes


def test_a_scene_without_anything_is_black():
    picture = renderer.render(
        renderer.load_dict(scene(sensor((0, 0, 0), (0, 1, 0)), "path"))
    )
    assert (np.asarray(picture) == 0).all()


def test_a_scene_without_shapes_shows_its_sky():
    camera = sensor((0, 0, 1), (0, 0, 0), up=(0, 1, 0), size=(5, 3))
    content = scene(camera, "path", sky() | {"radiance": rgb(0.25, 0.5, 4.0)})
    picture = np.asarray(renderer.render(renderer.load_dict(content)))
    assert (picture == np.array([0.25, 0.5, 4.0], np.float32)).all()


def test_one_triangle(tmp_path):
    """Half of the view is the triangle below its diagonal; beyond it there is nothing."""
    (tmp_path / "one.obj").write_text("v -1 -1 0\nv 1 -1 0\nv -1 1 0\nf 1 2 3\n")
    fov = 2 * np.degrees(np.arctan(0.5))
    camera = sensor((0, 0, 2), (0, 0, 0), up=(0, 1, 0), fov=fov, size=(8, 8))
    content = scene(camera, "depth", {"type": "obj", "filename": "one.obj"})
    loaded = renderer.load_dict(content, base_dir=tmp_path)
    met = np.asarray(renderer.render(loaded))[..., 0] > 0
    rows, columns = np.mgrid[:8, :8]
    on_the_edge = columns == rows  # pixel centres on the diagonal: either is right
    assert (met == (columns < rows))[~on_the_edge].all()


# ---------------------------------------------------------------------- hidden lights

# what the camera looks at: origin, target, radiance with lights shown and hidden
VIEWS = {
    "sky": ((0, 0, 0), (0, 0, 1), 1.0, 0.0),
    "sky in a mirror": ((0, 0, 0), (1, 0, -0.5), 0.5, 0.5),
    "lamp before the sky": ((0, 0, 0), (0, 1, 0), 3.0, 0.0),
    "lamp before a mirror": ((0, 0, 0), (0, 2, -0.6), 3.0, 0.5),
    "lamp in a mirror": ((0, 0, 0.3), (0, 1, -0.7), 1.5, 1.5),
    "black back of the lamp": ((0, 4, -0.1), (0, 2, -0.5), 0.0, 0.5),
}


def hidden_lights(view, hide):
    return scene(
        sensor(*VIEWS[view][:2], up=(1, 0, 0.1)),
        "path",
        rectangle((0, 0, -1), (9, 0, 0), (0, 9, 0), mirror(0.5)),
        rectangle((0, 2, 0), (1, 0, 0), (0, 0, 1), diffuse(0.0), shine=3.0),
        sky(),
        max_depth=4,
        hide_emitters=hide,
    )


def in_mitsuba(value):
    """Return the dictionary as Mitsuba's `load_dict` takes it."""
    if isinstance(value, dict):
        return {key: in_mitsuba(item) for key, item in value.items()}
    return mi.ScalarTransform4f(value) if isinstance(value, np.ndarray) else value


def mitsuba_picture(content):
    mi.set_variant("scalar_rgb")
    theirs = in_mitsuba(content)
    theirs["sensor"]["film"] |= {"component_format": "float32", "pixel_format": "rgb"}
    return np.array(mi.render(mi.load_dict(theirs, optimize=False)))


@pytest.mark.parametrize("hide", [False, True], ids=["shown", "hidden"])
@pytest.mark.parametrize("view", VIEWS)
def test_hidden_lights_are_seen_in_mirrors_only(view, hide):
    """`hide_emitters`: the camera looks through lights; reflections still show them.

    No view meets a diffuse surface that reflects, so the numbers are exact in both.
    """
    content = hidden_lights(view, hide)
    ours = np.asarray(renderer.render(renderer.load_dict(content), integrator="path"))
    assert ours == pytest.approx(VIEWS[view][3 if hide else 2], rel=2e-5)
    assert ours == pytest.approx(mitsuba_picture(content), rel=1e-5)


# ------------------------------------------------------------------- depth and AOVs


def first_hits(integrator, **settings):
    camera = sensor((0, 0, 3), (0, 0, 0), up=(0, 1, 0), fov=60, size=(6, 4))
    ground = rectangle((0, 0, 0), (1, 0, 0), (0, 9, 0), diffuse(0.2, 0.4, 0.6))
    return scene(camera, integrator, ground, point_light((0, 0, 2)), **settings)


def test_the_depth_integrator_shows_distances():
    """The picture is the distance in all colours, 0 where nothing is.

    Rays start at the near plane, 1e-4 before the eye here, in Mitsuba and so here.
    """
    content = first_hits("depth")
    picture = np.asarray(renderer.render(renderer.load_dict(content)))
    assert np.array_equal(picture[..., 0], picture[..., 2])
    half = np.tan(np.radians(30))
    x = ((np.arange(6) + 0.5) / 6 * 2 - 1) * half
    y = ((np.arange(4) + 0.5) / 6 * 2 - 4 / 6) * half
    expected = (3 - 1e-4) * np.sqrt(1 + x**2 + y[:, None] ** 2)
    expected[:, np.abs(3 * x) > 1] = 0
    assert picture[..., 0] == pytest.approx(expected, rel=1e-6)
    assert (picture == 0).any()
    assert picture == pytest.approx(mitsuba_picture(content), rel=1e-6)


def test_aovs_have_the_names_of_the_file():
    content = first_hits("aov", aovs="far:depth, colour:albedo, at:position, st:uv")
    image = renderer.render(renderer.load_dict(content))
    assert list(image.aovs) == ["far", "colour", "at", "st"]
    assert [a.shape[2] for a in image.aovs.values()] == [1, 3, 3, 2]
    assert dict(image.aov_kinds) == {
        "far": "depth",
        "colour": "albedo",
        "at": "position",
        "st": "uv",
    }
    hit = image.aovs["far"][..., 0] > 0
    assert image.aovs["colour"][hit] == pytest.approx(
        np.tile([0.2, 0.4, 0.6], (hit.sum(), 1))
    )
    assert (image.aovs["at"][hit][:, 2] == 0).all()
    for values in image.aovs.values():
        assert (values[~hit] == 0).all()
    assert not image.pixels.any()  # no integrator inside, no colours


def test_aovs_can_be_had_of_any_scene():
    """`integrator="aov"` gives all kinds, under their own names."""
    image = renderer.render(renderer.load_dict(first_hits("path")), integrator="aov")
    assert set(image.aovs) == {
        "albedo",
        "depth",
        "position",
        "uv",
        "geo_normal",
        "sh_normal",
        "prim_index",
        "shape_index",
    }
    hit = image.aovs["depth"][..., 0] > 0
    assert (image.aovs["shape_index"][..., 0] == hit).all()  # shapes count from 1
    assert (image.aovs["geo_normal"][hit] == (0, 0, 1)).all()


def test_aov_shows_the_picture_of_the_integrator_inside():
    """The nested integrator's render with the same seed comes as the pixels, as in Mitsuba."""
    inside = {"type": "path", "max_depth": 2}
    content = first_hits("aov", aovs="dd:depth", colours=inside)
    image = renderer.render(renderer.load_dict(content), seed=5)
    alone = renderer.render(renderer.load_dict(first_hits(inside)), seed=5)
    assert alone.pixels.any()
    assert np.array_equal(image, alone)
    assert list(image.aovs) == ["dd"]
    assert image.integrator == "aov"
    theirs = mitsuba_picture(content)
    assert image.pixels == pytest.approx(theirs[..., :3], rel=2e-5)
    assert image.aovs["dd"] == pytest.approx(theirs[..., 3:], rel=1e-6)
