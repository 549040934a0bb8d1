"""`lightproof convert`: models that `trimesh` has written become scenes."""

from __future__ import annotations

import json
import re
import struct
import sys

import numpy as np
import pytest

import renderer
from renderer.command.convert import main
from renderer.conversion.model import MISSING
from renderer.scene_file import read_file

pytestmark = pytest.mark.usefixtures("in_an_empty_folder")


def test_without_trimesh_one_line_says_how_to_install_it(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)  # its import fails
    assert main(["model.glb"]) == 2
    assert capsys.readouterr().err == f"lightproof convert: error: {MISSING}\n"


def shifted(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


@pytest.fixture
def glb(tmp_path):
    """A model with shared, textured, emitting and clear meshes, a camera and lights."""
    trimesh = pytest.importorskip("trimesh")
    pillow = pytest.importorskip("PIL.Image")
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    def dressed(mesh, uv=None, **material):
        mesh.visual = TextureVisuals(uv=uv, material=PBRMaterial(**material))
        return mesh

    model = trimesh.Scene()
    ball = trimesh.creation.icosphere(2, 0.5)
    assert len(ball.vertex_normals)  # computed, and so written
    model.add_geometry(
        dressed(
            ball, name="gold", baseColorFactor=[255, 190, 80, 255], roughnessFactor=0.25
        ),
        geom_name="ball",
        node_name="left",
        transform=shifted(-1, 0.5, 0),
    )
    model.graph.update("right", matrix=shifted(1, 0.5, 0), geometry="ball")
    corners = [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]]
    floor = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    texels = np.full((2, 2, 3), 200, np.uint8)
    texels[0, 0] = 255, 0, 0  # the top left
    model.add_geometry(
        dressed(
            floor,
            uv=[[0, 0], [1, 0], [1, 1], [0, 1]],
            name="floor",
            baseColorTexture=pillow.fromarray(texels),
            metallicFactor=0.0,
            roughnessFactor=0.9,
        ),
        geom_name="floor",
    )
    lamp = dressed(
        trimesh.creation.box([1, 0.1, 1]), name="lamp", emissiveFactor=[1, 0.5, 0]
    )
    model.add_geometry(lamp, geom_name="lamp", transform=shifted(0, 2, 0))
    glass = dressed(
        trimesh.creation.box([1, 1, 1]),
        name="veil",
        alphaMode="BLEND",
        baseColorFactor=[255, 255, 255, 51],
    )
    model.add_geometry(glass, geom_name="veil", transform=shifted(0, 0.5, -2))
    path = tmp_path / "model.glb"
    path.write_bytes(with_more(model.export(file_type="glb")))
    return path


def with_more(content):
    """Add a camera, lights and an animation to the JSON of a file, as other programs do."""
    (size,) = struct.unpack_from("<I", content, 12)
    header = json.loads(content[20 : 20 + size])
    half = np.sqrt(0.5)
    lights = [
        {"type": "point", "intensity": 3.0, "color": [1.0, 0.5, 0.0]},
        {"type": "directional", "intensity": 2.0},
        {"type": "spot", "spot": {"outerConeAngle": np.radians(30.0)}},
    ]
    extension = "KHR_lights_punctual"
    header["extensions"] = {extension: {"lights": lights}}
    header["extensionsUsed"] = [extension, "KHR_materials_clearcoat"]
    header["cameras"] = [
        {
            "type": "perspective",
            "perspective": {"yfov": np.radians(40.0), "aspectRatio": 2.0},
        }
    ]
    header["animations"] = [{"channels": [], "samplers": []}]
    own = [
        {"camera": 0, "translation": [0.0, 1.0, 8.0], "scale": [2.0, 2.0, 2.0]},
        # inside of another node, which is turned by 180 degrees around y
        {"extensions": {extension: {"light": 0}}, "translation": [-1.0, 2.0, 0.0]},
        # turned by 90 degrees around x: it shines downwards
        {"extensions": {extension: {"light": 1}}, "rotation": [-half, 0.0, 0.0, half]},
        {"extensions": {extension: {"light": 2}}, "translation": [0.0, 4.0, 0.0]},
    ]
    first = len(header["nodes"])
    around = {
        "children": [first + 1],
        "rotation": [0.0, 1.0, 0.0, 0.0],
        "translation": [0.0, 0.0, 3.0],
    }
    header["nodes"] += [*own, around]
    header["scenes"][0]["nodes"] += [first, first + 4, first + 2, first + 3]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + size :]
    total = 20 + len(text) + len(rest)
    start = struct.pack("<4sIIII", b"glTF", 2, total, len(text), 0x4E4F534A)
    return start + text + rest


def test_what_the_scene_has_is_what_the_model_had(glb, capsys):
    assert main([str(glb), "-o", "scene.xml"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said == [
        "differs from the model: animations: nothing moves in a scene",
        "differs from the model: the extension KHR_materials_clearcoat",
        "wrote scene.xml and scene_meshes",
    ]
    found = read_file("scene.xml")
    camera = found.camera
    assert (camera.film.width, camera.film.height) == (960, 480)
    np.testing.assert_allclose(camera.to_world[:3, 3], (0, 1, 8))
    np.testing.assert_allclose(camera.to_world[:3, 2], (0, 0, -1), atol=1e-12)
    left = camera.to_world[:3, 0]  # of Mitsuba's cameras; glTF's have +x on the right
    np.testing.assert_allclose(left, (-1, 0, 0), atol=1e-12)
    half = np.tan(np.radians(20.0)) * 2.0
    np.testing.assert_allclose(camera.fov_x, 2.0 * np.degrees(np.arctan(half)), rtol=1e-6)
    assert len(found.shapes) == 3 and len(found.instances) == 2
    places = sorted(instance.to_world[0, 3] for instance in found.instances)
    assert places == [-1.0, 1.0]
    (lamp,) = (shape for shape in found.shapes if shape.radiance is not None)
    np.testing.assert_allclose(lamp.radiance, (1.0, 0.5, 0.0))
    point, sun, spot = found.emitters
    np.testing.assert_allclose(point.intensity, (3.0, 1.5, 0.0))
    np.testing.assert_allclose(point.position, (1.0, 2.0, 3.0))
    np.testing.assert_allclose(sun.direction, (0.0, -1.0, 0.0), atol=1e-6)
    assert spot.cutoff_angle == pytest.approx(30.0)
    text = (glb.parent / "scene.xml").read_text()
    assert 'name="roughness" value="0.25"' in text
    assert '<float name="opacity" value="0.2"' in text


def test_textures_stand_the_right_way_up(glb):
    """The red texel at the picture's top left is at u = 0 and v = 1 of the model."""
    main([str(glb), "-o", "scene.xml"])
    scene = renderer.load_dict(floor_seen_from_above(glb.parent / "scene_meshes"))
    pixels = renderer.render(scene, spp=16).pixels
    red = pixels[:, :, 0] - pixels[:, :, 2]
    # the camera's up is -z of the floor, where v = 1; its right is +x, where u = 1
    assert np.unravel_index(red.argmax(), red.shape)[0] < 8
    assert np.unravel_index(red.argmax(), red.shape)[1] < 8
    assert red[8:, 8:].max() < 0.5 * red.max()


@pytest.mark.parametrize(("texel", "axis"), [((218, 128, 218), 0), ((128, 218, 218), 1)])
def test_normal_maps_turn_to_the_right_side(tmp_path, texel, axis):
    """Red turns normals along u, and green along v upwards: towards x and y here."""
    trimesh = pytest.importorskip("trimesh")
    pillow = pytest.importorskip("PIL.Image")
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    corners, uv = (
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]),
        np.zeros((4, 2)),
    )
    uv[:] = (corners[:, :2] + 1) / 2
    quad = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    normals = pillow.fromarray(np.full((2, 2, 3), texel, np.uint8))
    material = PBRMaterial(normalTexture=normals, metallicFactor=0.0, roughnessFactor=1.0)
    quad.visual = TextureVisuals(uv=uv, material=material)
    (tmp_path / "quad.glb").write_bytes(trimesh.Scene(quad).export(file_type="glb"))
    assert main(["quad.glb"]) == 0
    text = (tmp_path / "quad.xml").read_text()
    text = re.sub(r'<emitter type="constant">.*?</emitter>', "", text, flags=re.DOTALL)
    brightest = []
    for side in (1.0, -1.0):  # where the light comes from
        direction = [0.0, 0.0, -1.0]
        direction[axis] = -side
        words = " ".join(map(str, direction))
        lit = re.sub(
            r'name="direction" value="[^"]*"', f'name="direction" value="{words}"', text
        )
        scene = renderer.load_string(lit, base_dir=tmp_path, width=16, height=12)
        brightest.append(renderer.render(scene, 4).pixels.max())
    assert brightest[0] > 0.4 and brightest[1] < 0.05


def floor_seen_from_above(folder):
    (mesh,) = folder.glob("*floor.ply")
    (texture,) = folder.glob("*_base.png")
    return {
        "type": "scene",
        "sensor": {
            "type": "orthographic",
            "to_world": renderer.look_at([0, 5, 0], [0, 0, 0], [0, 0, -1])
            @ renderer.scale(2.9),
            "film": {
                "type": "hdrfilm",
                "width": 16,
                "height": 16,
                "rfilter": {"type": "box"},
            },
        },
        "floor": {
            "type": "ply",
            "filename": str(mesh),
            "bsdf": {
                "type": "diffuse",
                "reflectance": {
                    "type": "bitmap",
                    "filename": str(texture),
                    "filter_type": "nearest",
                },
            },
        },
        "sky": {"type": "constant"},
    }


@pytest.mark.parametrize("ending", ["obj", "ply", "stl"])
def test_other_formats_are_framed_and_lit(tmp_path, ending, capsys):
    """The camera sees the whole box: its corners are in the picture."""
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / f"box.{ending}"
    trimesh.creation.box([1.0, 2.0, 3.0]).export(path)
    assert main([str(path)]) == 0
    assert "an even sky and a sun were added" in capsys.readouterr().out
    found = read_file(tmp_path / "box.xml")
    camera, (shape,) = found.camera, found.shapes
    corners = np.c_[shape.vertices, np.ones(len(shape.vertices))]
    seen = corners @ np.linalg.inv(camera.to_world).T
    slope = np.abs(seen[:, :2] / seen[:, 2:3]).max(axis=0)
    across = np.tan(np.radians(camera.fov_x / 2.0))
    assert (seen[:, 2] > 0.0).all()
    fill = slope / (across, across * camera.film.height / camera.film.width)
    assert 0.8 < fill.max() < 1.0
    assert len(found.emitters) == 2
    up = camera.to_world[:3, 1]
    assert np.argmax(np.abs(up)) == (2 if ending == "stl" else 1)


def test_materials_of_an_obj_file(tmp_path):
    pytest.importorskip("trimesh")
    (tmp_path / "a.mtl").write_text(
        "newmtl red\nKd 0.8 0.2 0.2\nNs 100\nnewmtl lamp\nKd 0 0 0\nKe 3 2 1\n"
    )
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
        "usemtl red\nf 1 2 3\nusemtl lamp\nf 1 2 4\n"
    )
    assert main(["a.obj"]) == 0
    shapes = read_file("a.xml").shapes
    (lamp,) = (shape for shape in shapes if shape.radiance is not None)
    np.testing.assert_allclose(lamp.radiance, (3.0, 2.0, 1.0))
    text = (tmp_path / "a.xml").read_text()
    assert 'name="base_color" value="0.8 0.2 0.2"' in text
    assert 'name="metallic" value="0"' in text


def test_files_that_are_not_found_are_listed(tmp_path, capsys):
    """A texture outside of the model's folder is not read."""
    pillow = pytest.importorskip("PIL.Image")
    pytest.importorskip("trimesh")
    folder = tmp_path / "model"
    folder.mkdir()
    pillow.new("RGB", (2, 2)).save(tmp_path / "secret.png")
    (folder / "a.mtl").write_text("newmtl red\nKd 0.8 0.2 0.2\nmap_Kd ../secret.png\n")
    face = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    (folder / "a.obj").write_text(f"mtllib a.mtl\nusemtl red\n{face}")
    (folder / "b.obj").write_text(f"mtllib lost.mtl\n{face}")
    for name, words in (("a", "failed to load image"), ("b", "unable to load materials")):
        assert main([str(folder / f"{name}.obj")]) == 0
        assert f"differs from the model: {words}" in capsys.readouterr().out
    assert not list(folder.glob("a_meshes/*.png"))


def test_colours_of_vertices(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    corners, colors = np.eye(3), np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255]], np.uint8)
    mesh = trimesh.Trimesh(corners, [[0, 1, 2]], vertex_colors=colors, process=False)
    mesh.export(tmp_path / "colored.ply")
    assert main([str(tmp_path / "colored.ply")]) == 0
    (shape,) = read_file(tmp_path / "colored.xml").shapes
    np.testing.assert_allclose(shape.attributes["vertex_color"], np.eye(3))


def test_nothing_is_overwritten_unless_it_is_forced(tmp_path, capsys):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box().export(tmp_path / "box.ply")
    (tmp_path / "box.xml").write_text("mine")
    assert main(["box.ply"]) == 2
    assert "box.xml: is there already; --force" in capsys.readouterr().err
    assert (tmp_path / "box.xml").read_text() == "mine"
    assert main(["box.ply", "--force"]) == 0
    assert (tmp_path / "box.xml").read_text().startswith("<scene")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("missing.glb", None, "missing.glb: no such file"),
        ("a.glb", b"no model", "a.glb: cannot be read as glTF: there is no JSON in it"),
        ("a.ply", b"no model", "a.ply: cannot be read: "),
        ("a.xyz", b"1 2 3\n4 5 6\n", "a.xyz: has no triangles"),
        ("a.xyzzy", b"no model", "a.xyzzy: cannot be read: "),
    ],
)
def test_what_cannot_be_read_is_one_line(tmp_path, capsys, name, content, words):
    pytest.importorskip("trimesh")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert main([name]) == 2
    said = capsys.readouterr().err
    assert words in said and len(said.splitlines()) == 1
    assert not (tmp_path / name).with_suffix(".xml").exists()
