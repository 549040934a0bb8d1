"""Paths of `volpath`, flight by flight, in both renderers.

The scenes of the plugins: nested media, grids, coloured extinction, null boundaries.
"""

from __future__ import annotations

import shutil
from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import renderer
from mitsuba_ref.command.cli import main
from mitsuba_ref.our_renderer.steps_in_media import StepsInMedia
from mitsuba_ref.our_renderer.traced_path import COLLISION, ENDED, WHITE, TracedPath
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.replay.paths.path_comparison import compare_paths, first_difference
from mitsuba_ref.replay.paths.traced_pair import TracedPair

PLUGINS = Path(__file__).parents[2] / "plugins"
SCENES = ("heterogeneous", "volpath", "medium_of_camera", "volpathmis")
PIXELS = tuple(product(range(4, 40, 9), range(5, 30, 7)))


@pytest.fixture(scope="module", params=SCENES)
def pair(request):
    path = PLUGINS / f"{request.param}.xml"
    with TracedPair(RenderRequest(str(path), {}, spp=1, seed=5)) as both:
        yield both


def kinds_of(path: TracedPath) -> Counter[str]:
    """Count what a path has met."""
    events = [bounce.event for bounce in path.bounces]
    lights = [light for bounce in path.bounces for light in bounce.lights]
    dimmed = sum(light.passed not in (WHITE, (0.0, 0.0, 0.0)) for light in lights)
    scattered = [b.scattered for b in path.bounces if b.scattered is not None]
    straight = sum(on.straight for on in scattered)
    return Counter(events) + Counter(lights=len(lights), dimmed=dimmed, straight=straight)


def test_both_paths_agree_flight_by_flight(pair):
    """The same path, and no step of ours differs where it starts from Mitsuba's ray."""
    met: Counter[str] = Counter()
    for pixel in PIXELS:
        for sample in range(pair.spp):
            ours, reference = pair.trace(pixel, sample)
            assert first_difference(compare_paths(ours, reference)) is None
            assert pair.led(pixel, sample, reference).examine().within_rounding
            met += kinds_of(ours)
    assert min(met[COLLISION] + met["straight"], met[ENDED], met["lights"]) > 0


def test_the_steps_are_the_render(pair):
    """Our path, stage by stage, adds up to the pixel of an ordinary render."""
    path, options = pair._request.path, {"sampler": "mitsuba", "ray_offset": "mitsuba"}
    scene = renderer.load_file(path)
    picture = renderer.render(
        scene, spp=pair.spp, seed=5, measured_camera=pair.camera, **options
    )
    for x, y in PIXELS:
        samples = [pair.trace_ours((x, y), k).radiance for k in range(pair.spp)]
        shown = np.asarray(picture)[y, x]
        np.testing.assert_allclose(np.mean(samples, axis=0), shown, rtol=5e-7)


def test_a_led_path_draws_the_numbers_of_the_other(pair):
    """If Mitsuba has drawn one number more in a flight, ours does: the next ones differ."""
    for pixel in PIXELS:
        reference = pair.trace_mitsuba(pixel, 0)
        if len(reference.bounces) > 2:
            break
    first, *rest = reference.bounces
    more = replace(first, numbers={**first.numbers, "flight 9": 0.5})
    (led,) = pair._our_steps().trace_led(
        pixel, 0, replace(reference, bounces=(more, *rest))
    )
    (same,) = pair._our_steps().trace_led(pixel, 0, reference)
    assert led.bounces[0] == same.bounces[0]
    assert led.bounces[1] != same.bounces[1]


def test_a_defect_in_a_flight_is_named(monkeypatch, capsys):
    """A tenth less light in each second bounce: its throughput, not within rounding."""
    real = StepsInMedia._trace

    def darker(self, *given):
        path = real(self, *given)
        first, *rest = path.bounces
        rest = [replace(b, throughput=tuple(0.9 * c for c in b.throughput)) for b in rest]
        return replace(path, bounces=(first, *rest))

    monkeypatch.setattr(StepsInMedia, "_trace", darker)
    assert main([str(PLUGINS / "medium_of_camera.xml"), "--trace", "13,12"]) == 1
    output = capsys.readouterr().out
    assert "First difference at bounce 1: throughput" in output
    assert "Not within rounding" in output


@pytest.fixture(params=["true", "false"])
def spectral_scene(request, tmp_path):
    """`volpathmis` with the densities of all colours, or with one."""
    folder = shutil.copytree(PLUGINS, tmp_path / "plugins")
    scene = folder / "volpathmis.xml"
    kept = f'<boolean name="use_spectral_mis" value="{request.param}"/>'
    text = scene.read_text().replace("</integrator>", kept + "</integrator>", 1)
    scene.write_text(text)
    return scene


def test_a_wrong_weight_of_volpathmis_is_named(spectral_scene, monkeypatch, capsys):
    """Light samples are expected at 0.9 of their weight: at the first bounce."""
    trace = [str(spectral_scene), "--trace", "20,27", "--spp", "1"]
    assert main(trace) == 0
    assert "lit throughput after" in capsys.readouterr().out
    real = StepsInMedia._scattered

    def darker(self, tile, *given):
        scattered = real(self, tile, *given)
        self._weights_at(tile)[1] *= 0.9
        return scattered and replace(scattered, weights=self._weights(tile))

    monkeypatch.setattr(StepsInMedia, "_scattered", darker)
    assert main(trace) == 1
    output = capsys.readouterr().out
    assert "First difference at bounce 0: lit throughput after" in output
    assert "Not within rounding" in output
