"""Replays of `volpath` in what scenes of other people showed: lamps in fog, a far plane."""

from __future__ import annotations

import pytest

from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import NO_PROOF, USUAL_LIMITS
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.replay.replay_scene import replay_scene

SCENE = """<scene version="3.0.0">
<integrator type="volpath"><integer name="max_depth" value="{depth}"/></integrator>
<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.5"/></medium>
<sensor type="perspective"><float name="fov" value="40"/><ref id="fog"/>{planes}
<transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/>
</transform><film type="hdrfilm"><integer name="width" value="24"/>
<integer name="height" value="24"/><rfilter type="box"/></film></sensor>
{shapes}</scene>"""
SHINING = """<emitter type="area"><rgb name="radiance" value="8 7 6"/></emitter>
<ref name="exterior" id="fog"/></shape>"""
SPHERE = f"""<shape type="sphere"><float name="radius" value="0.6"/>
<point name="center" value="{{x}}, 0, 0"/>{SHINING}"""
SQUARE = f"""<shape type="ply"><string name="filename" value="square.ply"/>
<transform name="to_world"><translate x="{{x}}" y="0.5"/></transform>{SHINING}"""
ROOM = '<shape type="sphere"><float name="radius" value="6"/></shape>'
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
-0.5 0 -0.5
0.5 0 -0.5
0.5 0 0.5
-0.5 0 0.5
3 0 1 2
3 0 2 3
"""
# the most pixels that part, where rounding decides; the number before it was followed
SCENES = {
    # from one lamp to the other the density is infinite: no number is drawn (109)
    "lamps in one plane": (8, "", ROOM + SQUARE.format(x=-0.8) + SQUARE.format(x=0.8), 12),
    # a light sample is often the point itself, with density 0 (48)
    "shining spheres": (2, "", SPHERE.format(x=-0.8) + SPHERE.format(x=0.8), 12),
    # flights of camera rays end at the far plane (512)
    "a far plane": (8, '<float name="far_clip" value="4"/>', SPHERE.format(x=0), 24),
}


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_takes_mitsubas_paths(name, tmp_path):
    depth, planes, shapes, most = SCENES[name]
    (tmp_path / "square.ply").write_text(PLY)
    path = tmp_path / "scene.xml"
    path.write_text(SCENE.format(depth=depth, planes=planes, shapes=shapes))
    request = scene_request(path, NO_PROOF, Options())
    with MitsubaWorker(time_limit=120.0) as worker:
        references = ReferenceCache(worker.render)
        result, _, _ = replay_scene(request, 16, render_ours, references, USUAL_LIMITS)
    assert result.divergent <= most, result.sentence
    assert result.rmse < 1e-5
