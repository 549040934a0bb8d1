"""Shapes: the places, areas and normals of Mitsuba, and one error for each fault."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours, points_on, theirs
from scene_xml import props, tag

from renderer.scene_file.description import Cylinder, Disk, Rectangle, Shape, Sphere
from renderer.scene_file.meshes.mesh_data import surface_area

MOVED = '<transform name="to_world">{}</transform>'
ROTATED = MOVED.format(
    '<rotate y="1" angle="40"/><scale value="1.5"/><translate x="3" z="-1"/>'
)
MIRRORED = MOVED.format('<rotate y="1" angle="40"/><scale x="-1"/><translate y="2"/>')
STRETCHED = MOVED.format('<scale x="2" z="0.5"/><rotate x="1" angle="20"/>')
SHEARED = MOVED.format('<matrix value="1 0.5 0 1  0 1 0 2  0.25 0 1 3  0 0 0 1"/>')
FLIPPED = props(flip_normals=True)
BALL = '<point name="center" x="1" y="2" z="3"/><float name="radius" value="2"/>'
TUBE = (
    '<point name="p0" x="1" y="2" z="0"/><point name="p1" x="0" y="1" z="2"/>'
    '<float name="radius" value="0.5"/>'
)

SHAPES = [
    *((plugin, "") for plugin in ("rectangle", "disk", "sphere", "cylinder", "cube")),
    *((plugin, ROTATED) for plugin in ("rectangle", "disk", "sphere", "cylinder", "cube")),
    *((plugin, FLIPPED) for plugin in ("rectangle", "disk", "sphere", "cylinder", "cube")),
    *((plugin, MIRRORED) for plugin in ("rectangle", "disk", "sphere", "cylinder", "cube")),
    *((plugin, FLIPPED + MIRRORED) for plugin in ("rectangle", "disk", "sphere", "cube")),
    *((plugin, STRETCHED) for plugin in ("rectangle", "disk", "cube")),
    *((plugin, SHEARED) for plugin in ("rectangle", "disk", "cube")),
    *(("sphere", BALL + more) for more in ("", ROTATED, MIRRORED)),
    ("sphere", '<integer name="radius" value="3"/><vector name="center" value="1"/>'),
    *(("cylinder", TUBE + more) for more in ("", ROTATED)),
    ("cylinder", '<point name="p1" x="0" y="0" z="-2"/>'),
    ("cylinder", MOVED.format('<scale z="3"/><rotate x="1" angle="20"/>')),
]
IDS = [f"{plugin}-{n}" for n, (plugin, _) in enumerate(SHAPES)]


def both(plugin: str, content: str) -> tuple[Shape, Any]:
    text = f'<shape type="{plugin}">{content}</shape>'
    return ours(text).shapes[0], theirs(text).shapes()[0]


@pytest.mark.parametrize(("plugin", "content"), SHAPES, ids=IDS)
def test_bounds_and_area_are_those_of_mitsuba(plugin: str, content: str) -> None:
    shape, reference = both(plugin, content)
    points = points_on(shape)
    bounds = reference.bbox()
    size = np.max(np.array(bounds.max) - np.array(bounds.min))
    # Mitsuba's box around a moved disk or cylinder is exact; 721 points of a circle nearly.
    np.testing.assert_allclose(points.min(axis=0), bounds.min, atol=1e-5 * size)
    np.testing.assert_allclose(points.max(axis=0), bounds.max, atol=1e-5 * size)
    assert surface_area(shape) == pytest.approx(reference.surface_area(), rel=1e-5)


ANALYTIC = [(plugin, content) for plugin, content in SHAPES if plugin != "cube"]


@pytest.mark.parametrize(("plugin", "content"), ANALYTIC)
def test_surface_point_and_normal_are_those_of_mitsuba(plugin: str, content: str) -> None:
    """Shoot a ray through Mitsuba's scene and find its uv on our shape.

    Mitsuba's shading normal is compared: on a mirrored rectangle its geometric normal
    points the other way, as it does on any mirrored mesh without vertex normals.
    """
    text = f'<shape type="{plugin}">{content}</shape>'
    shape, scene = ours(text).shapes[0], theirs(text)
    m = shape.to_world
    for u, v in ((0.3, 0.4), (0.7, 0.2), (0.1, 0.9)):
        angle = 2.0 * np.pi * (v if plugin == "disk" else u)
        circle = np.array([np.cos(angle), np.sin(angle)])
        match shape:
            case Rectangle():
                p, n = [2 * u - 1, 2 * v - 1, 0], [0, 0, 1]
            case Disk():
                p, n = [*(u * circle), 0], [0, 0, 1]
            case Sphere():
                p = n = [*(np.sin(np.pi * v) * circle), np.cos(np.pi * v)]
            case Cylinder():
                p, n = [*circle, v], [*circle, 0]
        point = m[:3, :3] @ p + m[:3, 3]
        normal = np.linalg.inv(m[:3, :3]).T @ n
        normal /= np.linalg.norm(normal)
        si = scene.ray_intersect(mi.Ray3f(point + 0.1 * normal, -normal))
        assert si.is_valid()
        np.testing.assert_allclose(si.p, point, atol=1e-5)
        np.testing.assert_allclose(si.uv, [u, v], atol=1e-4)
        expected = -normal if shape.flip_normals else normal
        np.testing.assert_allclose(si.sh_frame.n, expected, atol=1e-4)


def test_meshes_come_from_their_files(tmp_path: Path) -> None:
    """Their content has tests of its own; here the properties that the scene sets."""
    (tmp_path / "t.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvt 0 0.25\nvt 1 0\nvt 1 1\n"
        "f 1/1 2/2 3/3\nf 2/2 4/3 3/3\nf 1/1 1/1 2/2\n"
    )
    (tmp_path / "t.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty float u\nproperty float v\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        "0 0 0 0 0.25\n1 0 0 1 0\n0 1 0 1 1\n3 0 1 2\n"
    )
    for plugin in ("obj", "ply"):
        name = f'<string name="filename" value="t.{plugin}"/>'
        for extra in (
            "",
            props(face_normals=True),
            FLIPPED,
            ROTATED,
            props(flip_tex_coords=True),
            props(flip_tex_coords=False),
        ):
            text = f'<shape type="{plugin}">{name}{extra}</shape>'
            scene = ours(text, folder=tmp_path)
            mesh = scene.shapes[0]
            reference = mi.traverse(theirs(text, folder=tmp_path).shapes()[0])
            points = np.array(reference["vertex_positions"]).reshape(-1, 3)
            np.testing.assert_allclose(mesh.vertices, points, atol=1e-5)
            uvs = np.array(reference["vertex_texcoords"]).reshape(-1, 2)
            np.testing.assert_allclose(mesh.uvs, uvs, atol=1e-6)
            assert (mesh.normals is None) == ("face_normals" in extra)
            assert mesh.flip_normals == (extra == FLIPPED)
            assert [Path(file).name for file in scene.files] == [f"t.{plugin}"]
            if plugin == "obj":
                assert "dropped 1 degenerate of 3 triangles" in scene.warnings[0]
                assert mesh.location.line == 2


def test_ids_lines_and_emission_are_kept() -> None:
    shape = ours(
        '\n<shape type="cube" id="lamp"><emitter type="area">'
        '<rgb name="radiance" value="1 2 3"/></emitter></shape>'
    ).shapes[0]
    assert (shape.id, shape.location.line, shape.radiance) == ("lamp", 3, (1.0, 2.0, 3.0))


def test_properties_without_effect_are_taken() -> None:
    for plugin in ("rectangle", "cube"):
        both(plugin, props(face_normals=True))
    both("sphere", props(silhouette_sampling_weight=2.0))


# -------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        (
            "ellipsoids",
            "",
            "supported shape plugins: obj, ply, cube, serialized, rectangle, disk",
        ),
        ("diffuse", "", 'shape "diffuse" is not supported; supported shape plugins: obj'),
        ("obj", "", 'property "filename": found nothing, expected the path of a .obj file'),
        ("ply", props(filename="no.ply"), '"no.ply" not found; looked in: '),
        (
            "obj",
            props(
                filename="/a/long/way/to/a/model/that/somebody/has/on/another/machine/no.obj"
            ),
            '/another/machine/no.obj" not found; looked in: ',
        ),
        ("sphere", props(face_normals=True), "supported: <bsdf>, <emitter>"),
        ("disk", props(radius=1.0), 'has no property "radius"; supported: '),
        ("cube", props(flip_tex_coords=True), "supported: <bsdf>"),
        ("sphere", props(radius="1"), "a value of type string, expected float"),
        ("sphere", tag("rgb", center="1"), "a value of type rgb, expected point or ve"),
        ("sphere", props(to_world=1.0), "of type float, expected transform"),
        ("sphere", props(flip_normals=1), "integer, expected boolean"),
        ("sphere", '<shape type="sphere"/>', "has no <shape>; supported: <bsdf>"),
        (
            "sphere",
            '<emitter type="area"/>\n<emitter type="area"/>',
            "a second <emitter> in sh",
        ),
    ],
)
def test_shapes_that_are_wrong(plugin: str, content: str, message: str) -> None:
    text = f'<shape type="{plugin}">{content}</shape>'
    assert error_of(text).startswith(("<string>:2: ", "<string>:3: "))
    assert message in error_of(text)
    assert mitsuba_refuses(text)


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("sphere", props(radius=0.0), "found 0, expected above 0"),
        ("sphere", props(radius=-1.0), "found -1, expected above 0"),
        ("cylinder", props(radius=-1.0), "found -1, expected above 0"),
        ("cylinder", tag("point", p1="0"), "found the same point as p0, expected anot"),
        ("sphere", STRETCHED, "a transform that makes an ellipsoid, expected a rotation"),
        ("sphere", SHEARED, "a transform that makes an ellipsoid"),
        ("cylinder", STRETCHED, "a transform that makes the tube elliptic or slanted"),
        ("cylinder", SHEARED, "a transform that makes the tube elliptic or slanted"),
        ("cylinder", MIRRORED + '<emitter type="area"/>', "a mirrored cylinder that emits"),
        ("sphere", '<texture type="checkerboard" name="x"/>', 'has no property "x"'),
        ("sphere", '<emitter type="constant"/>', 'emitter "constant" cannot be in a shape'),
    ],
)
def test_shapes_that_only_we_refuse(plugin: str, content: str, message: str) -> None:
    """Mitsuba renders something else than the file says, or NaN."""
    message_found = error_of(f'<shape type="{plugin}">{content}</shape>')
    assert message_found.startswith("<string>:2: ")
    assert message in message_found


@pytest.mark.parametrize("plugin", ["rectangle", "disk", "sphere", "cylinder", "cube"])
def test_emitter_whose_area_float32_cannot_hold(plugin: str) -> None:
    """Not singular, but 1e-25 squared is 0 in float32, and so is what Mitsuba samples."""
    tiny = MOVED.format('<scale value="1e-25"/>')
    found = error_of(f'\n<shape type="{plugin}">{tiny}<emitter type="area"/></shape>')
    assert found.startswith("<string>:3: ")
    assert "no area" in found


def test_damaged_mesh_says_where_it_is_named_and_what_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")
    (tmp_path / "range.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n")
    (tmp_path / "cut.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
        "end_header\n0 0 0\n1 0 0\n"
    )
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    for name, words in (
        ("bad.obj", "bad.obj:3"),
        ("range.obj", "range.obj:4"),
        ("cut.ply", "cut.ply"),
        ("flat.obj", "degenerate"),
    ):
        text = (
            f'<shape type="{name[-3:]}">\n<string name="filename" value="{name}"/>'
            '<emitter type="area"/></shape>'
        )
        message = error_of(text, folder=tmp_path)
        assert message.startswith(("<string>:3: ", "<string>:2: "))
        assert words in message
