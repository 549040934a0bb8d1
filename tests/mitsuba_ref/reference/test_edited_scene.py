"""The changes that a comparison makes to a scene hide nothing that Mitsuba refuses."""

from __future__ import annotations

import pytest

from mitsuba_ref.reference.edited_scene import load_edited_scene

SCENE = """<scene version="3.0.0"><integrator type="path"/><sensor type="perspective"/>
<bsdf type="diffuse" id="grey"/>
<texture type="checkerboard" id="board"/>
<shape type="sphere"><ref id="grey"/>
<emitter type="area"><spectrum name="radiance" type="blackbody">
<float name="temperature" value="5000"/></spectrum></emitter></shape>
<shape type="rectangle"><bsdf type="plastic">{}</bsdf></shape></scene>"""


@pytest.mark.parametrize("unsampled", [False, True])
@pytest.mark.parametrize(
    ("inside", "unknown"),
    [
        ('<float name="eta" value="1.5"/>', '"eta"'),  # plastic takes int_ior
        ('<string name="shade" value="a"/>', '"shade"'),
        ('<ref name="tint" id="board"/>', '"tint"'),
        ('<bsdf type="diffuse"/>', '"_arg_0"'),
    ],
)
def test_a_property_that_no_plugin_reads_is_refused(tmp_path, inside, unknown, unsampled):
    path = tmp_path / "scene.xml"
    path.write_text(SCENE.format(inside), encoding="utf-8")
    with pytest.raises(RuntimeError, match="unreferenced") as refused:
        load_edited_scene(path, {}, unsampled_lamps=unsampled)
    assert unknown in str(refused.value)


def test_what_its_plugins_read_is_not(tmp_path):
    path = tmp_path / "scene.xml"
    inside = '<ref name="diffuse_reflectance" id="board"/>'
    path.write_text(SCENE.format(inside), encoding="utf-8")
    assert load_edited_scene(path, {}).scene.shapes()
