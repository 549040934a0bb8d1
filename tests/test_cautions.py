"""Cautions are said where a scene is in a region of the atlas of failures, and only there.

Each check is tried on both sides of what it looks for; the scenes of the project, which
all pass, get none.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import renderer
from mitsuba_ref.command.scene_table import print_table
from mitsuba_ref.our_renderer.picture import cautions_about
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import SceneResult
from renderer.rendering.planning.cautions import cautions_of
from renderer.rendering.planning.cautions.closed_meshes import encloses, is_closed
from renderer.rendering.planning.cautions.overlap import overlap
from renderer.rendering.planning.plan import make_plan
from renderer.rendering.planning.plan_text import plan_text
from renderer.scene_file import read_string

ROOT = Path(__file__).parents[1]
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


def rows_of(body, *, eye="9,3,4", target="0,0,0", depth=8, integrator=None):
    text = _FRAME.format(body=body, eye=eye, target=target, depth=depth)
    scene = renderer.load_string(text)
    plan = make_plan(scene, integrator=integrator)
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
        # the same material, whichever is seen
        (_CUBE.format(z=1, turn="", bsdf='<bsdf type="diffuse"/>'), "9,3,-4", False),
    ],
)
def test_cube_on_a_floor(body, eye, said):
    found = rows_of(_FLOOR.format(turn="") + body + _LAMP, eye=eye)
    assert found == ["coincident-surfaces"] * said


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
    ],
)
def test_lamp_in_glass(shape, said):
    lamp = '<emitter type="point"><point name="position" value="0,0,0.5"/></emitter>'
    floor = """<shape type="rectangle"><transform name="to_world"><scale value="9"/>
        <translate z="-4"/></transform><bsdf type="diffuse"/></shape>"""
    found = rows_of(shape.format(glass=_GLASS) + lamp + floor)
    assert found == ["point-light-behind-glass"] * said


@pytest.mark.parametrize(
    ("lamps", "integrator", "said"),
    [(9, "path", False), (201, "path", True), (201, "direct", False)],
)
def test_starved_lamps(lamps, integrator, said):
    floor = """<shape type="rectangle"><bsdf type="diffuse"/></shape>"""
    street = "".join(
        f'<emitter type="point"><point name="position" x="{k - lamps // 2}" y="0" z="1"/>'
        "</emitter>"
        for k in range(lamps)
    )
    assert rows_of(floor + street, integrator=integrator) == ["lamps-starved"] * said


def _wall_behind_glass(depth):
    pane = _CUBE.format(z=0, turn='<translate x="2"/>', bsdf=_GLASS)
    wall = """<shape type="rectangle"><transform name="to_world"><scale value="9"/>
        <rotate y="1" angle="90"/></transform><bsdf type="diffuse"/></shape>"""
    lamp = '<emitter type="point"><point name="position" value="0.5,0,3"/></emitter>'
    return {"body": pane + wall + lamp, "eye": "30,0,0", "depth": depth}


@pytest.mark.parametrize(("depth", "said"), [(2, True), (3, True), (4, False)])
def test_depth_in_glass(depth, said):
    """Said of just those depths at which a wall behind glass is black."""
    given = _wall_behind_glass(depth)
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
    """Each row that a caution names is one of the atlas."""
    from reports.limits.atlas import ATLAS

    named = {"coincident-surfaces", "point-light-behind-glass", "lamps-starved"}
    named |= {"glass-depth", "far-from-origin"}
    assert named <= {row.name for row in ATLAS}
