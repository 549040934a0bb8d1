"""The scenes folder: complete, loadable by Mitsuba, and made by the scripts next to it."""

from __future__ import annotations

import importlib
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import ModuleType

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image

from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.reference.variant import load_mitsuba
from renderer.plugins.bsdfs.merl_file import read_merl
from renderer.scene_file.images.images import read_image

SCENES = Path(__file__).parents[2] / "scenes"
NAMES = sorted(path.parent.name for path in SCENES.glob("*/scene.xml"))
DETERMINISTIC = {
    "appel-teapot",
    "depth-and-normals",
    "kaleidoscope",
    "many-lights",
    "whitted-spheres",
}


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch):
    """Import a script of the scenes folder, which is no package."""
    monkeypatch.syspath_prepend(str(SCENES))

    def load(name: str) -> ModuleType:
        return importlib.import_module(name)

    yield load
    for name in ("make_meshes", "make_tables", "make_textures", "newell_teapot"):
        sys.modules.pop(name, None)


# ------------------------------------------------------------------- the folders


def test_there_are_enough_scenes_and_every_folder_is_one():
    folders = {path.name for path in SCENES.iterdir() if path.is_dir()} - {"__pycache__"}
    assert folders == set(NAMES)
    assert len(NAMES) >= 12


@pytest.mark.parametrize("name", NAMES)
def test_folder_is_complete(name: str):
    """README says first what proof.toml says; sizes are set; a tolerance has a reason."""
    proof = read_proof(SCENES / name / "scene.xml")
    readme = (SCENES / name / "README.md").read_text(encoding="utf-8")
    assert readme.startswith(f"# {proof.title}\n\n{proof.shows}\n\n")
    assert proof.shows.endswith(".")
    assert proof.demo is not None and proof.test is not None
    assert proof.test.width * proof.test.height <= 160 * 160
    assert proof.reason
    assert proof.deterministic == (name in DETERMINISTIC)


@pytest.mark.parametrize("name", NAMES)
def test_size_parameters_have_the_demo_size_as_default(name: str):
    """The harness passes width, height and spp; without them the file means the demo."""
    proof = read_proof(SCENES / name / "scene.xml")
    assert proof.demo is not None
    root = ElementTree.parse(SCENES / name / "scene.xml").getroot()
    defaults = {e.get("name"): e.get("value") for e in list(root)[:3]}
    assert defaults == proof.demo.parameters
    values = [e.get("value") for e in root.iter() if e.tag == "integer"]
    assert {"$spp", "$width", "$height"} <= set(values)


@pytest.mark.parametrize("name", NAMES)
def test_no_scene_depends_on_a_default_that_breaks_comparisons(name: str):
    """hdrfilm's defaults are a gaussian filter and float16 (docs of Mitsuba's hdrfilm)."""
    root = ElementTree.parse(SCENES / name / "scene.xml").getroot()
    film = root.find("sensor/film")
    assert film is not None
    assert film.find("rfilter") is not None
    assert film.find("string[@name='component_format']").get("value") == "float32"
    sampler = root.find("sensor/sampler")
    if name in DETERMINISTIC:
        assert film.find("rfilter").get("type") == "box"
        assert sampler.get("type") == "stratified"
        assert sampler.find("boolean[@name='jitter']").get("value") == "false"
        assert root.find("integrator").get("type") in ("direct", "whitted", "aov")
        # Anything but point lights would draw a random number.
        assert {e.get("type") for e in root.iter("emitter")} == {"point"}
    else:
        assert sampler.get("type") == "independent"


@pytest.mark.parametrize("name", NAMES)
def test_mitsuba_loads_and_renders_it(name: str):
    """A few pixels: finite and not black; Mitsuba refuses properties it does not know."""
    load_mitsuba()
    parameters = {"width": "16", "height": "12", "spp": "1"}
    scene = mi.load_file(str(SCENES / name / "scene.xml"), optimize=False, **parameters)
    pixels = np.array(mi.render(scene, seed=1))[..., :3]
    assert pixels.shape == (12, 16, 3)
    assert np.isfinite(pixels).all()
    assert pixels.max() > 0.01


def test_the_whole_folder_is_small():
    files = [path for path in SCENES.rglob("*") if "__pycache__" not in path.parts]
    assert sum(path.stat().st_size for path in files if path.is_file()) < 3_000_000


def test_the_cornell_box_is_mitsubas():
    """Every shape has the transform, the colour and the emission of `mi.cornell_box()`."""
    mi.set_variant("scalar_rgb")
    ours = mi.load_file(str(SCENES / "cornell-box/scene.xml"), optimize=False)
    theirs = mi.load_dict(mi.cornell_box(), optimize=False)
    ours_by_id = {shape.id(): shape for shape in ours.shapes()}
    assert ours_by_id.keys() == {shape.id() for shape in theirs.shapes()}
    for shape in theirs.shapes():
        same = ours_by_id[shape.id()]
        for corner in ("min", "max"):
            a, b = getattr(same.bbox(), corner), getattr(shape.bbox(), corner)
            np.testing.assert_allclose(np.array(a), np.array(b), atol=1e-6)
        assert same.surface_area() == pytest.approx(shape.surface_area(), rel=1e-5)
        albedo = [
            np.array(mi.traverse(s.bsdf())["reflectance.value"]) for s in (same, shape)
        ]
        np.testing.assert_array_equal(*albedo)
        assert same.is_emitter() == shape.is_emitter()
        if shape.is_emitter():
            radiance = [
                np.array(mi.traverse(s.emitter())["radiance.value"]) for s in (same, shape)
            ]
            np.testing.assert_array_equal(*radiance)
    # At the same size, the same camera rays.
    small = {"width": "256", "height": "256"}
    ours = mi.load_file(str(SCENES / "cornell-box/scene.xml"), **small)
    for at in ([0.1, 0.2], [0.5, 0.5], [0.9, 0.7]):
        rays = [
            s.sensors()[0].sample_ray(0, 0.5, at, [0.5, 0.5])[0] for s in (ours, theirs)
        ]
        np.testing.assert_allclose(np.array(rays[0].d), np.array(rays[1].d), atol=1e-6)
        np.testing.assert_allclose(np.array(rays[0].o), np.array(rays[1].o), atol=1e-6)


# ------------------------------------------------------------------- the scripts


def test_the_meshes_are_those_that_the_script_makes(tmp_path: Path, script):
    """Byte for byte, and there is no other mesh."""
    script("make_meshes").main(tmp_path)
    made = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    there = {path.relative_to(SCENES) for path in SCENES.glob("*/meshes/*")}
    assert made == there
    for path in made:
        assert (tmp_path / path).read_bytes() == (SCENES / path).read_bytes(), path


def test_the_textures_are_those_that_the_script_makes(tmp_path: Path, script):
    """The same pixels, and close to them where JPEG stands between."""
    script("make_textures").main(tmp_path)
    made = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    assert made == {path.relative_to(SCENES) for path in SCENES.glob("*/textures/*")}
    for path in made:
        pixels = [decoded(folder / path) for folder in (tmp_path, SCENES)]
        assert np.abs(pixels[0] - pixels[1]).max() <= (4 if path.suffix == ".jpg" else 0)


def decoded(path: Path) -> np.ndarray:
    """Return what an image holds, integers of any depth or half floats, as float64."""
    if path.suffix == ".exr":
        return read_image(path).astype(np.float64)
    return np.asarray(Image.open(path)).astype(np.float64)


def test_the_tables_are_those_that_the_script_makes(tmp_path: Path, script):
    """But for rounding: two machines' sines may differ in their last bits."""
    script("make_tables").main(tmp_path)
    made = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    assert made == {path.relative_to(SCENES) for path in SCENES.glob("*/measured/*")}
    for path in made:
        tables = [read_merl(folder / path).f for folder in (tmp_path, SCENES)]
        np.testing.assert_allclose(*tables, rtol=1e-6)


# ------------------------------------------------------------------- the teapot


def test_the_teapot_has_the_lectures_6320_triangles(script):
    """32 patches x 100 quads x 2 = 6400, less 80 at the tips of knob and bottom."""
    vertices, normals, faces = script("newell_teapot").teapot_mesh(divisions=10)
    assert len(faces) == 6320 == 32 * 10 * 10 * 2 - 80
    assert np.isfinite(normals).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(vertices.min(axis=0), (-3.0, -2.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(vertices.max(axis=0), (3.434, 2.0, 3.15), atol=1e-3)


def test_the_table_of_scenes_lists_each_of_them():
    table = (SCENES / "README.md").read_text(encoding="utf-8")
    for name in NAMES:
        proof = read_proof(SCENES / name / "scene.xml")
        assert f"| [{name}]({name}/README.md) | {proof.shows} |" in table
