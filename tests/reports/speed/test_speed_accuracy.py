"""Speed against accuracy: the arithmetic by hand, the truth, and what measures."""

from __future__ import annotations

import functools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from closed_room import CLOSED_ROOM
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from speed_accuracy_sample import PEER, curve, noisy, record

import renderer
from mitsuba_ref.records.proof_file import NO_PROOF, Size, read_proof
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.timed_mitsuba import TimedRender
from renderer.errors import SceneError
from renderer.scene_file import read_file
from renderer.simple.materials import Material
from reports.commands import speed_accuracy as command
from reports.speed_accuracy import contenders, noiseless
from reports.speed_accuracy import noisy as noisy_scenes
from reports.speed_accuracy.large_meshes import LARGE, written
from reports.speed_accuracy.noiseless import different, distance, has_noise, some_pixels
from reports.speed_accuracy.record import OURS
from reports.speed_accuracy.references import SEED, kept
from reports.speed_accuracy.summary import (
    BEST,
    around,
    degrees_of_sum,
    efficiencies,
    mean_interval,
    pareto_front,
    scene_ratio,
)
from reports.speed_accuracy.truth import true_pixels

SCENES = Path(__file__).parents[3] / "scenes"

# ---------------------------------------------------------------- front, intervals, summary


def test_the_front_by_hand():
    """Of two at one place the first; one that is slower and no better is not on it."""
    places = [(2.0, 1.0), (1.0, 3.0), (1.0, 4.0), (2.0, 1.0), (3.0, 1.0), (4.0, 0.5)]
    assert pareto_front(places) == [1, 0, 5]
    assert pareto_front([]) == []


@given(st.lists(st.tuples(*[st.integers(0, 9).map(float)] * 2), max_size=12))
def test_what_is_not_on_the_front_is_beaten_by_what_is(places):
    front = [places[index] for index in pareto_front(places)]
    for place in places:
        beaten = any(a <= place[0] and b <= place[1] for a, b in front)
        assert beaten or place in front
    for a, b in front:
        assert not any(x <= a and y <= b and (x, y) != (a, b) for x, y in places)
    assert front == sorted(set(front))


def test_an_interval_by_hand():
    """Two values with the mean 1: t = 12.706 with one degree of freedom, error 0.1."""
    low, high = mean_interval([0.9, 1.1])
    assert (math.log(low), math.log(high)) == pytest.approx((-1.2706, 1.2706), rel=1e-4)
    assert mean_interval([0.0, 0.0]) == (0.0, 0.0)
    assert mean_interval([2.0, 2.0]) == (2.0, 2.0)
    assert around(1.0, math.inf, 4)[1] > 1e300  # finite: JSON and charts need a number


def test_an_interval_holds_the_mean_as_often_as_it_claims():
    """Of 4000 times 5 values that scatter by 20 %, 95 % +- 1.4 % (four standard errors)."""
    values = np.random.default_rng(1).gamma(25.0, 1.0 / 25.0, (4000, 5))
    held = sum(low <= 1.0 <= high for low, high in map(mean_interval, values))
    assert held / 4000 == pytest.approx(0.95, abs=0.014)


def test_the_summary_by_hand():
    """Twice the best peer in one scene, half of it in the other: 1 on average."""
    best, independent, sobol = efficiencies(record())
    assert (best.name, best.scenes, best.ahead) == (BEST, 2, 1)
    # box: 1 / (0.5 x 0.25) beside 1 / (0.5 x 0.5); room: 1 / 1 beside 1 / 0.5
    assert best.mean == pytest.approx(1.0)
    assert (best.worst, best.worst_scene) == (pytest.approx(0.5), "room")
    # the other method of `room` is in no sampler's row
    assert independent.mean == pytest.approx(math.sqrt(0.5 * 0.5))
    assert sobol.mean == pytest.approx(math.sqrt(2.0 * 0.25))
    assert sobol.interval == pytest.approx((sobol.mean, sobol.mean))  # the same scatter


def test_degrees_of_a_sum_by_hand():
    """All together if alike, those of the largest alone; of nothing, the fewest."""
    assert degrees_of_sum([0.1] * 9, [4] * 9) == pytest.approx(36.0)
    assert degrees_of_sum([1e-9, 0.5, 1e-9], [4, 7, 4]) == pytest.approx(7.0)
    # variances 1 and 4: 25 / (1 / 4 + 16 / 2)
    assert degrees_of_sum([1.0, 2.0], [4, 2]) == pytest.approx(25.0 / 8.25)
    assert degrees_of_sum([0.0, 0.0], [4, 2]) == 2
    assert degrees_of_sum([1.0, math.inf], [4, 2]) == 2


def test_the_interval_of_many_scenes_holds_the_mean_where_one_scatters_most():
    """One scene of nine has all the scatter, five seeds: 95 % +- 1.4 % (four errors).

    With 36 degrees of freedom it would be 89 %.
    """
    logs = np.random.default_rng(2).normal(0.0, 0.3, (4000, 5))
    held = 0
    for values in logs:
        errors = [float(values.std(ddof=1)) / math.sqrt(5.0), *[1e-4] * 8]
        degrees = degrees_of_sum(errors, [4] * 9)
        low, high = around(math.exp(values.mean() / 9.0), math.hypot(*errors) / 9, degrees)
        held += low <= 1.0 <= high
    assert held / 4000 == pytest.approx(0.95, abs=0.014)


def test_our_best_is_not_chosen_by_the_pictures_of_its_ratio():
    lucky, steady = (curve(OURS, name, 1.0, 1.0) for name in ("sobol", "independent"))
    lucky.pictures[-1].errors[:] = [0.01, 0.01]
    steady.pictures[0].errors[:] = [0.1, 0.1]
    scene = noisy("box", lucky, steady, curve(PEER, "independent", 1.0, 1.0))
    assert scene.best_of_ours is steady
    del lucky.pictures[0], steady.pictures[0]
    assert scene.best_of_ours is lucky  # there are no others


def test_scenes_that_no_peer_can_draw_are_in_no_mean():
    alone = noisy("alone", curve(OURS, "independent", 1.0, 1.0))
    assert alone.best_peer is None
    assert scene_ratio(alone, alone.best_of_ours) is None
    assert efficiencies(record(noisy=[alone])) == []
    both = record(noisy=[alone, *record().noisy])
    assert efficiencies(both) == efficiencies(record())


# ------------------------------------------------------------------------------- the truth


def test_the_truth_is_what_the_kernels_draw(monkeypatch):
    """Mirror and glass, both branches of each hit, five lights: to single precision.

    What is seen through glass moves with the last digits: off by 1e-4 in a few pixels.
    """
    size = {"width": "12", "height": "9"}
    path = SCENES / "whitted-spheres" / "scene.xml"
    pixels = some_pixels(9, 12)
    truth = true_pixels(read_file(path, **size), pixels, lambda _: None)
    picture = np.asarray(renderer.render(renderer.load_file(path, **size)), np.float64)
    error, off = distance(picture[pixels[:, 0], pixels[:, 1]], truth)
    assert error < 1e-4 and off <= 1
    both = Material.branches
    for one in (0, 1):  # either branch of glass would be missed
        monkeypatch.setattr(Material, "branches", lambda at, i=one: both(at)[i::2])
        less = true_pixels(read_file(path, **size), pixels, lambda _: None)
        assert distance(less, truth)[0] > 0.1


def test_light_from_all_sides_has_no_truth():
    with pytest.raises(SceneError, match="light from all sides has noise"):
        size = {"width": "4", "height": "4"}
        scene = read_file(SCENES / "cornell-box" / "scene.xml", **size)
        true_pixels(scene, some_pixels(4, 4), lambda _: None)


def test_distance_by_hand():
    """A thousandth of the values is left out; a hole counts as a pixel that is off."""
    truth = np.ones((1000, 3))
    found = truth.copy()
    found[:500] *= 1.005
    found[7] = np.nan
    error, off = distance(found, truth)
    rest = 0.005**2 / 1.01 * 3 * 499 / 2997
    assert (error, off) == (pytest.approx(math.sqrt(rest)), 1)


def test_structures_that_differ_are_named():
    same, other = np.zeros((2, 2, 3)), np.ones((2, 2, 3))
    pictures = {
        (OURS, "direct", "brute", "tight", "own"): same,
        (OURS, "direct", "wide", "tight", "own"): same.copy(),
        (OURS, "direct", "grid", "tight", "own"): other,
        (OURS, "direct", "brute", "mitsuba", "own"): other,  # its own kind
    }
    assert different(pictures) == ["lightproof direct grid tight own"]


def test_noise_is_told_from_two_pictures(tmp_path):
    """Where no proof.toml says it."""
    path = tmp_path / "scene.xml"
    path.write_text(CLOSED_ROOM)
    assert has_noise(path, None)
    still = CLOSED_ROOM.replace('name="max_depth" value="4"', 'name="max_depth" value="2"')
    still = still.replace(
        'type="independent"><integer name="sample_count" value="$spp"/>',
        'type="stratified"><integer name="sample_count" value="1"/>'
        '<boolean name="jitter" value="false"/>',
    )
    path.write_text(still)
    assert not has_noise(path, None)
    assert has_noise(path, False) and not has_noise(path, True)


def test_what_takes_long_is_made_once(tmp_path, monkeypatch):
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path))
    file, made = tmp_path / "scene.xml", []
    file.write_text("one")

    def make():
        made.append(1)
        return np.full((2, 3), float(len(made)))

    assert kept(("a", 1, file), make)[0, 0] == kept(("a", 1, file), make)[0, 0] == 1.0
    assert kept(("a", 2, file), make)[0, 0] == 2.0
    file.write_text("two")
    assert kept(("a", 1, file), make)[0, 0] == 3.0
    entries = list((tmp_path / "speed_accuracy").glob("*.npy"))
    assert len(entries) == 3
    for entry in entries:
        entry.write_bytes(entry.read_bytes()[:90])
    assert kept(("a", 1, file), make)[0, 0] == 4.0


# ---------------------------------------------------------------------------- measurements


def measured(folder, part=True):
    name = f"speed_accuracy{'-part' if part else ''}"
    assert (folder / f"{name}.html").exists()
    return json.loads((folder / "data" / f"{name}.json").read_text())


@pytest.fixture
def room(tmp_path, monkeypatch):
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "room" / "scene.xml"
    path.parent.mkdir()
    path.write_text(CLOSED_ROOM)
    return path


def test_a_small_room_from_end_to_end(room, tmp_path, monkeypatch, capsys):
    """Errors beside Mitsuba's are of one size; a file that is not there is one line."""
    for module in (noisy_scenes, contenders):
        monkeypatch.setattr(module, "PEERS", ("scalar_rgb",))
    monkeypatch.setattr(noisy_scenes, "THEIR_SAMPLERS", ("independent", "multijitter"))
    words = ["--scene", str(room), "--spp", "16", "--seeds", "2", "--reference", "64"]
    words += ["--samplers", "independent", "--out", str(tmp_path)]
    assert command.main(words) == 0
    (scene,) = measured(tmp_path)["noisy"]
    of = {
        (c["renderer"], c["sampler"]): np.mean(c["pictures"][-1]["errors"])
        for c in scene["curves"]
    }
    theirs = of[PEER, "independent"]
    assert 0.5 < of[OURS, "independent"] / theirs < 2.0
    assert of[PEER, "multijitter"] < theirs  # it has another sampler
    assert (scene["width"], scene["height"]) == (8, 8)
    assert 0.0 < scene["reference_error"] < theirs
    assert scene["reference"].startswith(f"64 samples of {PEER} multijitter")
    assert not (tmp_path / "speed_accuracy.html").exists()  # it is one scene
    assert f"| {BEST} | 1 |" in capsys.readouterr().out
    nowhere = ["--scene", str(tmp_path / "none.xml")]
    assert command.main(nowhere) == command.WRONG_USE
    assert "no such scene file" in capsys.readouterr().err


def test_a_still_scene_from_end_to_end(tmp_path, monkeypatch):
    """Each structure, each offset; all structures draw one picture."""
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(noiseless, "PEERS", ())
    monkeypatch.setattr(noiseless, "ACCELERATORS", ("brute", "bvh"))
    monkeypatch.setattr(noiseless, "PIXELS", 60)
    proof = replace(NO_PROOF, demo=Size(16, 12, 1))
    monkeypatch.setattr(contenders, "read_proof", lambda path: proof)
    settings = contenders.Settings(seeds=2)
    path = SCENES / "whitted-spheres" / "scene.xml"
    found = noiseless.measure_noiseless(path, settings, lambda stage: None)
    ways = {(one.structure, one.ray_offset, one.numbers) for one in found.pictures}
    both = {(s, o, "own") for s in ("brute", "bvh") for o in ("tight", "mitsuba")}
    assert both <= ways
    assert (found.pixels, found.different) == (60, [])
    assert all(len(one.seconds) == 2 for one in found.pictures)
    assert min(one.error for one in found.pictures) < 1e-3


class FakeMitsuba:
    """Pictures of 1 with a little noise; what else it does is a test's."""

    broken: tuple[str, str] | None = None  # a variant's sampler that does not work
    shift: tuple[str, str] | None = None  # one whose pictures are brighter
    holes: tuple[str, str] | None = None  # one whose pictures have NaN
    value_at_last = 1.0  # of the pictures that are judged
    open_now = 0

    def __init__(self, variant, path, parameters, threads, samplers):
        self.variant = variant

    def __enter__(self):
        FakeMitsuba.open_now += 1
        return self

    def __exit__(self, *_):
        FakeMitsuba.open_now -= 1

    def render(self, seed, spp, keep, sampler):
        if (self.variant, sampler) == self.broken:
            raise MitsubaError("not today")
        picture = noisy_picture(seed, spp) + 0.5 * ((self.variant, sampler) == self.shift)
        if (self.variant, sampler) == self.holes:
            picture[1, 2] = math.nan
        # seed 0 is the warm-up's too
        if spp != contenders.CHECK_SPP and 0 < seed < SEED:
            picture[0, 0] *= self.value_at_last
        np.save(keep, picture)
        return TimedRender(0.1, (1.0, 1.0, 1.0))


def noisy_picture(seed, spp):
    return np.random.default_rng((seed, spp)).normal(1.0, 0.01, (4, 4, 3))


@pytest.fixture
def fake(room, tmp_path, monkeypatch):
    """Run the command with two variants and our samplers, all made up; give its status."""

    def ours(scene, threads, sampler, ray_offset, integrator=""):
        assert ray_offset == "mitsuba"  # the reference is Mitsuba's
        brighter = 0.5 * (FakeMitsuba.shift == ("ours", sampler))
        return lambda seed, spp: (0.1, noisy_picture(seed + 50, spp) + brighter)

    monkeypatch.setattr(noisy_scenes, "TimedMitsuba", FakeMitsuba)
    monkeypatch.setattr(noisy_scenes, "of_ours", ours)
    monkeypatch.setattr(command, "has_noise", lambda *_: True)

    def run(*words, **deeds):
        for name, value in deeds.items():
            monkeypatch.setattr(FakeMitsuba, name, value)
        given = ["--spp", "5", "--reference", "16", "--seeds", "4", *words]
        if not {"--quick", "--scene", "--from"} & set(words):
            given += ["--scene", str(room)]
        return command.main([*given, "--out", str(tmp_path)])

    return run


def test_a_variant_that_lacks_one_sampler_is_left_out(fake, tmp_path):
    """As a whole, its processes ended; and the reference's samples are those taken."""
    assert fake(broken=("llvm_ad_rgb", "multijitter")) == 0
    assert FakeMitsuba.open_now == 0
    (scene,) = measured(tmp_path)["noisy"]
    assert scene["unavailable"] == {"mitsuba llvm_ad_rgb": "not today"}
    assert {one["renderer"] for one in scene["curves"]} == {OURS, PEER}
    # 8 pictures of 2 samples each
    assert scene["reference"].startswith(f"16 samples of {PEER} multijitter")
    multijitter = [c for c in scene["curves"] if c["sampler"] == "multijitter"]
    # of 5 samples Mitsuba's `multijitter` makes 2 x 3 cells
    assert {c["pictures"][0]["spp"] for c in multijitter} == {6}


@pytest.mark.parametrize("shift", [("ours", "sobol"), ("llvm_ad_rgb", "multijitter")])
def test_nothing_is_timed_if_our_mean_or_the_reference_s_is_another(fake, capsys, shift):
    assert fake(shift=shift) == command.WRONG_USE
    error = capsys.readouterr().err
    assert "nothing was timed" in error
    assert " ".join(shift).replace("ours", OURS) in error


def test_no_peer_is_timed_whose_mean_is_another(fake, tmp_path):
    """It is named, with its means; the others are timed."""
    assert fake(shift=("scalar_rgb", "stratified")) == 0
    (scene,) = measured(tmp_path)["noisy"]
    ((who, why),) = scene["unavailable"].items()
    assert who == f"{PEER} stratified" and "standard errors apart" in why
    curves = {(one["renderer"], one["sampler"]) for one in scene["curves"]}
    assert (PEER, "stratified") not in curves and (PEER, "independent") in curves


def test_large_scenes_are_written_and_measured_with_one_peer(fake, tmp_path, monkeypatch):
    """The last that can draw it; the mesh is smaller here, and our pictures made up."""
    small = functools.partial(written, frequency=2)
    monkeypatch.setattr(command, "written", small)
    assert fake("--scene", *LARGE) == 0
    found = measured(tmp_path)["noisy"]
    assert [one["scene"] for one in found] == list(LARGE)
    for one in found:
        assert list(one["unavailable"]) == [PEER]
        assert "llvm_ad_rgb takes part" in one["unavailable"][PEER]
        assert {c["renderer"] for c in one["curves"]} == {OURS, "mitsuba llvm_ad_rgb"}
    assert fake("--scene", *LARGE, broken=("llvm_ad_rgb", "stratified")) == 0
    for one in measured(tmp_path)["noisy"]:
        assert one["unavailable"] == {"mitsuba llvm_ad_rgb": "not today"}
        assert {c["renderer"] for c in one["curves"]} == {OURS, PEER}


def test_mitsubas_ray_offset_lets_light_in_where_shadows_begin():
    """With the same random numbers it adds some in few pixels, and takes none away.

    More than noise leaves of the mean, so that comparisons use it on both sides.
    """
    with written(["ball-and-sun"], frequency=32) as (path,):
        scene = renderer.load_file(path, width="96", height="54")
    tight, theirs = (
        renderer.render(scene, 64, 1, 1, sampler="sobol", ray_offset=rule).pixels
        for rule in ("tight", noisy_scenes.RAY_OFFSET)
    )
    added = theirs.astype(float) - tight
    assert added.min() >= 0.0
    assert 5e-5 < added.sum() / tight.sum(dtype=float) < 3e-4  # 1.3e-4
    assert np.mean(added > 0.0) < 0.02


def test_a_large_scene_is_what_was_asked_for():
    """Of 80 triangles here: a directional light; a lamp and a floor, five bounces."""
    with written(list(LARGE), frequency=2) as paths:
        scenes = [renderer.load_file(path) for path in paths]
        sizes = [read_proof(path).size("test") for path in paths]
    assert not any(path.exists() for path in paths)
    sun, lamp = (scene.description for scene in scenes)
    for one in (sun, lamp):
        assert len(one.shapes[0].faces) == 80
        assert (one.camera.film.width, one.camera.film.height) == (1280, 720)
    assert [one.integrator.max_depth for one in (sun, lamp)] == [2, 6]
    assert (len(sun.shapes), len(sun.emitters)) == (1, 1)
    assert [shape.radiance is not None for shape in lamp.shapes] == [False, False, True]
    assert [size.width for size in sizes if size is not None] == [640, 640]


def test_a_sampler_with_holes_in_its_pictures_is_left_out(fake, tmp_path):
    """And the whole variant, if it is one that others are judged by."""
    assert fake(holes=("scalar_rgb", "ldsampler")) == 0
    (scene,) = measured(tmp_path)["noisy"]
    assert list(scene["unavailable"]) == [f"{PEER} ldsampler"]
    assert fake(holes=("llvm_ad_rgb", "independent")) == 0
    (scene,) = measured(tmp_path)["noisy"]
    assert "not finite" in scene["unavailable"]["mitsuba llvm_ad_rgb"]
    assert FakeMitsuba.open_now == 0


def test_a_picture_with_a_nan_ends_it(fake, capsys):
    assert fake(value_at_last=math.nan) == command.WRONG_USE
    assert "seed 1: 3 of 48 values of the picture are not finite" in capsys.readouterr().err


def test_a_short_run_never_replaces_the_whole(fake, room, tmp_path, monkeypatch):
    """Nor does one of a chosen scene, one that was interrupted, or a part drawn again."""
    monkeypatch.setattr(command, "SCENES", tmp_path)
    monkeypatch.setattr(command, "QUICK", (str(room),))
    monkeypatch.setattr(command, "LARGE", {})
    whole = ["--spp", "5", "--reference", "16", "--seeds", "2", "--out", str(tmp_path)]
    assert command.main(whole) == 0
    page, data = (tmp_path / f"speed_accuracy.{kind}" for kind in ("html", "json"))
    data = tmp_path / "data" / data.name
    before = page.read_bytes(), data.read_bytes()
    assert fake("--quick") == 0
    part = measured(tmp_path)
    assert not part["whole"] and measured(tmp_path, part=False)["whole"]
    assert fake("--from", str(tmp_path / "data" / "speed_accuracy-part.json")) == 0
    measure, calls = command.measure_noisy, []

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) > 1:
            raise KeyboardInterrupt
        return measure(*arguments)

    other = tmp_path / "a room" / "scene.xml"
    other.parent.mkdir()
    other.write_text(CLOSED_ROOM)
    monkeypatch.setattr(command, "measure_noisy", interrupted)
    assert command.main(whole) == command.INTERRUPTED
    assert (page.read_bytes(), data.read_bytes()) == before
    assert [one["scene"] for one in measured(tmp_path)["noisy"]] == ["a room"]


def test_a_scene_that_fails_leaves_the_others(fake, room, tmp_path, capsys):
    bad = tmp_path / "bad" / "scene.xml"
    bad.parent.mkdir()
    bad.write_text("<scene>")
    assert fake("--scene", str(room), str(bad)) == command.FAILED
    assert "bad: " in capsys.readouterr().err
    found = measured(tmp_path)
    assert list(found["failed"]) == ["bad"] and len(found["noisy"]) == 1


@pytest.mark.parametrize(
    ("option", "value", "told"),
    [
        ("--reference", "0", "0: must be 1 or more"),
        ("--spp", "0", "0: must be 1 or more"),
        ("--seeds", "1", "1: must be 2 or more"),
        ("--threads", "x", "'x' is no whole number"),
    ],
)
def test_no_samples_are_no_use(fake, capsys, option, value, told):
    with pytest.raises(SystemExit):
        fake(option, value)
    assert f"argument {option}: {told}" in capsys.readouterr().err
