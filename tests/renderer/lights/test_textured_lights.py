"""Lamps with textures, spots with textures, projectors: against Mitsuba's own objects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from light_probes import LightProbe
from scene_file_samples import error_of, mitsuba_refuses, ours
from scene_xml import element, to_world

mi = pytest.importorskip("mitsuba")

PLUGINS = Path(__file__).parents[2] / "plugins"
SEED = 21
NUMBERS = 600


def bitmap(name="glow.exr", **more):
    return {"type": "bitmap", "filename": str(PLUGINS / name), **more}


def lamp(kind, texture, **more):
    return {"type": kind, **more, "emitter": {"type": "area", "radiance": texture}}


def place(*, mirrored=False):
    spin = mi.ScalarTransform4f().translate([0.3, 0.2, 0.1]).rotate([0, 1, 0], 30)
    return spin.scale([-1.7 if mirrored else 1.7, 1.7, 1.7])


def uv_map(*rows):
    """Return a map of uv for both renderers."""
    matrix = np.eye(4)
    matrix[:2, :2], matrix[:2, 3] = [row[:2] for row in rows], [row[2] for row in rows]
    return mi.ScalarTransform4f(matrix)


# They turn, slant and move: no number of them can stand in the place of another.
TURNED = uv_map((1.3, -0.6, 0.3), (0.4, 0.9, -0.7))
SLANTED = uv_map((0.7, 0.5, -0.4), (-0.2, 1.4, 0.6))
BOARD = {
    "type": "checkerboard",
    "to_uv": uv_map((2.0, -0.7, 0.3), (0.9, 3.0, -0.2)),
    "color0": {"type": "rgb", "value": [0.9, 0.3, 0.1]},
}
SHAPES = {
    "rectangle": lamp("rectangle", bitmap(), to_world=place()),
    "flipped": lamp("rectangle", bitmap(), to_world=place(), flip_normals=True),
    "mirrored": lamp("rectangle", BOARD, to_world=place(mirrored=True)),
    "disk": lamp(
        "disk",
        bitmap("slide.png", filter_type="nearest", wrap_mode="mirror"),
        to_world=place(),
    ),
    "flipped disk": lamp("disk", BOARD, to_world=place(), flip_normals=True),
    "sphere": lamp("sphere", bitmap(wrap_mode="clamp"), to_world=place()),
    "mesh": lamp("obj", bitmap(), filename=str(PLUGINS / "lamp.obj")),
    "turned rectangle": lamp("rectangle", bitmap(to_uv=TURNED), to_world=place()),
    "turned disk": lamp("disk", bitmap(to_uv=SLANTED), to_world=place()),
    "turned sphere": lamp("sphere", bitmap(to_uv=SLANTED), to_world=place()),
    "turned mesh": lamp("obj", bitmap(to_uv=TURNED), filename=str(PLUGINS / "lamp.obj")),
}
OTHERS = {
    "spot": {
        "type": "spot",
        "to_world": place().translate([0, 0, -3]),
        "cutoff_angle": 40.0,
        "intensity": {"type": "rgb", "value": [3, 2, 1]},
        "texture": bitmap("slide.png"),
    },
    "board spot": {
        "type": "spot",
        "to_world": place().translate([0, 0, -3]),
        "cutoff_angle": 50.0,
        "texture": BOARD,
    },
    "projector": {
        "type": "projector",
        "to_world": place().scale([1 / 1.7] * 3).translate([0, 0, -3]),
        "irradiance": bitmap("slide.png"),
        "scale": 3.0,
        "fov": 60.0,
    },
    "plain projector": {"type": "projector", "fov": 50.0, "fov_axis": "y"},
    "turned spot": {
        "type": "spot",
        "to_world": place().translate([0, 0, -3]),
        "cutoff_angle": 40.0,
        "texture": bitmap("slide.png", to_uv=TURNED),
    },
    "turned projector": {
        "type": "projector",
        "to_world": place().scale([1 / 1.7] * 3).translate([0, 0, -3]),
        "irradiance": bitmap("slide.png", to_uv=SLANTED),
        "fov": 60.0,
    },
}


def ours_of(content):
    """The same with transforms as arrays."""
    if isinstance(content, dict):
        return {key: ours_of(value) for key, value in content.items()}
    if hasattr(content, "matrix"):
        return np.array(content.matrix, np.float64)
    return content


@pytest.fixture(scope="module")
def lights():
    return LightProbe(ours_of(SHAPES), ours_of(OTHERS), (1.0, 1.0, 1.0))


def scene_of(name):
    """Mitsuba's, which has to live as long as its emitter is used."""
    content = (SHAPES | OTHERS)[name]
    world = {"type": "scene", "light": content, "ball": {"type": "sphere"}}
    return mi.load_dict(world, optimize=False)


@pytest.mark.parametrize("name", [*SHAPES, *OTHERS])
def test_samples_are_mitsubas(lights, name):
    """The same numbers give the same direction, distance, density and weight."""
    rng = np.random.default_rng(SEED)
    numbers = rng.random((3, NUMBERS), np.float32)
    positions = np.float32(rng.normal(size=(NUMBERS, 3)) * 4).astype(float)
    drawn = lights.sample(name, positions, numbers)
    scene, at = scene_of(name), mi.Interaction3f()
    emitter = scene.emitters()[0]
    wi, distance, pdf, weight = [], [], [], []
    for p, (x, y, _) in zip(positions, numbers.T, strict=True):
        at.p = p
        sample, w = emitter.sample_direction(at, mi.Point2f(x, y))
        wi.append(np.array(sample.d).ravel())
        distance.append(sample.dist)
        pdf.append(0.0 if sample.delta else sample.pdf)
        weight.append(np.array(w).ravel())
    wi, pdf, weight = np.array(wi), np.array(pdf), np.array(weight)
    lit = weight.any(axis=1)
    assert lit.sum() > NUMBERS / 20
    # a cosine of 0 or the edge of a slide is decided by the last bit
    assert np.mean((drawn.radiance.any(axis=1)) != lit) <= 2 / NUMBERS
    lit &= drawn.radiance.any(axis=1)
    np.testing.assert_allclose(drawn.wi[lit], wi[lit], atol=1e-4)
    np.testing.assert_allclose(drawn.distance[lit], np.array(distance)[lit], rtol=3e-5)
    for mine, reference in ((drawn.pdf, pdf), (drawn.radiance, weight)):
        off = np.abs(mine - reference)[lit]
        scale = np.maximum(np.abs(reference), 1e-3 * np.abs(reference).max())[lit]
        scale = np.where(scale > 0, scale, 1.0)
        assert np.quantile(off / scale, 0.98) < 3e-4, np.sort((off / scale).ravel())[-20:]


# --------------------------------------------------------------------- reading


def test_a_shape_refers_to_an_area_emitter_of_the_scene():
    """It adds nothing by itself, and its light has the place of the shape."""
    area = '<emitter type="area" id="lamp"><rgb name="radiance" value="1, 2, 3"/></emitter>'
    text = f'{area}<shape type="sphere"><ref id="lamp"/></shape>'
    assert ours(text).shapes[0].radiance == (1.0, 2.0, 3.0)
    assert ours(text).emitters == ()
    assert ours(area + '<shape type="sphere"/>').shapes[0].radiance is None


def test_a_point_light_in_a_shape_stands_where_it_says():
    """As in Mitsuba: the shape is black and does not shine."""
    inner = '<emitter type="point"><point name="position" x="1" y="2" z="3"/></emitter>'
    text = f'<shape type="cube"/><shape type="sphere">{inner}</shape><shape type="disk"/>'
    scene = ours(text)
    assert scene.emitters[0].position == (1.0, 2.0, 3.0)
    assert scene.emitter_places == (1,)
    assert scene.shapes[1].radiance is None
    assert scene.shapes[1].bsdf.reflectance.rgb == (0.0, 0.0, 0.0)


AREA = '<emitter type="area" id="lamp"/>'
USED = '<shape type="sphere"><ref id="lamp"/></shape>'
TEXTURED = (
    '<emitter type="area"><texture type="checkerboard" name="radiance"/></emitter></shape>'
)


@pytest.mark.parametrize(
    ("content", "words", "refused"),
    [
        (AREA + "\n" + USED + "\n" + USED, "is that of the shape of line 3 already", True),
        ('<emitter type="point" id="lamp"/>\n' + USED, "lights the scene already", False),
        ('<shape type="sphere"><emitter type="constant"/></shape>', "environment", False),
        ('<shape type="cube">' + TEXTURED, "faces share a part of it", False),
        ('<shape type="cylinder">' + TEXTURED, "on a cylinder", False),
        (
            '<emitter type="spot"><texture name="texture" type="uniform"/></emitter>',
            "a texture that varies",
            True,
        ),
        (
            element("emitter", "projector", fov=190.0),
            "a field of view between 0 and 180",
            True,
        ),
        (
            element("emitter", "projector", to_world('<scale value="2"/>')),
            "rotation and translation",
            False,
        ),
    ],
)
def test_lights_that_are_wrong(content, words, refused):
    assert words in error_of(content)
    if refused:
        assert mitsuba_refuses(content)
