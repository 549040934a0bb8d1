"""`direct` with several samples of lights and BSDF at each point, and Mitsuba's fault."""

import mitsuba as mi
import numpy as np
import pytest

import renderer
from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.rendering.planning.make_plan import make_plan

mi.set_variant("scalar_rgb")

SCENE = """<scene version="3.0.0"><integrator type="moment">
<integrator type="direct" name="d">
  <integer name="block_size" value="32"/>
  <integer name="emitter_samples" value="{}"/><integer name="bsdf_samples" value="{}"/>
</integrator></integrator>
<sensor type="perspective"><float name="fov" value="0.01"/>
  <transform name="to_world"><lookat origin="3,0,3" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/>
    <rfilter type="box"/></film>
  <sampler type="independent"/></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="9"/></transform>
  <bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></shape>
{}
</scene>"""
LAMP = """<shape type="rectangle">
  <transform name="to_world"><rotate x="1" angle="180"/><translate z="2"/></transform>
  <emitter type="area"/></shape>"""
POINT = '<emitter type="point"><point name="position" value="0,0,2"/></emitter>'


def loaded(lights, directions, content=LAMP):
    return renderer.load_string(SCENE.format(lights, directions, content))


def mean_and_variance(lights, directions):
    """Return both of single samples, over 65,536 of them that see the same point."""
    image = renderer.render(loaded(lights, directions), spp=64, seed=5)
    mean = image.aovs["d"][..., 1].mean(dtype=np.float64)
    return mean, image.aovs["m2_d"][..., 1].mean(dtype=np.float64) - mean**2


@pytest.mark.parametrize("directions", [0, 1])
def test_the_variance_falls_with_the_number_of_samples(directions):
    """n samples of each way: the same mean, 1/n of the variance.

    The ratio of two variances over 65,536 samples has an error of 1 % (kurtosis up to 5);
    5 % is five of these, a false alarm in a million runs, and sees a sample counted twice.
    """
    mean, variance = mean_and_variance(1, directions)
    four, less = mean_and_variance(4, 4 * directions)
    assert abs(four - mean) < 5.0 * np.sqrt(1.25 * variance / 65536)
    assert abs(4.0 * less / variance - 1.0) < 0.05


def test_point_lights_take_one_sample():
    """They do not vary from sample to sample, so more would be the same again."""
    scene = renderer.load_string(
        SCENE.format(4, 3, POINT)
        .replace('type="moment"', 'type="aov"')
        .replace(
            '<integrator type="direct"',
            '<string name="aovs" value="t:depth"/><integrator type="direct"',
        )
    )
    plan = make_plan(scene, integrator="direct")
    assert (plan.light_samples, plan.bsdf_samples, plan.several) == (1, 1, False)


def test_moments_are_those_of_all_its_samples():
    plan = make_plan(loaded(4, 3, POINT))
    assert (plan.light_samples, plan.bsdf_samples, plan.every_light) == (4, 3, False)
    assert plan.name == "moments of direct with several samples"


def test_the_picture_of_a_point_light_does_not_depend_on_their_number():
    one, four = (renderer.render(loaded(n, 0, POINT), spp=4) for n in (1, 4))
    np.testing.assert_allclose(four.pixels, one.pixels, rtol=1e-5)


def test_without_light_samples_bsdf_samples_find_the_lamp():
    """The mean of both ways, within five errors; with more noise, as it is one alone."""
    mean, variance = mean_and_variance(1, 1)
    alone, more = mean_and_variance(0, 1)
    assert abs(alone - mean) < 5.0 * np.sqrt((variance + more) / 65536)
    assert more > 2.0 * variance


def test_without_light_samples_points_give_no_light():
    """As in Mitsuba: no direction that the BSDF chooses meets one."""
    for directions in (1, 2):
        image = renderer.render(loaded(0, directions, POINT), spp=4)
        assert not image.pixels.any()


@pytest.mark.parametrize("other", ["path", "whitted"])
def test_another_integrator_samples_lights_all_the_same(other):
    scene = loaded(0, 1, POINT)
    plan = make_plan(scene, integrator=other)
    assert (plan.strategy, plan.light_samples) == ("both", 1)
    assert renderer.render(scene, spp=1, integrator=other).pixels.any()


@pytest.mark.parametrize("directions", [1, 3])
@pytest.mark.parametrize("content", [LAMP, POINT + LAMP])
def test_without_light_samples_the_paths_are_mitsubas(
    content, directions, references, tmp_path
):
    path = tmp_path / "scene.xml"
    path.write_text(SCENE.format(0, directions, content))
    options = Options(checks="replay", replay=(1,))
    result = validate_scene(path, options, render_ours, references).result
    assert result.verdict == "pass", result.reasons


@pytest.fixture(scope="module")
def references():
    with MitsubaWorker(time_limit=120.0) as worker:
        yield ReferenceCache(worker.render)


@pytest.mark.parametrize(
    ("content", "verdict"), [(POINT + LAMP, "reference-wrong"), (LAMP, "pass")]
)
def test_the_fault_of_the_reference_is_a_verdict_of_its_own(
    content, verdict, references, tmp_path
):
    """Mitsuba adds its light samples of a point light undivided; nothing else is wrong."""
    path = tmp_path / "scene.xml"
    path.write_text(SCENE.format(3, 2, content).replace('value="32"/>', 'value="16"/>', 1))
    text = SCENE.format(3, 2, content)
    path.write_text(text)
    options = Options(checks="replay", replay=(1,))
    result = validate_scene(path, options, render_ours, references).result
    assert result.verdict == verdict
    if verdict == "reference-wrong":
        assert "known to be wrong here, by a factor of 3" in result.reasons[0]
