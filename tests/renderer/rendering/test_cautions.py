"""Cautions are said where a scene is in a region of the atlas of failures, and only there.

Each check is tried on both sides of what it looks for; the scenes of the project, which
all pass, get none.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import renderer
from mitsuba_ref.command.scene_table import print_table
from mitsuba_ref.our_renderer.picture import cautions_about
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import SceneResult
from renderer.advice.all_cautions import CHECKS, cautions_of
from renderer.advice.cautions import flat_faces, surface_points
from renderer.advice.closed_shapes import encloses, is_closed
from renderer.advice.coincident_surfaces import overlap, overlapping_boxes, values_of
from renderer.command.plan_text import plan_text
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene_file import read_string
from reports.atlas import every_case

ROOT = Path(__file__).parents[3]
SCENES = sorted((ROOT / "scenes").glob("*/scene.xml"))
PLUGINS = sorted((ROOT / "tests" / "plugins").glob("*.xml"))

_FRAME = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>
<sensor type="perspective"><float name="fov" value="30"/>
    <transform name="to_world"><lookat origin="{eye}" target="{target}" up="0,0,1"/>
    </transform>
    <film type="hdrfilm"><integer name="width" value="16"/>
        <integer name="height" value="16"/><rfilter type="box"/></film></sensor>
{body}
</scene>"""
_LAMP = '<emitter type="point"><point name="position" value="0,0,9"/></emitter>'
_FLOOR = """<shape type="rectangle" id="floor"><transform name="to_world">
    <scale value="5"/>{turn}</transform><bsdf type="diffuse"/></shape>"""
_CUBE = """<shape type="cube" id="cube"><transform name="to_world">
    <translate z="{z}"/>{turn}</transform>{bsdf}</shape>"""
_RED = '<bsdf type="diffuse"><rgb name="reflectance" value="0.9,0.1,0.1"/></bsdf>'
_GLASS = '<bsdf type="dielectric"/>'
_LAMP_INSIDE = """<emitter type="point"><point name="position" value="0,0,0.5"/></emitter>
<shape type="rectangle"><transform name="to_world"><scale value="9"/><translate z="-4"/>
    </transform><bsdf type="diffuse"/></shape>"""


def rows_of(
    body, *, eye="9,3,4", target="0,0,0", depth=8, integrator=None, light_choice=None
):
    text = _FRAME.format(body=body, eye=eye, target=target, depth=depth)
    scene = renderer.load_string(text, allow_outside="/")
    plan = make_plan(scene, integrator=integrator, light_choice=light_choice)
    return [caution.row for caution in cautions_of(scene, plan)]


@pytest.mark.parametrize(
    "path", [*SCENES, *PLUGINS], ids=lambda path: "/".join(path.parts[-2:])
)
def test_scenes_that_pass_get_none(path):
    scene = renderer.load_file(path)
    assert cautions_of(scene, make_plan(scene)) == ()


@pytest.mark.parametrize(
    ("body", "eye", "said"),
    [
        (_CUBE.format(z=1, turn="", bsdf=_GLASS), "9,3,4", True),
        (_CUBE.format(z=1.001, turn="", bsdf=_GLASS), "9,3,4", False),
        (_CUBE.format(z=0.5, turn="", bsdf=_GLASS), "9,3,4", False),  # sunk in
        # an opaque cube hides where it stands, but not from below
        (_CUBE.format(z=1, turn="", bsdf=_RED), "9,3,4", False),
        (_CUBE.format(z=1, turn="", bsdf=_RED), "9,3,-4", True),
        # the same material, but a floor is black from behind
        (_CUBE.format(z=1, turn="", bsdf='<bsdf type="diffuse"/>'), "9,3,-4", True),
    ],
)
def test_cube_on_a_floor(body, eye, said):
    found = rows_of(_FLOOR.format(turn="") + body + _LAMP, eye=eye)
    assert found == ["coincident-surfaces"] * said


_TWO_SIDED = '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>'
_CHECKERS = """<bsdf type="diffuse"><texture type="checkerboard" name="reflectance"/>
    </bsdf>"""


def _square(bsdf, scale=1, turn=0):
    return f"""<shape type="rectangle"><transform name="to_world"><scale value="{scale}"/>
        <rotate x="1" angle="{turn}"/></transform>{bsdf}</shape>"""


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        # one of the two is black, seen from anywhere
        (_square(_RED), _square(_RED, turn=180), True),
        (_square(_RED), _square(_RED, scale=2), False),
        (_square(_TWO_SIDED), _square(_TWO_SIDED, turn=180), False),
        # a texture that is given twice is equal, but for where it is
        (_square(_CHECKERS), _square(_CHECKERS), False),
        (_square(_CHECKERS), _square(_CHECKERS, scale=2), True),
    ],
)
def test_squares_of_one_material(first, second, said):
    assert rows_of(first + second + _LAMP) == ["coincident-surfaces"] * said


@pytest.mark.parametrize(("eye", "said"), [("9,3,4", False), ("9,3,-4", True)])
def test_cube_on_a_floor_with_a_post(tmp_path, eye, said):
    """The face that touches the cube counts, not the first of the mesh."""
    path = tmp_path / "floor.obj"
    path.write_text(
        "v 4 -1 0\nv 4 1 0\nv 4 0 2\nv -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\n"
        "f 1 2 3\nf 4 5 6\nf 4 6 7\n"
    )
    floor = f"""<shape type="obj"><string name="filename" value="{path}"/>
        <bsdf type="diffuse"/></shape>"""
    body = floor + _CUBE.format(z=1, turn="", bsdf=_RED) + _LAMP
    assert rows_of(body, eye=eye) == ["coincident-surfaces"] * said


@pytest.mark.parametrize("z", [-5, 5])
def test_rug_and_lamp_of_a_room_that_is_a_cube(z):
    room = """<shape type="cube"><boolean name="flip_normals" value="true"/>
        <transform name="to_world"><scale value="5"/></transform>
        <bsdf type="diffuse"/></shape>"""
    rug = f"""<shape type="rectangle"><transform name="to_world"><translate z="{z}"/>
        </transform>{_RED}</shape>"""
    assert rows_of(room + rug + _LAMP, eye="3,3,1") == ["coincident-surfaces"]
    assert rows_of(room + rug + _LAMP, eye="30,3,1") == []


@pytest.mark.parametrize(
    ("x", "z", "said"),
    [
        (1.0, 0.0, True),  # one in the other: their tops are in one plane
        (0.5, 2.0, False),  # one on the other
    ],
)
@pytest.mark.parametrize("eye", ["9,3,4", "9,3,-4"])
def test_two_opaque_cubes(eye, x, z, said):
    def cube(x, y, z, bsdf):
        return f"""<shape type="cube"><transform name="to_world">
            <translate x="{x}" y="{y}" z="{z}"/></transform>{bsdf}</shape>"""

    body = cube(0, 0, 0, _RED) + cube(x, 0.5, z, _TWO_SIDED) + _LAMP
    assert rows_of(body, eye=eye) == ["coincident-surfaces"] * said


@pytest.mark.parametrize(
    ("sensor", "said"), [("perspective", False), ("orthographic", True)]
)
def test_parallel_rays_see_a_floor_from_below(sensor, said):
    """Wherever the camera stands: it looks up."""
    body = _FLOOR.format(turn="") + _CUBE.format(z=1, turn="", bsdf=_RED) + _LAMP
    text = _FRAME.format(body=body, eye="-9,0,0.5", target="0,0,2", depth=8)
    if sensor == "orthographic":
        text = text.replace(
            '"perspective"><float name="fov" value="30"/>', '"orthographic">'
        )
    scene = renderer.load_string(text)
    found = cautions_of(scene, make_plan(scene))
    assert [caution.row for caution in found] == ["coincident-surfaces"] * said


@pytest.mark.parametrize(("integrator", "said"), [("depth", False), ("direct", True)])
def test_depth_does_not_tell_materials_apart(integrator, said):
    body = _FLOOR.format(turn="") + _CUBE.format(z=1, turn="", bsdf=_GLASS) + _LAMP
    found = rows_of(body, integrator=integrator)
    assert ("coincident-surfaces" in found) == said


def test_tiles_that_share_edges_are_not_looked_at():
    """Of 30 x 30 tiles only the halves of each share some area of their boxes."""
    x, y = (side.ravel().astype(float) for side in np.mgrid[:30, :30])
    square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    tiles = (np.stack([x, y], 1)[:, None, None] + square).reshape(-1, 3, 2)
    i, j, area = overlapping_boxes(tiles / 3.0, np.full(len(tiles), 1e-6))
    assert set(map(frozenset, zip(i, j, strict=True))) == {
        frozenset((k, k + 1)) for k in range(0, len(tiles), 2)
    }
    assert area == pytest.approx(1.0 / 9.0)


@pytest.mark.parametrize("seed", range(5))
def test_cube_on_a_floor_however_it_is_turned(seed):
    """Rounded coordinates of both are a few 1e-8 apart: still one plane."""
    x, y, z = np.random.default_rng(seed).uniform(-180, 180, 3)
    turn = f'<rotate x="1" angle="{x}"/><rotate y="1" angle="{y}"/>'
    turn += f'<rotate z="1" angle="{z}"/><translate x="1" y="-2" z="3"/>'
    body = _FLOOR.format(turn=turn) + _CUBE.format(z=1, turn=turn, bsdf=_GLASS) + _LAMP
    assert rows_of(body, eye="30,3,4") == ["coincident-surfaces"]


def test_squares_that_share_an_edge_do_not_overlap():
    square = """<shape type="rectangle"><transform name="to_world">
        <translate x="{x}"/></transform>{bsdf}</shape>"""
    beside = square.format(x=0, bsdf=_RED) + square.format(x=2, bsdf=_GLASS)
    assert rows_of(beside + _LAMP) == []
    above = square.format(x=0, bsdf=_RED) + square.format(x=1.9, bsdf=_GLASS)
    assert rows_of(above + _LAMP) == ["coincident-surfaces"]


def test_disk_on_a_floor():
    disk = f'<shape type="disk">{_RED}</shape>'
    assert rows_of(_FLOOR.format(turn="") + disk + _LAMP) == ["coincident-surfaces"]
    raised = disk.replace(
        "<bsdf", '<transform name="to_world"><translate z="0.01"/></transform><bsdf'
    )
    assert rows_of(_FLOOR.format(turn="") + raised + _LAMP) == []


def test_nothing_to_say_about_nothing():
    assert rows_of("") == []


@pytest.mark.parametrize(("place", "said"), [(1e3, False), (1e6, True)])
def test_far_coordinates(place, said):
    """At 1e6 single precision steps by 0.06; a pixel here is 0.3 wide or less."""
    body = f"""<shape type="sphere"><point name="center" x="{place}" y="0" z="0"/>
        <bsdf type="diffuse"/></shape>{_LAMP}"""
    found = rows_of(body, eye=f"{place + 5},0,0", target=f"{place},0,0")
    assert found == ["far-from-origin"] * said


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ('<shape type="sphere"><float name="radius" value="2"/>{glass}</shape>', True),
        ('<shape type="cube">{glass}</shape>', True),
        ('<shape type="sphere"><point name="center" value="3,0,0"/>{glass}</shape>', False),
        ('<shape type="rectangle">{glass}</shape>', False),
        ('<shape type="sphere"><bsdf type="diffuse"/></shape>', False),
        ('<shape type="sphere"><bsdf type="null"/></shape>', True),
        ('<shape type="sphere"><bsdf type="retarder"/></shape>', True),
        (
            '<shape type="cube"><bsdf type="mask"><bsdf type="diffuse"/></bsdf></shape>',
            True,
        ),
        (
            '<shape type="cube"><bsdf type="mask"><float name="opacity" value="1"/>'
            '<bsdf type="diffuse"/></bsdf></shape>',
            False,
        ),
    ],
)
def test_lamp_in_glass(shape, said):
    found = rows_of(shape.format(glass=_GLASS) + _LAMP_INSIDE)
    assert found == ["point-light-behind-glass"] * said


@pytest.mark.parametrize("bsdf", ["dielectric", "null", "polarizer", "mask"])
def test_shadow_rays_of_volpath_end_at_glass_alone(bsdf):
    nested = '<bsdf type="diffuse"/>' if bsdf == "mask" else ""
    shape = f'<shape type="sphere"><bsdf type="{bsdf}">{nested}</bsdf></shape>'
    found = rows_of(shape + _LAMP_INSIDE, integrator="volpath")
    assert found == ["point-light-behind-glass"] * (bsdf == "dielectric")


@pytest.mark.parametrize(
    ("lamps", "integrator", "choice", "said"),
    [
        (9, "path", "uniform", False),
        (201, "path", "uniform", True),
        (201, "path", "importance", False),
        (201, "direct", "uniform", False),
    ],
)
def test_starved_lamps(lamps, integrator, choice, said):
    floor = """<shape type="rectangle"><bsdf type="diffuse"/></shape>"""
    street = "".join(
        f'<emitter type="point"><point name="position" x="{k - lamps // 2}" y="0" z="1"/>'
        "</emitter>"
        for k in range(lamps)
    )
    found = rows_of(floor + street, integrator=integrator, light_choice=choice)
    assert found == ["lamps-starved"] * said


def test_lamps_beside_small_balls():
    """The floor, nearly all of the area, gets as much from each of 25 lamps."""
    body = '<shape type="rectangle"><bsdf type="diffuse"/></shape>'
    for k in range(25):
        x, y = 0.1 * (k % 5 - 2), 0.1 * (k // 5 - 2)
        body += f"""<emitter type="point"><point name="position" value="{x},{y},5"/>
            </emitter><shape type="sphere"><point name="center" value="{x},{y},5.03"/>
            <float name="radius" value="0.01"/></shape>"""
    assert rows_of(body) == []


def test_surface_points_are_spread_by_area():
    """A quarter of them on the square, the rest on the ball, evenly within each."""
    ball = f"""<shape type="sphere"><float name="radius" value="{np.sqrt(3 / np.pi)}"/>
        </shape>"""
    text = _FRAME.format(body=_square(_RED) + ball, eye="9,0,0", target="0,0,0", depth=2)
    points = surface_points(read_string(text).shapes, 1024)
    square = points.owner == 0
    assert square.sum() == 1024 // 4
    assert np.abs(points.position[square]).max() <= 1.0
    assert points.position[square].mean(axis=0) == pytest.approx(np.zeros(3), abs=0.02)
    assert points.normal[square] == pytest.approx(np.tile([0.0, 0.0, 1.0], (256, 1)))
    away = points.position[~square] * np.sqrt(np.pi / 3)
    assert away == pytest.approx(points.normal[~square])
    assert away.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.02)


_CUBE_OF_GLASS = _CUBE.format(z=0, turn='<translate x="2"/>', bsdf=_GLASS)
_PANE = """<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="90"/>
    <translate x="2"/></transform><bsdf type="dielectric"/></shape>"""


def _wall_behind_glass(depth, pane=_CUBE_OF_GLASS, eye="30,0,0"):
    wall = """<shape type="rectangle"><transform name="to_world"><scale value="9"/>
        <rotate y="1" angle="90"/></transform><bsdf type="diffuse"/></shape>"""
    lamp = '<emitter type="point"><point name="position" value="0.5,0,3"/></emitter>'
    return {"body": pane + wall + lamp, "eye": eye, "depth": depth}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (_wall_behind_glass(2), True),
        (_wall_behind_glass(3), True),
        (_wall_behind_glass(4), False),
        # one surface to go through: a pane without a back, and from within
        (_wall_behind_glass(2, _PANE), True),
        (_wall_behind_glass(3, _PANE), False),
        (_wall_behind_glass(2, eye="2.5,0,0"), True),
        (_wall_behind_glass(3, eye="2.5,0,0"), False),
    ],
)
def test_depth_in_glass(given, said):
    """Said of just those depths at which a wall behind glass is black."""
    assert rows_of(**given) == ["glass-depth"] * said
    text = _FRAME.format(target="0,0,0", **given)
    picture = renderer.render(renderer.load_string(text), spp=16).pixels
    assert (picture[8, 8].max() == 0.0) == said


def test_explain_says_them_with_their_row():
    scene = renderer.load_string(_FRAME.format(target="0,0,0", **_wall_behind_glass(3)))
    text = " ".join(plan_text(scene).split())
    assert "What is known to fail here" in text
    assert "shapes of glass in which paths of 3 segments end: 1 ('cube')" in text
    assert "(atlas: glass-depth)" in text
    assert "known to fail" not in plan_text(renderer.load_file(SCENES[0]))


def test_the_harness_prints_them(tmp_path):
    """Below the table, with the scene's name; verdicts do not depend on them."""
    path = tmp_path / "scene.xml"
    path.write_text(_FRAME.format(target="0,0,0", **_wall_behind_glass(3)))
    (caution,) = cautions_about(RenderRequest(str(path)))
    assert caution.endswith("(atlas: glass-depth)")
    path.write_text("<scene/>")  # refused, which its rendering says
    assert cautions_about(RenderRequest(str(path))) == ()
    result = SceneResult(name="box", verdict="pass", cautions=("glass [dark]",))
    output = io.StringIO()
    print_table([result], Console(file=output, width=120))
    assert "caution box: glass [dark]\n" in output.getvalue()


def test_closed_meshes():
    text = _FRAME.format(
        body=_CUBE.format(z=0, turn="", bsdf=_RED), eye="9,0,0", target="0,0,0", depth=2
    )
    (cube,) = read_string(text).shapes
    assert is_closed(cube)
    assert encloses(cube, np.array([0.9, -0.9, 0.9]))
    assert not encloses(cube, np.array([1.1, 0.0, 0.0]))
    open_box = type(cube)(**{**vars(cube), "faces": cube.faces[1:]})
    assert not is_closed(open_box)


def test_overlap_of_triangles_as_on_paper():
    triangle = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 2.0, 1.0]])
    assert overlap(triangle, triangle) == pytest.approx(1.0)
    assert overlap(triangle, triangle[::-1]) == pytest.approx(1.0)
    moved = triangle + np.array(
        [1.0, 0.0, 0.0]
    )  # what is shared is half as wide and as high
    assert overlap(triangle, moved) == pytest.approx(0.25)
    assert overlap(triangle, triangle + np.array([2.0, 0.0, 0.0])) == 0.0


def test_rows_exist():
    """Each name of a caution is that of a case of the atlas, or of a method in one."""
    cases = every_case()
    methods = {name for case in cases.values() for name in case.methods}
    assert set(CHECKS) <= {*cases, *methods}


@dataclass(slots=True)
class _Slotted:
    """What a plugin may hold: without `__dict__`, and not hashable."""

    data: object


def test_equal_descriptions_have_equal_values():
    def value(last):
        array = np.array([1.0, last])
        return values_of({"a": [_Slotted(array), {"b": (1, None)}]}, {})

    assert value(2.0) == value(2.0) != value(3.0)
    assert hash(values_of(_Slotted({1, 2}), {})) is not None
    assert values_of(np.zeros((2, 1)), {}) != values_of(np.zeros((1, 2)), {})


def test_what_fails_in_a_caution_breaks_no_scene(tmp_path, monkeypatch):
    """It is said where the caution would be, by --explain and by the harness alike."""

    def fail(scene, plan):
        raise TypeError("unhashable")

    monkeypatch.setattr("renderer.advice.all_cautions.CHECKS", {"row": fail})
    path = tmp_path / "scene.xml"
    path.write_text(_FRAME.format(target="0,0,0", **_wall_behind_glass(3)))
    with pytest.warns(RuntimeWarning, match="caution 'row' not checked: TypeError"):
        (caution,) = cautions_about(RenderRequest(str(path)))
    assert caution == (
        "not checked: TypeError: unhashable; a defect of lightproof (atlas: row)"
    )
    with pytest.warns(RuntimeWarning):
        text = plan_text(renderer.load_file(path))
    assert caution in " ".join(text.split())


def test_faces_without_area_are_left_out():
    flat = """<shape type="cube"><transform name="to_world"><scale x="1" y="1" z="1e-30"/>
        </transform><bsdf type="diffuse"/></shape>"""
    text = _FRAME.format(body=flat, eye="9,0,0", target="0,0,0", depth=2)
    faces = flat_faces(read_string(text).shapes)
    assert np.all(faces.area > 0.0)
    assert np.linalg.norm(faces.normal, axis=1) == pytest.approx(np.ones(len(faces.area)))
