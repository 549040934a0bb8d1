"""Attributes of meshes: read from PLY as Mitsuba reads them, looked up as it does."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from kernel_probes import Inputs, run_parameters
from scene_file_samples import error_of, ours

import renderer
from renderer.kernels.jit import pack
from renderer.plugins.textures.registry import mean_of
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene_file.description import MeshAttributeTexture
from renderer.scene_file.meshes.ply_file import read_ply

MESH = Path(__file__).parents[2] / "plugins" / "textures" / "octahedron.ply"
NOT_ATTRIBUTES = {"vertex_positions", "vertex_normals", "vertex_texcoords"}


def write_ply(
    path: Path, of_vertices: str, of_faces: str = "", kind: str = "float"
) -> None:
    """Write a triangle; `of_vertices` and `of_faces` are the names of more fields."""
    fields, face_fields = of_vertices.split(), of_faces.split()
    lines = ["ply", "format ascii 1.0", "element vertex 3"]
    lines += [f"property float {name}" for name in "xyz"]
    lines += [f"property {kind} {name}" for name in fields]
    lines += ["element face 1", "property list uchar int vertex_indices"]
    lines += [f"property {kind} {name}" for name in face_fields]
    lines.append("end_header")
    for i, corner in enumerate(("0 0 0", "1 0 0", "0 1 0")):
        values = [str(10 * (i + 1) + k) for k in range(len(fields))]
        lines.append(" ".join([corner, *values]))
    lines.append(" ".join(["3 0 1 2", *(str(7 + k) for k in range(len(face_fields)))]))
    path.write_text("\n".join(lines) + "\n")


FIELDS = (
    *("r g b", "red green blue", "red green blue alpha", "r g b a", "r", "r g", "g r b"),
    *("red g b", "foo_x foo_y foo_z", "foo_r foo_g foo_b", "color_r color_g color_b"),
    *("foo_r", "foo_x", "foo_0 foo_1 foo_2", "foo_1 foo_2 foo_3", "foo_1", "foo_0"),
    *("foo_2", "foo_a", "foo", "foo_x foo_y", "foo_x foo_y foo_z foo_w", "foo_x bar_x"),
    *("foo_x bar_y foo_y", "a_b_x", "foo_bar", "intensity foo_x", "foo_z foo_y foo_x"),
    *("foo_r foo_g foo_b foo_a", "foo_x r g b bar_0", "nx ny foo_x", "u foo_x"),
    *("foo_g foo_b foo_r", "foo_x foo_r foo_0", "u v foo_x", "s t r g b"),
)


@pytest.mark.parametrize("on_faces", [False, True])
@pytest.mark.parametrize("fields", FIELDS)
def test_fields_make_the_attributes_of_mitsuba(
    tmp_path: Path, fields: str, on_faces: bool
) -> None:
    path = tmp_path / "mesh.ply"
    write_ply(path, *(("", fields) if on_faces else (fields, "")))
    mesh = mi.traverse(mi.load_dict({"type": "ply", "filename": str(path)}))
    expected = {
        key: np.array(mesh[key])
        for key in mesh.keys()
        if key.startswith(("vertex_", "face_"))
        and not key.endswith("_count")
        and key not in NOT_ATTRIBUTES
    }
    found = read_ply(path).attributes
    assert found.keys() == expected.keys()
    for name, values in found.items():
        np.testing.assert_array_equal(values.ravel(), expected[name])


def test_bytes_stay_what_they_are(tmp_path: Path) -> None:
    """As in Mitsuba, which warns as well; colours of 0..255 are no reflectances."""
    write_ply(tmp_path / "mesh.ply", "red green blue", kind="uchar")
    mesh = read_ply(tmp_path / "mesh.ply")
    assert mesh.attributes["vertex_color"].max() == 32.0
    assert "vertex_color is up to 32; as in Mitsuba it is not divided by 255" in str(
        mesh.warnings
    )


def test_what_makes_no_attribute_is_mentioned(tmp_path: Path) -> None:
    write_ply(tmp_path / "mesh.ply", "quality foo_x foo_y")
    assert [
        line.partition(": ")[2] for line in read_ply(tmp_path / "mesh.ply").warnings
    ] == [
        "vertex fields `quality` make no attribute",
        "vertex fields `foo_x`, `foo_y` make no attribute",
    ]


@pytest.mark.parametrize(
    ("fields", "row", "name"),
    [(("foo_x", ""), "1 0 0 20", "vertex_foo"), (("", "foo_x"), "3 0 1 2 7", "face_foo")],
)
def test_an_attribute_that_is_not_finite_is_refused_where_a_texture_shows_it(
    tmp_path: Path, fields: tuple[str, str], row: str, name: str
) -> None:
    """Mitsuba renders such a mesh as long as nothing looks at the attribute."""
    path = tmp_path / "mesh.ply"
    write_ply(path, *fields)
    text = path.read_text()
    assert row in text
    path.write_text(text.replace(row, row.rpartition(" ")[0] + " nan"))
    file = f'<string name="filename" value="{path}"/>'
    ours(f'<shape type="ply">{file}</shape>', folder=tmp_path)
    named = f'<string name="name" value="{name}"/>'
    found = whole(
        SCENE.format(
            shape="ply", file=file, bsdf="diffuse", parameter="reflectance", name=named
        )
    )
    assert f'"{name}" of the shape at <string>:1 is not finite at 1 of' in found


def test_faces_without_area_take_their_attributes_along(tmp_path: Path) -> None:
    path = tmp_path / "mesh.ply"
    write_ply(path, "", "foo_x")
    text = path.read_text().replace("element face 1", "element face 2")
    path.write_text(text.replace("3 0 1 2 7", "3 0 1 1 5\n3 0 1 2 7"))
    mesh = ours(
        '<shape type="ply"><string name="filename" value="mesh.ply"/></shape>',
        folder=tmp_path,
    ).shapes[0]
    np.testing.assert_array_equal(mesh.attributes["face_foo"], [[7.0]])


# ------------------------------------------------------------------------ looked up


def octahedron(name: str, scale: float = 1.0) -> dict:
    texture = {"type": "mesh_attribute", "name": name, "scale": scale}
    return {
        "type": "ply",
        "filename": str(MESH),
        "to_world": mi.ScalarTransform4f().translate([3, 2, 1]).scale([2, 1, 0.5]),
        "bsdf": {"type": "diffuse", "reflectance": texture},
    }


@pytest.mark.parametrize(
    "name", ["vertex_color", "vertex_heat", "face_tint_color", "face_age"]
)
def test_against_mitsuba(name: str) -> None:
    """At 500 points that rays hit, from all sides; a second mesh comes first."""
    content = {
        "type": "scene",
        "camera": {"type": "perspective"},
        "other": octahedron("vertex_color") | {"to_world": mi.ScalarTransform4f()},
        "mesh": octahedron(name, 0.75),
    }
    theirs = mi.load_dict(content, optimize=False)
    texture = mi.load_dict({"type": "mesh_attribute", "name": name, "scale": 0.75})
    rng = np.random.default_rng(0)
    position, prim, expected = [], [], []
    while len(prim) < 500:
        d = rng.normal(size=3)
        target = np.array([3, 2, 1]) + 0.2 * rng.normal(size=3)
        si = theirs.ray_intersect(mi.Ray3f((target - 9 * d).tolist(), d.tolist()))
        if si.is_valid() and si.shape.id() == "mesh":
            position.append(list(si.p))
            prim.append(8 + si.prim_index)
            expected.append(list(texture.eval(si)))
    n = len(prim)
    inputs = Inputs(
        scene := renderer.load_dict(content), make_plan(scene, integrator="path")
    )
    points = inputs.workspace(n).points
    points.bsdf[:n] = 1
    points.position[:, :n] = np.array(position).T
    points.prim[:n] = prim
    run_parameters(pack(inputs.record.bsdfs), pack(points), n)
    np.testing.assert_allclose(points.parameters[:3, :n].T, expected, atol=2e-6)
    assert len(np.unique(np.round(expected, 4), axis=0)) >= 8


# -------------------------------------------------------------------------- errors

SCENE = """<shape type="{shape}">{file}
<bsdf type="{bsdf}">
<texture name="{parameter}" type="mesh_attribute">{name}</texture></bsdf></shape>"""


def error(
    name: str, *, shape: str = "ply", bsdf: str = "diffuse", parameter: str = "reflectance"
) -> str:
    file = f'<string name="filename" value="{MESH}"/>' if shape == "ply" else ""
    named = f'<string name="name" value="{name}"/>' if name else ""
    content = SCENE.format(
        shape=shape, file=file, bsdf=bsdf, parameter=parameter, name=named
    )
    return error_of(content)


def test_names_that_are_wrong() -> None:
    assert 'property "name": found nothing, expected the name' in error("")
    found = error("color")
    assert found.startswith('<string>:4: texture "mesh_attribute"')
    assert 'found "color", expected a name that begins with vertex_ or face_' in found


def whole(content: str) -> str:
    """Return the error of building the scene, which knows the meshes."""
    text = f'<scene version="3.0.0">{content}<sensor type="perspective"/></scene>'
    with pytest.raises(renderer.SceneError) as caught:
        renderer.load_string(text, allow_outside="/")
    return str(caught.value)


@pytest.mark.parametrize(
    ("shape", "name", "message"),
    [
        ("ply", "vertex_paint", 'has no attribute "vertex_paint"; it has: vertex_color, '),
        (
            "ply",
            "face_color",
            "it has: vertex_color, vertex_heat, face_tint_color, face_age",
        ),
        ("sphere", "vertex_color", 'has no attribute "vertex_color"; it has: none'),
        ("rectangle", "vertex_color", "it has: none"),
    ],
)
def test_attributes_that_a_shape_has_not(shape: str, name: str, message: str) -> None:
    file = f'<string name="filename" value="{MESH}"/>' if shape == "ply" else ""
    named = f'<string name="name" value="{name}"/>'
    found = whole(
        SCENE.format(
            shape=shape, file=file, bsdf="diffuse", parameter="reflectance", name=named
        )
    )
    assert found.startswith('<string>:3: texture "mesh_attribute", property "name": ')
    assert "the shape at <string>:1 " in found
    assert message in found


@pytest.mark.parametrize("scale", ["3.4e38", "-1e10"])
def test_attributes_that_paths_cannot_be_multiplied_by(scale: str) -> None:
    """The picture was not finite; the soak found it, cases 197911 and 206711."""
    name = f'<string name="name" value="face_age"/><float name="scale" value="{scale}"/>'
    file = f'<string name="filename" value="{MESH}"/>'
    found = whole(
        SCENE.format(
            shape="ply", file=file, bsdf="diffuse", parameter="reflectance", name=name
        )
    )
    assert found.startswith('<string>:3: texture "mesh_attribute", property "scale": ')
    assert "the shape at <string>:1 up to " in found and "at most 1e+09" in found


def test_a_colour_where_a_number_is_needed(tmp_path: Path) -> None:
    """As in Mitsuba; four components are refused."""
    file = f'<string name="filename" value="{MESH}"/>'
    named = '<string name="name" value="vertex_color"/>'
    found = whole(
        SCENE.format(
            shape="ply", file=file, bsdf="roughconductor", parameter="alpha", name=named
        )
    )
    assert (
        '"vertex_color" of the shape at <string>:1 has 3 components; expected a number'
        in (found)
    )
    write_ply(tmp_path / "mesh.ply", "r g b a")
    file = f'<string name="filename" value="{tmp_path / "mesh.ply"}"/>'
    found = whole(
        SCENE.format(
            shape="ply", file=file, bsdf="diffuse", parameter="reflectance", name=named
        )
    )
    assert "has 4 components; expected a number or a colour" in found


def test_instances_are_refused() -> None:
    """Mitsuba looks for the point in the world among the vertices of the group."""
    file = f'<string name="filename" value="{MESH}"/>'
    named = '<string name="name" value="vertex_color"/>'
    shape = SCENE.format(
        shape="ply", file=file, bsdf="diffuse", parameter="reflectance", name=named
    )
    found = whole(
        f'<shape type="shapegroup" id="g">{shape}</shape>'
        '<shape type="instance"><ref id="g"/></shape>'
    )
    assert "which is inside of a shapegroup; expected a mesh" in found


def test_an_attribute_has_no_mean() -> None:
    """Nor has it in Mitsuba; plastics need one."""
    with pytest.raises(renderer.SceneError, match="depends on the mean"):
        mean_of(MeshAttributeTexture("vertex_color"))
    with pytest.raises(RuntimeError, match="not implemented"):
        mi.load_dict({"type": "mesh_attribute", "name": "vertex_color"}).mean()
    found = error("vertex_color", bsdf="plastic", parameter="diffuse_reflectance")
    assert found.startswith(
        '<string>:4: texture "mesh_attribute" cannot give this parameter'
    )
