"""A replay beyond its limits passes if rounding explains it, and only then.

Scenes as strangers write them pass with a note; the same scenes with a defect fail. What
happens to single steps is worked by hand, on paths that stand for both renderers.
"""

from __future__ import annotations

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from stranger_scenes import STRANGERS
from test_path_comparison import PATH, with_bounce, with_light

import renderer.plugins.bsdfs.dielectric
import renderer.plugins.bsdfs.diffuse
from mitsuba_ref.mutations import rungs
from mitsuba_ref.mutations.mutation import PACKAGE
from mitsuba_ref.our_renderer import picture as our_picture
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import NO_PROOF, USUAL_LIMITS, read_proof
from mitsuba_ref.records.results import ReplayResult, SceneResult
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.errors import MitsubaCrashed
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.replay import beyond_limits, replay_scene
from mitsuba_ref.replay.beyond_limits import (
    excluded_share,
    look_at_causes,
    pixels_beyond,
    spread_evenly,
)
from mitsuba_ref.replay.paths.path_from_reference_rays import EXACT, STEPS, LedPath
from mitsuba_ref.replay.replay_comparison import compare_replay
from renderer.mitsuba_version import NEWEST, RULES
from reports.look.results import contradicted

ROOT = PACKAGE.parent

# ------------------------------------------------------------------- which are traced


def test_sixteen_without_a_defect_exclude_seventeen_percent():
    """0.83^16 = 0.05; of one pixel alone nearly nothing is excluded."""
    assert excluded_share(16) == pytest.approx(0.1707, abs=1e-4)
    assert excluded_share(1) == pytest.approx(0.95)


def test_the_sample_is_spread_evenly_and_the_same_each_time():
    """One of each of 16 strata of 100; of fewer than 16 all."""
    places = spread_evenly(1600, 16)
    assert list(places // 100) == list(range(16))
    assert (places == spread_evenly(1600, 16)).all()
    assert list(spread_evenly(5, 16)) == [0, 1, 2, 3, 4]


def test_each_pixel_is_as_likely_as_another(monkeypatch):
    """Over many seeds the 4 of 10 are drawn alike: else the bound would not hold."""
    counts = np.zeros(10)
    for seed in range(4000):
        monkeypatch.setattr(beyond_limits, "SEED", seed)
        np.add.at(counts, spread_evenly(10, 4), 1)
    # a pixel on the border of two strata may be drawn by both, and counts once
    assert counts.min() > 0.85 * 1600
    assert counts.max() < 1.1 * 1600


@pytest.mark.parametrize("sign", [1, -1], ids=["brighter", "darker"])
def test_pixels_beyond_a_limit_are_found_whichever_way_they_are_off(sign):
    """By hand: three pixels that diverge, and two that alone make the RMSE too large."""
    reference = np.tile(np.array([0.2, 0.6, 0.4], np.float32), (50, 40, 1))
    ours = reference.astype(np.float64)
    diverged = [(3, 7), (20, 1), (49, 39)]
    for channel, (row, column) in enumerate(diverged):
        ours[row, column, channel] += sign * 1e-3
    others = [(0, 5), (31, 2)]
    for channel, (row, column) in enumerate(others):
        ours[row, column, channel] += sign * 1e-4
    ours = ours.astype(np.float32)
    limits = msgspec.structs.replace(USUAL_LIMITS, rmse=1e-6)
    result = compare_replay(ours, reference, limits)
    found = list(pixels_beyond(result, ours, reference, limits))
    assert [beyond.places.tolist() for beyond in found] == [
        [list(place) for place in sorted(diverged)],
        [list(place) for place in sorted(others)],
    ]
    np.testing.assert_allclose(found[0].scale, 0.6, rtol=1e-6)  # the brightest channel
    np.testing.assert_allclose(found[1].scale, 0.4, rtol=1e-6)  # the mean


# ---------------------------------------------------------------------- single steps


def finding(ours, moved=None, size=0.0, alone=None):
    """Compare ours with PATH; a move of a ray's start by `size` or more makes `moved`."""

    def trace_led(moves):
        for move in moves:
            far = move is not None and math.hypot(*move.start) > 0.99 * size
            yield moved if far and moved is not None else ours

    return LedPath(PATH, trace_led, lambda *ray: alone).examine()


def test_steps_that_all_agree_are_amplified_rounding():
    """From the same rays nothing differs, so what does has grown on the way."""
    found = finding(PATH)
    assert found.within_rounding
    assert found.sentence.startswith("Amplified rounding")


@pytest.mark.parametrize(("error", "passes"), [(0.9 * EXACT, True), (3.0 * EXACT, False)])
def test_a_value_may_differ_by_a_few_roundings(error, passes):
    """Beyond them it needs a move of the ray that changes it by as much."""
    (light,) = PATH.bounces[0].lights
    weight = tuple(c * (1.0 + error) for c in light.weight)
    found = finding(with_light(0, weight=weight, carried=(0.2 * (1 + error), 0.15, 0.1)))
    assert found.within_rounding == passes
    assert passes or "light weight at bounce 0" in found.sentence


def test_a_value_that_a_tiny_move_changes_as_much_is_within_rounding():
    """The largest coordinate is 2: a move by 4e-7 of it changes the throughput more."""
    ours = with_bounce(1, throughput=(0.50001, 0.4, 0.3))
    moved = with_bounce(1, throughput=(0.50003, 0.4, 0.3))
    assert not finding(ours).within_rounding
    found = finding(ours, moved, 2.0 * STEPS[-1])
    assert (found.within_rounding, found.step) == (True, STEPS[-1])


@pytest.mark.parametrize(("short", "passes"), [(0.02, True), (0.2, False)])
def test_beyond_a_jump_lies_the_other_value_but_for_rounding(short, passes):
    """A bump map's slope jumps at a texel's edge; moved across it, ours is theirs."""
    x, *rest = PATH.bounces[1].throughput
    ours = with_bounce(1, throughput=(1.1 * x, *rest))
    moved = with_bounce(1, throughput=((1.0 + 0.1 * short) * x, *rest))
    assert finding(ours, moved, 2.0 * STEPS[0]).within_rounding == passes


@pytest.mark.parametrize(
    ("pdf", "off", "passes"),
    [(0.5, 1.5e-5, True), (0.5, 3e-5, False), (0.0, 1.5e-5, False), (0.0, 1e-6, True)],
)
def test_a_rough_surface_may_choose_a_direction_less_exactly_than_a_mirror(
    pdf, off, passes, monkeypatch
):
    """A direction with a density is made of a half vector; a mirror's is not."""
    scattered = PATH.bounces[0].scattered
    theirs = replace(scattered, pdf=pdf)
    x, y, z = scattered.direction
    ours = replace(theirs, direction=(x + off, y, z))
    monkeypatch.setitem(globals(), "PATH", with_bounce(0, scattered=theirs))
    assert finding(with_bounce(0, scattered=ours)).within_rounding == passes


@pytest.mark.parametrize("emitted", [0.0, 0.1])
def test_a_density_counts_only_where_it_weighs_a_lamp(emitted, monkeypatch):
    """Elsewhere it is unused; what the direction carries is another quantity."""
    theirs = with_bounce(1, emitted=(emitted, 0.0, 0.0))
    monkeypatch.setitem(globals(), "PATH", theirs)
    other = replace(PATH.bounces[0].scattered, pdf=2.0 * PATH.bounces[0].scattered.pdf)
    assert finding(with_bounce(0, scattered=other)).within_rounding == (emitted == 0.0)


@pytest.mark.parametrize(("size", "passes"), [(2.0 * STEPS[0], True), (1e-4, False)])
def test_a_shadow_is_rounding_only_where_a_tiny_move_flips_it(size, passes):
    """1e-4 is two hundred times what rounding may do there."""
    found = finding(with_light(1, blocked=False), PATH, size)
    assert found.within_rounding == passes


def test_two_surfaces_in_one_point_may_be_hit_in_either_order():
    """No move flips it; but alone in the world, ours hits Mitsuba's shape right there."""
    ours, there = with_bounce(1, shape=4), PATH.bounces[1]
    assert not finding(ours).within_rounding
    assert finding(ours, alone=there).within_rounding
    elsewhere = replace(there, position=(1.0, 2.0, 1.5001))
    assert not finding(ours, alone=elsewhere).within_rounding
    assert not finding(ours, alone=replace(there, face=8)).within_rounding
    # 4e-6 along a ray nearly parallel to the surface are 4e-7 across it
    slanted = with_bounce(1, shape=4, normal=(0.995, 0.0, 0.1))
    farther = replace(
        there, position=(1.0, 2.0, 1.500004), normal=slanted.bounces[1].normal
    )
    assert not finding(ours, alone=replace(farther, normal=None)).within_rounding
    assert finding(slanted, alone=farther).within_rounding
    facing = replace(farther, normal=(0.0, 0.0, 1.0))
    assert not finding(slanted, alone=facing).within_rounding
    elsewhere = replace(elsewhere, normal=farther.normal)
    assert not finding(slanted, alone=elsewhere).within_rounding


def test_other_random_numbers_are_never_rounding():
    """However little they differ."""
    numbers = PATH.bounces[1].numbers | {"bsdf": 0.30001}
    found = finding(with_bounce(1, numbers=numbers), PATH, 0.0)
    assert not found.within_rounding
    assert "random: bsdf" in found.sentence


# ---------------------------------------------------------------- scenes of strangers


@pytest.fixture(scope="module")
def replayed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("strangers")
    scenes = {name: make(folder) for name, make in STRANGERS.items()}
    with MitsubaWorker(time_limit=120.0) as worker:
        references = ReferenceCache(worker.render)

        def replay(name, spp=1, limits=NO_PROOF.replay, causes=0):
            request = scene_request(scenes[name], NO_PROOF, Options(threads=2))
            one = replay_scene.replay_scene(
                request, spp, render_ours, references, limits, causes
            )
            return one[0]

        yield replay


@pytest.mark.parametrize("name", ["coincident-rectangles", "thin-triangles-far-away"])
def test_a_scene_of_a_stranger_passes_with_a_note(replayed, name):
    """It fails by the strict limits; the note says of how many the causes were seen."""
    assert not replayed(name, limits=USUAL_LIMITS).passed
    result = replayed(name)
    assert result.passed, result.sentence
    assert result.traced >= 16
    assert result.unexplained == 0
    assert "16, spread evenly, were traced, and rounding explains each" in result.sentence
    assert "95 % confidence less than 17 %" in result.sentence


def test_a_bright_lamp_in_the_picture_passes(replayed):
    """Relative to the mean alone its RMSE was 5e-3; its pixels are traced, all of them."""
    result = replayed("bright-lamp-seen")
    assert result.passed, result.sentence
    assert result.divergent == 0
    assert result.rmse < 1e-3


@pytest.mark.slow
def test_nested_glass_passes_with_a_note(replayed):
    """Up to 50 bounces on 21 balls: what differs has grown, and no step does."""
    result = replayed("nested-glass", 16)
    assert result.passed, result.sentence
    assert result.traced >= 16


def brighter(texture, factor):
    """Return a plain colour times a factor."""
    return replace(texture, rgb=tuple(factor * c for c in texture.rgb))


def defect(monkeypatch, kind, size):
    """Inject a defect of a relative size into our side of this process."""
    if kind == "offset":
        rules = NEWEST._replace(ray_epsilon=NEWEST.ray_epsilon * (1.0 + size))
        monkeypatch.setitem(RULES, NEWEST.version, rules)
        return
    module, name = {
        "albedo": (renderer.plugins.bsdfs.diffuse, "read_texture"),
        "index": (renderer.plugins.bsdfs.dielectric, "read_relative_index"),
    }[kind]
    sound = getattr(module, name)

    def wrong(*given, **named):
        value = sound(*given, **named)
        if kind == "index":
            return value * (1.0 + size)
        return brighter(value, 1.0 + size) if hasattr(value, "rgb") else value

    monkeypatch.setattr(module, name, wrong)


@pytest.mark.parametrize(
    ("kind", "size", "named"),
    [
        ("albedo", 3e-5, "throughput after"),
        ("albedo", 1e-3, "throughput after"),
        ("offset", 0.1, "origin"),
        ("offset", -0.9, "origin"),
    ],
)
def test_a_defect_does_not_pass_as_rounding(replayed, monkeypatch, kind, size, named):
    """On a scene that passes with a note when nothing is wrong."""
    defect(monkeypatch, kind, size)
    result = replayed("thin-triangles-far-away")
    assert not result.passed
    assert result.unexplained > result.traced // 4
    assert "NOT explained by rounding, as pixel " in result.sentence
    assert named in result.sentence


@pytest.mark.parametrize("size", [4e-4, 9e-4, 3e-3])
def test_causes_name_a_defect_that_the_verdict_names(replayed, monkeypatch, size):
    """Below 1e-3 they said "below the tolerance" next to a verdict that named the cause."""
    defect(monkeypatch, "albedo", size)
    result = replayed("thin-triangles-far-away", causes=3)
    (verdict, *_) = result.partings
    causes = [pixel for pixel in result.listed[:3] if pixel.cause]
    assert len(causes) == 3
    # one and the same defect, with the same limit, in every check
    steps = {pixel.parting for pixel in causes if not pixel.parting.within_rounding}
    assert steps
    assert {step.limit for step in steps} == {verdict.limit} == {EXACT}
    assert {step.quantity for step in steps} <= {"throughput after", "unblocked light"}
    assert all("tolerance" not in pixel.cause for pixel in causes)
    assert all(step.error == pytest.approx(size, rel=0.5) for step in steps)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-5, 1e-3])
def test_a_slightly_wrong_index_of_refraction_does_not_pass(replayed, monkeypatch, size):
    """Where glass amplifies every rounding, each single step still shows it."""
    defect(monkeypatch, "index", size)
    result = replayed("nested-glass", 16)
    assert not result.passed
    assert result.unexplained > result.traced // 2


def test_a_picture_that_the_paths_do_not_add_up_to_is_not_explained(replayed, monkeypatch):
    """What a defect adds after the paths, on the film, no trace can explain."""

    def brighter_film(request):
        picture = our_picture.render_ours(request)
        picture.pixels[20:22] *= np.float32(1.01)
        return picture

    monkeypatch.setitem(globals(), "render_ours", brighter_film)
    result = replayed("coincident-rectangles")
    assert not result.passed
    assert "do not add up to our picture" in result.sentence


# ------------------------------------------------------------- where limits stay limits


def test_all_scenes_of_the_project_keep_strict_limits():
    """Those of the demo, of the mutations and of the plugins' tests."""
    scenes = [
        *(ROOT / "scenes").glob("*/scene.xml"),
        *(ROOT / "mitsuba_ref" / "mutations" / "scenes").glob("*/scene.xml"),
    ]
    assert len(scenes) > 25
    assert all(read_proof(scene).replay.traced == 0 for scene in scenes)
    assert USUAL_LIMITS.traced == 0


def test_a_mutant_is_judged_by_strict_limits_whatever_the_scene_asks(tmp_path, monkeypatch):
    """The matrix must not take a defect for rounding."""
    asked = []

    def note(request, spp, ours, references, limits):
        asked.append(limits.traced)
        return (ReplayResult(passed=True, verdict="pass", sentence=""),)

    (tmp_path / "proof.toml").write_text(
        'title = ""\nshows = ""\n'
        "demo = {width = 8, height = 8, spp = 1}\ntest = {width = 8, height = 8, spp = 1}\n"
        '[replay]\ntraced = 16\nreason = "asked for"\n'
    )
    monkeypatch.setattr(rungs, "replay_scene", note)
    assert read_proof(tmp_path / "scene.xml").replay.traced == 16
    rungs.replay(tmp_path / "scene.xml", rungs.CountedRender(render_ours), None)
    assert asked == [0, 0]


def failed():
    """A replay of grey pictures in which 20 of 400 pixels diverged."""
    reference = np.full((20, 20, 3), 0.5, np.float32)
    ours = reference.copy()
    ours[0] *= 1.01
    return compare_replay(ours, reference), ours, reference


def test_a_scene_that_cannot_be_traced_fails_as_before(monkeypatch):
    """Mitsuba ends while it traces: still a verdict on the pictures, not on Mitsuba."""

    def no_trace(*given):
        raise MitsubaCrashed("it is gone")

    monkeypatch.setattr(beyond_limits, "TracedPair", no_trace)
    result, ours, reference = failed()
    seen = look_at_causes(result, ours, reference, None, NO_PROOF.replay)
    assert (seen.passed, seen.verdict) == (False, "fail")
    assert seen.sentence.endswith("causes not traced: it is gone")


def test_the_report_believes_a_pass_beyond_the_limits_only_with_its_traces():
    """A file that says pass, and has no trace or one that explains nothing, fails."""
    result, *_ = failed()
    said = replace(result, passed=True, verdict="pass")

    def verdict(**fields):
        scene = SceneResult(name="x", verdict="pass", replay=(replace(said, **fields),))
        return contradicted(scene).verdict

    assert verdict(traced=16) == "pass"
    assert verdict() == "fail"
    assert verdict(traced=16, unexplained=1) == "fail"


def test_limits_of_a_file_are_checked():
    """A share of pixels to trace is a number of them, not below 0."""
    limits = type(USUAL_LIMITS)
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert({"traced": -1, "reason": ""}, limits)
