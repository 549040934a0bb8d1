"""What the camera meets first: lights that hide, depth, AOVs; next to Mitsuba's."""

from __future__ import annotations

import io

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import in_mitsuba
from small_scenes import (
    diffuse,
    mirror,
    point_light,
    rectangle,
    scene,
    sensor,
    sky,
)

import renderer
from renderer.rendering.picture.image_files import encode_png

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


@pytest.mark.parametrize("first", ["dd:depth", "st:uv", "at:position", "ss:shape_index"])
def test_without_an_integrator_inside_the_first_aov_is_the_picture(first, tmp_path):
    """Mitsuba's picture are all AOVs; one number shows as grey, of two the third is 0."""
    content = first_hits("aov", aovs=f"{first}, colour:albedo")
    image = renderer.render(renderer.load_dict(content))
    theirs = mitsuba_picture(content)
    assert list(image.aovs) == [first[:2], "colour"]
    both = np.concatenate(list(image.aovs.values()), axis=2)
    np.testing.assert_allclose(both, theirs, rtol=1e-5, atol=1e-6)
    values = image.aovs[first[:2]]
    shown = {1: values[..., [0, 0, 0]], 3: values}.get(values.shape[2])
    if shown is None:
        shown = np.dstack([values, np.zeros((4, 6), np.float32)])
    np.testing.assert_array_equal(image.pixels, shown)
    assert image.pixels.any()
    image.save(tmp_path / "a.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), shown)
    image.save(tmp_path / "a.exr")
    stored = np.array(mi.Bitmap(str(tmp_path / "a.exr")).split()[0][1])
    np.testing.assert_array_equal(stored, shown)
    assert f'the first AOV, "{first[:2]}"' in image.explain
    assert image._repr_png_() == encoded(shown)


def encoded(pixels):
    buffer = io.BytesIO()
    encode_png(pixels).save(buffer, format="PNG")
    return buffer.getvalue()


def test_moments_of_aovs_alone_have_a_black_picture_as_in_mitsuba():
    inside = {"type": "aov", "aovs": "dd:depth, at:position"}
    content = first_hits({"type": "moment", "inside": inside})
    image = renderer.render(renderer.load_dict(content))
    theirs = mitsuba_picture(content)
    assert not image.pixels.any()
    assert not theirs[..., :3].any()
    values = np.concatenate(list(image.aovs.values()), axis=2)
    black = [4, 5, 6, 11, 12, 13]  # X, Y and Z of no colours, and their moments
    rest = np.delete(theirs[..., 3:], black, axis=2)
    np.testing.assert_allclose(values, rest, rtol=1e-5, atol=1e-6)


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
    """The pixels are the nested integrator's render with the same seed, as in Mitsuba."""
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
