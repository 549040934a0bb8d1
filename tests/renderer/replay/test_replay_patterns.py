"""A picture by each of Mitsuba's other samplers: the same paths, no pixel diverges.

Rationale: the scenes draw with `independent` or `stratified`, and the numbers of the other
samplers are compared by themselves (test_replay_samplers.py); here they are drawn where a
picture needs them, in the right order and by the right pixel. Setup: a lit corner on a film
of several blocks, of which a window is cropped. Expectation: 0 divergent pixels.
"""

from __future__ import annotations

import pytest

from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.replay.replay_scene import replay_scene

# Each sampler compiles its own kernels, 8 seconds each: of rectangles alone, with `path`,
# which costs no more than `direct` and draws more.
CORNER = """<scene version="3.0.0">
<default name="spp" value="16"/>
<integrator type="path"><integer name="rr_depth" value="2"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/>
  <transform name="to_world"><lookat origin="1.5, -4, 2.5" target="0, 0, 0.5"
    up="0, 0, 1"/></transform>
  <sampler type="SAMPLER"><integer name="sample_count" value="$spp"/></sampler>
  <film type="hdrfilm"><integer name="width" value="80"/><integer name="height" value="60"/>
    <integer name="crop_offset_x" value="9"/><integer name="crop_offset_y" value="5"/>
    <integer name="crop_width" value="66"/><integer name="crop_height" value="44"/>
    <rfilter type="box"/></film>
</sensor>
<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/>
  <translate x="0" y="1" z="0.5"/></transform></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.4"/>
  <rotate x="1" angle="180"/><translate x="0.3" y="-0.2" z="1.6"/></transform>
  <emitter type="area"><rgb name="radiance" value="4, 5, 6"/></emitter></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.2"/>
  <rotate y="1" angle="90"/><translate x="-1.3" y="0.1" z="0.7"/></transform>
  <emitter type="area"><rgb name="radiance" value="9, 5, 2"/></emitter></shape>
</scene>"""


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sampler", "samples"),
    [
        ("stratified", (1, 16)),
        ("multijitter", (1, 16)),
        ("orthogonal", (4, 25)),  # squares of primes, and never 1
        ("ldsampler", (4, 16)),
    ],
)
def test_every_sampler_gives_mitsubas_picture(sampler, samples, references, tmp_path):
    """Not one pixel may part: a number out of order moves most of them."""
    file = tmp_path / "corner.xml"
    file.write_text(CORNER.replace("SAMPLER", sampler))
    request = scene_request(file, read_proof(file), Options(seed=3))
    for spp in samples:
        result, ours, _ = replay_scene(request, spp, render_ours, references)
        assert result.passed, result.sentence
        assert (result.divergent, result.spp) == (0, spp)
        assert ours.shape == (44, 66, 3) and ours.mean() > 0.1
