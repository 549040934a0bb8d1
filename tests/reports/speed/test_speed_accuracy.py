"""Speed against accuracy: the arithmetic by hand, the truth, what measures, the page."""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from closed_room import CLOSED_ROOM
from drawn_charts import figures, guides, points
from speed_accuracy_sample import OURS, PEER, box, noisy, room, still, table

import renderer
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.timed_mitsuba import TimedRender
from renderer.errors import SceneError
from renderer.scene_file import read_file
from renderer.scene_file.description import Mesh
from renderer.simple.materials import Material
from reports.bench import runner
from reports.bench.intervals import around, degrees_of_sum, mean_interval, mean_of_ratios
from reports.bench.rows import Row
from reports.bench.runner import Request, run_study
from reports.bench.store import Store
from reports.bench.study import find_study
from reports.errors import ReportError
from reports.look.formatting import number
from reports.pages.speed_accuracy_page import (
    BEST,
    efficiencies,
    noisy_scenes,
    speed_accuracy_page,
)
from reports.studies import speed_accuracy as study
from reports.trials import noiseless, timed_renderers
from reports.trials.architecture_scenes import ARCHITECTURE, architecture_scene
from reports.trials.large_meshes import LARGE, written
from reports.trials.noiseless import different, distance, has_noise, some_pixels
from reports.trials.plain_scenes import write_plain_scene
from reports.trials.references import SEED, kept
from reports.trials.timed_renderers import RAY_OFFSET, Settings, other_renderers
from reports.trials.truth import true_pixels

SCENES = Path(__file__).parents[3] / "scenes"
STUDY = find_study("speed-accuracy")

# ------------------------------------------------------------------ intervals and summary


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
    best, independent, sobol = efficiencies(noisy_scenes(table()))
    assert (best.name, best.scenes, best.ahead) == (BEST, 2, 1)
    # box: 1 / (0.5 x 0.25) and 1 / (0.5 x 0.5); room: 1 / 1 and 1 / 0.5
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
        ratios = [math.exp(values.mean()), *[1.0] * 8]
        ends = [around(r, e, 4) for r, e in zip(ratios, errors, strict=True)]
        low, high = mean_of_ratios(ratios, ends, [4] * 9)[1]
        held += low <= 1.0 <= high
    assert held / 4000 == pytest.approx(0.95, abs=0.014)


def test_our_best_is_not_chosen_by_the_pictures_of_its_ratio():
    """The luckiest with most samples is not; it is where there are no other pictures."""
    lucky, steady, peer = f"{OURS}, sobol", f"{OURS}, independent", f"{PEER}, independent"
    errors = {lucky: [[1.0] * 2, [0.01] * 2], steady: [[0.1] * 2, [1.0] * 2]}
    errors[peer] = [[1.0] * 2] * 2
    seconds = {name: [[1.0] * 2] * 2 for name in errors}
    facts = [row for row in box() if not row.contender]

    def best(errors, counts):
        rows = list(study.rows_of("box", counts, errors, seconds))
        return noisy_scenes(table([*facts, *rows]))[0].best.name

    assert best(errors, (4, 16)) == steady
    assert best({name: steps[1:] for name, steps in errors.items()}, (16,)) == lucky


def test_scenes_that_no_peer_can_draw_are_in_no_mean():
    alone = noisy("alone", {f"{OURS}, independent": (1.0, 1.0)})
    assert efficiencies(noisy_scenes(table(alone))) == []
    both = efficiencies(noisy_scenes(table(alone, box(), room())))
    assert both == efficiencies(noisy_scenes(table(box(), room())))
    assert "alone" in speed_accuracy_page("speed-accuracy", STUDY, table(alone))


# ------------------------------------------------------------------------- the kept record


@pytest.fixture(scope="module")
def kept_table(tmp_path_factory):
    return Store(tmp_path_factory.mktemp("nothing")).read("speed-accuracy")


def test_the_kept_rows_have_the_numbers_of_their_page(kept_table):
    """Written down from docs/performance.md when they were measured."""
    assert len(kept_table.distinct("case")) == 32
    rows = {row.name: row for row in efficiencies(noisy_scenes(kept_table))}
    found = {
        name: (number(row.mean), *map(number, row.interval), number(row.worst), row.ahead)
        for name, row in rows.items()
    }
    assert found[BEST] == ("5.78", "5.59", "5.97", "2.37", 25)
    assert found["independent"] == ("3.11", "3", "3.23", "0.567", 21)
    assert found["sobol"] == ("5.84", "5.66", "6.02", "2.37", 25)
    teapot = kept_table.where(case="appel-teapot")
    assert len(teapot.where(quantity="seconds")) == 37
    assert len(kept_table.where(case="measured-ball", quantity="unavailable")) == 4


# ------------------------------------------------------------------------------- the page


@pytest.fixture
def page():
    return speed_accuracy_page("speed-accuracy", STUDY, table())


def test_the_first_chart_ranks_all_scenes_with_the_best_peer(page):
    first = figures(page)[0]
    (trace,) = first["data"]
    assert trace["y"] == ["box", "room"] and trace["x"] == pytest.approx([2.0, 0.5])
    assert trace["name"] == f"best peer: {PEER}"
    assert f"as {PEER}, multijitter" in trace["hovertext"][0]
    assert first["layout"]["xaxis"]["tickformat"] == "~g"  # 0.1, not a power


def test_a_chart_shows_few_lines_and_hides_the_others():
    """Our best, our default, the best of each peer; colour is the program."""
    names = [f"{OURS}, {s}" for s in ("sobol", "multijitter", "independent", "stratified")]
    names += [
        f"{p}, {s}"
        for p in (PEER, "mitsuba llvm_ad_rgb", "cycles", "luxcore")
        for s in "ab"
    ]
    rows = noisy("box", {name: (1.0, 1.0 + k) for k, name in enumerate(names)})
    chart = figures(speed_accuracy_page("speed-accuracy", STUDY, table(rows)))[1]
    traces = [one for one in chart["data"] if one not in guides(chart)]
    shown = [one["name"] for one in traces if one["visible"] is True]
    assert shown == [names[0], names[2], names[4], names[6], names[8]]
    assert {one["visible"] for one in traces} == {True, "legendonly"}
    assert len({(t["marker"]["color"], t["marker"]["symbol"]) for t in traces}) == 12
    marks = [
        (t["marker"]["symbol"], t["line"]["dash"]) for t in traces if t["visible"] is True
    ]
    assert len(set(marks)) == 5  # told apart without colour


def test_bars_are_the_intervals(page):
    """Two errors 10 % around the mean: 3.563 times it with one degree of freedom."""
    chart = figures(page)[1]
    (sobol,) = [one for one in chart["data"] if one.get("name") == f"{OURS}, sobol"]
    assert points(sobol) == [(1.0, 0.125), (4.0, 0.03125)]
    bars = sobol["error_y"]
    assert 0.125 + bars["array"][0] == pytest.approx(0.125 * 3.563, rel=1e-3)
    assert sobol["error_x"]["array"] == [0.0, 0.0]


def test_the_absent_are_one_folded_list_at_the_end(page):
    main = page[page.index("<main") : page.index("</main")]
    assert 'class="banner fail"' not in page and "banner error" not in page
    last = main[main.rindex("<details") :]
    assert "could not take part, and why (1)" in last and "no &lt;LLVM&gt;" in last
    assert "in box, room" in last and "no &lt;LLVM&gt;" not in page[: page.index("<main")]


def test_a_structure_with_another_picture_is_a_fault_on_top():
    fault = Row(case="teapot", contender="grid", quantity="fault", value="a <hole>")
    text = speed_accuracy_page("speed-accuracy", STUDY, table([*still(), fault]))
    assert "teapot, grid: a &lt;hole&gt;" in text[: text.index("<main")]


def test_an_exact_picture_has_a_place_on_a_logarithmic_axis(page):
    assert any(points(trace) == [(0.1, 1e-9)] for trace in figures(page)[3]["data"])


def test_the_page_loads_nothing(page):
    assert "http" not in page.split('id="plotly"')[0].replace("http-equiv", "")


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
    tight, mitsuba = "lightproof direct, offset tight", "lightproof direct, offset mitsuba"
    pictures = {
        f"{tight}, brute": same,
        f"{tight}, wide": same.copy(),
        f"{tight}, grid": other,
    }
    pictures |= {f"{mitsuba}, brute": other, "mitsuba scalar_rgb": other}
    families = {tight: same, mitsuba: other, "mitsuba scalar_rgb": other}
    assert different(pictures, families) == [f"{tight}, grid"]


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


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """Measure a case with options; return faults and rows."""
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "cache"))
    values = {"created": "2026", "commit": "abc", "command": "c", "machine": {}}
    monkeypatch.setattr(runner, "circumstances", lambda *_: {**values, "versions": {}})
    store = Store(tmp_path / "data", tmp_path / "measured")
    path = tmp_path / "room.xml"
    path.write_text(CLOSED_ROOM)
    monkeypatch.setattr(study, "OTHERS", ())

    def run(case=str(path), **options):
        usual = {"spp": "5", "reference": "16", "seeds": "2", "side": "8"}
        request = Request(
            store, ["x"], again=True, cases=[case], options=usual | options, folder=tmp_path
        )
        faults = run_study("speed-accuracy", STUDY, request, lambda stage: None)
        return faults, store.read("speed-accuracy")

    return run


def test_a_small_room_from_end_to_end(measured, monkeypatch, tmp_path):
    """Errors are of one size with Mitsuba's; a file that is not there is one line."""
    monkeypatch.setattr(study, "VARIANTS", ("scalar_rgb",))
    monkeypatch.setattr(timed_renderers, "THEIR_SAMPLERS", ("independent", "multijitter"))
    faults, rows = measured(spp="16", reference="64", samplers="independent")
    assert faults == []
    of = {r.contender: r.value for r in rows.where(quantity="relative MSE")}
    theirs = of[f"{PEER}, independent"]
    assert 0.5 < of[f"{OURS}, independent"] / theirs < 2.0
    assert of[f"{PEER}, multijitter"] < theirs
    facts = {r.quantity: r.value for r in rows if not r.contender}
    assert facts["size"] == "8 x 8"
    assert 0.0 < facts["relative MSE of the reference"] < theirs
    assert facts["reference"] == f"64 samples of {PEER}, multijitter, in 8 pictures"
    (picture,) = rows.where(quantity="picture")
    assert (tmp_path / picture.value).is_file()
    with pytest.raises(ReportError, match=r"none\.xml': no such file; names of scenes are"):
        measured("none.xml")


def test_a_still_scene_from_end_to_end(measured, monkeypatch):
    """Each structure, each offset; all structures draw one picture."""
    monkeypatch.setattr(noiseless, "VARIANTS", ())
    monkeypatch.setattr(noiseless, "ACCELERATORS", ("brute", "bvh"))
    monkeypatch.setattr(noiseless, "PIXELS", 60)
    faults, rows = measured("whitted-spheres", side="16")
    assert faults == []
    timed = {row.contender for row in rows.where(quantity="seconds")}
    wanted = {
        f"lightproof whitted, offset {o}, {s}"
        for o in ("tight", "mitsuba")
        for s in ("brute", "bvh")
    }
    assert wanted <= timed
    assert min(row.value for row in rows.where(quantity="error")) < 1e-3


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
        if spp != timed_renderers.CHECK_SPP and 0 < seed < SEED:
            picture[0, 0] *= self.value_at_last
        np.save(keep, picture)
        return TimedRender(0.1, (1.0, 1.0, 1.0))


def noisy_picture(seed, spp):
    return np.random.default_rng((seed, spp)).normal(1.0, 0.01, (4, 4, 3))


@pytest.fixture
def fake(measured, monkeypatch):
    """Measure with two variants and our samplers, all made up."""

    def ours(scene, threads, sampler, ray_offset, integrator=""):
        assert ray_offset == "mitsuba"  # the reference is Mitsuba's
        brighter = 0.5 * (FakeMitsuba.shift == ("ours", sampler))
        return lambda seed, spp: (0.1, noisy_picture(seed + 50, spp) + brighter)

    monkeypatch.setattr(timed_renderers, "TimedMitsuba", FakeMitsuba)
    monkeypatch.setattr(timed_renderers, "of_ours", ours)
    monkeypatch.setattr(study, "has_noise", lambda *_, **__: True)

    def run(options=None, **deeds):
        for name, value in deeds.items():
            monkeypatch.setattr(FakeMitsuba, name, value)
        found = measured(**(options or {}))
        assert FakeMitsuba.open_now == 0
        return found

    return run


def absent(rows):
    return {row.contender: row.value for row in rows.where(quantity="unavailable")}


def test_a_variant_that_lacks_one_sampler_is_left_out(fake):
    """As a whole; and the reference's samples are those taken."""
    faults, rows = fake(broken=("llvm_ad_rgb", "multijitter"))
    assert faults == [] and absent(rows) == {"mitsuba llvm_ad_rgb": "not today"}
    # 8 pictures of 2 samples each
    assert rows.value(quantity="reference").startswith(f"16 samples of {PEER}, multijitter")
    # of 5 samples Mitsuba's `multijitter` makes 2 x 3 cells
    assert {row.at for row in rows.where(contender=f"{PEER}, multijitter")} == {6.0, None}


def test_nothing_is_timed_if_our_mean_is_another(fake):
    (fault,), rows = fake(shift=("ours", "sobol"))
    assert "nothing was timed" in fault and "sobol" in fault
    assert not rows.where(quantity="seconds")


def test_the_reference_is_of_another_sampler_if_the_mean_of_the_usual_one_is(fake):
    _, rows = fake(shift=("llvm_ad_rgb", "multijitter"))
    ((who, _),) = absent(rows).items()
    assert who == "mitsuba llvm_ad_rgb, multijitter"
    assert "mitsuba llvm_ad_rgb, independent" in rows.value(quantity="reference")


def test_no_peer_is_timed_whose_mean_is_another(fake):
    """It is named, with its means; the others are timed."""
    _, rows = fake(shift=("scalar_rgb", "stratified"))
    ((who, why),) = absent(rows).items()
    assert who == f"{PEER}, stratified" and "standard errors apart" in why
    assert not rows.where(contender=who, quantity="seconds")
    assert rows.where(contender=f"{PEER}, independent", quantity="seconds")


def test_a_sampler_with_holes_in_its_pictures_is_left_out(fake):
    """And the whole variant, if it is one that others are judged by."""
    _, rows = fake(holes=("scalar_rgb", "ldsampler"))
    assert list(absent(rows)) == [f"{PEER}, ldsampler"]
    _, rows = fake(holes=("llvm_ad_rgb", "independent"))
    assert "not finite" in absent(rows)["mitsuba llvm_ad_rgb"]


def test_a_picture_with_a_nan_ends_it(fake):
    (fault,), _ = fake(value_at_last=math.nan)
    assert "seed 1: 3 of 48 values of the picture are not finite" in fault


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"spp": "4,0"}, "spp: expected 1 or more, found '4,0'"),
        ({"seeds": "1"}, "seeds: expected 2 or more"),
        ({"threads": "x"}, "threads: expected 2 or more, found 'x'"),
        ({"samplers": "x"}, "samplers: 'x' is none of independent"),
    ],
)
def test_a_wrong_option_is_one_line(fake, options, told):
    (fault,), _ = fake(options)
    assert told in fault


def test_pictures_have_the_side_that_is_wanted():
    """A crop window keeps the size of its file."""
    size = study.parameters_of(SCENES / "analytic-shapes" / "scene.xml", Settings().side)
    assert size == {"width": "320", "height": "213"}
    assert study.parameters_of(SCENES / "cropped-film" / "scene.xml", 320) == {}


# ------------------------------------------------------------------------ generated scenes


def test_mitsubas_ray_offset_lets_light_in_where_shadows_begin():
    """With the same random numbers it adds some in few pixels, and takes none away.

    More than noise leaves of the mean, so that comparisons use it on both sides.
    """
    with written(["ball-and-sun"], frequency=32) as (path,):
        scene = renderer.load_file(path, width="96", height="54")
    tight, theirs = (
        renderer.render(scene, 64, 1, 1, sampler="sobol", ray_offset=rule).pixels
        for rule in ("tight", RAY_OFFSET)
    )
    added = theirs.astype(float) - tight
    assert added.min() >= 0.0
    assert 5e-5 < added.sum() / tight.sum(dtype=float) < 3e-4  # 1.3e-4
    assert np.mean(added > 0.0) < 0.02


def test_a_large_scene_is_what_was_asked_for():
    """Of 80 triangles here: a directional light; a lamp and a floor, five bounces."""
    with written(list(LARGE), frequency=2) as paths:
        scenes = [renderer.load_file(path) for path in paths]
    assert not any(path.exists() for path in paths)
    sun, lamp = (scene.description for scene in scenes)
    for one in (sun, lamp):
        assert len(one.shapes[0].faces) == 80
        assert (one.camera.film.width, one.camera.film.height) == (1280, 720)
    assert [one.integrator.max_depth for one in (sun, lamp)] == [2, 6]
    assert (len(sun.shapes), len(sun.emitters)) == (1, 1)
    assert [shape.radiance is not None for shape in lamp.shapes] == [False, False, True]


@pytest.mark.parametrize("name", ARCHITECTURE)
def test_a_scene_of_architecture_size_is_the_same_each_time(name, tmp_path, monkeypatch):
    """It has many triangles, lamps or a sky, and a texture."""
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "one"))
    path = architecture_scene(name)
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path / "other"))
    for file in sorted(path.parent.iterdir()):
        other = architecture_scene(name).parent / file.name
        assert other.read_bytes() == file.read_bytes(), file.name
    description = read_file(path)
    meshes = [shape for shape in description.shapes if isinstance(shape, Mesh)]
    assert 100_000 <= sum(len(mesh.faces) for mesh in meshes) <= 2_000_000
    lamps = sum(shape.radiance is not None for shape in description.shapes)
    assert lamps >= {"kitchen": 3, "conservatory": 0, "gallery": 38}.get(name, 40)
    assert bool(description.emitters) == (name in ("street", "kitchen", "conservatory"))
    assert 'type="bitmap"' in path.read_text()
    assert all(mesh.uvs is not None for mesh in meshes)


# -------------------------------------------------------------------------- other programs


def test_a_program_that_is_not_installed_is_one_sentence(tmp_path, monkeypatch):
    """Where its package is missing, and where its Python is."""
    path = SCENES / "cornell-box" / "scene.xml"
    scene = renderer.load_file(path, width="4", height="4")

    def why():
        with ExitStack() as stack:
            found, absent = other_renderers(stack, "cycles", scene, Settings(), tmp_path)
        assert found == {}
        return absent["cycles"]

    monkeypatch.setenv("LIGHTPROOF_CYCLES_PYTHON", sys.executable)
    if importlib.util.find_spec("bpy") is None:
        told = (
            "bpy is not installed; LIGHTPROOF_CYCLES_PYTHON may name a Python that has it"
        )
        assert why() == told
    monkeypatch.setenv("LIGHTPROOF_CYCLES_PYTHON", str(tmp_path / "python"))
    assert why().endswith("which is no program")


def plain(path, folder, **parameters):
    write_plain_scene(read_file(path, **parameters), folder)
    return json.loads((folder / "scene.json").read_text()), np.load(folder / "arrays.npz")


def test_a_plain_scene_has_all_that_the_file_has(tmp_path):
    """The Cornell box: triangles face inwards as the file's normals do, one lamp shines."""
    content, arrays = plain(
        SCENES / "cornell-box" / "scene.xml", tmp_path, width="8", height="6"
    )
    assert (content["width"], content["height"], content["max_depth"]) == (8, 6, 8)
    shining = [k for k, m in enumerate(content["materials"]) if m["radiance"]]
    assert len(shining) == 1
    a, b, c = arrays[f"vertices{shining[0]}"][arrays[f"faces{shining[0]}"][0]]
    normal = np.cross(b - a, c - a)
    description = read_file(SCENES / "cornell-box" / "scene.xml")
    (lamp,) = [shape for shape in description.shapes if shape.radiance]
    assert normal @ lamp.to_world[:3, 2] > 0.0
    triangles = sum(len(arrays[name]) for name in arrays.files if name.startswith("faces"))
    assert triangles == 2 * 6 + 2 * 12  # five walls, the lamp, two boxes


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("textured-room", "the film filter 'tent'"),
        ("metals", "the BSDF '"),
        ("colour-bleeding", "a light of type DirectionalLight"),
        ("instances", "instances"),
        ("emitters", "the integrator 'direct'"),
    ],
)
def test_a_scene_that_is_not_plain_is_refused(name, told, tmp_path):
    with pytest.raises(SceneError, match=f"does not translate {told}"):
        plain(SCENES / name / "scene.xml", tmp_path)
