"""A verdict on any picture: noise is no difference, and mistakes get their names."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from scipy import ndimage

import renderer
from mitsuba_ref import renderer_compare
from mitsuba_ref.diagnosis.comparison import compare_with_scene
from mitsuba_ref.diagnosis.diagnose import diagnose
from mitsuba_ref.diagnosis.difference import brightness_for_neighbours, compare, set_aside
from mitsuba_ref.diagnosis.image_mistakes import Evidence
from mitsuba_ref.diagnosis.picture_files import read_picture
from mitsuba_ref.diagnosis.scene_mistakes import (
    FEATURES,
    algorithm_mistakes,
    reading_mistakes,
)
from mitsuba_ref.diagnosis.scene_reference import SceneReference
from mitsuba_ref.mutations.mutation import mutated_files
from renderer.errors import SceneError
from renderer.rendering.picture.picture import srgb_from_linear
from renderer.scene_file import read_file, read_string
from renderer.scene_file.images.image import SRGB_FROM_XYZ
from reports import compare_command
from reports.pages.compare_page import compare_page
from reports.trials.faulty_pictures import EDITS

ROOT = Path(__file__).resolve().parents[3]
SIDE = 96


@pytest.fixture(scope="module")
def truth():
    """A picture with shapes, edges, a gradient and three different channels."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    disk = (x - 0.3) ** 2 + (y - 0.4) ** 2 < 0.04
    box = (x > 0.6) & (y > 0.55)
    red = 0.2 + 0.5 * x + 1.0 * disk
    green = 0.3 + 0.2 * y + 0.6 * box
    blue = 0.1 + 0.3 * x * y + 0.2 * disk
    return np.stack([red, green, blue], axis=-1)


def noisy(truth, seed, relative=0.3):
    """Return the picture with skewed noise, that of a gamma distribution."""
    rng = np.random.default_rng(seed)
    shape = 1.0 / relative**2
    return truth * rng.gamma(shape, 1.0 / shape, truth.shape)


@pytest.fixture(scope="module")
def references(truth):
    return [noisy(truth, 100 + k, 0.1) for k in range(4)]


def named(picture, references, **given):
    aside, used = set_aside(references)
    reference = np.mean(used, axis=0)
    scale = brightness_for_neighbours(picture, reference, 1, aside)
    evidence = Evidence(picture, reference, scale, aside=aside, **given)
    return diagnose(compare([picture], references, 1), evidence, 1)


@pytest.mark.parametrize("relative", [0.05, 0.3, 1.0, 3.0])
def test_noise_is_no_difference(truth, references, relative):
    """Of 40 right pictures none is called wrong, however noisy: 1 in 1000 would be."""
    wrong = [compare([noisy(truth, k, relative)], references, 1).differs for k in range(40)]
    assert sum(wrong) == 0


@pytest.mark.parametrize(("sigma", "lag"), [(0.0, 1), (0.5, 4), (1.0, 8)])
def test_noise_of_large_pictures_and_of_filters_is_no_difference(sigma, lag):
    """512 x 512 pixels with 30 % noise in the references too, which is in the scale."""
    rng = np.random.default_rng(5)

    def drawn():
        noise = 0.3 * rng.standard_normal((512, 512, 3))
        return 1.0 + (ndimage.gaussian_filter(noise, (sigma, sigma, 0)) if sigma else noise)

    found = [compare([drawn()], [drawn() for _ in range(4)], lag) for _ in range(6)]
    assert not any(one.differs for one in found)
    z = np.array([[test.z for test in one.tests] for one in found])
    assert np.abs(z.mean(axis=0)).max() < 1.6  # of 6 each; standard deviation 0.41


def test_a_stated_bias_is_seen(truth, references):
    """What would have been seen with 99 % is seen, in 30 of 30 pictures."""
    stated = compare([noisy(truth, 1)], references, 1).detectable
    assert 0.0 < stated < 0.05
    biased = [noisy(truth, k) * (1.0 + 1.1 * stated) for k in range(30)]
    assert all(compare([one], references, 1).differs for one in biased)


def test_noise_of_few_pixels_is_no_difference(truth):
    """Rare bright samples in a small disk, as in a caustic: 1 of 20 differed."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    disk = 60.0 * ((x - 0.6) ** 2 + (y - 0.6) ** 2 < 0.005)
    rng = np.random.default_rng(8)

    def drawn():
        rare = (rng.random(disk.shape) < 0.05) * rng.exponential(size=disk.shape)
        return (
            truth * (1.0 + 0.05 * rng.standard_normal(truth.shape))
            + (disk * rare)[..., None]
        )

    found = [compare([drawn()], [drawn() for _ in range(4)], 1) for _ in range(60)]
    assert not any(one.differs for one in found)


@pytest.mark.parametrize("size", [(63, 96), (94, 96), (47, 47), (108, 130)])
def test_noise_at_the_border_is_no_difference(size):
    """Under a sky without noise is a floor of the last rows: 38 of 40 differed."""
    rng = np.random.default_rng(3)

    def drawn():
        picture = np.full((*size, 3), 0.8)
        rows = size[0] % 16 or 4
        floor = rng.gamma(4.0, 0.25, (rows, size[1], 1)) * [0.9, 0.8, 0.7]
        picture[-rows:] = 0.3 * floor
        return picture

    found = [compare([drawn()], [drawn() for _ in range(4)], 1) for _ in range(40)]
    assert not any(one.differs for one in found)


@pytest.mark.parametrize("place", ["upside down", "cut off"])
def test_a_bright_lamp_does_not_hide_a_difference(truth, place):
    """A lamp of 100 times the brightness, and noise of 30 %."""
    lit = truth.copy()
    lit[4:10, 40:64] += 100.0
    wrong = lit[::-1] if place == "upside down" else np.minimum(lit, 1.0)
    references = [noisy(lit, k) for k in range(4)]
    assert not compare([noisy(lit, 9)], references, 1).differs
    assert compare([noisy(wrong, 9)], references, 1).differs


MISTAKES = EDITS | {  # and what shows in square pictures alone, or has another size
    "factor-1/2": lambda p: 0.5 * p,
    "rotated-90": np.rot90,
    "transposed": lambda p: p.swapaxes(0, 1),
    "shift": lambda p: ndimage.shift(p, (1, 2, 0), order=0, mode="nearest"),
}
del MISTAKES["wider-filter"]  # it blurs the noise too, which these tests know as white


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_its_name(truth, references, name):
    """The mistake is made to the noisy picture, as a renderer makes it."""
    found = named(MISTAKES[name](noisy(truth, 7, 0.1)), references)
    assert found.difference.differs
    assert found.names[0] == name
    assert found.explanations[0].share > 0.9


def test_a_mistake_that_is_not_known_gets_no_name(truth, references):
    rng = np.random.default_rng(0)
    blots = ndimage.gaussian_filter(rng.normal(size=truth.shape[:2]), 6)[..., None]
    found = named(noisy(truth * (1.0 + 4.0 * blots), 3, 0.1), references)
    assert found.difference.differs and found.names == []


def test_a_shape_that_loses_energy_is_named(truth, references):
    index = np.zeros((SIDE, SIDE, 1), np.float32)
    index[20:60, 20:60] = 3
    wrong = np.where(index == 3, 0.8, 1.0) * truth
    found = named(
        noisy(wrong, 5, 0.1), references, aovs={"shape_index": index}, shapes={3: "ball"}
    )
    assert found.names[0] == "material"
    sentence = found.explanations[0].prediction.sentence
    assert re.search(r"shape ball are 0\.(8|79\d*|80\d*) times as bright", sentence)


# ------------------------------------------------------------------------ with a scene

SCENE = """<scene version="3.0.0">
<default name="spp" value="16"/>
<integrator type="path"><integer name="max_depth" value="3"/></integrator>
<sensor type="perspective"><float name="fov" value="60"/>
<film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/>
<rfilter type="box"/></film>
<sampler type="independent"><integer name="sample_count" value="$spp"/></sampler></sensor>
<shape type="cube"><boolean name="flip_normals" value="true"/></shape>
<emitter type="point"><point name="position" x="0.3" y="0.2" z="-0.2"/>
<rgb name="intensity" value="1 0.8 0.6"/></emitter></scene>"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    return path


def rendered(scene, path, **parameters):
    renderer.render(renderer.load_file(scene, **parameters), seed=5).save(path)
    return path


def run(capsys, *words):
    status = compare_command.main([str(word) for word in words])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_a_right_picture_of_a_scene_passes(scene, tmp_path, capsys):
    mine = rendered(scene, tmp_path / "mine.exr")
    status, out, _ = run(capsys, mine, "--scene", scene, "--reference", "ours")
    assert status == compare_command.SAME
    assert "do not differ by more than noise" in out
    assert "would have been seen with a probability of 99 %" in out


@pytest.mark.parametrize("name", ["cornell-box", str(ROOT / "scenes/cornell-box")])
def test_a_demo_or_a_folder_is_a_scene(tmp_path, capsys, name):
    np.save(tmp_path / "a.npy", np.ones((32, 32, 3)))
    status, _, err = run(capsys, tmp_path / "a.npy", "--scene", name)
    assert status == compare_command.WRONG_USE
    assert "cornell-box/scene.xml 192 x 192; equal sizes are needed; -D name=value" in err


def test_a_scene_that_was_read_wrongly_is_named(scene, tmp_path, capsys):
    other = tmp_path / "other.xml"
    other.write_text(
        SCENE.replace('name="max_depth" value="3"', 'name="max_depth" value="2"')
    )
    mine = rendered(other, tmp_path / "mine.exr")
    report = tmp_path / "verdict.json"
    options = ("--scene", scene, "--reference", "ours", "--quick", "--json", report)
    status, out, _ = run(capsys, mine, *options)
    assert status == compare_command.DIFFERENT
    assert "1. one-bounce-fewer: Paths have 2 segments" in out
    verdict = json.loads(report.read_text())
    assert verdict["differs"] and verdict["mistakes"][0]["name"] == "one-bounce-fewer"


def test_two_pictures_without_a_scene(scene, tmp_path, capsys):
    mine = rendered(scene, tmp_path / "mine.npy")
    pixels = np.load(mine)
    np.save(tmp_path / "twice.npy", 2.0 * pixels)
    status, out, _ = run(capsys, tmp_path / "twice.npy", mine)
    assert status == compare_command.DIFFERENT and "1. factor-2" in out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["none.exr", "a.npy"], "none.exr: no such picture"),
        (["a.npy", "small.npy"], "a.npy has 48 x 32 pixels, the reference small.npy 3 x 2"),
        (
            ["small.npy", "small.npy"],
            "small.npy has 3 x 2 pixels; in pictures of",
        ),
        (
            ["a.npy", "a.npy", "--json", "none/x.json"],
            "none/x.json: there is no such",
        ),
        (["nan.npy", "a.npy"], "in 1 of 1536 pixels, the first at x = 4"),
        (["int.npy", "a.npy"], "int.npy holds integers; linear values are expected"),
        (["a.jpg", "a.npy"], "a.jpg: JPEG spreads the noise"),
        (["two.npy", "a.npy"], "two.npy: the channels 0, 1; R, G, B or Y are possible"),
        (["a.npy", "--scene", "none.xml"], "none.xml"),
    ],
)
def test_bad_input_is_one_line(tmp_path, monkeypatch, capsys, words, says):
    monkeypatch.chdir(tmp_path)
    good = np.ones((32, 48, 3), np.float32)
    broken = good.copy()
    broken[2, 4, 1] = np.nan
    for name, pixels in {
        "a": good,
        "small": good[:2, :3],
        "nan": broken,
        "two": good[..., :2],
        "int": good.astype(np.uint8),
    }.items():
        np.save(f"{name}.npy", pixels)
    Path("a.jpg").write_bytes(b"\xff\xd8\xff")
    status, out, err = run(capsys, *words)
    assert (status, out) == (compare_command.WRONG_USE, "")
    assert says in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["a.npy"], "name one picture and --scene, or two pictures"),
        (["a.npy", "b.npy", "c.npy"], "name one picture and --scene, or two pictures"),
        (["a.npy", "--"], "none follows"),
        (["a.npy", "--scene", "s.xml", "--with", "a.npy"], "leave out --with"),
        (["a.npy", "--scene", "s.xml", "--", "a.npy"], "leave out --with"),
    ],
)
def test_words_that_say_nothing_are_told(capsys, words, says):
    with pytest.raises(SystemExit) as ended:
        compare_command.main(words)
    assert ended.value.code == compare_command.WRONG_USE
    assert says in capsys.readouterr().err


def test_several_pictures_show_a_difference_in_one_tile(truth, tmp_path, capsys):
    """One tile of 144 is 30 % brighter: pictures of 16 seeds on both sides show it."""
    for k in range(16):
        wrong = noisy(truth, k)
        np.save(tmp_path / f"right{k}.npy", noisy(truth, 100 + k))
        np.save(tmp_path / f"same{k}.npy", wrong)
        wrong[40:48, 16:24] *= 1.3
        np.save(tmp_path / f"wrong{k}.npy", wrong)
    files = {n: sorted(tmp_path.glob(f"{n}*.npy")) for n in ("right", "same", "wrong")}
    page = tmp_path / "page.html"
    assert run(capsys, *files["same"], "--", *files["right"])[0] == compare_command.SAME
    status, out, _ = run(capsys, "-o", page, *files["wrong"], "--", *files["right"])
    assert status == compare_command.DIFFERENT
    assert "known mistakes explains half" in out and "within a tile" in out
    assert "<td" in page.read_text() and "tiles" in page.read_text()


def test_the_page_is_one_file_that_names_the_mistake(truth, tmp_path, capsys):
    np.save(tmp_path / "a.npy", np.pi * noisy(truth, 1))
    np.save(tmp_path / "b.npy", noisy(truth, 2))
    page = tmp_path / "page.html"
    status, out, _ = run(capsys, tmp_path / "a.npy", tmp_path / "b.npy", "-o", page)
    assert status == compare_command.DIFFERENT and f"The page: {page}" in out
    text = page.read_text()
    assert "All values are pi times as large" in text
    assert text.count("data:image/png;base64,") == 5
    assert not re.search(r'(src|href)="(?!data:|#)', text)  # nothing else is loaded


def test_pictures_of_8_bits_are_decoded_with_a_note(tmp_path):
    from PIL import Image

    path = tmp_path / "a.png"
    Image.fromarray(np.full((2, 3, 3), 188, np.uint8)).save(path)
    read = read_picture(path)
    np.testing.assert_allclose(read.pixels, 0.5028, atol=1e-3)
    assert "8 bits a channel" in read.note and read.levels == 255
    with pytest.raises(SceneError, match="no such picture"):
        read_picture(tmp_path / "b.png")


def test_a_right_png_with_lamps_is_no_difference(truth, tmp_path, capsys):
    """Values above 1 are lost in the file, and so they are in the reference."""
    from PIL import Image

    bright = 3.0 * truth
    encoded = 255.0 * srgb_from_linear(noisy(bright, 1, 0.1))
    Image.fromarray(np.round(encoded).astype(np.uint8)).save(tmp_path / "a.png")
    for k in range(4):
        np.save(tmp_path / f"b{k}.npy", noisy(bright, 10 + k, 0.1))
    status, out, _ = run(capsys, tmp_path / "a.png", "--", *tmp_path.glob("b*.npy"))
    assert status == compare_command.SAME and "8 bits a channel" in out


@pytest.mark.parametrize(
    ("name", "curve"),
    [
        ("srgb-curve-missing", lambda p: p),
        ("gamma-2.2-instead-of-srgb", lambda p: p ** (1 / 2.2)),
        ("srgb-curve-applied-twice", lambda p: srgb_from_linear(srgb_from_linear(p))),
        ("tone-mapped", lambda p: srgb_from_linear(p / (1.0 + p))),
        ("factor-1/2", lambda p: srgb_from_linear(0.5 * p)),
    ],
)
def test_curves_of_a_png_get_their_names(truth, references, tmp_path, name, curve):
    from PIL import Image

    encoded = np.clip(255.0 * curve(noisy(truth, 1, 0.1)), 0, 255)
    Image.fromarray(np.round(encoded).astype(np.uint8)).save(tmp_path / "a.png")
    found = renderer_compare(tmp_path / "a.png", references, filter_radius=0.5)
    assert found.named[0].prediction.name == name, found.sentences()


@pytest.mark.parametrize("layer", ["", "ViewLayer.Combined."])
def test_layers_and_xyz_of_exr_files(truth, tmp_path, layer):
    colours = truth.astype(np.float32)
    xyz = colours @ np.linalg.inv(SRGB_FROM_XYZ.T).astype(np.float32)
    for name, names, pixels in (("rgb", "RGB", colours), ("xyz", "XYZ", xyz)):
        path = tmp_path / f"{name}.exr"
        channels = {f"{layer}{n}": pixels[..., c].copy() for c, n in enumerate(names)}
        OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(path))
        np.testing.assert_allclose(read_picture(path).pixels, colours, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "give references or a scene, and not both"),
        ({"references": "word"}, "word: no such picture"),
        ({"references": np.ones((4, 4, 2))}, r"expected an array \(H, W, 3\) of numbers"),
        ({"references": [None]}, "expected an array"),
        ({"references": np.ones((64, 64, 3), np.uint8)}, "array 1 holds uint8"),
        ({"references": []}, "there is no picture"),
        (
            {"references": np.ones((64, 32))},
            "64 x 64 pixels, the reference array 1 32 x 64",
        ),
    ],
)
def test_bad_arrays_are_one_line(given, says):
    with pytest.raises(SceneError, match=says):
        renderer_compare(np.ones((64, 64, 3)), **given)


def test_shapes_have_the_names_of_the_file():
    """A difference in the pixels of one shape is said of this shape."""
    reference = SceneReference(ROOT / "scenes/instances/scene.xml", by="ours")
    assert reference.shapes[401] == "sand" and "instance" in reference.shapes[146]
    reference = SceneReference(ROOT / "scenes/smooth-mesh/scene.xml", by="ours")
    index = reference.aovs["shape_index"][..., 0]
    assert reference.shapes == {1: "smooth", 2: "faceted", 3: "floor"}
    assert index[0, 0] == 3 and index[72, 80] == 1 and index[72, 144] == 2


def test_a_missing_background_is_named(truth, references):
    index = np.ones((SIDE, SIDE, 1), np.float32)
    index[:30] = 0
    seen = np.where(index > 0, truth, 0.0)
    found = named(noisy(seen, 5, 0.1), references, aovs={"shape_index": index})
    assert found.names[0] == "no-background"


def test_a_crop_window_is_told(scene, tmp_path):
    crop = '<integer name="crop_width" value="40"/><rfilter'
    scene.write_text(SCENE.replace("<rfilter", crop))
    with pytest.raises(SceneError, match="crop window has 40 x 32"):
        renderer_compare(np.ones((32, 48, 3)), scene=scene, reference="ours")


def test_the_same_picture_twice_is_told(truth):
    one, two = noisy(truth, 1), noisy(truth, 2)
    with pytest.raises(SceneError, match="array 1 and array 2 are the same picture"):
        renderer_compare([one, one.copy()], two)


def test_a_png_as_the_reference_is_judged_as_one(truth, tmp_path):
    from PIL import Image

    encoded = np.round(255.0 * srgb_from_linear(noisy(2.0 * truth, 1, 0.1)))
    Image.fromarray(encoded.astype(np.uint8)).save(tmp_path / "a.png")
    found = renderer_compare(noisy(2.0 * truth, 2, 0.1), tmp_path / "a.png")
    assert not found.differs, found.sentences()


def test_a_reference_that_is_not_finite_is_told(scene):
    reference = SceneReference(scene, by="ours")
    reference.pixels[1][3, 4] = np.nan
    with pytest.raises(SceneError, match="reference 2: NaN, infinite or above"):
        compare_with_scene(np.ones((32, 48, 3)), reference)


@pytest.mark.parametrize(("value", "name"), [(0.0, "black"), (0.4, "one-colour")])
def test_a_picture_without_the_scene_is_told(truth, references, value, name):
    found = named(np.full_like(truth, value), references)
    assert found.names[0] == name


def test_very_bright_pixels_that_hide_a_factor_are_told(truth):
    wrong = 2.0 * noisy(truth, 1)
    wrong[3, 3] = 1e5
    found = renderer_compare(wrong, [noisy(truth, k) for k in range(2, 6)])
    assert found.differs or "this says little" in found.sentences()[1]
    assert found.differs or "this says little" in compare_page(found, ["command"])


def test_a_missing_area_light_is_among_the_mistakes():
    made = list(reading_mistakes(read_file(ROOT / "scenes/cornell-box/scene.xml")))
    assert {"light-missing", "one-bounce-fewer", "one-bounce-more"} <= {m[0] for m in made}


def test_a_picture_of_this_renderer_is_taken(scene):
    """It is right, so what only explains a difference is not rendered."""
    image = renderer.render(renderer.load_file(scene), seed=5)
    assert not renderer_compare(image, scene=scene, reference="ours").differs
    reference = SceneReference(scene, by="ours")
    assert not compare_with_scene(image, reference).differs
    assert "aovs" not in vars(reference)


@pytest.mark.parametrize("scale", [1e-6, 1e-4, 1e4, 1e6])
def test_the_verdict_has_no_unit(truth, scale):
    right, wrong = noisy(truth, 1), 0.9 * noisy(truth, 1)
    references = [scale * noisy(truth, k) for k in range(2, 6)]
    for picture, differs in ((right, False), (wrong, True)):
        assert compare([scale * picture], references, 1).differs is differs


def test_the_fixture_fails_a_test_with_a_sentence(assert_same_picture, truth):
    assert not assert_same_picture(noisy(truth, 1), noisy(truth, 2)).differs
    with pytest.raises(
        pytest.fail.Exception, match=r"1\. factor-2: All values are 2 times"
    ):
        assert_same_picture(2.0 * noisy(truth, 1), noisy(truth, 2))


def test_every_mistake_of_the_table_can_be_made():
    """Its edits fit the sources, and its needs are features that are known."""
    everything = read_string(SCENE)
    for feature in FEATURES.values():
        assert feature(everything) in (True, False)
    names = {mistake.name for mistake in algorithm_mistakes(everything)}
    assert {"missing-cosine", "no-shadows", "no-falloff", "acne"} <= names
    assert "texture-gamma" not in names  # the scene has no texture
    for mistake in algorithm_mistakes(everything):
        assert mutated_files(mistake.mutation)


def test_scenes_that_were_read_wrongly_differ_from_it():
    found = {name for name, *_ in reading_mistakes(read_string(SCENE))}
    assert found == {
        "one-bounce-fewer",
        "one-bounce-more",
        "depth-limited",
        "fov-axis",
        "light-missing",
        "normals-not-interpolated",  # a cube has them, and they change nothing
    }
