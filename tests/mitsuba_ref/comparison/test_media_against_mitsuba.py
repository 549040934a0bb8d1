"""Scenes with participating media, rendered here and by Mitsuba: means of many pictures.

Mitsuba has the integrator that is right in the scene at hand. False alarms: 24 means of
colours, each with a limit of five standard errors, 1.4e-5 together. What is found: a factor
of 1.01 to 1.05, the errors being 0.2 to 1 %.
"""

from __future__ import annotations

import numpy as np
import pytest

import renderer
from mitsuba_ref.reference.variant import load_mitsuba

SENSOR = """<sensor type="perspective"><float name="fov" value="20"/>
<transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
<sampler type="independent"><integer name="sample_count" value="64"/></sampler>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>
<rfilter type="box"/></film></sensor>"""
LAMP = """<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/>
<translate y="2"/></transform><emitter type="area"><rgb name="radiance" value="8 7 6"/>
</emitter></shape>"""
FLOOR = """<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
<scale value="3"/><translate y="-1.2"/></transform></shape>"""
SKY = """<emitter type="constant"><rgb name="radiance" value=".3 .4 .5"/></emitter>"""
BALL = """<shape type="sphere"><bsdf type="null"/><medium name="interior"
type="homogeneous"><float name="scale" value="3"/><rgb name="sigma_t" value=".7 .5 .4"/>
<rgb name="albedo" value=".9 .8 .7"/><phase type="hg"><float name="g" value=".5"/></phase>
</medium></shape>"""
GRID = """<shape type="cube"><bsdf type="null"/><medium name="interior"
type="heterogeneous"><float name="scale" value="4"/><float name="albedo" value=".9"/>
<volume name="sigma_t" type="gridvolume"><string name="filename" value="grid.vol"/>
<transform name="to_world"><scale value="2"/><translate x="-1" y="-1" z="-1"/>
<rotate y="1" angle="30"/></transform></volume></medium></shape>"""
LEAF = """<shape type="rectangle"><transform name="to_world"><scale value=".7"/>
<rotate x="1" angle="70"/><translate y="1.4"/></transform><bsdf type="mask">
<float name="opacity" value=".4"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf>
</bsdf></shape><shape type="rectangle"><transform name="to_world"><scale value=".5"/>
<translate x="-.5" z="1.5"/></transform><bsdf type="thindielectric">
<rgb name="specular_transmittance" value=".9 .5 .7"/></bsdf></shape>"""
GLASS = BALL.replace('<bsdf type="null"/>', '<bsdf type="dielectric"/>')
SCENES = {
    "a ball of mist, sky and lamp": SKY + LAMP + BALL,
    "smoke over a floor": LAMP + FLOOR + GRID,
    "behind leaves and a pane": LAMP + FLOOR + BALL + LEAF,
    "in glass": SKY + LAMP + FLOOR + GLASS,
}


def means(name, folder):
    """Return the mean colour of 16 pictures of each renderer, ours first: (2, 16, 3)."""
    mitsuba = load_mitsuba()
    mitsuba.VolumeGrid(
        np.array([0.2, 1, 0.5, 0.8, 0.1, 0.6, 0.9, 0.3], "f4").reshape(2, 2, 2)
    ).write(str(folder / "grid.vol"))
    integrator = """<integrator type="volpath"><integer name="max_depth" value="8"/>
    <integer name="rr_depth" value="100"/></integrator>"""
    text = f'<scene version="3.0.0">{integrator}{SENSOR}{SCENES[name]}</scene>'
    (folder / "scene.xml").write_text(text)
    mine = renderer.load_file(folder / "scene.xml")
    theirs = mitsuba.load_file(str(folder / "scene.xml"), optimize=False)
    both = (
        np.array([renderer.render(mine, seed=k, spp=256).pixels for k in range(16)]),
        np.array([mitsuba.render(theirs, seed=k, spp=256) for k in range(16)]),
    )
    return np.array([pictures.reshape(16, -1, 3).mean(axis=1) for pictures in both])


def standard_error(both):
    """Return the error of the difference of two means, (3,)."""
    return np.sqrt(both.var(axis=1, ddof=1).sum(axis=0) / 16)


@pytest.mark.parametrize("scene", SCENES)
def test_the_mean_is_that_of_mitsuba(scene, tmp_path):
    both = means(scene, tmp_path)
    error, (a, b) = standard_error(both), both.mean(axis=1)
    assert (error < 0.02 * a).all()
    assert (np.abs(a - b) < 5.0 * error).all()
