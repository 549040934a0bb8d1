"""Scenes at the ends of what single precision can hold, and lights that look both ways.

Each was once a wrong picture: a black floor, a lamp that shone backwards, a box of
infinite size in the builder.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scene_xml import element, to_world
from small_scenes import diffuse, placed, rgb, sensor

import renderer


def _floor_under_the_sun(scale: float) -> renderer.Scene:
    """A floor of half width `scale` at z = 0, lit straight from above, seen from 3 up."""
    return renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": sensor((0, 0, 3), (0, 0, 0), up=(0, 1, 0)),
            "floor": {
                "type": "rectangle",
                "to_world": placed((0, 0, 0), (scale, 0, 0), (0, scale, 0)),
                "bsdf": diffuse(0.5),
            },
            "sun": {"type": "directional", "direction": [0, 0, -1], "irradiance": rgb(1)},
        }
    )


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e10, 1e17])
def test_floors_of_any_size_are_equally_bright(scale: float) -> None:
    """L = rho / pi E; the square of an area of 1e20 would leave float32 and give black."""
    pixels = renderer.render(_floor_under_the_sun(scale)).pixels
    if scale >= 1.0:  # the smallest is nowhere near the ray
        np.testing.assert_allclose(pixels, 0.5 / np.pi, rtol=1e-6)
    assert np.isfinite(pixels).all()


TOO_FAR = "found what makes the shape reach farther than 1e+18, expected coordinates"
BALL = '<shape type="sphere">\n<float name="radius" value="{}"/>\n</shape>'
MESH = """<shape type="obj">
<string name="filename" value="far.obj"/>
<transform name="to_world"><scale value="{}"/></transform></shape>"""
CAMERA = '<sensor type="perspective"/>'


@pytest.mark.parametrize("scale", [1e18, 1e25, 1e38])
def test_floors_beyond_single_precision_are_refused(scale: float) -> None:
    words = f'shape "rectangle", property "to_world": {TOO_FAR}'
    with pytest.raises(renderer.SceneError, match=re.escape(words)):
        _floor_under_the_sun(scale)


@pytest.mark.parametrize(
    ("shape", "place"),
    [
        (BALL.format("1e30"), ':3: shape "sphere", property "radius"'),
        (
            '<shape type="disk"><transform name="to_world">\n'
            '<scale value="2e19"/></transform></shape>',  # its box would be infinite
            ':2: shape "disk", property "to_world"',
        ),
        (
            '<shape type="cylinder"><point name="p1" value="0 0 2"/>\n'
            '<point name="p0" value="0 -3e18 0"/></shape>',
            ':3: shape "cylinder", property "p0"',
        ),
        (
            element("shape", "cube", to_world('<translate x="1e20"/>')),
            ':2: shape "cube", property "to_world"',
        ),
        (MESH.format(1), ':3: shape "obj", property "filename"'),
        (MESH.format("1e15"), ':4: shape "obj", property "to_world"'),
        (
            f'<shape type="shapegroup" id="g">{BALL.format("2e18")}</shape>'
            '<shape type="instance"><ref id="g"/></shape>',
            ':3: shape "sphere", property "radius"',
        ),
    ],
)
def test_what_reaches_too_far_is_named_by_line_plugin_and_property(
    shape: str, place: str, tmp_path: Path
) -> None:
    """Squares of 1e18 and more leave float32. The mesh's vertices reach 1e4 or 1e19."""
    far = "1e4" if "1e15" in shape else "1e19"
    (tmp_path / "far.obj").write_text(f"v 0 0 0\nv {far} 0 0\nv 0 {far} 0\nf 1 2 3\n")
    with pytest.raises(renderer.SceneError) as caught:
        renderer.load_string(
            f'<scene version="3.0.0">\n{shape}{CAMERA}</scene>', base_dir=tmp_path
        )
    assert str(caught.value).startswith(f"<string>{place}: {TOO_FAR}")


def test_what_reaches_almost_too_far_is_read() -> None:
    """A sphere of radius 9e17; the sum of its axes' coordinates would pass the limit."""
    turned = element("shape", "sphere", to_world('<rotate y="1" angle="45"/>'), radius=9e17)
    scene = renderer.load_string(f'<scene version="3.0.0">{turned}{CAMERA}</scene>')
    assert 9e17 <= np.abs(scene.bounds).max() < 1e18


LAMP = """v -1 -1 2
v 1 -1 2
v 0 1 2
vn 0.95 0 {}0.312
f 1//1 3//1 2//1
"""


@pytest.mark.parametrize("bsdf_samples", [0, 1])
@pytest.mark.parametrize(("sign", "lit"), [("-", True), ("", False)])
def test_shading_normals_decide_which_side_of_a_lamp_shines(
    tmp_path: Path, bsdf_samples: int, sign: str, lit: bool
) -> None:
    """Light samples and arriving paths agree: the floor is lit only if vn looks at it.

    The lamp is level, 2 above the floor, and its geometric normal points down; vertex
    normals (0.95, 0, -+0.312) look to +x. Lit: a spot at x = 1.5 under a lamp that looks
    down a little. Not lit: a spot at x = -1.5 under one that looks up a little.
    """
    side = 1 if lit else -1
    path = tmp_path / "lamp.obj"
    path.write_text(LAMP.format(sign))
    scene = renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "bsdf_samples": bsdf_samples},
            "sensor": sensor((4 * side, 0, 1.5), (1.5 * side, 0, 0), spp=256, jitter=True),
            "floor": {
                "type": "rectangle",
                "to_world": placed((0, 0, 0), (9, 0, 0), (0, 9, 0)),
                "bsdf": diffuse(0.5),
            },
            "lamp": {
                "type": "obj",
                "filename": str(path),
                "emitter": {"type": "area", "radiance": rgb(1)},
            },
        }
    )
    mean = float(renderer.render(scene).pixels.mean())
    assert (mean > 1e-3) if lit else (mean == 0.0)


# ------------------------------------------- found by soaking (reports soak, damaged files)


def _ball(bsdf: str = "", light: str = '<emitter type="constant"/>') -> str:
    return (
        f'<scene version="3.0.0"><shape type="sphere">{bsdf}</shape>{light}'
        '<sensor type="perspective"><transform name="to_world"><lookat origin="0 0 3" '
        'target="0 0 0" up="0 1 0"/></transform><film type="hdrfilm">'
        '<integer name="width" value="4"/><integer name="height" value="4"/></film>'
        "</sensor></scene>"
    )


@pytest.mark.parametrize(
    ("scene", "found"),
    [
        (
            _ball(
                light='<emitter type="constant"><rgb name="radiance" value="1 3.4e38 1"/>'
                "</emitter>"
            ),
            r"radiance.*3\.4e\+38.*an emission of at least 0 and at most 1e30",
        ),
        (
            _ball('<bsdf type="conductor"><rgb name="k" value="4 4294967296 2"/></bsdf>'),
            r"\bk\b.*4\.29497e\+09.*an index of refraction from -1e9 to 1e9",
        ),
        (
            _ball(element("bsdf", "principled", metallic=-3.4e38)),
            r"metallic.*-3\.4e\+38.*numbers from -1e9 to 1e9",
        ),
        (
            _ball(
                light='<emitter type="constant"><spectrum name="radiance" '
                'value="400:3e38 700:3e38"/></emitter>'
            ),
            r"radiance.*an emission of at least 0 and at most 1e30",
        ),
        (
            _ball(
                '<bsdf type="bumpmap"><texture type="uniform"/><float name="scale" '
                'value="1e38"/><bsdf type="diffuse"/></bsdf>'
            ),
            r"scale.*1e\+38",
        ),
        (
            _ball(light=element("emitter", "projector", scale=3e38)),
            r"scale.*3e\+38.*at most 1e\+30",
        ),
        (_ball(light=element("emitter", "projector", fov=1e-38)), r"fov.*1e-38 degrees"),
    ],
    ids=["emission", "conductor", "metallic", "spectrum", "bumps", "projector", "fov"],
)
def test_numbers_whose_products_leave_single_precision_are_refused(
    scene: str, found: str
) -> None:
    """Each gave a picture of NaN or infinity."""
    with pytest.raises(renderer.SceneError, match=found):
        renderer.load_string(scene)


@pytest.mark.parametrize(
    "texture", ["", '<texture type="bitmap" name="texture">{}</texture>']
)
def test_the_narrowest_spot_has_a_sharp_edge_and_no_warning(texture: str) -> None:
    """The inverse of its width is beyond float32: NumPy warned of an overflow."""
    image = Path(__file__).parents[2] / "plugins" / "slide.png"
    slide = texture.format(f'<string name="filename" value="{image}"/>')
    angle = '<float name="cutoff_angle" value="1e-45"/>'
    light = f'<emitter type="spot">{angle}{slide}</emitter>'
    pixels = renderer.render(renderer.load_string(_ball(light=light)), spp=1).pixels
    assert (pixels == 0.0).all()


@pytest.mark.parametrize(
    ("light", "name"),
    [
        ('<emitter type="point">\n<point name="position" value="1 2e18 3"/>', "position"),
        (
            '<emitter type="point">\n<transform name="to_world"><translate x="-1e30"/>'
            "</transform>",
            "to_world",
        ),
        (
            '<emitter type="spot">\n<transform name="to_world">'
            '<lookat origin="-3.4e38 4 0" target="-1 -1 1" up="0 0 1"/></transform>',
            "to_world",
        ),
        (
            '<emitter type="projector">\n<transform name="to_world"><translate z="1e18"/>'
            "</transform>",
            "to_world",
        ),
    ],
)
def test_a_light_that_stands_too_far_away_is_refused(light: str, name: str) -> None:
    """Of two lights the tree that points choose from squared such places: a RuntimeWarning.

    The soak found it, cases 71541, 75941 and 115321 of its damaged files.
    """
    plugin = re.search('type="([a-z]+)"', light)[1]
    with pytest.raises(renderer.SceneError) as caught:
        renderer.load_string(f'<scene version="3.0.0">\n{light}</emitter>{CAMERA}</scene>')
    assert str(caught.value) == (
        f'<string>:3: emitter "{plugin}", property "{name}": found what puts the light '
        "farther than 1e+18, expected coordinates that single precision can square; scale "
        "the scene down"
    )


@pytest.mark.parametrize(
    ("camera", "name"),
    [
        (
            'thinlens"><float name="aperture_radius" value="1"/>\n'
            '<float name="focus_distance" value="3.4e38"/>',
            "focus_distance",
        ),
        ('thinlens">\n<float name="aperture_radius" value="1e19"/>', "aperture_radius"),
        (  # the default of the focus
            'thinlens"><float name="aperture_radius" value="1"/>\n'
            '<float name="far_clip" value="3e38"/>',
            "far_clip",
        ),
        (
            'perspective">\n<float name="principal_point_offset_y" value="-1e38"/>',
            "principal_point_offset_y",
        ),
        (
            'perspective">\n<transform name="to_world"><translate y="1e20"/></transform>',
            "to_world",
        ),
    ],
)
def test_a_camera_that_reaches_too_far_is_refused(camera: str, name: str) -> None:
    """The first was a RuntimeWarning: case 264503 of the soak's damaged files."""
    with pytest.raises(renderer.SceneError) as caught:
        renderer.load_string(
            f'<scene version="3.0.0">\n<sensor type="{camera}</sensor></scene>'
        )
    assert str(caught.value).startswith(
        f'<string>:3: sensor "{camera.partition(chr(34))[0]}", property "{name}": '
        "found what makes the camera's picture reach farther than 1e+18, expected"
    )


def test_where_a_light_at_infinity_stands_means_nothing() -> None:
    """A translation of 1e30 is in the matrix of some exporters' environments."""
    far = element("emitter", "directional", to_world('<translate x="1e30"/>'))
    renderer.load_string(f'<scene version="3.0.0">{far}{CAMERA}</scene>')
