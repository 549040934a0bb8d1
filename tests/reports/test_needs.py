"""What a scene needs: exact zeros, losses known on paper, commands within tolerance."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace

import numpy as np
import pytest

import renderer
from renderer.advice.simplifications import words_of
from renderer.command.cli import main as render_command
from renderer.errors import SceneError
from renderer.rendering.accuracy import relative_squares
from reports.needs import command
from reports.needs.claims import claims_of
from reports.needs.command import main
from reports.needs.content import content_of
from reports.needs.losses import loss_between
from reports.needs.record import Claim
from reports.needs.study import least_model, measure

# A floor under a lamp, with a wall that throws light back, and a far lamp that hardly
# counts. Diffuse rectangles, path and independent: kernels that other tests use too.
SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="5"/></integrator>
  <sensor type="perspective">
    <transform name="to_world">
      <lookat origin="0, -4, 2" target="0, 0, 0.5" up="0, 0, 1"/>
    </transform>
    <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
    <film type="hdrfilm">
      <integer name="width" value="16"/><integer name="height" value="12"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <bsdf type="diffuse" id="grey"><rgb name="reflectance" value="0.3"/></bsdf>
  <shape type="rectangle"><ref id="grey"/>
    <transform name="to_world"><scale value="2"/></transform></shape>
  <shape type="rectangle"><ref id="grey"/>
    <transform name="to_world">
      <scale value="2"/><rotate x="1" angle="90"/><translate y="1"/>
    </transform></shape>
  <shape type="rectangle" id="lamp">
    <transform name="to_world">
      <rotate x="1" angle="180"/><translate z="3"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="10"/></emitter></shape>
  <shape type="rectangle" id="far">
    <transform name="to_world">
      <rotate x="1" angle="180"/><translate z="3" x="300"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
</scene>
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return the scene's file."""
    file = tmp_path_factory.mktemp("needs") / "floor.xml"
    file.write_text(SCENE)
    return file


@pytest.fixture(scope="module")
def found(path):
    """Return what was measured, where each simplification spares a tenth of the time.

    So much by decree: what the clock says of so small pictures hangs on who else is busy.
    """
    render = renderer.render

    def in_time(scene, *arguments, **choices):
        image = render(scene, *arguments, **choices)
        return replace(image, seconds=0.9 ** len(scene.description.simplified))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(renderer, "render", in_time)
        return measure(path, spp=16, seeds=5, tolerance=0.03, timed=0.01)


def noisy(generator, mean, noise, count=6):
    """Return pictures of one mean with normal noise."""
    shape = (count, *mean.shape)
    return list((mean + noise * generator.standard_normal(shape)).astype(np.float32))


def test_the_loss_has_no_noise_in_it():
    """The difference is 5 % of every pixel, under noise of 30 % that is not shared.

    The noise alone would show as 17 %. The estimate is within 2 % of the truth, about three
    of its standard errors.
    """
    generator = np.random.default_rng(1)
    mean = np.full((48, 48, 3), 0.5)
    full, less = (noisy(generator, m, 0.15) for m in (mean, 0.95 * mean))
    loss = loss_between(full, less, mean, ["x"], "", 1.0)
    truth = np.sqrt(relative_squares(0.05 * mean, mean).mean())
    assert loss.error == pytest.approx(truth, abs=0.02)
    assert loss.error < loss.error_high < truth + 0.04
    assert abs(loss.mean + 0.05) < loss.mean_half_width < 0.02
    assert loss.shared_variance == pytest.approx(1.0, abs=0.05)


def test_the_upper_end_covers_the_loss():
    """In 200 trials; 97.5 % is meant. Fewer than 185 happen by chance once in 1e4."""
    generator = np.random.default_rng(2)
    mean = np.full((16, 16, 3), 0.5)
    truth = np.sqrt(relative_squares(0.1 * mean, mean).mean())
    covered = 0
    for _ in range(200):
        full, less = (noisy(generator, m, 0.1) for m in (mean, 0.9 * mean))
        covered += loss_between(full, less, mean, ["x"], "", 1.0).error_high >= truth
    assert covered >= 185


def test_no_loss_is_below_its_noise():
    generator = np.random.default_rng(3)
    mean = np.full((48, 48, 3), 0.5)
    full, less = (noisy(generator, mean, 0.15) for _ in range(2))
    loss = loss_between(full, less, mean, ["x"], "", 1.0)
    assert loss.error < 0.04 and loss.error < loss.error_high < 0.08
    assert loss.tiles_off == 0  # of 36, all at once: 5 % of the seeds have one or more


def test_the_same_pictures_lose_nothing():
    pictures = noisy(np.random.default_rng(4), np.ones((8, 8, 3)), 0.1)
    loss = loss_between(pictures, pictures, pictures[0], ["x"], "", 1.0)
    assert loss.exact and loss.mean == 0.0 and loss.flip == 0.0
    assert loss.shared_variance == 0.0


def test_what_the_scene_has_not_is_exactly_nothing(found):
    needs, _ = found
    assert "textures=mean" in needs.absent and "glass=straight" in needs.absent


def test_a_claim_of_the_plan_is_an_exact_zero(path, tmp_path):
    """Direct light leaves roulette out, though the file asks for it: measured, it is 0."""
    file = tmp_path / "direct.xml"
    ended = '<integer name="max_depth" value="2"/><integer name="rr_depth" value="1"/>'
    file.write_text(SCENE.replace('<integer name="max_depth" value="5"/>', ended))
    needs, study = measure(file, spp=4, seeds=3, tolerance=0.0, timed=0.01)
    assert "Russian roulette:" in renderer.render(study.scene, 1).explain
    (roulette,) = [loss for loss in needs.losses if loss.words == ["roulette=off"]]
    assert roulette.exact


def test_the_claims_of_the_plan_are_in_the_record(found):
    """Each with what leaves out the same; of what nothing is about there is no zero."""
    needs, _ = found
    words = {claim.text.partition(":")[0]: claim.words for claim in needs.claims}
    assert words["Russian roulette"] == ["roulette=off"]
    assert words["textures and uv"] == ["textures=mean"]
    (shapes,) = [w for text, w in words.items() if text.endswith("instances")]
    assert shapes == ["instances=flat"]
    (kinds,) = [w for text, w in words.items() if text.startswith("conductor")]
    assert set(kinds) >= {"glass=straight", "metal=diffuse", "caustics=off"}
    assert set().union(*words.values()) <= {*needs.absent, "roulette=off"}


def test_a_wrong_claim_of_the_plan_is_an_error(path, monkeypatch):
    """As if the plan said that the scene had no light that has an extent."""
    wrong = Claim(
        text="multiple importance sampling: no", words=["no-light=lamp"], at_its_word=False
    )
    monkeypatch.setattr("reports.needs.study.claims_of", lambda scene, spp: [wrong])
    with pytest.raises(AssertionError, match="no-light=lamp"):
        measure(path, spp=1, seeds=3, timed=0.0)


POINT = """<scene version="3.0.0">
  <integrator type="{integrator}"/>
  <sensor type="perspective"><film type="hdrfilm">
    <integer name="width" value="8"/><integer name="height" value="8"/>
    <rfilter type="box"/></film></sensor>
  <shape type="rectangle"><transform name="to_world"><translate z="3"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>{light}</scene>"""
SPOT = """<emitter type="spot"><texture type="checkerboard" name="texture"/></emitter>"""
PLAIN = """<emitter type="point"/>"""


@pytest.mark.parametrize(
    ("integrator", "light", "text"),
    [
        ("path", "", "all samples but one per pixel"),
        ("direct", PLAIN, "scattering"),
        ("depth", PLAIN, "lights, shadow rays, bounces"),
    ],
)
def test_claims_that_other_scenes_have(tmp_path, integrator, light, text):
    """Measured without an AssertionError, so that they are exact zeros."""
    file = tmp_path / "scene.xml"
    file.write_text(POINT.format(integrator=integrator, light=light))
    needs, _ = measure(file, spp=1, seeds=3, timed=0.0)
    checked = [c.text for c in needs.claims if c.words or c.at_its_word]
    assert any(one.startswith(text) for one in checked)


def test_no_claim_about_textures_where_a_light_has_one():
    """`textures=mean` changes that light, though no BSDF looks at a texture."""
    for light in (PLAIN, SPOT):
        scene = renderer.load_string(POINT.format(integrator="path", light=light))
        claimed = [claim.text for claim in claims_of(scene, 1)]
        assert any("textures" in text for text in claimed) == (light == PLAIN)


def test_losses_of_the_floor(found):
    needs, study = found
    losses = {" ".join(loss.words): loss for loss in needs.losses}
    depths = [loss.error for words, loss in losses.items() if "depth" in words]
    assert len(depths) >= 2 and depths == sorted(depths, reverse=True)
    lamp, far = losses["no-light=lamp"], losses["no-light=far"]
    assert lamp.mean == pytest.approx(-1.0, abs=0.01) and not lamp.exact
    assert far.error_high < 0.5 * lamp.error
    # BSDF samples hardly ever hit the far lamp, nor the near one
    assert losses["sampling=bsdfs"].noise > 3.0 > 1.5 > losses["sampling=lights"].noise
    assert losses["no-light=lamp"].cost < losses["sampling=bsdfs"].cost
    # the same paths up to the third segment: most of the noise is not in the difference
    assert losses["depth=3"].shared_variance < 0.2
    assert all(np.isfinite(one).all() for one in study.differences.values())


def test_the_command_is_within_the_tolerance(path, found, tmp_path, capsys):
    """Its picture beside that of the file, both of 4096 samples of other seeds."""
    needs, _ = found
    assert needs.least is not None and needs.least.error_high <= 0.03
    assert needs.least.words == ["no-light=far", "depth=3", "sampling=lights"]
    assert needs.least.time == pytest.approx(0.729)
    words = shlex.split(needs.command)
    assert words[:3] == ["python", "-m", "renderer"]
    pictures = []
    for number, arguments in enumerate((words[3:], [str(path)])):
        out = tmp_path / f"{number}.npy"
        arguments = [*arguments, "--spp", "4096", "--seed", "77", "-o", str(out)]
        assert render_command(arguments) == 0
        pictures.append(np.load(out).astype(np.float64))
    less, full = pictures
    assert np.sqrt(relative_squares(less - full, full).mean()) <= 0.03
    assert "4096 spp" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("time", "error", "kept"),
    [
        (0.5, 0.02, ["depth=2", "no-light=far"]),  # faster still, and good enough
        (0.5, 0.04, ["depth=2"]),  # each alone was good enough, both are not
        (0.9, 0.02, ["depth=2"]),  # both together take longer than the first
    ],
)
def test_a_step_stays_where_it_saves_time_within_the_tolerance(
    path, found, monkeypatch, time, error, kept
):
    _, study = found
    blank = replace(found[0].losses[0], noise=1.0)
    first, second = (
        replace(blank, words=[word], time=spent, error_high=0.01)
        for word, spent in (("depth=2", 0.6), ("no-light=far", 0.7))
    )
    both = replace(blank, words=kept, time=time, error_high=error)
    monkeypatch.setattr(study, "loss", lambda words: replace(both, words=list(words)))
    least = least_model(study, [second, first])
    assert least is not None and least.words == kept
    assert least_model(study, [replace(first, time=1.2)]) is None
    assert least_model(study, [replace(first, noise=2.0)]) is None  # 0.6 x 2 = 1.2


def test_a_word_whose_thing_is_gone_is_passed_over(path, found):
    """Without the specular lobes of all, the BSDF of one has none that has a name."""
    needs, study = found
    text = path.read_text().replace('type="diffuse"', 'type="plastic"')
    text = text.replace("reflectance", "diffuse_reflectance")
    study = replace(study, scene=renderer.load_string(text))
    blank = replace(needs.losses[0], time=0.5, error_high=0.0, noise=1.0)
    name = next(w for w in words_of(study.scene.description) if "no-specular=" in w)
    losses = [replace(blank, words=["specular=off"])]
    losses += [replace(blank, words=[name], time=0.6)]
    least = least_model(study, losses)
    assert least is not None and least.words == ["specular=off"]


def test_the_page_and_the_record(path, tmp_path, capsys):
    arguments = [
        str(path),
        "--seeds",
        "3",
        "--spp",
        "2",
        "--timed",
        "0.01",
        "--out",
        str(tmp_path),
    ]
    assert main([*arguments, "--tolerance", "200%"]) == 0
    record = json.loads((tmp_path / "data" / "needs.json").read_text())
    (needs,) = record["scenes"]
    assert needs["tolerance"] == 2.0 and needs["least"]["words"]
    page = (tmp_path / "needs.html").read_text()
    assert needs["command"] in page and page.count("<img") > len(needs["losses"])
    output = capsys.readouterr().out
    assert needs["command"] in output and "the least model" in output


@pytest.mark.parametrize(
    ("end", "status"), [(None, 0), (KeyboardInterrupt(), 130), (SceneError("x"), 1)]
)
def test_a_record_says_whether_it_is_whole(found, tmp_path, monkeypatch, end, status):
    measured = iter([found, found if end is None else None])

    def next_one(*_):
        one = next(measured)
        if one is None:
            raise end
        return one

    monkeypatch.setattr(command, "_measured", next_one)
    assert main(["a.xml", "b.xml", "--out", str(tmp_path)]) == status
    record = json.loads((tmp_path / "data" / "needs.json").read_text())
    assert record["whole"] == (end is None)
    assert len(record["scenes"]) == (2 if end is None else 1)


@pytest.fixture
def interrupted(found, path, tmp_path, monkeypatch):
    """Measure one of two scenes; return the folder and the scenes that were asked for."""
    now = {"commit": "abc", "versions": {"numpy": "2"}, "files": "as they were"}

    def circumstances(module, words):
        described = {key: now[key] for key in ("commit", "versions")}
        return {**described, "command": shlex.join(["python", "-m", module, *words])}

    monkeypatch.setattr(command, "circumstances", circumstances)
    asked = []

    def measured(scene, *_):
        asked.append(str(scene))
        if scene.name == "b.xml" and len(asked) == 2:
            raise KeyboardInterrupt
        return replace(found[0], scene=str(scene), content=now["files"]), None

    monkeypatch.setattr(command, "_measured", measured)
    monkeypatch.setattr(command, "_content", lambda *_: now["files"])
    assert main(["a.xml", "b.xml", "--out", str(tmp_path)]) == 130
    return tmp_path, asked, now


def test_a_run_goes_on_with_the_scenes_that_are_missing(interrupted, found):
    folder, asked, _ = interrupted
    assert main(["a.xml", "b.xml", "--out", str(folder), "--resume"]) == 0
    assert asked == ["a.xml", "b.xml", "b.xml"]
    record = json.loads((folder / "data" / "needs.json").read_text())
    assert record["whole"] and [one["scene"] for one in record["scenes"]] == asked[:2]
    page = (folder / "needs.html").read_text()
    assert page.count(found[0].command) >= 2
    assert main(["a.xml", "b.xml", "--out", str(folder)]) == 0
    assert asked[3:] == ["a.xml", "b.xml"]  # who does not ask for it has all anew


def test_an_interrupt_loses_no_scene_further_down(interrupted):
    folder, asked, _ = interrupted
    asked.clear()  # the second scene that is asked for, if b.xml, is interrupted
    words = ["--out", str(folder), "--resume"]
    assert main(["c.xml", "b.xml", "a.xml", *words]) == 130
    record = json.loads((folder / "data" / "needs.json").read_text())
    assert [one["scene"] for one in record["scenes"]] == ["c.xml", "a.xml"]
    assert not record["whole"]


@pytest.mark.parametrize(
    ("change", "words", "told"),
    [
        ({"commit": "def"}, [], "of commit abc, here is def"),
        ({"commit": "abc-dirty"}, [], "of commit abc, here is abc-dirty"),
        ({"versions": {}}, [], "other versions of libraries"),
        ({}, ["--timed", "7"], "measured with other options: a.xml b.xml"),
        ({}, ["-D", "spp=3"], "measured with other options: a.xml b.xml"),
    ],
)
def test_a_run_goes_on_with_nothing_else(interrupted, capsys, change, words, told):
    folder, asked, now = interrupted
    before = (folder / "data" / "needs.json").read_bytes()
    now.update(change)
    assert main(["a.xml", "b.xml", "--out", str(folder), "--resume", *words]) == 2
    assert told in capsys.readouterr().err
    assert len(asked) == 2 and (folder / "data" / "needs.json").read_bytes() == before


def test_a_scene_that_was_edited_is_measured_anew(interrupted):
    folder, asked, now = interrupted
    now["files"] = "edited"
    assert main(["a.xml", "b.xml", "--out", str(folder), "--resume"]) == 0
    assert asked[2:] == ["a.xml", "b.xml"]


def test_no_scene_of_the_record_is_lost_when_others_are_asked_for(interrupted, capsys):
    folder, asked, _ = interrupted
    before = (folder / "data" / "needs.json").read_bytes()
    assert main(["b.xml", "--out", str(folder), "--resume"]) == 2
    assert "has scenes that are not asked for: a.xml" in capsys.readouterr().err
    assert len(asked) == 2 and (folder / "data" / "needs.json").read_bytes() == before


def test_the_content_of_a_scene_is_that_of_all_its_files(tmp_path):
    mesh, scene = tmp_path / "one.obj", tmp_path / "scene.xml"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene.write_text(
        '<scene version="3.0.0"><sensor type="perspective"/><shape type="obj">'
        '<string name="filename" value="one.obj"/></shape></scene>'
    )
    first = content_of(renderer.load_file(scene))
    assert first == content_of(renderer.load_file(scene))
    mesh.write_text(mesh.read_text() + "# edited\n")
    second = content_of(renderer.load_file(scene))
    scene.write_text(scene.read_text() + "\n")
    assert len({first, second, content_of(renderer.load_file(scene))}) == 3


def test_refusals(path, tmp_path, capsys):
    assert main([str(tmp_path / "none.xml"), "--out", str(tmp_path)]) == 1
    assert "none.xml: no such scene file" in capsys.readouterr().err
    assert not (tmp_path / "needs.html").exists()
    for wrong in (
        ["--tolerance", "x"],
        ["--tolerance", "-1%"],
        ["--timed", "inf"],
        ["--seeds", "2"],
    ):
        with pytest.raises(SystemExit) as stop:
            main([str(path), *wrong])
        assert stop.value.code == 2
