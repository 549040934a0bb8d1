"""Mesh files: triangles, normals and uv as in Mitsuba, and one error for each fault."""

from __future__ import annotations

import itertools
import struct
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

mi.set_variant("scalar_rgb")

import renderer  # noqa: E402
from renderer.errors import SceneError  # noqa: E402
from renderer.scene_file.description import Diffuse, Location, Mesh  # noqa: E402
from renderer.scene_file.meshes.mesh import build_mesh, cube_mesh  # noqa: E402
from renderer.scene_file.meshes.mesh_data import MeshData  # noqa: E402
from renderer.scene_file.meshes.obj_file import read_obj  # noqa: E402
from renderer.scene_file.meshes.ply_file import read_ply  # noqa: E402

POINTS = "v 0 0 0\nv 1 0 0\nv 1 1 0.25\nv 0 1 0\nv 0 0 1\n"
NORMALS = "vn 0 0 2\nvn 0 1 1\nvn 1 0 1\n"
UVS = "vt 0 0.25\nvt 1 0\nvt 1 1\n"

# The mirror has a shear and unequal scales, so that a normal moved like a point shows.
TRANSFORMS = {
    "identity": np.eye(4),
    "affine": np.array([[2, 0.5, 0, 1], [0, 1, 0.25, -2], [0, 0, 0.5, 3], [0, 0, 0, 1.0]]),
    "mirror": np.array([[-1, 0.5, 0, 0], [0, 2, 0, 1], [0.25, 0, 1, 0], [0, 0, 0, 1.0]]),
}

PLY_POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0.25), (0, 1, 0), (0, 0, 1)]
PLY_NORMALS = [(0, 0, 2), (0, 1, 1), (1, 0, 1), (0, 0, 1), (0, 1, 0)]
PLY_UVS = [(0, 0.25), (1, 0), (1, 1), (0, 1), (0.5, 0.5)]
PLY_FACES = [(0, 1, 2), (0, 2, 3), (0, 3, 4)]
TYPE_CODES = {
    "float": "f", "double": "d", "uchar": "B", "int": "i", "short": "h", "uint": "I",
    "int32": "i", "uint8": "B", "float32": "f", "float64": "d", "ushort": "H", "char": "b",
}  # fmt: skip


def write_ply(
    path: Path,
    encoding: str = "binary_little_endian",
    *,
    number: str = "float",
    count: str = "uchar",
    index: str = "int",
    list_name: str = "vertex_indices",
    uv_names: tuple[str, str] | None = None,
    normals: bool = False,
    extra: bool = False,
    points: list[tuple[float, ...]] = PLY_POINTS,
    faces: list[tuple[int, ...]] = PLY_FACES,
) -> Path:
    """Write the test mesh with the requested properties; `extra` adds unknown ones."""
    order = ">" if encoding == "binary_big_endian" else "<"
    names = [(number, name) for name in ("x", "y", "z")]
    rows = [list(point) for point in points]
    if extra:
        names.insert(1, ("uchar", "red"))
        for row in rows:
            row.insert(1, 200)
    if normals:
        names += [(number, name) for name in ("nx", "ny", "nz")]
        for row, normal in zip(rows, PLY_NORMALS, strict=True):
            row += normal
    if uv_names:
        names += [(number, name) for name in uv_names]
        for row, uv in zip(rows, PLY_UVS, strict=True):
            row += uv
    header = ["ply", f"format {encoding} 1.0", "comment made by a test"]
    header.append(f"element vertex {len(rows)}")
    header += [f"property {kind} {name}" for kind, name in names]
    header.append(f"element face {len(faces)}")
    header.append(f"property list {count} {index} {list_name}")
    if extra:
        header.append("property short quality")
    header.append("end_header\n")
    body = b""
    codes = "".join(TYPE_CODES[kind] for kind, _ in names)
    for row in rows:
        if encoding == "ascii":
            body += (" ".join(f"{value:g}" for value in row) + "\n").encode()
        else:
            values = [v if c in "fd" else int(v) for v, c in zip(row, codes, strict=True)]
            body += struct.pack(order + codes, *values)
    for face in faces:
        tail = (7,) if extra else ()
        if encoding == "ascii":
            body += (" ".join(map(str, (len(face), *face, *tail))) + "\n").encode()
        else:
            codes_face = TYPE_CODES[count] + TYPE_CODES[index] * len(face) + "h" * extra
            body += struct.pack(order + codes_face, len(face), *face, *tail)
    path.write_bytes("\n".join(header).encode() + body)
    return path


def build(data: MeshData, transform: str = "identity", **flags: bool) -> Mesh:
    return build_mesh(data, to_world=TRANSFORMS[transform], bsdf=Diffuse(), **flags)[0]


def mitsuba_mesh(plugin: str, transform: str = "identity", **properties: object) -> mi.Mesh:
    properties["to_world"] = mi.ScalarTransform4f(TRANSFORMS[transform])
    return mi.load_dict({"type": plugin, **properties})


def assert_same_mesh(ours: Mesh, theirs: mi.Mesh) -> None:
    """Same vertices, faces, normals, uv, bounds and area, and the same geometric normal.

    `flip_normals` is applied at a hit in Mitsuba and at load by us, so the sign is put
    back before the stored normals are compared, and the hit is compared as well.
    """
    params = mi.traverse(theirs)
    stored = {
        key: np.array(params[key])
        for key in ("vertex_positions", "faces", "vertex_normals", "vertex_texcoords")
    }
    np.testing.assert_array_equal(ours.faces, stored["faces"].reshape(-1, 3))
    np.testing.assert_allclose(
        ours.vertices, stored["vertex_positions"].reshape(-1, 3), rtol=1e-6, atol=1e-6
    )
    assert (ours.normals is None) == (stored["vertex_normals"].size == 0)
    if ours.normals is not None:
        sign = -1.0 if ours.flip_normals else 1.0
        np.testing.assert_allclose(
            sign * ours.normals, stored["vertex_normals"].reshape(-1, 3), atol=2e-6
        )
    assert (ours.uvs is None) == (stored["vertex_texcoords"].size == 0)
    if ours.uvs is not None:
        np.testing.assert_allclose(
            ours.uvs, stored["vertex_texcoords"].reshape(-1, 2), atol=1e-6
        )
    used = ours.vertices[np.unique(ours.faces)]
    assert theirs.surface_area() == pytest.approx(area(ours), rel=1e-5)
    np.testing.assert_array_less(np.array(theirs.bbox().min) - 1e-6, used.min(axis=0))
    np.testing.assert_array_less(used.max(axis=0), np.array(theirs.bbox().max) + 1e-6)
    assert_same_hits(ours, theirs)


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def assert_same_hits(ours: Mesh, theirs: mi.Mesh) -> None:
    """Shoot at the middle of each face along its normal: geometric and shading normal."""
    scene = mi.load_dict({"type": "scene", "mesh": theirs})
    corners = ours.vertices[ours.faces].astype(float)
    sign = -1.0 if ours.flip_normals else 1.0
    for index, (a, b, c) in enumerate(corners):
        normal = sign * np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        middle = (a + b + c) / 3
        hit = scene.ray_intersect(mi.Ray3f(middle + 0.01 * normal, -normal))
        assert hit.is_valid()
        assert hit.prim_index == index
        np.testing.assert_allclose(np.array(hit.n).ravel(), normal, atol=1e-5)
        shading = normal
        if ours.normals is not None:
            shading = ours.normals[ours.faces[index]].astype(float).mean(axis=0)
            shading /= np.linalg.norm(shading)
        np.testing.assert_allclose(np.array(hit.sh_frame.n).ravel(), shading, atol=1e-4)


# ----------------------------------------------------------------- same as Mitsuba

OBJ_FILES = {
    "positions only": POINTS + "f 1 2 3\nf 1 3 4\n",
    "uv": POINTS + UVS + "f 1/1 2/2 3/3\nf 1/1 3/3 4/2\n",
    "normals": POINTS + NORMALS + "f 1//1 2//2 3//3\nf 1//1 3//3 4//1\n",
    "both": POINTS + UVS + NORMALS + "f 1/1/1 2/2/2 3/3/3\nf 1/1/1 3/3/3 4/2/1\n",
    "pentagon": POINTS + "f 1 2 3 4 5\n",
    "vertices in another order, one unused": POINTS + "f 4 5 2\nf 4 2 3\n",
    "names, groups, comments": "# head\nmtllib a.mtl\no thing\n" + POINTS
    + "g one two\nusemtl red\ns off\nf 1 2 3 # first\n\nf 1 3 4\n",
    "windows, colours": "v 0 0 0 1 0 0\r\nv 1 0 0 0 1 0\r\nv 0 1 0 0 0 1\r\nf 1 2 3\r\n",
    "no newline at the end": POINTS + "f 1 2 3",
}  # fmt: skip


@pytest.mark.parametrize("content", OBJ_FILES.values(), ids=OBJ_FILES.keys())
@pytest.mark.parametrize("transform", TRANSFORMS)
def test_obj_is_read_as_mitsuba_reads_it(tmp_path: Path, content: str, transform: str):
    path = tmp_path / "mesh.obj"
    path.write_bytes(content.encode())
    theirs = mitsuba_mesh("obj", transform, filename=str(path))
    assert_same_mesh(build(read_obj(path), transform), theirs)


@pytest.mark.parametrize("flip_normals", [False, True])
@pytest.mark.parametrize("face_normals", [False, True])
@pytest.mark.parametrize("content", [OBJ_FILES["both"], OBJ_FILES["pentagon"]])
def test_normal_flags_mean_the_same(
    tmp_path: Path, content: str, face_normals: bool, flip_normals: bool
):
    """Under a mirror too, where geometric normals turn around and vertex normals do not."""
    path = tmp_path / "mesh.obj"
    path.write_text(content)
    flags = {"face_normals": face_normals, "flip_normals": flip_normals}
    for transform in TRANSFORMS:
        theirs = mitsuba_mesh("obj", transform, filename=str(path), **flags)
        assert_same_mesh(build(read_obj(path), transform, **flags), theirs)


def test_texture_coordinates_flip_by_default_in_obj_and_not_in_ply(tmp_path: Path):
    obj = tmp_path / "mesh.obj"
    obj.write_text(OBJ_FILES["uv"])
    ply = write_ply(tmp_path / "mesh.ply", uv_names=("u", "v"))
    for path, plugin, read in ((obj, "obj", read_obj), (ply, "ply", read_ply)):
        assert_same_mesh(build(read(path)), mitsuba_mesh(plugin, filename=str(path)))
        for flip in (False, True):
            theirs = mitsuba_mesh(plugin, filename=str(path), flip_tex_coords=flip)
            assert_same_mesh(build(read(path, flip_tex_coords=flip)), theirs)


PLY_FILES: dict[str, dict[str, object]] = {
    "plain": {},
    "normals": {"normals": True},
    "u, v": {"uv_names": ("u", "v")},
    "s, t and normals": {"uv_names": ("s", "t"), "normals": True},
    "texture_u, texture_v": {"uv_names": ("texture_u", "texture_v")},
    "vertex_index": {"list_name": "vertex_index"},
    "double, int count, short index": {
        "number": "double",
        "count": "int",
        "index": "short",
    },
    "sized type names": {"number": "float32", "count": "uint8", "index": "int32"},
    "other properties": {"extra": True, "normals": True},
}


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("options", PLY_FILES.values(), ids=PLY_FILES.keys())
def test_ply_is_read_as_mitsuba_reads_it(tmp_path: Path, encoding: str, options: dict):
    path = write_ply(tmp_path / "mesh.ply", encoding, **options)
    for transform in TRANSFORMS:
        theirs = mitsuba_mesh("ply", transform, filename=str(path))
        assert_same_mesh(build(read_ply(path), transform), theirs)


def test_integer_positions_are_plain_numbers(tmp_path: Path):
    """A colour type is not scaled to [0, 1] when it holds a position."""
    points = [(0, 0, 0), (100, 0, 0), (0, 100, 7)]
    for encoding in ("ascii", "binary_big_endian"):
        path = write_ply(
            tmp_path / "mesh.ply",
            encoding,
            number="uchar",
            points=points,
            faces=[(0, 1, 2)],
        )
        np.testing.assert_array_equal(build(read_ply(path)).vertices, points)


@pytest.mark.parametrize("flip_normals", [False, True])
@pytest.mark.parametrize("transform", TRANSFORMS)
def test_cube_is_mitsubas_cube(transform: str, flip_normals: bool):
    """24 vertices in the same order; `face_normals` changes nothing in Mitsuba's either."""
    theirs = mitsuba_mesh("cube", transform, flip_normals=flip_normals)
    assert_same_mesh(build(cube_mesh(), transform, flip_normals=flip_normals), theirs)
    assert mitsuba_mesh("cube", face_normals=True).has_vertex_normals()


# ------------------------------------------------------------- beyond Mitsuba's reader


@pytest.mark.parametrize(
    "faces",
    [
        "f -5/-3 -4/-2 -3/-1\n",
        "f 1/1 2/2 \\\n 3/3\n",
        "f 1/1 2/2 \\\r\n 3/3\r\n",
    ],
)
def test_negative_indices_and_continued_lines(tmp_path: Path, faces: str):
    path = tmp_path / "mesh.obj"
    path.write_bytes((POINTS + UVS + faces).encode())
    plain = tmp_path / "plain.obj"
    plain.write_text(POINTS + UVS + "f 1/1 2/2 3/3\n")
    ours, expected = build(read_obj(path)), build(read_obj(plain))
    np.testing.assert_array_equal(ours.vertices, expected.vertices)
    np.testing.assert_array_equal(ours.uvs, expected.uvs)
    np.testing.assert_array_equal(ours.faces, expected.faces)


@pytest.mark.parametrize("negative", list(itertools.product((False, True), repeat=3)))
@pytest.mark.parametrize("counts", [(5, 4, 3), (3, 4, 5), (4, 3, 5), (3, 5, 4)])
def test_a_negative_index_counts_back_from_the_newest_of_its_kind(
    tmp_path: Path, counts: tuple[int, int, int], negative: tuple[bool, bool, bool]
):
    """There are unequally many `v`, `vt` and `vn`, and more of each behind the first face.

    No two corners of a face share an index of any kind, and none has two equal indices
    throughout, so that an index that is counted from another list shows.
    """
    rng = np.random.default_rng(2)
    values = [
        rng.uniform(0.1, 1.0, (2 * count, width)).round(3)
        for count, width in zip(counts, (3, 2, 3), strict=True)
    ]
    faces, text = [], ""
    for block in range(2):
        for word, rows, count in zip(("v", "vt", "vn"), values, counts, strict=True):
            for row in rows[block * count : (block + 1) * count]:
                text += f"{word} {' '.join(map(str, row))}\n"
        there = [count * (block + 1) for count in counts]
        # from the front, from the back, and from the second on
        face = [(i, there[1] - 1 - i, (i + 1) % there[2]) for i in range(3)]
        faces.append(face)
        text += "f"
        for corner in face:
            shown = (
                index - count if is_negative else index + 1
                for index, count, is_negative in zip(corner, there, negative, strict=True)
            )
            text += " " + "/".join(map(str, shown))
        text += "\n"
    path = tmp_path / "mesh.obj"
    path.write_text(text)
    mesh = build(read_obj(path, flip_tex_coords=False))
    found = [
        table[mesh.faces].reshape(6, -1)
        for table in (mesh.vertices, mesh.uvs, mesh.normals)
    ]
    values[2] /= np.linalg.norm(values[2], axis=1, keepdims=True)
    for kind, (table, expected) in enumerate(zip(found, values, strict=True)):
        indices = [corner[kind] for face in faces for corner in face]
        np.testing.assert_allclose(
            table,
            expected[indices],
            rtol=1e-6,
            err_msg=f"{('v', 'vt', 'vn')[kind]}\n{text}",
        )


@pytest.mark.parametrize("is_negative", [False, True])
@pytest.mark.parametrize("kind", [0, 1, 2])
def test_an_index_beyond_its_own_list_is_refused(
    tmp_path: Path, kind: int, is_negative: bool
):
    """Even if the two other lists are long enough for it."""
    words, names = ("v", "vt", "vn"), ("vertex", "texture coordinate", "normal")
    text = ""
    for place, word in enumerate(words):
        text += f"{word} 0.5 1 2\n{word} 1 0.5 3\n{word} 1 2 0.5\n"
        text += f"{word} 4 5 6\n" * (0 if place == kind else 2)
    corner = ["1", "1", "1"]
    corner[kind] = "-4" if is_negative else "4"
    path = tmp_path / "mesh.obj"
    path.write_text(f"{text}f {'/'.join(corner)} 2/2/2 3/3/3\n")
    with pytest.raises(SceneError) as caught:
        read_obj(path)
    there = "3 come before it" if is_negative else "the file has 3"
    assert str(caught.value) == (
        f"{path}:14: face corner `{'/'.join(corner)}`: {names[kind]} {corner[kind]} does "
        f"not exist, {there}"
    )


def test_corners_without_normal_or_uv_get_defined_values(tmp_path: Path):
    """Mitsuba leaves memory as it was there: a computed normal and uv (0, 0) for us."""
    path = tmp_path / "mesh.obj"
    path.write_text(POINTS + UVS + NORMALS + "f 1/1/2 2/2/2 3/3/2\nf 1 2 5\n")
    mesh = build(read_obj(path))
    assert mesh.normals is not None and mesh.uvs is not None
    np.testing.assert_allclose(mesh.normals[:3], [[0, 0.5**0.5, 0.5**0.5]] * 3, atol=1e-6)
    np.testing.assert_allclose(mesh.normals[3:], [[0, -1, 0]] * 3, atol=1e-6)
    np.testing.assert_array_equal(mesh.uvs[3:], np.zeros((3, 2)))


def test_degenerate_triangles_are_dropped_counted_and_keep_their_numbers(tmp_path: Path):
    path = tmp_path / "mesh.obj"
    line = "v 0 0 0\nv 1 1 1\nv 2 2 2\nv 0 3 0\n"  # the first three in one line
    path.write_text(line + "f 1 2 2\nf 1 2 4\nf 1 2 3\nf 2 3 4\n")
    data = read_obj(path)
    mesh, warnings = build_mesh(data, to_world=np.eye(4), bsdf=Diffuse())
    assert mesh.face_ids is not None
    assert mesh.face_ids.tolist() == [1, 3]
    assert warnings == (f"{path}: dropped 2 degenerate of 4 triangles",)


def test_tiny_and_huge_triangles_are_no_degenerate_ones(tmp_path: Path):
    path = tmp_path / "mesh.obj"
    path.write_text(POINTS + "f 1 2 3\nf 1 3 4\n")
    for scale in (1e-15, 1e15):
        to_world = np.diag((scale, scale, scale, 1.0))
        mesh, warnings = build_mesh(read_obj(path), to_world=to_world, bsdf=Diffuse())
        assert len(mesh.faces) == 2
        assert warnings == ()


def test_lines_of_unknown_kind_are_reported_not_fatal(tmp_path: Path):
    path = tmp_path / "mesh.obj"
    path.write_text(POINTS + "l 1 2\ncurv 0 1\nf 1 2 3\n")
    assert read_obj(path).warnings == (
        f"{path}:6: `l` lines are not read (2 lines of kinds other than v, vt, vn and f)",
    )


# ------------------------------------------------------------------------- faults

OBJ_FAULTS = {
    "empty file": ("", "the mesh file is empty"),
    "garbage": ("\x00\x01 hello\n", "no `f` line"),
    "no face": (POINTS, "no `f` line"),
    "NaN": ("v nan 0 0\n" + POINTS + "f 1 3 4\n", ":1: vertex (nan, 0, 0) is not finite"),
    "infinite": (POINTS + "v 1e39 0 0\nf 1 2 6\n", ":6: vertex (1e+39, 0, 0)"),
    "no number": ("v 0 zero 0\n", ":1: a vertex needs numbers, found `zero`"),
    "underscore": (POINTS + "v 0 1_0 0\n", ":6: a vertex needs numbers, found `1_0`"),
    "two coordinates": ("v 0 0\n", ":1: a vertex needs 3 numbers, found 2"),
    "index past the end": (POINTS + "f 1 2 9\n", ":6: face corner `9`: vertex 9"),
    "index 0": (POINTS + "f 0 1 2\n", ":6: face corner `0`: vertex 0"),
    "negative past the start": (POINTS + "f -1 -2 -6\n", ":6: face corner `-6`: vertex -6"),
    "negative, some later": (
        "v 0 0 0\nv 1 0 0\nf -1 -2 -3\nv 0 1 0\n",
        ":3: face corner `-3`: vertex -3 does not exist, 2 come before it",
    ),
    "negative uv": (
        POINTS + UVS + "f -1/-9 -2/-1 -3/-1\n",
        "`-1/-9`: texture coordinate -9",
    ),
    "minus 0": (
        "v 0 0 0\nv 1 0 0\nf -1 -2 -0\nv 0 1 0\n",
        ":3: face corner `-0`: vertex 0",
    ),
    "uv index": (POINTS + UVS + "f 1/4 2/1 3/1\n", ":9: face corner `1/4`: texture"),
    "normal index": (POINTS + "f 1 2 3\nf 1//1 2 3\n", ":7: face corner `1//1`: normal 1"),
    "two corners": (POINTS + "f 1 2\n", ":6: a face needs 3 corners or more, found 2"),
    "four indices": (POINTS + "f 1/1/1/1 2 3\n", ":6: face corner `1/1/1/1` is not"),
    "word as index": (POINTS + "f 1 2 x\n", ":6: face corner `x` is not of the form"),
}


HEAD = "ply\nformat ascii 1.0\nelement vertex 3\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
FACE = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
DATA = "0 0 0\n1 0 0\n0 1 0\n"
PLY_FAULTS = {
    "empty file": ("", "the mesh file is empty"),
    "no PLY": ("solid cube\n", ":1: not a PLY file"),
    "no end_header": (HEAD + XYZ, "no `end_header`"),
    "no format": ("ply\nelement vertex 3\nend_header\n", "no `format` line"),
    "other format": ("ply\nformat ascii 2.0\n", ":2: unknown PLY format `ascii 2.0`"),
    "unknown word": ("ply\nformat ascii 1.0\nelemnt\n", ":3: unknown word `elemnt`"),
    "unknown type": (HEAD + "property real x\n", ":4: unknown PLY type `real`"),
    "bad count": ("ply\nformat ascii 1.0\nelement vertex -3\n", ":3: expected `element"),
    "huge count": ("ply\nformat ascii 1.0\nelement vertex " + "9" * 30 + "\n", ":3: 999"),
    "count far above the data": (
        (HEAD + XYZ).replace("vertex 3", "vertex 300000000000") + FACE + DATA,
        "take 900000000000 numbers, found 9",
    ),
    "property first": ("ply\nproperty float x\n", ":2: `property` before"),
    "short property": (HEAD + "property float\n", ":4: expected `property"),
    "property twice": (HEAD + XYZ + "property float x\n", ":7: a second property `x`"),
    "element twice": (HEAD + HEAD[-17:], ":4: a second element `vertex`"),
    "float length": (HEAD + XYZ + FACE.replace("uchar", "float"), ":8: a list's length"),
    "no z": (HEAD + XYZ[:34] + FACE + "0 0 1 0 0 1 3 0 1 2", "no number `z`; they"),
    "no index list": (
        HEAD + XYZ + FACE.replace("vertex_indices", "corners") + DATA + "3 0 1 2\n",
        "no list `vertex_index` or `vertex_indices`; they have: corners",
    ),
    "no face element": (HEAD + XYZ + "end_header\n" + DATA, "no `face` records"),
    "too few vertices": (HEAD + XYZ + FACE + "0 0 0\n1 0\n", "take 9 numbers, found 5"),
    "no word for the face": (HEAD + XYZ + FACE + DATA, "`face` take 1 numbers, found 0"),
    "short face": (HEAD + XYZ + FACE + DATA + "3 0 1\n", "has length 3, but only 2 values"),
    "left over": (HEAD + XYZ + FACE + DATA + "3 0 1 2\n7 7\n", ":14: 2 numbers are left"),
    "word": (HEAD + XYZ + FACE + "0 0 0\n1 zero 0\n", ":11: expected a number"),
    "underscore": (HEAD + XYZ + FACE + "0 0 0\n1 1_0 0\n", ":11: expected a number"),
    "quad": (HEAD + XYZ + FACE + DATA + "4 0 1 2 0\n", "face 0 has 4 corners; only"),
    "quad later": (
        HEAD + XYZ + FACE.replace("face 1", "face 2") + DATA + "3 0 1 2\n4 0 1 2 0\n",
        ":14: list `vertex_indices` of face 1 has length 4",
    ),
    "index past the end": (HEAD + XYZ + FACE + DATA + "3 0 1 3\n", "face 0 has the"),
    "negative index": (HEAD + XYZ + FACE + DATA + "3 0 1 -1\n", "integers from 0 to 2"),
    "index 0.5": (HEAD + XYZ + FACE + DATA + "3 0 1 0.5\n", "integers from 0 to 2"),
    "NaN": (HEAD + XYZ + FACE + "0 0 0 1 0 nan 0 1 0 3 0 1 2", "(1, 0, nan) of vertex 1"),
    "infinite": (HEAD + XYZ + FACE + "0 0 0 1 0 inf 0 1 0 3 0 1 2", "is not finite"),
}  # fmt: skip


FAULTS = [(read_obj, *fault) for fault in OBJ_FAULTS.values()]
FAULTS += [(read_ply, *fault) for fault in PLY_FAULTS.values()]


@pytest.mark.parametrize(
    ("read", "content", "message"), FAULTS, ids=[*OBJ_FAULTS, *PLY_FAULTS]
)
def test_faults_are_one_line_errors(tmp_path: Path, read, content: str, message: str):
    path = tmp_path / "mesh"
    path.write_bytes(content.encode())
    with pytest.raises(SceneError) as caught:
        read(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("read", "name"), [(read_obj, "gone.obj"), (read_ply, "gone.ply")])
def test_missing_and_unreadable_files(tmp_path: Path, read, name: str):
    with pytest.raises(SceneError, match=r"gone\....: no such mesh file"):
        read(tmp_path / name)
    with pytest.raises(SceneError, match="cannot read it"):
        read(tmp_path)


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian"])
def test_binary_ply_with_missing_or_extra_bytes_names_both_counts(
    tmp_path: Path, encoding: str
):
    content = write_ply(tmp_path / "mesh.ply", encoding).read_bytes()
    path = tmp_path / "cut.ply"
    path.write_bytes(content[:-2])
    with pytest.raises(SceneError, match="3 records of `face` take 39 bytes, found 37"):
        read_ply(path)
    path.write_bytes(content + b"xx")
    with pytest.raises(SceneError, match="2 bytes are left over"):
        read_ply(path)


@pytest.mark.parametrize("number", ["float", "double"])
def test_a_signalling_nan_in_a_ply_is_an_error_and_no_warning(tmp_path: Path, number: str):
    """The processor raises its flag where it casts one, and NumPy a warning."""
    path = write_ply(tmp_path / "mesh.ply", number=number)
    content = path.read_bytes()
    first = content.index(b"end_header\n") + len(b"end_header\n")
    bits = {"float": "0100807f", "double": "010000000000f07f"}[number]
    size = len(bits) // 2
    path.write_bytes(content[:first] + bytes.fromhex(bits) + content[first + size :])
    with pytest.raises(SceneError, match=r"vertex 0|\(nan, "):
        build(read_ply(path))


@pytest.mark.parametrize(
    ("to_world", "message"),
    [
        (np.diag((1.0, 0.0, 1.0, 1.0)), "scene.xml:7: to_world is singular"),
        (np.full((4, 4), np.nan), "scene.xml:7: to_world is singular"),
        (
            np.diag((1e30, 1e30, 1e30, 1.0)),
            "scene.xml:7: vertex 1 of big.obj becomes (1e+40,",
        ),
    ],
)
def test_transforms_that_leave_no_mesh(to_world: np.ndarray, message: str):
    points = np.array([[0, 0, 0], [1e10, 0, 0], [0, 1e10, 0.0]])
    data = MeshData(points, np.array([[0, 1, 2]], dtype=np.int32), source="big.obj")
    with pytest.raises(SceneError) as caught:
        build_mesh(
            data, to_world=to_world, bsdf=Diffuse(), location=Location("scene.xml", 7)
        )
    assert str(caught.value).startswith(message)


def test_a_mesh_of_degenerate_triangles_alone_is_not_seen_and_cannot_shine(tmp_path: Path):
    """Mitsuba takes such a mesh as well, and no more as a light."""
    path = tmp_path / "mesh.obj"
    path.write_text(POINTS + "f 1 2 2\nf 1 1 1\n")
    mesh = build(read_obj(path))
    assert len(mesh.faces) == len(mesh.face_ids) == 0
    lines = '<shape type="obj"><string name="filename" value="mesh.obj"/>{}</shape>'
    film = (
        '<film type="hdrfilm"><integer name="width" value="4"/>'
        '<integer name="height" value="4"/></film>'
    )
    text = (
        f'<scene version="3.0.0"><sensor type="perspective">{film}</sensor>'
        f'<emitter type="constant"/>{lines.format("")}<shape type="shapegroup" id="g">'
        f'{lines.format("")}<shape type="sphere"/></shape><shape type="instance">'
        '<ref id="g"/><transform name="to_world"><translate z="-9"/></transform></shape>'
        "</scene>"
    )
    scene = renderer.load_string(text, base_dir=tmp_path)
    np.testing.assert_array_equal(renderer.render(scene, spp=1).pixels, 1.0)
    shining = text.replace("</shape>", '<emitter type="area"/></shape>', 1)
    with pytest.raises(SceneError, match=r"all 2 triangles of .* are degenerate"):
        renderer.load_string(shining, base_dir=tmp_path)
    with pytest.raises(SceneError, match='all triangles in shape "shapegroup" are degen'):
        renderer.load_string(text.replace('<shape type="sphere"/>', ""), base_dir=tmp_path)
    mi.load_string(text.replace("mesh.obj", str(path)))
    with pytest.raises(RuntimeError, match="no probability mass"):
        mi.load_string(shining.replace("mesh.obj", str(path)))


def truncations(content: bytes) -> list[bytes]:
    return [content[:end] for end in range(len(content))]


def test_every_truncation_is_an_error_or_a_valid_mesh(tmp_path: Path):
    """Cut valid files at every byte: nothing but SceneError, and no half-read mesh."""
    obj = tmp_path / "full.obj"
    obj.write_text(OBJ_FILES["both"])
    files = [(obj.read_bytes(), read_obj)]
    for encoding in ("ascii", "binary_little_endian", "binary_big_endian"):
        path = write_ply(tmp_path / "full.ply", encoding, normals=True, extra=True)
        files.append((path.read_bytes(), read_ply))
    cut = tmp_path / "cut"
    errors = 0
    for content, read in files:
        for short in truncations(content):
            cut.write_bytes(short)
            try:
                mesh = build(read(cut))
            except SceneError as error:
                assert "\n" not in str(error)
                errors += 1
            else:
                assert_valid(mesh)
    assert errors > 1000


def assert_valid(mesh: Mesh) -> None:
    assert mesh.faces.min(initial=0) >= 0  # degenerate ones may have been all
    assert mesh.faces.max(initial=-1) < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    assert mesh.normals is None or np.isfinite(mesh.normals).all()
    assert mesh.uvs is None or np.isfinite(mesh.uvs).all()
