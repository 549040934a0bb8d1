"""The integrator `moment`: first and second moments of single samples."""

import logging

import mitsuba as mi
import numpy as np
import pytest

import renderer
from renderer.errors import SceneError
from renderer.integrators.moment import XYZ_FROM_SRGB
from renderer.rendering.picture.image_files import aov_channel_names
from renderer.rendering.planning.make_plan import make_plan

mi.set_variant("scalar_rgb")

PATH = (
    '<integrator type="path" name="inner"><integer name="max_depth" value="{}"/>'
    "</integrator>"
)
MOMENT = '<integrator type="moment"><integer name="block_size" value="32"/>{}</integrator>'
AOV = '<integrator type="aov"><string name="aovs" value="dd:depth"/>{}</integrator>'
SCENE = """<scene version="3.0.0">{}
<sensor type="perspective">
  <transform name="to_world">
  <lookat origin="0,3,4" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="18"/>
    <string name="component_format" value="float32"/>{}</film>
  <sampler type="independent"/>
</sensor>
<emitter type="constant"><rgb name="radiance" value="0.6, 0.5, 0.4"/></emitter>
<shape type="sphere"><bsdf type="diffuse">
<rgb name="reflectance" value=".9, .7, .5"/></bsdf>
</shape>
<shape type="rectangle">
  <transform name="to_world"><scale value="0.5"/>
  <translate x="-1" y="2" z="-1"/></transform>
  <emitter type="area"><rgb name="radiance" value="10"/></emitter></shape>
</scene>"""
BOX = '<rfilter type="box"/>'


def channels(image):
    """Return every channel of a picture of ours by the name that a file has for it."""
    named = {"RGB"[c]: image.pixels[..., c] for c in range(3)}
    for name, values in image.aovs.items():
        names = aov_channel_names(name, image.aov_kinds[name], values.shape[2])
        named |= {channel: values[..., c] for c, channel in enumerate(names)}
    return named


def both(integrator, spp, rfilter=BOX):
    """Return all channels of Mitsuba's picture and of ours, with the same numbers."""
    text = SCENE.format(integrator, rfilter)
    scene = mi.load_string(text, optimize=False)
    theirs = np.array(mi.render(scene, spp=spp, seed=3))
    names = [*"RGB", *scene.integrator().aov_names()]
    ours = renderer.render(renderer.load_string(text), spp=spp, seed=3, sampler="mitsuba")
    return {name: theirs[..., c] for c, name in enumerate(names)}, channels(ours)


@pytest.mark.parametrize(
    ("inner", "spp", "rfilter"),
    [
        (PATH.format(5), 16, BOX),
        ('<integrator type="direct"/>', 16, BOX),
        ('<integrator type="depth"/>', 4, BOX),
        # the path inside goes on with its numbers, ours with the same sample's place
        (AOV.format(PATH.format(4)), 1, BOX),
        (AOV.format(""), 1, BOX),
    ],
)
def test_every_channel_is_mitsubas(inner, spp, rfilter):
    """With the same random numbers; alpha channels are left out, which we have not."""
    theirs, ours = both(MOMENT.format(inner), spp, rfilter)
    alpha = {name for name in theirs if name.endswith(".A")}
    # an aov without colours has moments of black in Mitsuba
    black = {name for name in theirs if not theirs[name].any()} - set("RGB")
    assert set(ours) == set(theirs) - alpha - black
    for name, values in ours.items():
        scale = np.abs(theirs[name]).mean()
        assert np.sqrt(np.mean((values - theirs[name]) ** 2)) <= 1e-5 * scale, name


def test_a_wide_filter_weighs_squares_as_it_weighs_values():
    """Where weights nearly cancel, tables of filters differ: measured 9e-5 of the mean."""
    theirs, ours = both(MOMENT.format(PATH.format(5)), 16, '<rfilter type="tent"/>')
    for name, values in ours.items():
        scale = np.abs(theirs[name]).mean()
        assert np.sqrt(np.mean((values - theirs[name]) ** 2)) < 1e-3 * scale, name


def test_of_a_single_sample_they_are_its_square():
    text = SCENE.format(MOMENT.format(PATH.format(3)), BOX)
    image = renderer.render(renderer.load_string(text), spp=1)
    xyz = image.pixels @ XYZ_FROM_SRGB.T
    np.testing.assert_allclose(image.aovs["inner"], xyz, rtol=1e-6)
    np.testing.assert_allclose(image.aovs["m2_inner"], xyz**2, rtol=1e-5)
    assert image.pixels.mean() > 0.1


def test_inside_of_aov_its_channels_stand_before_the_list():
    text = SCENE.format(AOV.format(MOMENT.format(PATH.format(3))), BOX)
    image = renderer.render(renderer.load_string(text), spp=2)
    assert list(image.aovs) == ["_arg_0.inner", "_arg_0.m2_inner", "dd"]
    names = mi.load_string(text).integrator().aov_names()
    theirs = [name for name in names if not name.startswith("_arg_0") or "inner" in name]
    assert list(channels(image))[3:] == theirs


def test_no_leaner_method_stands_in_for_it():
    """Its mean would be the same, its squares would not."""
    scene = renderer.load_string(SCENE.format(MOMENT.format(PATH.format(2)), BOX))
    plan = make_plan(scene)
    assert (plan.method, plan.every_light, plan.name) == ("path", False, "moments of path")
    assert any(line.startswith("moments ") for line in plan.lines)
    assert make_plan(scene, integrator="direct").moments is None


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        ("", 'integrator "moment" holds 0 integrators; expected one'),
        (PATH.format(1) + '<integrator type="direct"/>', "holds 2 integrators"),
        (MOMENT.format(PATH.format(1)), "around another one is not supported"),
        (AOV.format(MOMENT.format(PATH.format(1))), "around another one is not supported"),
        (PATH.format(1) + '<float name="x" value="1"/>', 'has no property "x"'),
    ],
)
def test_what_it_cannot_hold(inner, message):
    with pytest.raises(SceneError, match=message):
        renderer.load_string(SCENE.format(MOMENT.format(inner), BOX))


def test_the_refusal_of_what_is_inside_is_its_own(caplog):
    caplog.set_level(logging.WARNING)
    scene = renderer.load_string(
        SCENE.format(MOMENT.format('<integrator type="ptracer"/>'), BOX)
    )
    with pytest.raises(SceneError, match='integrator "ptracer" is not supported'):
        renderer.render(scene)
