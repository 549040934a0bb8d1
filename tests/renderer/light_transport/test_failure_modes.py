"""Rows of the failure modes that have no other home: very near lamps, closed boxes.

The other rows are next to what they are about; docs/ground_truth.md says where.
"""

from __future__ import annotations

import numpy as np
import pytest
from scene_file_samples import mi
from small_scenes import box, diffuse, floor, pixels, point_light, scene, sensor

import renderer


@pytest.mark.parametrize("ray_offset", ["tight", "mitsuba"])
@pytest.mark.parametrize("half", [1.0, 10.0])
def test_the_inverse_square_down_to_the_rounding_of_the_floor(half, ray_offset):
    """L = rho I / (pi h^2) for lamps at h = 1 to 10^-5 (row 23), far below the offsets.

    What is left is where float32 puts the point: off the lamp's foot by up to 3 units of
    the floor's half width, delta, and L falls by 1.5 (delta / h)^2. A start of 10^-3 above
    the floor would be wrong by a factor of 4 at h = 10^-3.
    """
    delta = 3 * half * 2.0**-23
    for h in 10.0 ** -np.arange(0, 5.5, 0.5):
        content = scene(
            sensor((0, -3, 5), (0, 0, 0)),
            "path",
            floor(half=half),
            point_light((0, 0, h)),
            max_depth=2,
        )
        expected = 0.5 / (np.pi * h * h)
        allowed = 1.5 * (delta / h) ** 2 + 1e-6
        assert pixels(content, ray_offset=ray_offset) == pytest.approx(
            expected, rel=allowed
        )


def closed_box(*, outward, twosided=False):
    """A lamp in a box whose walls look inwards or outwards, seen from inside."""
    walls = box(0.5)
    for wall in walls:
        wall["flip_normals"] = outward
        if twosided:
            wall["bsdf"] = {"type": "twosided", "bsdf": diffuse(0.5)}
    camera = sensor((0.5, 0.25, 0.125), (-1, 0, 0), fov=90, size=(8, 8))
    return scene(camera, "path", *walls, point_light((0, 0, 0)), max_depth=2)


def test_one_sided_walls_are_black_from_behind():
    """A closed box with outward normals holds no light at all (row 30)."""
    assert (pixels(closed_box(outward=True)) == 0).all()


def test_two_sided_walls_are_as_bright_whichever_way_they_look():
    """Turned around, twosided walls change no bit of the picture."""
    inward = pixels(closed_box(outward=False))
    assert inward.min() > 0.01
    for outward in (False, True):
        picture = pixels(closed_box(outward=outward, twosided=True))
        np.testing.assert_array_equal(picture, inward)


XML = """<scene version="3.0.0"><integrator type="direct"/>
<sensor type="perspective">
    <transform name="to_world">
        <lookat origin="0,0,2" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="4"/>
        <integer name="height" value="4"/><rfilter type="box"/>
        <string name="component_format" value="float32"/></film>
    <sampler type="stratified"/></sensor>
<shape type="rectangle"><boolean name="flip_normals" value="{flip}"/>{bsdf}</shape>
<emitter type="point"><point name="position" value="0,0,1"/></emitter>
</scene>"""


@pytest.mark.parametrize("flip", ["false", "true"])
@pytest.mark.parametrize("sides", ["one", "two"])
def test_mitsuba_sees_the_same_sides(flip, sides):
    """Front and back of a diffuse square, one-sided and twosided: lit or black alike."""
    bsdf = '<bsdf type="diffuse"/>'
    if sides == "two":
        bsdf = f'<bsdf type="twosided">{bsdf}</bsdf>'
    text = XML.format(flip=flip, bsdf=bsdf)
    ours = renderer.render(renderer.load_string(text), spp=1).pixels
    theirs = np.array(mi.render(mi.load_string(text), spp=1))
    lit = flip == "false" or sides == "two"
    assert ((ours > 0).all() and (theirs > 0).all()) if lit else ours.max() == 0
    assert (theirs > 0).all() == lit
