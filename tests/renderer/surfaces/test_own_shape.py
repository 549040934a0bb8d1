"""A shape that nothing in `renderer/` knows: tests/own_shape.py, registered by one call.

Every structure and an instance must show it as it stands in the scene by itself, and one
that is a ball must look as the renderer's own sphere.
"""

from __future__ import annotations

import numpy as np
import pytest
from own_shape import ELLIPSOIDS

import renderer
from renderer.plugins.shapes.registry import KINDS, PLUGINS, SHAPES, register_shape

CAMERA = """<sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="3,-7,4" target="0,0,0.5" up="0,0,1"/></transform>
<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/>
<rfilter type="box"/></film></sensor>"""
ROOM = """<shape type="rectangle"><transform name="to_world"><scale value="6"/>
<translate z="-1.2"/></transform></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/>
<translate z="6"/></transform>
<emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>"""
SLANTED = (
    '<matrix value="1.2 0.3 0 {x}  -0.2 0.6 0.4 {y}  0.1 0 0.8 0.2  0 0 0 1"/>',
    '<rotate z="1" angle="30"/><scale x="-0.5" y="0.9" z="0.4"/>'
    '<translate x="{x}" y="{y}"/>',
)


@pytest.fixture(autouse=True, scope="module")
def registered():
    register_shape(ELLIPSOIDS)
    yield
    KINDS.remove(ELLIPSOIDS.name)
    del SHAPES[ELLIPSOIDS.name], PLUGINS["ellipsoid"]


def picture(shapes: str, **how) -> np.ndarray:
    """Linear RGB of shapes in a lit room."""
    text = f'<scene version="3.0.0"><integrator type="path"/>{CAMERA}{ROOM}{shapes}</scene>'
    return renderer.render(renderer.load_string(text), spp=4, threads=1, **how).pixels


def shape(plugin: str, to_world: str) -> str:
    return (
        f'<shape type="{plugin}"><transform name="to_world">{to_world}</transform></shape>'
    )


def crowd() -> str:
    """Nine ellipsoids, so that a leaf does not hold all of them."""
    return "".join(
        shape("ellipsoid", SLANTED[k % 2].format(x=1.4 * (k % 3 - 1), y=1.4 * (k // 3 - 1)))
        for k in range(9)
    )


def test_a_round_one_is_a_sphere():
    where = '<scale value="0.9"/><translate x="0.3" z="0.1"/>'
    own, known = picture(shape("ellipsoid", where)), picture(shape("sphere", where))
    assert np.ptp(known) > 0.1
    # paths part where a silhouette is within rounding
    assert np.mean(np.abs(own - known) > 1e-3 * (1.0 + known)) < 0.01


@pytest.mark.parametrize("accel", ["wide", "kd-sah"])
def test_every_structure_finds_what_brute_force_does(accel):
    found, truth = (
        picture(crowd(), integrator="depth", accel=name) for name in (accel, "brute")
    )
    assert not np.array_equal(truth, picture("", integrator="depth"))
    np.testing.assert_array_equal(found, truth)


@pytest.mark.parametrize("accel", ["auto", "brute"])
def test_in_an_instance_it_is_where_the_group_is_placed(accel):
    place = '<scale value="0.7"/><rotate z="1" angle="25"/><translate x="0.4" z="0.3"/>'
    placed = (
        f'<shape type="shapegroup" id="g">{crowd()}</shape><shape type="instance">'
        f'<ref id="g"/><transform name="to_world">{place}</transform></shape>'
    )
    direct = crowd().replace("</transform>", f"{place}</transform>")
    inside, outside = (
        picture(content, integrator="depth", accel=accel) for content in (placed, direct)
    )
    assert not np.array_equal(inside, picture("", integrator="depth"))
    # samples at a silhouette may see one and not the other
    assert np.mean(np.abs(inside - outside) > 1e-5 * outside) < 0.01
