"""A BSDF of a user's: tests/own_bsdf.py, the file that docs/adding-a-bsdf.md walks through.

Nothing in renderer/ knows of it. It is rendered, its sampler is tested, and it is compared
with its twin in Mitsuba (tests/own_bsdf_in_mitsuba.py) in the ways of a scene of ours.
"""

from __future__ import annotations

import ast
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scene_xml import element
from scipy.integrate import quad
from small_scenes import (
    assert_mean,
    floor,
    mirror,
    pixels,
    point_light,
    rectangle,
    rgb,
    scene,
    sensor,
    sky,
    sphere,
    sun,
)

import renderer
from mitsuba_ref.command.cli import main
from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records.options import Options
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.command.cli import main as render_command
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.functions import splat_f32, splat_i32
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import store3, vec3
from renderer.plugins.bsdfs.kind import (
    DELTA,
    Branch,
    BsdfMethods,
    BsdfSample,
    Color,
    Float,
    Numbers,
)
from renderer.plugins.bsdfs.registry import BSDFS
from renderer.plugins.sampling.numbers_and_warps import Plain
from renderer.scene_file.plugins import import_plugin_file

TESTS = Path(__file__).parents[2]
FILE, SCENE = TESTS / "own_bsdf.py", TESTS / "own_bsdf.xml"
WALK_THROUGH = TESTS.parent / "docs" / "adding-a-bsdf.md"

# As --plugins imports it: one class in this process, and one set of kernels. The other
# tests of this process see the renderer's own kinds only.
own = import_plugin_file(str(FILE))
Lunar, eval_pdf, sample = own.Lunar, own.eval_pdf, own.sample
LUNAR = BSDFS.pop("lunar")


@pytest.fixture(scope="module", autouse=True)
def registered():
    before = dict(BSDFS)
    BSDFS["lunar"] = LUNAR
    yield
    BSDFS.clear()
    BSDFS.update(before)


def test_the_file_is_short_and_names_nothing_private():
    text = FILE.read_text()
    assert len(text.splitlines()) <= 60
    assert not re.search(r"\b_\w", text)
    imported = {
        node.module
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom) and node.module.startswith("renderer")
    }
    assert imported == {"renderer.plugins.bsdfs.kind", "renderer.kernels.lanes.functions"}


# ------------------------------------------------------------------------- closed forms


def plate(albedo=0.6):
    """Return a large plate of dust at z = 0 that faces up."""
    dust = {"type": "lunar", "albedo": rgb(albedo)}
    return rectangle((0, 0, 0), (10, 0, 0), (0, 10, 0), dust)


def f(albedo, cos_i, cos_o):
    return albedo / (4 * np.pi * (cos_i + cos_o))


def direction(degrees, turn=0.0):
    theta, phi = np.radians([degrees, turn])
    return np.array(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    )


@pytest.mark.parametrize("integrator", ["direct", "whitted", "path"])
@pytest.mark.parametrize(("incident", "seen"), [(0, 37), (60, 1), (45, 45), (85, 80)])
def test_sunlit_dust_shines_as_the_formula_says(integrator, incident, seen):
    """E cos_i f, on paper: one light, one direction, no noise."""
    to_sun, to_eye = direction(incident, 70), direction(seen)
    camera = sensor(4 * to_eye, (0, 0, 0), up=(0, 1, 0))
    expected = 2.0 * to_sun[2] * f(0.6, to_sun[2], to_eye[2])
    found = pixels(scene(camera, integrator, plate(), sun(-to_sun, 2.0)))
    np.testing.assert_allclose(found, expected, rtol=3e-6)


def test_dust_is_black_from_behind():
    camera = sensor((0, 1, -4), (0, 0, 0))
    assert not pixels(scene(camera, "path", plate(), sun((0, 0, 1)))).any()


@pytest.mark.parametrize("seen", [10, 75])
def test_dust_under_a_white_sky_reflects_the_integral_of_its_formula(seen):
    """The integral of f cos_i over the hemisphere, by float64 quadrature."""
    cos_o = np.cos(np.radians(seen))
    albedo, _ = quad(lambda c: 2 * np.pi * c * f(0.8, c, cos_o), 0, 1)
    assert albedo < 0.8 / 2  # dust that absorbs nothing in a grain absorbs half below
    camera = sensor(4 * direction(seen), (0, 0, 0), up=(0, 1, 0), spp=4096, jitter=True)
    content = scene(camera, "path", plate(0.8), sky(), max_depth=2)
    assert_mean(content, albedo, within=1e-3)


# --------------------------------------------------------------------- sample and density

N = 1 << 18


@entry_kernel
def run_sample(bsdf, wo, x, y, wi, weight, pdf, eta):
    for i in range(0, x.size, 16):
        a, b = load_row(x, 0, i), load_row(y, 0, i)
        none = a * 0.0
        lunar = Lunar(vec3(none + 0.9, none + 0.5, none))
        seen = vec3(none + wo[0], none + wo[1], none + wo[2])
        chosen = sample(lunar, seen, Numbers(a, b, none, bsdf.arithmetic))
        store3(wi, i, chosen.wi)
        store3(weight, i, chosen.weight)
        store_row(pdf, 0, i, chosen.pdf)
        store_row(eta, 0, i, chosen.eta)


def sampled(wo, count=N):
    """Draw directions; return wi (3, n), weight (3, n), pdf, eta."""
    bsdf = pack(BsdfMethods(Lunar(None), Plain()))
    x, y = np.random.default_rng(5).random((2, count), np.float32)
    out = [np.empty(shape, np.float32) for shape in [(3, count)] * 2 + [count] * 2]
    run_sample(bsdf, np.float32(wo), x, y, *out)
    return out


# -------------------------------------------------------------------------- every method


def test_a_texture_gives_the_albedo():
    """The AOV shows the two colours of a checkerboard, in turn along x."""
    board = {
        "type": "checkerboard",
        "color0": rgb(0.9, 0.2, 0.1),
        "color1": rgb(0.1, 0.8, 0.3),
    }
    views = []
    for x in (-5, 5):
        camera = sensor((x, 5, 4), (x, 5, 0), up=(0, 1, 0))
        dust = plate() | {"bsdf": {"type": "lunar", "albedo": board}}
        shown = scene(camera, "aov", dust, aovs="a:albedo")
        views.append(renderer.render(renderer.load_dict(shown)).aovs["a"].ravel())
    found = sorted(tuple(view.astype(float).round(6)) for view in views)
    assert found == [(0.1, 0.8, 0.3), (0.9, 0.2, 0.1)]


def test_the_explanation_names_it():
    image = renderer.render(renderer.load_file(SCENE), spp=1)
    assert re.search(r"^BSDFs +lunar$", image.explain, re.MULTILINE)


# ------------------------------------------------------------------ lobes of one direction


class Polished(NamedTuple):
    tint: Color = 1.0


@renderer.kernel
def sample_polished(polished, wo, numbers):
    wi, one = vec3(-wo.x, -wo.y, wo.z), splat_f32(1.0)
    return BsdfSample(wi, polished.tint, one, one, splat_i32(DELTA))


class PolishedBefore(NamedTuple):
    tint: Color = 1.0


@renderer.kernel
def sample_polished_before(polished, wo, numbers):
    """Say by a density of 0 that the lobe is delta; of the direction only z counts."""
    none = splat_f32(0.0)
    return BsdfSample(vec3(none, none, wo.z), polished.tint, none, splat_f32(1.0))


@renderer.kernel
def polished_branch(polished, wo):
    one = splat_f32(1.0)
    return Branch(polished.tint, one, wo.z, one)


@pytest.mark.parametrize("form", ["present", "version 1"])
@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_a_mirror_of_ones_own_shows_what_the_renderers_own_shows(integrator, form):
    """A delta lobe is sampled by paths and followed by trees, as that of a conductor.

    Up to rounding: the renderer's own mirrors need no tangents (`BsdfKind.in_plane`).
    """
    name = f"polished, {form}"
    if form == "present":
        renderer.register_bsdf(name, Polished, sample=sample_polished, delta=True)
    else:
        kernels = {"sample": sample_polished_before, "reflection": polished_branch}
        with pytest.warns(FutureWarning, match="1': reflection and transmission"):
            renderer.register_bsdf(name, PolishedBefore, **kernels)
    camera = sensor((0, -3, 4), (0, 0, 0.5), fov=40, size=(16, 16), spp=4)
    found, expected = (
        pixels(
            scene(
                camera,
                integrator,
                floor(),
                sphere(bsdf, center=(0, 0, 1)),
                point_light((2, -2, 5), 20.0),
                max_depth=4,
            )
        )
        for bsdf in ({"type": name, "tint": rgb(0.7)}, mirror(0.7))
    )
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)


# ------------------------------------------------------------------------------- errors


class OfNumbers(NamedTuple):
    albedo: float = 0.5


class OfColors(NamedTuple):
    albedo: Color = 0.5
    size: Float = 1.0


class NoTuple:
    albedo: Color


@pytest.mark.parametrize(
    ("name", "parameters", "kernels", "said"),
    [
        ("diffuse", OfColors, {"eval_pdf": eval_pdf}, "'diffuse' is the renderer's own"),
        ("twosided", OfColors, {"eval_pdf": eval_pdf}, "'twosided' is the renderer's own"),
        ("mine", OfColors, {}, "neither eval_pdf nor a delta lobe"),
        ("mine", NoTuple, {"eval_pdf": eval_pdf}, "no NamedTuple class"),
        ("mine", OfColors, {"eval_pdf": eval_pdf.py_func}, "'eval_pdf' is no kernel"),
        ("mine", OfColors, {"transmission": eval_pdf}, "needs transmits=True, and refl"),
        ("mine", Lunar, {"eval_pdf": eval_pdf}, "belongs to 'lunar' already"),
        ("mine", OfNumbers, {"eval_pdf": eval_pdf}, "albedo is annotated neither Color"),
    ],
)
def test_a_mistake_in_what_is_registered(name, parameters, kernels, said):
    """One sentence, and nothing is registered."""
    with pytest.raises(ValueError, match=said):
        renderer.register_bsdf(name, parameters, sample=sample, **kernels)
    assert "mine" not in BSDFS


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('<bsdf type="lunar"/>', '<bsdf type="lunr"/>', "lunar"),
        ('<bsdf type="lunar"/>', element("bsdf", "lunar", colour=1.0), '"colour"'),
        ('<bsdf type="lunar"/>', element("bsdf", "lunar", albedo="grey"), "albedo"),
    ],
    ids=["unknown kind", "unknown property", "wrong type"],
)
def test_a_mistake_in_a_scene_is_one_line_with_its_place(tmp_path, old, new, said):
    text = SCENE.read_text()
    line = text[: text.index(old)].count("\n") + 1
    path = tmp_path / "scene.xml"
    path.write_text(text.replace(old, new))
    with pytest.raises(renderer.SceneError, match=said) as caught:
        renderer.load_file(path)
    message = str(caught.value)
    assert message.startswith(f"{path}:{line}: ") and "\n" not in message


# --------------------------------------------------------------------- against Mitsuba


def test_it_agrees_with_its_twin_in_mitsuba():
    """Path by path with the same random numbers, in the mean with others, and the AOVs."""
    with MitsubaWorker(time_limit=120.0) as worker:
        options = Options(plugins=FILE, replay=(1, 16))
        result = validate_scene(
            SCENE, options, render_ours, ReferenceCache(worker.render)
        ).result
    assert (result.verdict, result.reasons) == ("pass", ())
    assert [replay.spp for replay in result.replay] == [1, 16]
    assert all(replay.passed for replay in result.replay)


def commands():
    """Return the commands on the harness that the walk-through gives."""
    blocks = re.findall(r"^```sh\n(.*?)^```", WALK_THROUGH.read_text(), re.M | re.S)
    lines = "".join(blocks).splitlines()
    return [line for line in lines if "mitsuba_ref" in line]


def test_both_paths_agree_where_the_walk_through_traces_one(capsys, monkeypatch):
    monkeypatch.chdir(TESTS.parent)
    (trace,) = (line for line in commands() if "--trace" in line)
    assert main(shlex.split(trace)[3:]) == 0
    output = capsys.readouterr().out
    assert "BSDF pdf" in output and "The paths agree" in output


# ----------------------------------------------------------------- kernels that are kept

IN_A_PROCESS = """
import json, sys
from numba.core.event import install_recorder
from renderer.scene_file.plugins import import_plugin_file
with install_recorder("numba:compile") as compiled:
    import_plugin_file(sys.argv[1])
    import renderer
    image = renderer.render(renderer.load_file(sys.argv[2]), spp=1, threads=1)
print(json.dumps([image.pixels.tolist(), len(compiled.buffer)]))
"""


def rendered_elsewhere(file):
    """Return (picture, functions compiled) of another process."""
    command = [sys.executable, "-c", IN_A_PROCESS, str(file), str(SCENE)]
    finished = subprocess.run(command, capture_output=True, text=True, cwd=TESTS.parent)
    assert finished.returncode == 0, finished.stderr
    picture, compiled = json.loads(finished.stdout)
    return np.array(picture), compiled


def test_a_second_process_compiles_nothing():
    here = renderer.render(renderer.load_file(SCENE), spp=1, threads=1)
    picture, compiled = rendered_elsewhere(FILE)
    assert compiled == 0
    np.testing.assert_array_equal(picture, here.pixels)


def test_the_file_renders_under_another_name(tmp_path):
    """Kept kernels name their module: those of one that is not there are not taken."""
    another = tmp_path / "another.py"
    another.write_text(FILE.read_text())
    picture, _ = rendered_elsewhere(another)
    here = renderer.render(renderer.load_file(SCENE), spp=1, threads=1)
    np.testing.assert_array_equal(picture, here.pixels)


def test_an_edit_of_the_formula_is_seen(tmp_path):
    """The same names in a file of the same name: only its text tells it apart."""
    edited = tmp_path / FILE.name
    edited.write_text(FILE.read_text().replace("0.25", "0.125"))
    picture, _ = rendered_elsewhere(edited)
    here = renderer.render(renderer.load_file(SCENE), spp=1, threads=1)
    assert picture.mean() < 0.9 * here.pixels.mean()


def test_the_command_line_takes_the_file(tmp_path, capsys):
    """`--plugins` is the harness's import; what cannot be imported is one line."""
    output = tmp_path / "moon.npy"
    size = ["--spp", "1", "-o", str(output), "--quiet"]
    assert render_command([str(SCENE), "--plugins", str(FILE), *size]) == 0
    here = renderer.render(renderer.load_file(SCENE), spp=1)
    np.testing.assert_array_equal(np.load(output), here.pixels)
    assert render_command([str(SCENE), "--plugins", "no.py", *size]) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and said[0].startswith("error: no.py: FileNotFoundError")


def test_a_scene_does_not_mix_a_kind_with_its_successor():
    """Registered anew, as in a notebook: the old scene is refused, a new one renders."""

    class Successor(NamedTuple):
        albedo: Color = 0.3

    old, registered = renderer.load_file(SCENE), BSDFS["lunar"]
    try:
        renderer.register_bsdf("lunar", Successor, sample=sample_polished, delta=True)
        with pytest.raises(renderer.SceneError, match="'lunar' was registered anew"):
            renderer.render(old, spp=1)
    finally:
        BSDFS["lunar"] = registered
    assert renderer.render(old, spp=1).pixels.any()


# --------------------------------------------------------------------- the walk-through


def test_the_walk_through_quotes_the_file():
    quoted = re.findall(r"^```python\n(.*?)^```", WALK_THROUGH.read_text(), re.M | re.S)
    assert FILE.read_text() in quoted


def test_nothing_of_the_renderers_names_it():
    named = re.compile(r"\blunar\b|own_bsdf", re.IGNORECASE)
    sources = [TESTS.parent / "renderer", TESTS.parent / "mitsuba_ref"]
    found = [
        file
        for folder in sources
        for file in folder.rglob("*.py")
        if named.search(file.read_text())
    ]
    assert not found
