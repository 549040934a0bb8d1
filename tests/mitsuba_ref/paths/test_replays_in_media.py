"""Replays of `volpath` in scenes that showed a difference in scenes of other people."""

from __future__ import annotations

from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import NO_PROOF, USUAL_LIMITS
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.replay.replay_scene import replay_scene

LAMP = """<shape type="ply"><string name="filename" value="square.ply"/>
<transform name="to_world"><translate x="{x}" y="0.5"/></transform>
<emitter type="area"><rgb name="radiance" value="8 7 6"/></emitter></shape>"""
SCENE = f"""<scene version="3.0.0">
<integrator type="volpath"><integer name="max_depth" value="8"/></integrator>
<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.5"/></medium>
<sensor type="perspective"><float name="fov" value="40"/><ref id="fog"/>
<transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/>
</transform><film type="hdrfilm"><integer name="width" value="24"/>
<integer name="height" value="24"/><rfilter type="box"/></film></sensor>
<shape type="sphere"><float name="radius" value="6"/></shape>
{LAMP.format(x=-0.8)}{LAMP.format(x=0.8)}</scene>"""
SQUARE = """ply
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


def test_lamps_in_one_plane(tmp_path):
    """From one to the other the density is infinite: Mitsuba draws no number for it.

    Rounding decides whether a point lies in the plane of a lamp: 4 pixels part, and 109
    did where a number was drawn.
    """
    (tmp_path / "square.ply").write_text(SQUARE)
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    request = scene_request(path, NO_PROOF, Options())
    with MitsubaWorker(time_limit=120.0) as worker:
        references = ReferenceCache(worker.render)
        result, _, _ = replay_scene(request, 16, render_ours, references, USUAL_LIMITS)
    assert result.divergent < 12
    assert result.rmse < 1e-5
