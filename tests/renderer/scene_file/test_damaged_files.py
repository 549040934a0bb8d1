"""Damaged files of every format end in a scene or in one sentence that names the file."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from renderer import scene_file
from renderer.errors import SceneError
from renderer.scene_file.description import Mesh, SdfGrid
from renderer.scene_file.images.images import read_texels

PLUGINS = Path(__file__).parents[2] / "plugins"
TEXTURE = (
    '<bsdf type="diffuse"><texture type="bitmap" name="reflectance">{}</texture></bsdf>'
)
USES = {  # what a file is read for
    "textures/rgb.bmp": TEXTURE,
    "textures/rgb.hdr": TEXTURE,
    "four_by_three.pfm": TEXTURE,
    "textures/rgb.jpg": TEXTURE,
    "textures/rgba.png": TEXTURE,
    "textures/grey_16.png": TEXTURE,
    "textures/rgb.tga": TEXTURE,
    "textures/half.exr": TEXTURE,
    "textures/octahedron.ply": '<shape type="ply">{}</shape>',
    "lamp.obj": '<shape type="obj">{}</shape>',
    "grids/torus.vol": '<shape type="sdfgrid">{}</shape>',
    "curves/wires.txt": '<shape type="linearcurve">{}</shape>',
    "curves/strands.txt": '<shape type="bsplinecurve">{}</shape>',
    "meshes/version-3.serialized": '<shape type="serialized">{}</shape>',
    "meshes/version-4.serialized": '<shape type="serialized">{}</shape>',
    "small.binary": '<bsdf type="merl">{}</bsdf>',
    "copper_rgb.bsdf": '<bsdf type="measured">{}</bsdf>',
    "sky.exr": '<emitter type="envmap">{}</emitter>',
    "small.spd": '<bsdf type="diffuse"><spectrum name="reflectance" filename="{}"/></bsdf>',
}
SENSOR = '<sensor type="perspective"/>'


def damaged(content: bytes) -> list[bytes]:
    """Return a file cut at each of its first bytes and elsewhere, and with wrong bytes."""
    rng = random.Random(len(content))
    cuts = [*range(min(40, len(content))), *(rng.randrange(len(content)) for _ in range(8))]
    found = [content[:cut] for cut in cuts]
    for last in (len(content), min(len(content), 80)):  # all of it, and the header
        for width in (1, 1, 1, 4):
            for _ in range(15):
                wrong = bytearray(content)
                place = rng.randrange(last)
                wrong[place : place + width] = rng.choice(
                    (b"\xff" * width, rng.randbytes(width))
                )
                found.append(bytes(wrong))
    return [*found, content + b"\0", content * 2]


def assert_valid(shape: object) -> None:
    """No half-read mesh: all indices are in range, and all numbers finite."""
    if isinstance(shape, Mesh):
        assert shape.faces.min(initial=0) >= 0  # degenerate ones may have been all
        assert shape.faces.max(initial=-1) < len(shape.vertices)
        for numbers in (shape.vertices, shape.normals, shape.uvs):
            assert numbers is None or np.isfinite(numbers).all()
    if isinstance(shape, SdfGrid):
        assert np.isfinite(shape.distances).all() and min(shape.distances.shape) >= 2


@pytest.mark.parametrize("name", USES)
def test_a_damaged_file_gives_a_scene_or_one_sentence(tmp_path: Path, name: str) -> None:
    if name.endswith(".spd"):
        content = b"# sampled\n400 0.1\n500 0.3\n600 0.4\n700 .2\n"
    elif name.endswith(".pfm"):
        content = b"PF\n4 3\n-1.0\n" + np.linspace(0, 9, 36, dtype="<f4").tobytes()
    else:
        content = (PLUGINS / name).read_bytes()
    path = tmp_path / Path(name).name
    given = "{}" if name.endswith(".spd") else '<string name="filename" value="{}"/>'
    inside = USES[name].replace("{}", given.replace("{}", path.name))
    if inside.startswith("<bsdf"):
        inside = f'<shape type="sphere">{inside}</shape>'
    xml = f'<scene version="3.0.0">{inside}{SENSOR}</scene>'
    path.write_bytes(content)
    scene_file.read_string(xml, base_dir=tmp_path)
    refused = 0
    for wrong in damaged(content):
        path.write_bytes(wrong)
        try:
            for shape in scene_file.read_string(xml, base_dir=tmp_path).shapes:
                assert_valid(shape)
        except SceneError as error:
            refused += 1
            assert path.name in str(error)
            assert str(error).isprintable()  # bytes of the file are quoted escaped
    assert refused > 10


def test_textures_that_double_by_references_are_not_visited_one_by_one() -> None:
    """30 boards, each with the one before as both colours, would be 2^30 colours."""
    boards = '<texture type="checkerboard" id="t0"/>' + "".join(
        f'<texture type="checkerboard" id="t{k + 1}"><ref id="t{k}" name="color0"/>'
        f'<ref id="t{k}" name="color1"/></texture>'
        for k in range(30)
    )
    bsdf = '<bsdf type="diffuse"><ref id="t30" name="reflectance"/></bsdf>'
    xml = f'<scene version="3.0.0">{boards}<shape type="sphere">{bsdf}</shape></scene>'
    with pytest.raises(SceneError, match="nests more than 12 textures"):
        scene_file.read_string(xml)


def test_an_implicit_surface_that_reaches_too_far_blames_its_bounds() -> None:
    xml = (
        '<scene version="3.0.0"><shape type="implicit">'
        '<string name="expression" value="x"/>'
        '<point name="bounds_min" value="-1 -1 -1"/>'
        '<point name="bounds_max" value="1e38 1 1"/></shape></scene>'
    )
    with pytest.raises(SceneError, match='"bounds_max": found what makes the shape reach'):
        scene_file.read_string(xml)


@pytest.mark.parametrize("name", ["int_ior", "ext_ior"])
def test_indices_of_refraction_whose_squares_overflow_are_refused(name: str) -> None:
    """Mitsuba's picture is NaN there."""
    glass = f'<bsdf type="dielectric"><float name="{name}" value="1e30"/></bsdf>'
    xml = f'<scene version="3.0.0"><shape type="sphere">{glass}</shape></scene>'
    with pytest.raises(SceneError, match="expected a quotient from 1e-09 to 1e"):
        scene_file.read_string(xml)


def test_an_image_that_claims_too_much_memory_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from PIL import Image

    def load(image: Image.Image) -> None:
        raise MemoryError

    monkeypatch.setattr("PIL.PngImagePlugin.PngImageFile.load", load)
    content = (PLUGINS / "textures/rgba.png").read_bytes()
    (tmp_path / "large.png").write_bytes(content)
    with pytest.raises(SceneError, match=r"large\.png: damaged image: it claims more"):
        read_texels(tmp_path / "large.png")
