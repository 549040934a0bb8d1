"""The public interface: what goes in, what comes out, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from small_scenes import (
    floor,
    point_light,
    rgb,
    scene,
    sensor,
    sky,
)

import renderer
from renderer import Image, SceneError
from renderer.rendering.job import RenderJob

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
    np.testing.assert_array_equal(from_file, from_string)
    np.testing.assert_array_equal(from_file, from_dict)


def test_parameters_replace_the_defaults_of_a_file(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(XML)
    assert renderer.render(renderer.load_file(path, width=9)).width == 9
    assert renderer.render(renderer.load_string(XML, spp=4, width=2)).spp == 4


def test_a_scene_shows_itself_in_a_line():
    """Its fields would be pages of arrays, in every notebook and debugger."""
    shown = repr(renderer.load_dict(lit_floor(size=(40, 30))))
    assert shown == "<Scene <dictionary>: 40 x 30, 1 rectangle>"


def test_what_the_reader_drops_is_in_the_log(tmp_path, caplog):
    """A program that calls `load_file` sees it without asking for the warnings.

    Of two triangles one is a line. Each way to load says so once, to the logger "renderer".
    """
    (tmp_path / "two.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n")
    mesh = {"type": "obj", "filename": "two.obj"}
    shape = '<shape type="obj"><string name="filename" value="two.obj"/></shape>'
    xml = XML.replace("</scene>", f"{shape}</scene>")
    (tmp_path / "scene.xml").write_text(xml)
    renderer.load_file(tmp_path / "scene.xml")
    renderer.load_string(xml, base_dir=tmp_path)
    renderer.load_dict(lit_floor() | {"mesh": mesh}, base_dir=tmp_path)
    assert [record.name for record in caplog.records] == ["renderer"] * 3
    assert {record.levelname for record in caplog.records} == {"WARNING"}
    for message in caplog.messages:
        assert message.endswith("two.obj: dropped 1 degenerate of 2 triangles")


# ---------------------------------------------------------------------------- images


def test_an_image_is_what_the_documentation_says():
    image = renderer.render(renderer.load_dict(lit_floor(size=(7, 5))), spp=4, threads=2)
    assert isinstance(image, Image)
    assert image.pixels.shape == (5, 7, 3)
    assert image.pixels.dtype == np.float32
    np.testing.assert_array_equal(np.asarray(image), image.pixels)
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


def test_progress_counts_up_to_the_last_sample(monkeypatch):
    monkeypatch.setattr(
        renderer.process.worker_pool, "WAKE", 1e-4
    )  # so short a render is over soon
    seen = []
    loaded = renderer.load_dict(lit_floor(size=(40, 40)))
    renderer.render(loaded, spp=529, progress=seen.append)
    counts = [p.done for p in seen if p.stage == "render"]
    assert len(counts) > 2
    assert counts == sorted(counts)
    assert counts[-1] == seen[-1].total == 40 * 40 * 529


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
            "'bidirectional' is unknown; there are: auto,",
        ),
        ({"accel": "kd-sha"}, "; did you mean kd-sah?"),
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


@pytest.mark.parametrize("name", ["spp", "threads", "seed"])
@pytest.mark.parametrize(
    ("value", "found"),
    [("4", "'4' (of type str)"), (4.0, "4.0 (of type float)"), ([4], "[4] (of type list)")],
)
def test_what_is_no_whole_number_is_one_line_that_says_what_is(name, value, found):
    """Beside the value its type: '4' and 4 look the same in many messages."""
    loaded = renderer.load_dict(lit_floor())
    with pytest.raises(TypeError) as caught:
        renderer.render(loaded, **{name: value})
    line = rf"{name} is {re.escape(found)}; whole numbers from \d+ to \d+ are possible"
    assert re.fullmatch(line, str(caught.value))


def test_whole_numbers_of_numpy_are_whole_numbers():
    loaded = renderer.load_dict(lit_floor(size=(2, 2)))
    image = renderer.render(loaded, spp=np.int32(4), threads=np.int64(2), seed=np.uint32(0))
    assert (image.spp, image.threads) == (4, 2)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: renderer.render(3), "the scene is 3 (of type int); possible is what `lo"),
        (lambda: renderer.render("scene.xml"), "the scene is 'scene.xml' (of type str); "),
        (lambda: renderer.load_string(3), "the scene is of type int; possible is XML"),
        (
            lambda: renderer.load_file(3),
            "the path of the scene is of type int; possible is",
        ),
        (
            lambda: renderer.load_string(XML, base_dir=3),
            "base_dir is of type int; possible",
        ),
    ],
)
def test_what_is_no_scene_is_one_line_that_says_what_is(call, words):
    with pytest.raises(TypeError) as caught:
        call()
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)


def test_bad_scenes_are_refused_when_they_are_loaded(tmp_path):
    with pytest.raises(SceneError, match="teapot"):
        renderer.load_dict(scene(sensor((0, 0, 0), (0, 1, 0)), "path", {"type": "teapot"}))
    with pytest.raises(SceneError, match=r"missing\.xml"):
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


def test_the_time_of_a_picture_is_without_compilation(monkeypatch):
    """Methods are compiled while the kernels' record is assembled, not when it is used."""
    monkeypatch.setattr(RenderJob, "methods_seconds", 1000.0)
    view = sensor((0, -3, 0), (0, 0, 0), fov=40, size=(4, 4))
    image = renderer.render(renderer.load_dict(scene(view, "depth")), threads=1)
    assert image.compile_seconds >= 1000.0
    assert image.seconds < 0.0  # what is not spent there is not counted twice
