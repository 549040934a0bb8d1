"""What a scene needs: exact zeros, losses known on paper, commands within tolerance."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import renderer
from renderer.advice.simplifications import words_of
from renderer.command.cli import main as render_command
from renderer.rendering.accuracy import relative_squares
from reports.bench import runner
from reports.bench.store import Store
from reports.command import main
from reports.studies import needs
from reports.studies.needs import command, content
from reports.trials.losses import loss_between
from reports.trials.plan_claims import Claim, claims_of
from reports.trials.simpler_scenes import Trial, least_model, needs_of

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

    The clock is not used: so small pictures take as long as the machine is busy.
    """
    render = renderer.render

    def in_time(scene, *arguments, **choices):
        image = render(scene, *arguments, **choices)
        return replace(image, seconds=0.9 ** len(scene.description.simplified))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(renderer, "render", in_time)
        trial = Trial(renderer.load_file(path), 16, 5, 0.03, 0.01)
        return needs_of(trial), trial


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
    loss = loss_between(full, less, mean)
    truth = np.sqrt(relative_squares(0.05 * mean, mean).mean())
    assert loss.error == pytest.approx(truth, abs=0.02)
    assert truth - 0.04 < loss.error_low < loss.error < loss.error_high < truth + 0.04
    assert abs(loss.mean + 0.05) < loss.mean_half_width < 0.02


def test_the_upper_end_covers_the_loss():
    """In 200 trials; 97.5 % is meant. Fewer than 185 happen by chance once in 1e4."""
    generator = np.random.default_rng(2)
    mean = np.full((16, 16, 3), 0.5)
    truth = np.sqrt(relative_squares(0.1 * mean, mean).mean())
    covered = 0
    for _ in range(200):
        full, less = (noisy(generator, m, 0.1) for m in (mean, 0.9 * mean))
        covered += loss_between(full, less, mean).error_high >= truth
    assert covered >= 185


def test_no_loss_is_below_its_noise():
    generator = np.random.default_rng(3)
    mean = np.full((48, 48, 3), 0.5)
    full, less = (noisy(generator, mean, 0.15) for _ in range(2))
    loss = loss_between(full, less, mean)
    assert loss.error < 0.04 and loss.error < loss.error_high < 0.08
    # of 36 tiles, all at once: 5 % of the seeds have one or more that is off
    assert abs(loss.tile) < loss.tile_half_width


def test_the_same_pictures_lose_nothing():
    pictures = noisy(np.random.default_rng(4), np.ones((8, 8, 3)), 0.1)
    loss = loss_between(pictures, pictures, pictures[0])
    assert loss.exact and loss.mean == 0.0 and loss.flip == 0.0


def test_what_the_scene_has_not_is_exactly_nothing(found):
    needs, _ = found
    assert "textures=mean" in needs.absent and "glass=straight" in needs.absent


def test_a_claim_of_the_plan_is_an_exact_zero(path, tmp_path):
    """Direct light leaves roulette out, though the file has it: measured, it is 0."""
    file = tmp_path / "direct.xml"
    ended = '<integer name="max_depth" value="2"/><integer name="rr_depth" value="1"/>'
    file.write_text(SCENE.replace('<integer name="max_depth" value="5"/>', ended))
    trial = Trial(renderer.load_file(file), 4, 3, 0.0, 0.01)
    needs = needs_of(trial)
    assert "Russian roulette:" in renderer.render(trial.scene, 1).explain
    assert needs.simpler["roulette=off"].loss.exact


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
        text="multiple importance sampling: no", words=["no-light=lamp"], verbatim=False
    )
    monkeypatch.setattr(
        "reports.trials.simpler_scenes.claims_of", lambda scene, spp: [wrong]
    )
    with pytest.raises(ValueError, match="no-light=lamp changes the picture, though"):
        needs_of(Trial(renderer.load_file(path), 1, 3, 0.01, 0.0))


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
    """Measured without an error, so that they are exact zeros."""
    file = tmp_path / "scene.xml"
    file.write_text(POINT.format(integrator=integrator, light=light))
    needs = needs_of(Trial(renderer.load_file(file), 1, 3, 0.01, 0.0))
    checked = [c.text for c in needs.claims if c.words or c.verbatim]
    assert any(one.startswith(text) for one in checked)


def test_no_claim_about_textures_where_a_light_has_one():
    """`textures=mean` changes that light, though no BSDF looks at a texture."""
    for light in (PLAIN, SPOT):
        scene = renderer.load_string(POINT.format(integrator="path", light=light))
        claimed = [claim.text for claim in claims_of(scene, 1)]
        assert any("textures" in text for text in claimed) == (light == PLAIN)


def test_losses_of_the_floor(found):
    needs, _ = found
    losses = {words: one.loss for words, one in needs.simpler.items()}
    depths = [loss.error for words, loss in losses.items() if words.startswith("depth")]
    assert len(depths) >= 2 and depths == sorted(depths, reverse=True)
    lamp, far = losses["no-light=lamp"], losses["no-light=far"]
    assert lamp.mean == pytest.approx(-1.0, abs=0.01) and not lamp.exact
    assert far.error_high < 0.5 * lamp.error
    # BSDF samples hardly ever hit the far lamp, nor the near one
    assert losses["sampling=bsdfs"].noise > 3.0 > 1.5 > losses["sampling=lights"].noise
    simpler = needs.simpler
    assert simpler["no-light=lamp"].cost < simpler["sampling=bsdfs"].cost
    assert all(np.isfinite(one.difference).all() for one in simpler.values())


def test_the_command_is_within_the_tolerance(path, found, tmp_path, capsys):
    """Its picture against that of the file, both of 4096 samples of other seeds."""
    needs, _ = found
    assert needs.least is not None and needs.least.loss.error_high <= 0.03
    assert needs.least.words == ["no-light=far", "depth=3", "sampling=lights"]
    assert needs.least.time == pytest.approx(0.729)
    words = shlex.split(command(path, needs.least.words))
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
    needs, trial = found
    one = next(iter(needs.simpler.values()))

    def made(words, spent, high, noise=1.0):
        loss = replace(one.loss, error_high=high, noise=noise)
        return one._replace(words=words, time=spent, loss=loss)

    first, second = made(["depth=2"], 0.6, 0.01), made(["no-light=far"], 0.7, 0.01)
    monkeypatch.setattr(trial, "without", lambda words: made(list(words), time, error))
    least = least_model(trial, [second, first])
    assert least is not None and least.words == kept
    assert least_model(trial, [first._replace(time=1.2)]) is None
    assert least_model(trial, [made(["depth=2"], 0.6, 0.01, noise=2.0)]) is None


def test_a_word_whose_thing_is_gone_is_passed_over(path, found):
    """Without the specular lobes of all, the BSDF of one has none that has a name."""
    needs, trial = found
    text = path.read_text().replace('type="diffuse"', 'type="plastic"')
    text = text.replace("reflectance", "diffuse_reflectance")
    trial = replace(trial, scene=renderer.load_string(text))
    one = next(iter(needs.simpler.values()))
    one = one._replace(loss=replace(one.loss, error_high=0.0, noise=1.0), time=0.5)
    name = next(w for w in words_of(trial.scene.description) if "no-specular=" in w)
    simpler = [one._replace(words=["specular=off"]), one._replace(words=[name], time=0.6)]
    least = least_model(trial, simpler)
    assert least is not None and least.words == ["specular=off"]


# ---------------------------------------------------------------- the study and its page


@pytest.fixture
def out(path, tmp_path, monkeypatch):
    """Return the folder of a run of one commit with the smallest settings."""
    made = {"created": "2026", "commit": "abc", "machine": {}, "versions": {}}
    monkeypatch.setattr(
        runner, "circumstances", lambda module, words: {**made, "command": "c"}
    )
    assert main(words(path, tmp_path)) == 0
    return tmp_path


def words(scene, out, *more):
    sizes = ["tolerance=200%", "spp=2", "seeds=3"]
    options = [word for size in sizes for word in ("--set", size)]
    return ["needs", "--quick", "--case", str(scene), *options, "--out", str(out), *more]


def test_a_scene_of_the_users_is_measured_and_shown(out, path):
    """Picture and command come first, then the table; what has no effect is folded."""
    table = Store(out / "data").read("needs")
    least = table.value(quantity="least model", case=path.name)
    loss = table.where(case=path.name, contender=least, quantity="loss").rows[0]
    assert least and loss.interval[0] <= loss.value <= loss.interval[1] <= 2.0
    assert table.value(case=path.name, quantity="tolerance") == 2.0
    pictures = table.where(quantity="picture", case=path.name)
    assert all((out / row.value).is_file() for row in pictures)
    losses = table.where(quantity="loss", case=path.name)
    assert len(pictures) == len(losses) + 1
    page = (out / "needs.html").read_text()
    card = page[page.index('id="floor.xml"') :]
    card = card[: card.index("</section>")]
    assert card.count("<img") == 2 and f"--simplify {least.split()[0]}" in card
    assert page.index('class="cards"') < page.index("<table>")
    absent = table.value(quantity="without effect", case=path.name)
    assert "textures=mean" in absent
    assert page.index("<summary>Without effect") < page.rindex("textures=mean")


def test_a_scene_is_measured_again_when_its_file_has_changed(out, path, monkeypatch):
    """Of one commit: the file of a user is in no commit."""
    measured = []
    monkeypatch.setattr(needs, "needs_of", lambda trial: measured.append(1) or 1 / 0)
    assert main(words(path, out)) == 0 and not measured
    with path.open("a") as file:
        file.write("<!-- edited -->")
    assert main(words(path, out)) == 1 and measured == [1]


@pytest.mark.parametrize(
    ("option", "told"),
    [
        ("tolerance=-1", "--set tolerance=-1: expected a number from 0 or per cent"),
        ("tolerance=x", "--set tolerance=x: expected a number from 0 or per cent"),
        ("seeds=2", "--set seeds=2: expected a whole number, 3 or more"),
        ("define=width", "--set define=width: 'width' is not of the form name=value"),
    ],
)
def test_a_wrong_setting_is_one_line(path, tmp_path, capsys, option, told):
    assert main(words(path, tmp_path, "--set", option)) == 2
    assert capsys.readouterr().err.strip().splitlines()[-1] == f"reports: {told}"


def test_an_unknown_scene_is_one_line(tmp_path, capsys):
    assert main(words("cornel-box", tmp_path)) == 2
    assert (
        "scene 'cornel-box': no such file; names of scenes are" in capsys.readouterr().err
    )


def test_the_content_of_a_scene_is_that_of_all_its_files(tmp_path):
    mesh, scene = tmp_path / "one.obj", tmp_path / "scene.xml"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene.write_text(
        '<scene version="3.0.0"><sensor type="perspective"/><shape type="obj">'
        '<string name="filename" value="one.obj"/></shape></scene>'
    )
    first = content(str(tmp_path), {})
    assert first == content(str(scene), {}) != ""
    mesh.write_text(mesh.read_text() + "# edited\n")
    second = content(str(scene), {})
    scene.write_text(scene.read_text() + "\n")
    assert len({first, second, content(str(scene), {})}) == 3
    assert content(str(tmp_path / "missing.xml"), {}) == ""


def test_the_repositorys_rows_have_the_numbers_of_the_old_record():
    """Those that the page showed before studies had rows."""
    table = Store(Path("nowhere")).read("needs")
    assert len(table.distinct("case")) == 23
    box = table.where(case="cornell-box")
    words = "normals=flat sampling=lights roulette=off"
    assert box.value(quantity="least model") == words
    (loss,) = box.where(quantity="loss", contender=words)
    assert (loss.value, loss.interval[1]) == (0.004221, 0.007977)
    assert box.value(quantity="time of the least model") == 0.8136
    (mean,) = box.where(quantity="mean", contender="depth=2")
    assert mean.value == pytest.approx(-0.2514, abs=1e-4)
    assert box.value(quantity="noise", contender="sampling=bsdfs") == 71.41
    assert box.value(quantity="setting") == "48 x 48 pixels, 6 seeds of 32 samples"
    assert "caustics=off" in box.value(quantity="without effect")
    assert table.value(case="emitters", quantity="least model") == ""
