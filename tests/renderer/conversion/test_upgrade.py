"""`lightproof upgrade`: scenes of Mitsuba 0.5 and 0.6 as those of Mitsuba 3."""

from __future__ import annotations

import re

import numpy as np
import pytest

from renderer.command.upgrade import main
from renderer.conversion.old_mitsuba import upgraded
from renderer.conversion.upgrade_record import APPROXIMATED, CHANGED, DROPPED, LEFT
from renderer.errors import SceneError
from renderer.scene_file import read_file

pytestmark = pytest.mark.usefixtures("in_an_empty_folder")

OLD = """<?xml version="1.0" encoding="utf-8"?>
<!-- maxDepth in a comment stays -->
<scene version="0.5.0">
\t<default name="maxDepth" value="5"/>
\t<integrator type="bdpt">
\t\t<integer name="maxDepth" value="$maxDepth"/>
\t\t<boolean name="sampleDirect" value="true"/>
\t</integrator>
\t<sensor type="perspective">
\t\t<string name="fovAxis" value="smaller"/> <!-- as 0.6 said it -->
\t\t<float name="fov" value="40"/>
\t\t<transform name="toWorld">
\t\t\t<lookAt origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/>
\t\t</transform>
\t\t<sampler type="halton">
\t\t\t<integer name="sampleCount" value="16"/>
\t\t\t<integer name="scramble" value="-1"/>
\t\t</sampler>
\t\t<film type="ldrfilm">
\t\t\t<integer name="width" value="24"/>
\t\t\t<integer name="height" value="16"/>
\t\t\t<string name="fileFormat" value="png"/>
\t\t\t<string name="pixelFormat" value="luminanceAlpha"/>
\t\t\t<float name="gamma" value="2.2"/>
\t\t\t<boolean name="highQualityEdges" value="true"/>
\t\t\t<rfilter type="box"/>
\t\t</film>
\t</sensor>
\t<bsdf type="roughplastic" id="shiny">
\t\t<srgb name="diffuseReflectance" value="#ff8000"/>
\t\t<float name="intIOR" value="1.9"/>
\t\t<string name="distribution" value="phong"/>
\t</bsdf>
\t<shape type="sphere">
\t\t<ref id="shiny"/>
\t\t<emitter type="area"><rgb name="radiance" value="1 2 3" intent="illuminant"/></emitter>
\t</shape>
\t<shape type="rectangle">
\t\t<boolean name="flipNormals" value="true"/>
\t\t<bsdf type="roughdiffuse">
\t\t\t<texture name="reflectance" type="checkerboard">
\t\t\t\t<spectrum name="color0" value="0.1, 0.2, 0.3"/>
\t\t\t\t<float name="uscale" value="4"/>
\t\t\t\t<float name="vscale" value="2"/>
\t\t\t\t<float name="uoffset" value="0.5"/>
\t\t\t</texture>
\t\t\t<float name="alpha" value="0.3"/>
\t\t</bsdf>
\t</shape>
</scene>
"""


def write(path, text):
    path.write_text(text)
    return path


def scene(body, version="0.6.0"):
    return f'<scene version="{version}">\n<sensor type="perspective"/>\n{body}\n</scene>\n'


def test_the_result_is_read_and_means_what_the_old_file_meant(tmp_path):
    old = write(tmp_path / "old.xml", OLD)
    assert main([str(old), "-o", "new.xml"]) == 0
    found = read_file("new.xml")
    camera = found.camera
    assert (camera.film.width, camera.film.height) == (24, 16)
    assert camera.film.sample_border
    np.testing.assert_allclose(camera.to_world[:3, 3], (0, 0, 5))
    assert (camera.sampler.name, camera.sampler.sample_count) == ("multijitter", 16)
    assert (found.integrator.name, found.integrator.max_depth) == ("path", 5)
    ball, sheet = found.shapes
    # half of the largest byte of sRGB is 0.2159 of the light
    np.testing.assert_allclose(
        ball.bsdf.diffuse_reflectance.rgb, (1.0, 0.215861, 0.0), atol=1e-5
    )
    np.testing.assert_allclose(ball.radiance, (1, 2, 3))
    texture = sheet.bsdf.reflectance
    # Mitsuba 0.6: uv * scale + offset
    np.testing.assert_allclose(texture.to_uv @ (1.0, 1.0, 1.0), (4.5, 2.0, 1.0))
    assert read_file("new.xml", maxDepth=2).integrator.max_depth == 2


def test_layout_and_comments_stay(tmp_path):
    """What no change names is the same text, line for line."""
    content, changes = upgraded(write(tmp_path / "old.xml", OLD))
    lines = content.decode().splitlines()
    changed = {change.line for change in changes}
    kept = [
        line
        for number, line in enumerate(OLD.splitlines(), 1)
        if number not in changed and "vscale" not in line and "uoffset" not in line
    ]
    following = iter(lines)
    assert all(line in following for line in kept)  # in their order
    assert '\t\t<string name="fov_axis" value="smaller"/> <!-- as 0.6 said it -->' in lines
    assert '\t\t\t\t<transform name="to_uv">' in lines
    assert '\t\t\t\t\t<scale x="4" y="2"/>' in lines
    windows = OLD.replace("\n", "\r\n").encode()
    (tmp_path / "windows.xml").write_bytes(windows)
    again, _ = upgraded(tmp_path / "windows.xml")
    assert again.count(b"\n") == again.count(b"\r\n")
    assert again.replace(b"\r\n", b"\n") == content


def test_each_change_is_listed_with_its_line(tmp_path, capsys):
    old = write(tmp_path / "old.xml", OLD)
    _, changes = upgraded(old)
    lines = OLD.splitlines()
    assert [change.line for change in changes] == sorted(change.line for change in changes)
    said = {(lines[c.line - 1].strip(), c.kind): c for c in changes}
    assert len(said) >= 20
    assert (
        said['<integer name="maxDepth" value="$maxDepth"/>', CHANGED].after == '"max_depth"'
    )
    assert said['<sampler type="halton">', APPROXIMATED].after == '"multijitter"'
    assert "bdpt" in said['<integrator type="bdpt">', APPROXIMATED].before
    assert said['<integer name="scramble" value="-1"/>', DROPPED].why
    assert said['<float name="alpha" value="0.3"/>', DROPPED].why
    assert said['<srgb name="diffuseReflectance" value="#ff8000"/>', CHANGED]
    assert LEFT not in {change.kind for change in changes}
    main([str(old)])
    told = capsys.readouterr().out.splitlines()
    assert len(told) == len(changes) + 1
    assert told[0] == f'{old}:3: changed <scene version="0.5.0"> -> "3.0.0"'
    assert re.fullmatch(r"\d+ changed, .*; wrote .*old_upgraded.xml", told[-1])
    main([str(old), "--force", "--quiet"])
    assert ": changed " not in capsys.readouterr().out


def test_what_has_no_heir_is_left_and_said(tmp_path, capsys):
    body = """<emitter type="collimated"><float name="power" value="2"/></emitter>
<shape type="sphere"><bsdf type="ward"/></shape>
<shape type="hair"/>
<include filename="more.xml"/>"""
    old = write(tmp_path / "old.xml", scene(body))
    assert main([str(old), "-o", "new.xml"]) == 1
    said = capsys.readouterr().out
    assert f'{old}:3: left emitter "collimated" (lightproof has none)' in said
    assert f'{old}:4: left bsdf "ward" (roughconductor' in said
    assert f'{old}:5: left shape "hair"' in said
    assert f"{old}:6: left include more.xml (lightproof upgrade more.xml)" in said
    assert "lightproof does not read it yet: new.xml:6: the included file" in said


SKY = """<emitter type="{}">
	<float name="turbidity" value="4"/>{}
</emitter>"""


@pytest.mark.parametrize(
    ("plugin", "scaled", "dark"),
    [("sky", "sky_scale", "sun_scale"), ("sun", "sun_scale", "sky_scale")],
)
def test_a_sky_or_a_sun_is_half_a_sunsky_whose_y_is_up(tmp_path, plugin, scaled, dark):
    given = """
	<float name="scale" value="3"/><float name="stretch" value="1.2"/>
	<vector name="sunDirection" x="0.1" y="0.5" z="-0.2"/>
	<float name="sunRadiusScale" value="2"/>"""
    content, changes = upgraded(
        write(tmp_path / "old.xml", scene(SKY.format(plugin, given)))
    )
    (tmp_path / "new.xml").write_bytes(content)
    description = read_file(tmp_path / "new.xml")
    (light,) = description.emitters
    assert description.warnings == ()  # its sun stands above the horizon
    assert light.turbidity == 4.0
    assert (getattr(light, scaled), getattr(light, dark)) == (3.0, 0.0)
    np.testing.assert_allclose(light.to_world[:3, 2], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(light.to_world[:3, 0], [1, 0, 0], atol=1e-12)
    dropped = [change.before for change in changes if change.kind == DROPPED]
    assert len(dropped) == 2 and "stretch" in dropped[0] and "sunRadius" in dropped[1]


def test_of_a_sky_and_a_sun_the_second_is_left(tmp_path):
    """Mitsuba 0.6 had one of each; a sunsky is both, and an environment."""
    both = SKY.format("sky", "") + SKY.format("sun", "")
    _, changes = upgraded(write(tmp_path / "old.xml", scene(both)))
    (left,) = (change for change in changes if change.kind == LEFT)
    assert left.before == 'emitter "sun"'


@pytest.mark.parametrize("empty", [False, True])
def test_a_sky_by_date_keeps_its_compass(tmp_path, empty):
    """At noon the sun stands in the south, which was +z; in the morning in the east, +x."""
    turn = """
	<transform name="toWorld"><rotate y="1" angle="90"/></transform>"""
    hour = '<float name="hour" value="{}"/>'

    def sun(hours):
        body = SKY.format("sunsky", hour.format(hours) + ("" if empty else turn))
        content, _ = upgraded(write(tmp_path / "old.xml", scene(body)))
        (tmp_path / "new.xml").write_bytes(content)
        (light,) = read_file(tmp_path / "new.xml").emitters
        return light.sun_direction

    south, east = ((2, 1), (0, 1)) if empty else ((0, 1), (2, -1))
    axis, sign = south
    assert sun(12)[axis] * sign > 0.2 and sun(12)[1] > 0.95
    axis, sign = east
    assert sun(7)[axis] * sign > 0.7
    none = upgraded(write(tmp_path / "old.xml", scene('<emitter type="sky"/>')))[0]
    (tmp_path / "new.xml").write_bytes(none)
    assert read_file(tmp_path / "new.xml").emitters[0].sun_scale == 0.0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('<float name="gamma" value="1"/>', '<boolean name="raw" value="true"/>'),
        ('<float name="gamma" value="2.2"/>', ""),
        (
            '<string name="wrapModeU" value="clamp"/>',
            '<string name="wrap_mode" value="clamp"/>',
        ),
        (
            '<string name="filterType" value="ewa"/>',
            '<string name="filter_type" value="bilinear"/>',
        ),
    ],
)
def test_bitmaps(tmp_path, old, new):
    body = '<texture type="bitmap"><string name="filename" value="a.png"/>{}</texture>'
    content, _ = upgraded(write(tmp_path / "old.xml", scene(body.format(old))))
    assert content.decode() == scene(body.format(new), "3.0.0")


def test_colours_of_black_bodies_and_of_vertices(tmp_path):
    body = """<shape type="sphere">
  <emitter type="area"><blackbody name="radiance" temperature="5000K" scale="2"/></emitter>
</shape>
<texture type="vertexcolors" id="paint"/>
<bsdf type="diffuse"><ref name="diffuseReflectance" id="paint"/></bsdf>"""
    content, changes = upgraded(write(tmp_path / "old.xml", scene(body)))
    (tmp_path / "new.xml").write_bytes(content)
    found = read_file(tmp_path / "new.xml")
    red, _, blue = found.shapes[0].radiance
    assert red > blue > 0.0
    assert any("scale 2" in change.before for change in changes if change.kind == DROPPED)
    assert '<string name="name" value="vertex_color"/>' in content.decode()


@pytest.mark.parametrize(
    ("weights", "kind"), [("0.75, 0.25", "blendbsdf"), ("0.5 0.3", "mixturebsdf")]
)
def test_a_mixture_of_two_is_a_blend_if_its_weights_add_up(tmp_path, weights, kind):
    body = f"""<shape type="sphere"><bsdf type="mixturebsdf">
<string name="weights" value="{weights}"/>
<bsdf type="diffuse"/><bsdf type="roughconductor"/>
</bsdf></shape>"""
    content, changes = upgraded(write(tmp_path / "old.xml", scene(body)))
    assert f'<bsdf type="{kind}">' in content.decode()
    assert (LEFT in {change.kind for change in changes}) == (kind == "mixturebsdf")
    if kind == "blendbsdf":
        (tmp_path / "new.xml").write_bytes(content)
        (shape,) = read_file(tmp_path / "new.xml").shapes
        assert shape.bsdf.weight == 0.25


def test_no_file_is_overwritten_unless_it_is_forced(tmp_path, capsys):
    old = write(tmp_path / "old.xml", scene(""))
    before = old.read_bytes()
    assert main([str(old), "-o", str(old)]) == 2
    assert "is the scene itself; --force overwrites it" in capsys.readouterr().err
    other = write(tmp_path / "other.xml", "mine")
    assert main([str(old), "-o", str(other)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert (old.read_bytes(), other.read_text()) == (before, "mine")
    assert main([str(old), "-o", str(old), "--force"]) == 0
    assert b'version="3.0.0"' in old.read_bytes()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (scene("", "3.0.0"), "is of version 3.0.0, which is read as it is"),
        (scene("", "0.3.0"), "is of version 0.3.0, which cannot be upgraded"),
        ("<scene/>", "is of no version"),
        ('<scene version="0.6.0">', "not well-formed XML"),
        (scene('<bsdf type="diffuse"><srgb name="r" value="red"/></bsdf>'), "3: the srgb"),
    ],
)
def test_what_cannot_be_upgraded_is_one_line(tmp_path, capsys, text, words):
    old = write(tmp_path / "old.xml", text)
    assert main([str(old)]) == 2
    said = capsys.readouterr().err
    assert words in said and len(said.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["old.xml"]
    with pytest.raises(SceneError):
        upgraded(tmp_path / "missing.xml")


def test_a_refused_scene_of_an_old_version_names_the_command(tmp_path):
    """Of what an upgrade may help with; a file that is missing is no such thing."""
    missing = '<shape type="obj"><string name="filename" value="no.obj"/></shape>'
    helped = {
        scene('<shape type="sphere"><bsdf type="ward"/></shape>'): True,
        scene('<shape type="sphere"><float name="extEta" value="1"/></shape>'): True,
        scene('<transform name="a"><lookAt/></transform>'): True,
        scene(missing): False,
        scene('<shape type="sphere"><bsdf type="ward"/></shape>', "3.0.0"): False,
    }
    path = tmp_path / "old.xml"
    for text, has in helped.items():
        with pytest.raises(SceneError) as caught:
            read_file(write(path, text))
        hint = f"the scene is of version 0.6.0: lightproof upgrade {path} writes it"
        assert (hint in str(caught.value)) == has
