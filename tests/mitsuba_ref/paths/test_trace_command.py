"""`python -m mitsuba_ref SCENE --trace X,Y`: both paths of a pixel, and the exit status.

The Cornell box at 12 x 12 pixels, so that the kernels are those of other tests.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import renderer
from mitsuba_ref.command.cli import main
from mitsuba_ref.our_renderer.step_by_step import StepByStep
from mitsuba_ref.our_renderer.traced_path import TracedPath
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.verdicts import VERDICTS
from mitsuba_ref.replay.paths.path_comparison import compare_paths, first_difference
from mitsuba_ref.replay.paths.traced_pair import TracedPair, is_traceable

SCENES = Path(__file__).parents[3] / "scenes"
BOX = SCENES / "cornell-box" / "scene.xml"
SIZE = {"width": "12", "height": "12", "spp": "3"}
PIXEL, SAMPLE = "5,4", "2"


def run(*arguments: object, scene: Path = BOX) -> int:
    defines = [f"-D{name}={value}" for name, value in SIZE.items()]
    return main([str(scene), *map(str, arguments), *defines])


@pytest.fixture(scope="module")
def pair():
    with TracedPair(RenderRequest(str(BOX), SIZE, spp=3, seed=5)) as both:
        yield both


def test_agreeing_paths_are_status_0(capsys):
    """Both paths, bounce by bounce, no mark, and nothing cut off in a pipe."""
    assert run("--trace", PIXEL, "--sample", SAMPLE) == 0
    output = capsys.readouterr().out
    for shown in (
        "pixel 5,4, sample 2 of 3",
        "random: film x",
        "bounce 0",
        "light blocked",
    ):
        assert shown in output
    assert "The paths agree" in output
    assert "first" not in output and "…" not in output


@pytest.mark.parametrize(
    "around", ['type="moment">', 'type="aov"><string name="aovs" value="d:depth"/>']
)
def test_the_paths_of_the_colours_are_traced_inside_other_integrators(
    pair, tmp_path, around
):
    """`aov` and `moment` draw no numbers of their own: the same two paths."""
    path = '<integrator type="path">'
    text = BOX.read_text().replace(path, f"<integrator {around}{path}")
    scene = tmp_path / "scene.xml"
    scene.write_text(text.replace("</integrator>", "</integrator></integrator>"))
    with TracedPair(RenderRequest(str(scene), SIZE, spp=3, seed=5)) as both:
        wrapped = both.trace((5, 4), 2)
    plain = pair.trace((5, 4), 2)
    assert [path.numbers for path in wrapped] == [path.numbers for path in plain]
    assert [path.radiance for path in wrapped] == [path.radiance for path in plain]


def test_sides_of_two_kinds_have_their_lights_in_a_trace(tmp_path):
    """The hit stands in the lists of both kinds, and first in that of the wrong one."""
    scene = tmp_path / "scene.xml"
    for sides in (("diffuse", "plastic"), ("plastic", "diffuse")):
        inside = "".join(f'<bsdf type="{side}"/>' for side in sides)
        walls = rf'<bsdf type="twosided" id="\1">{inside}</bsdf>'
        named = r'<bsdf type="diffuse" id="(\w+)">.*?</bsdf>'
        scene.write_text(re.sub(named, walls, BOX.read_text(), flags=re.DOTALL))
        with TracedPair(RenderRequest(str(scene), SIZE, spp=3, seed=5)) as both:
            mine, other = both.trace((5, 9), 0)
        lights = [
            [sampled.light for hit in path.bounces for sampled in hit.lights]
            for path in (mine, other)
        ]
        assert lights[0] == lights[1]
        assert lights[0]
        assert first_difference(compare_paths(mine, other)) is None


def test_a_blocked_light_is_told_from_one_that_is_seen(pair):
    """At the floor of the box, between the blocks, and where paths go on from there."""
    said = []
    for x in range(0, 12, 2):
        mine, other = pair.trace((x, 9), 0)
        said += [
            (ours.blocked, theirs.blocked)
            for here, there in zip(mine.bounces, other.bounces, strict=True)
            for ours, theirs in zip(here.lights, there.lights, strict=True)
        ]
    assert all(ours == theirs for ours, theirs in said)
    assert {True, False} <= {ours for ours, _ in said}


def inject(monkeypatch, defect) -> None:
    """Let the kernels' path of each sample, moved or not, have a defect."""
    real = StepByStep._trace

    def spoilt(self, tile, sample, *moved):
        return defect(real(self, tile, sample, *moved), sample)

    monkeypatch.setattr(StepByStep, "_trace", spoilt)


def darker_light(path: TracedPath, factor: float = 0.9) -> TracedPath:
    """Return a path on which the lights of bounce 1 carry `factor` times as much."""
    first, second, *rest = path.bounces
    lights = tuple(
        replace(light, carried=tuple(factor * c for c in light.carried))
        for light in second.lights
    )
    return replace(path, bounces=(first, replace(second, lights=lights), *rest))


def test_an_injected_defect_is_status_1_and_marked_in_its_bounce(monkeypatch, capsys):
    """A tenth less light at bounce 1: the row `unblocked light`, called a value."""
    inject(monkeypatch, lambda path, sample: darker_light(path))
    assert run("--trace", PIXEL, "--sample", SAMPLE) == 1
    output = capsys.readouterr().out
    (marked,) = (line for line in output.splitlines() if "<-- first" in line)
    assert marked.split()[:2] == ["unblocked", "light"]
    assert "First difference at bounce 1: unblocked light" in output
    assert "Not within rounding: from the same ray as Mitsuba's no move by 4e-07" in output
    assert "Likely a value" in output


def test_what_a_verdict_calls_a_defect_is_marked_though_it_is_small(monkeypatch, capsys):
    """Half a thousandth at bounce 1: paths may differ by more, a single step may not."""
    inject(monkeypatch, lambda path, sample: darker_light(path, 0.9995))
    assert run("--trace", PIXEL, "--sample", SAMPLE) == 1
    output = capsys.readouterr().out
    (marked,) = (line for line in output.splitlines() if "<-- first" in line)
    assert marked.split()[:2] == ["unblocked", "light"]
    assert "First difference at bounce 1: unblocked light" in output
    # a stated tolerance holds, and no other
    assert run("--trace", PIXEL, "--sample", SAMPLE, "--tolerance", "1e-3") == 0
    assert "The paths agree" in capsys.readouterr().out


def test_an_earlier_sample_that_parted_is_named(monkeypatch, capsys):
    """Samples share a stream: where sample 0 parted, sample 2 draws other numbers."""

    def parted(path, sample):
        if sample == 0:
            return darker_light(path)
        return replace(path, numbers=dict.fromkeys(path.numbers, 0.5))

    inject(monkeypatch, parted)
    assert run("--trace", PIXEL, "--sample", SAMPLE) == 1
    output = capsys.readouterr().out
    assert "First difference at the camera: random: film x" in output
    assert "Sample 0. First difference at bounce 1: unblocked light" in output


@pytest.mark.parametrize(
    ("scenes", "arguments", "sentence"),
    [
        ("cornell-box", "--trace=12,0", "pixel 12,0 is outside"),
        ("cornell-box", "--trace=0,12", "12 x 12 pixels"),
        ("cornell-box", "--trace=0,0 --sample=3", "3 samples, 0 to 2"),
        ("whitted-spheres", "--trace=0,0", "not whitted"),
        ("cornell-box caustic", "--trace=0,0", "one scene; 2 are given"),
        ("cornell-box", "--trace=-1,0", "must be X,Y"),
        ("cornell-box", "--trace=3", "must be X,Y"),
        ("cornell-box", "--trace=0,0 --sample=x", "whole number"),
        ("cornell-box", "--trace=0,0 --tolerance=0", "above 0"),
        ("cornell-box", "--sample=1", "go with --trace"),
    ],
)
def test_wrong_use_is_status_2_and_one_sentence(scenes, arguments, sentence, capsys):
    """Nothing on standard output, no traceback."""
    paths = [SCENES / scene / "scene.xml" for scene in scenes.split()]
    assert run(*paths[1:], *arguments.split(), scene=paths[0]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert sentence in " ".join(captured.err.split())
    assert "Traceback" not in captured.err


def test_a_scene_that_mitsuba_refuses_has_its_status(monkeypatch, capsys):
    """Its own sentence, from its own process, after the verdict's name."""
    real = TracedPair.trace

    def spoil(self, pixel, sample):
        self._request = replace(self._request, parameters={**SIZE, "unheard": "1"})
        return real(self, pixel, sample)

    monkeypatch.setattr(TracedPair, "trace", spoil)
    assert run("--trace", PIXEL) == VERDICTS["refused-by-mitsuba"].status
    error = " ".join(capsys.readouterr().err.split())
    assert "refused-by-mitsuba: trace: scalar_rgb: " in error and "unheard" in error


def test_a_mitsuba_that_is_silent_is_ended_at_the_time_limit(monkeypatch, capsys):
    """A process that sleeps for an hour, a limit of one second: the status of a timeout."""
    real = subprocess.Popen

    def sleeper(command, **given):
        return real([command[0], "-c", "import time; time.sleep(3600)"], **given)

    monkeypatch.setattr(subprocess, "Popen", sleeper)
    assert run("--trace", PIXEL, "--time-limit", 1) == VERDICTS["mitsuba-timeout"].status
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "mitsuba-timeout: trace: scalar_rgb: no answer within 1 s" in captured.err


def test_a_scene_that_we_refuse_has_its_status(capsys, tmp_path):
    """Not 2, which is a wrong command line."""
    scene = tmp_path / "scene.xml"
    scene.write_text('<scene version="3.0.0"><shape type="unheard"/></scene>')
    assert main([str(scene), "--trace", "0,0"]) == VERDICTS["refused-by-us"].status
    assert "refused-by-us: trace: " in capsys.readouterr().err


def test_help_says_which_pixels_are_meant(capsys):
    """X,Y count inside the crop window."""
    assert main(["--help"]) == 0
    assert "inside the crop window" in " ".join(capsys.readouterr().out.split())


def test_the_steps_are_the_render(pair):
    """Our path, stage by stage, adds up to the pixel of an ordinary render.

    The mean of the three samples is the pixel of the picture to the last bit or two, for
    pixels all over it; so what a trace shows is what the kernels do.
    """
    scene = renderer.load_file(BOX, **SIZE)
    picture = renderer.render(
        scene,
        spp=3,
        seed=5,
        sampler="mitsuba",
        ray_offset="mitsuba",
        measured_camera=pair.camera,
    )
    picture = np.asarray(picture)
    for x, y in ((0, 0), (5, 4), (6, 2), (3, 9), (11, 11), (8, 7)):
        samples = [pair.trace_ours((x, y), sample).radiance for sample in range(3)]
        np.testing.assert_allclose(np.mean(samples, axis=0), picture[y, x], rtol=3e-7)


def test_a_pixel_whose_samples_agree_has_no_cause(pair):
    """`cause` is for pixels that diverged."""
    assert pair.cause((5, 4)) == ""


def test_what_has_several_samples_at_a_point_is_not_traced():
    """By its plan, not by its plugin's name: a replay then tells other causes."""
    scenes = Path(__file__).parents[2] / "plugins"
    assert not is_traceable(renderer.load_file(scenes / "direct_samples.xml").description)
    assert is_traceable(renderer.load_file(scenes / "envmap.xml").description)
