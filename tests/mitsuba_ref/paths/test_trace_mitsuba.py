"""The path tracer over Mitsuba's objects is Mitsuba's: same pixels from the same numbers.

What is compared with our paths is written down by a tracer in Python, not by Mitsuba's own
integrators. So its radiance is held against their pictures, which share nothing with it
but scene, BSDFs, emitters and sampler.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mitsuba_ref.reference.edited_scene import load_edited_scene
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.variant import load_mitsuba
from mitsuba_ref.replay.integrator_method import read_method
from mitsuba_ref.replay.paths.mitsuba_trace_process import tracer_of
from renderer.replay.pixel_seeds import pixel_seeds

SCENES = Path(__file__).parents[3] / "scenes"
PLUGINS = Path(__file__).parents[2] / "plugins"
WIDTH, HEIGHT, SEED = 20, 14, 3
BLOCK = 8  # 3 x 2 blocks, the last ones of each row and column not full


def load(path: Path, spp: int):
    size = {"width": str(WIDTH), "height": str(HEIGHT)} if path.parent != PLUGINS else {}
    parameters = {**size, "spp": str(spp)}
    return load_edited_scene(
        path, parameters, box_filter=True, keep_shapes_apart=True
    ).scene


def integrator(**parameters):
    return load_mitsuba().load_dict({"block_size": BLOCK, **parameters})


def errors(scene, method, spp: int, densities: int = 3) -> np.ndarray:
    """Return the largest relative difference of each pixel between tracer and picture."""
    picture = load_mitsuba().render(scene, integrator=method, spp=spp, seed=SEED)
    picture = np.array(picture)[..., :3]
    tracer = tracer_of(scene, spp, method, densities)
    height, width = picture.shape[:2]
    seeds = pixel_seeds(width, height, SEED, BLOCK)
    assert np.ptp(picture) > 0.0
    traced = np.zeros((height, width, 3))
    for y, x in np.ndindex(height, width):
        paths = [tracer.trace((x, y), int(seeds[y, x]), sample) for sample in range(spp)]
        traced[y, x] = np.mean([path.radiance for path in paths], axis=0)
    scale = np.maximum(picture.max(axis=2), 1e-2 * picture.mean())
    return np.abs(traced - picture).max(axis=2) / scale


@pytest.mark.parametrize("spp", [1, 4])
@pytest.mark.parametrize(
    ("scene", "parameters"),
    [
        ("cornell-box", {"type": "path", "max_depth": 8, "rr_depth": 3}),
        ("caustic", {"type": "path"}),
        ("instances", {"type": "path", "max_depth": 4}),
        ("analytic-shapes", {"type": "path", "max_depth": 3, "hide_emitters": True}),
        ("emitters", {"type": "direct"}),
        ("emitters", {"type": "direct", "hide_emitters": True}),
        ("emitters", {"type": "direct", "emitter_samples": 2, "bsdf_samples": 0}),
        ("emitters", {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1}),
    ],
    ids=lambda value: (
        value if isinstance(value, str) else "-".join(map(str, value.values()))
    ),
)
def test_traced_radiance_is_the_pixel(scene, parameters, spp):
    """Every pixel to 1e-6 (measured: 2e-7) over 6 blocks, first and later samples.

    Glass, metal, roulette, meshes, instances, all lights, textures; a number drawn out of
    order, another seed or a light counted otherwise moves most pixels by more than 1 %.
    """
    loaded = load(SCENES / scene / "scene.xml", spp)
    assert errors(loaded, integrator(**parameters), spp).max() < 1e-6


@pytest.mark.parametrize("hide", [False, True])
@pytest.mark.parametrize(
    "scene",
    ["homogeneous", "heterogeneous", "volpath", "phase_functions", "medium_of_camera"],
)
def test_traced_radiance_in_media_is_the_pixel(scene, hide):
    """Every pixel to 1e-5 (measured: 3e-6): flights, null collisions, shadow rays."""
    loaded = load(PLUGINS / f"{scene}.xml", 1)
    method = integrator(type="volpath", max_depth=12, hide_emitters=hide)
    spp = loaded.sensors()[0].sampler().sample_count()
    assert errors(loaded, method, spp).max() < 1e-5


@pytest.mark.parametrize("hide", [False, True])
@pytest.mark.parametrize("spectral", [True, False])
@pytest.mark.parametrize("scene", ["volpathmis", "medium_of_camera"])
def test_traced_radiance_of_volpathmis_is_the_pixel(scene, spectral, hide):
    """The same with the weights of all densities and of one."""
    loaded = load(PLUGINS / f"{scene}.xml", 1)
    options = {"use_spectral_mis": spectral, "hide_emitters": hide}
    method = integrator(type="volpathmis", max_depth=12, rr_depth=2, **options)
    spp = loaded.sensors()[0].sampler().sample_count()
    assert errors(loaded, method, spp, 3 if spectral else 1).max() < 1e-5


@pytest.mark.parametrize(
    "sampler", ["stratified", "multijitter", "orthogonal", "ldsampler"]
)
def test_samplers_with_a_pattern(sampler, tmp_path):
    """Their numbers depend on the sample's place in the pattern and on the dimension."""
    text = (SCENES / "cornell-box" / "scene.xml").read_text()
    assert text.count('type="independent"') == 1
    changed = tmp_path / "scene.xml"
    changed.write_text(text.replace('type="independent"', f'type="{sampler}"'))
    scene = load(changed, 4)
    spp = scene.sensors()[0].sampler().sample_count()  # what the pattern allows
    assert errors(scene, integrator(type="path"), spp).max() < 1e-6


@pytest.mark.parametrize(
    "parameters",
    [{"type": "ptracer"}, {"type": "direct", "bsdf_samples": 2}],
    ids=["ptracer", "two BSDF samples"],
)
def test_what_is_no_single_path_is_refused(parameters):
    """One sentence that names what the scene has."""
    with pytest.raises(MitsubaError, match="a trace follows"):
        read_method(load_mitsuba().load_dict(parameters))
