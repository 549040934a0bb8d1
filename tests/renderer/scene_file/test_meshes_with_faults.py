"""Mesh files whose faults no picture needs to show: what Mitsuba renders is rendered.

Normals that `face_normals` drops, numbers of vertices that no face uses, texture
coordinates that are not finite, byte order marks. What is replaced is counted in the log.
"""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

mi.set_variant("scalar_rgb")

from scene_file_samples import error_of, mitsuba_refuses, ours  # noqa: E402
from serialized_files import Mesh, serialized  # noqa: E402

POINTS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0.5], [-1, 1, 0.25], [4, 4, 4]], float)
FACES = [[0, 1, 2], [0, 2, 3]]  # the last point is not used
UP = np.tile([0.0, 0.6, 0.8], (5, 1))
UVS = np.random.default_rng(2).random((5, 2))
SHARP = '<boolean name="face_normals" value="true"/>'
NAN, INF = float("nan"), float("inf")
FORMATS = ("obj", "ply", "binary ply", "serialized")


def rows(values: np.ndarray, head: str = "") -> str:
    return "".join(f"{head}{' '.join(map(str, row))}\n" for row in values.tolist())


def write(
    folder: Path,
    form: str,
    points: np.ndarray = POINTS,
    normals: np.ndarray | None = None,
    uvs: np.ndarray | None = None,
    faces: list[list[int]] = FACES,
) -> Path:
    """Write the mesh in one of the formats."""
    path = folder / f"mesh.{form.rpartition(' ')[2]}"
    if form == "serialized":
        with np.errstate(over="ignore"):
            mesh = Mesh(points, faces, normals=normals, uvs=uvs)
            path.write_bytes(serialized([mesh], 4))
    elif form == "obj":
        text = rows(points, "v ")
        text += "" if uvs is None else rows(uvs, "vt ")
        text += "" if normals is None else rows(normals, "vn ")
        for face in faces:
            uv, normal = ("" if of is None else "{0}" for of in (uvs, normals))
            corner = f"{{0}}/{uv}/{normal}".rstrip("/")
            text += " ".join(["f", *(corner.format(i + 1) for i in face)]) + "\n"
        path.write_text(text)
    else:
        columns = {"x y z": points, "nx ny nz": normals, "u v": uvs}
        there = {names: of for names, of in columns.items() if of is not None}
        binary = form.startswith("binary")
        kind = "binary_little_endian" if binary else "ascii"
        head = f"ply\nformat {kind} 1.0\nelement vertex {len(points)}\n"
        head += "".join(f"property float {n}\n" for n in " ".join(there).split())
        head += f"element face {len(faces)}\nproperty list uchar int vertex_index\n"
        table = np.hstack(list(there.values()))
        content = (head + "end_header\n").encode()
        if binary:
            with np.errstate(over="ignore"):
                content += table.astype("<f4").tobytes()
            for face in faces:
                content += b"\3" + np.array(face, "<i4").tobytes()
        else:
            content += (rows(table) + rows(np.array(faces).reshape(-1, 3), "3 ")).encode()
        path.write_bytes(content)
    return path


def shape(path: Path, more: str = "") -> str:
    plugin = path.suffix[1:]
    file = f'<string name="filename" value="{path.name}"/>'
    return f'<shape type="{plugin}">{file}{more}</shape>'


def read(path: Path, more: str = "") -> tuple[Any, tuple[str, ...]]:
    scene = ours(shape(path, more), folder=path.parent)
    return scene.shapes[0], scene.warnings


def with_row(values: np.ndarray, index: int, *row: float) -> np.ndarray:
    changed = values.copy()
    changed[index] = row
    return changed


NO_DIRECTION = [(0, 0, 0), (NAN, 0, 0), (INF, 0, 1), (1e39, 0, 0)]


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("normal", NO_DIRECTION, ids=str)
def test_normals_that_face_normals_drops_are_not_judged(
    tmp_path: Path, form: str, normal: tuple[float, ...]
) -> None:
    path = write(tmp_path, form, normals=with_row(UP, 1, *normal))
    mesh, warnings = read(path, SHARP)
    assert mesh.normals is None
    assert warnings == ()
    if form != "ply":  # in ascii it has no "nan"
        assert not mitsuba_refuses(shape(path, SHARP), folder=tmp_path)


@pytest.mark.parametrize(
    "corners",
    ["1//1 2//9 3//-7", "1//1 2// 3//1", "1//0 2//1 3//1"],
    ids=["no such normal", "none", "0"],
)
def test_what_stands_for_normals_in_an_obj_may_be_anything_then(
    tmp_path: Path, corners: str
) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(rows(POINTS, "v ") + f"vn x y\nvn\nvn 0 0 1\nf {corners}\n")
    mesh, warnings = read(path, SHARP)
    assert mesh.normals is None and len(mesh.faces) == 1
    assert warnings == ()
    error_of(shape(path), folder=tmp_path)  # but not without


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("normal", NO_DIRECTION, ids=str)
@pytest.mark.parametrize("vertex", [4, 3])
def test_normals_without_a_direction_are_computed_and_counted(
    tmp_path: Path, form: str, normal: tuple[float, ...], vertex: int
) -> None:
    """Of a vertex that no face uses (4) and of one that a face uses.

    The faces of the latter are black in Mitsuba, or its file is refused.
    """
    path = write(tmp_path, form, normals=with_row(UP, vertex, *normal))
    mesh, warnings = read(path)
    if form == "obj" and vertex == 4:  # such a line is not even a vertex
        assert warnings == ()
        return
    assert len(warnings) == 1
    assert re.search(r"1 of [45] vertices have a normal like \(", warnings[0])
    assert "which has no direction" in warnings[0]
    assert f"faces use {int(vertex == 3)} of them" in warnings[0]
    assert ("in line 9" if form == "obj" else f"of vertex {vertex}") in warnings[0]
    assert np.isfinite(mesh.normals).all()
    plain, _ = read(write(tmp_path, form))
    at = np.flatnonzero((mesh.vertices == np.float32(POINTS[vertex])).all(axis=1))[0]
    np.testing.assert_allclose(mesh.normals[at], plain.normals[at], atol=1e-6)
    others = np.delete(mesh.normals, at, axis=0)
    np.testing.assert_allclose(others, UP[: len(others)], atol=1e-6)


@pytest.mark.parametrize("form", FORMATS)
def test_normals_of_degenerate_faces_alone(tmp_path: Path, form: str) -> None:
    """A face that is dropped uses nothing that a picture shows."""
    faces = [[0, 1, 2], [0, 3, 3]]
    normals = with_row(UP, 3, 0, 0, 0)
    mesh, warnings = read(write(tmp_path, form, normals=normals, faces=faces))
    assert len(mesh.faces) == 1 and len(warnings) == 2
    np.testing.assert_allclose(mesh.normals[:3], UP[:3], atol=1e-6)


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("position", [(NAN, 0, 0), (0, INF, 0), (0, 0, -INF)], ids=str)
def test_positions_count_where_a_face_uses_them(
    tmp_path: Path, form: str, position: tuple[float, ...]
) -> None:
    path = write(tmp_path, form, with_row(POINTS, 4, *position))
    mesh, warnings = read(path)
    assert np.isfinite(mesh.vertices).all() and len(mesh.faces) == 2
    assert len(warnings) == (form != "obj")
    assert form == "obj" or "1 of 5 vertices have a position like (" in warnings[0]
    path = write(tmp_path, form, with_row(POINTS, 2, *position))
    message = error_of(shape(path), folder=tmp_path)
    assert "is not finite" in message
    assert ("mesh.obj:3: vertex (" if form == "obj" else "of vertex 2") in message


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("more", ["", SHARP])
@pytest.mark.parametrize("vertex", [4, 3])
def test_uv_that_are_not_finite_become_0_and_are_counted(
    tmp_path: Path, form: str, more: str, vertex: int
) -> None:
    """No material here needs them, and Mitsuba shows the mesh."""
    path = write(tmp_path, form, uvs=with_row(UVS, vertex, 0.5, NAN))
    mesh, warnings = read(path, more)
    if form == "obj" and vertex == 4:
        assert warnings == ()
        return
    assert len(warnings) == 1
    assert re.search(r"1 of [45] vertices have a uv like \(0.5, nan\)", warnings[0])
    assert "it becomes (0, 0)" in warnings[0]
    assert ("in line 9" if form == "obj" else f"of vertex {vertex}") in warnings[0]
    at = np.flatnonzero((mesh.vertices == np.float32(POINTS[vertex])).all(axis=1))[0]
    np.testing.assert_array_equal(mesh.uvs[at], (0, 0))
    assert np.isfinite(mesh.uvs).all() and mesh.uvs.any()


def test_a_mesh_without_faces_is_not_seen(tmp_path: Path) -> None:
    path = write(tmp_path, "ply", faces=[])
    assert not mitsuba_refuses(shape(path), folder=tmp_path)
    mesh, warnings = read(path)
    assert len(mesh.faces) == 0
    assert len(warnings) == 1 and "no faces, so that nothing is seen" in warnings[0]
    lamp = '<emitter type="area"/>'
    assert "at least one must be left" in error_of(shape(path, lamp), folder=tmp_path)


# ------------------------------------------------------------------ byte order marks


@pytest.mark.parametrize("form", ["obj", "ply", "binary ply"])
def test_a_byte_order_mark_is_skipped(tmp_path: Path, form: str) -> None:
    """Mitsuba drops the line of an OBJ, here the first vertex, and refuses a PLY."""
    path = write(tmp_path, form, normals=UP, uvs=UVS)
    expected, _ = read(path)
    content = path.read_bytes()
    path.write_bytes(codecs.BOM_UTF8 + content)
    mesh, warnings = read(path)
    assert warnings == ()
    for name in ("vertices", "faces", "normals", "uvs"):
        np.testing.assert_array_equal(getattr(mesh, name), getattr(expected, name))
    for cut in (1, 3, 4, 8, len(content) // 2):
        path.write_bytes((codecs.BOM_UTF8 + content)[:cut])
        assert path.name in error_of(shape(path), folder=tmp_path)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
@pytest.mark.parametrize("form", ["obj", "ply"])
def test_utf_16_is_named(tmp_path: Path, form: str, encoding: str) -> None:
    path = write(tmp_path, form)
    mark = codecs.BOM_UTF16_BE if encoding == "utf-16-be" else b""
    path.write_bytes(mark + path.read_text().encode(encoding))
    assert "is UTF-16 text; expected" in error_of(shape(path), folder=tmp_path)


def test_lines_of_a_marked_file_keep_their_numbers(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_bytes(codecs.BOM_UTF8 + b"v 0 0 0\nv 1 0\n")
    assert "mesh.obj:2: a vertex needs 3" in error_of(shape(path), folder=tmp_path)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_spectrum_may_begin_with_a_mark(tmp_path: Path, mark: str) -> None:
    (tmp_path / "a.spd").write_text(mark + "400 0.25\n700 0.25\n", encoding="utf-8")
    text = (
        '<shape type="sphere"><bsdf type="diffuse">'
        '<spectrum name="reflectance" filename="a.spd"/></bsdf></shape>'
    )
    scene = ours(text, folder=tmp_path)
    without = text.replace('filename="a.spd"', 'value="400:0.25, 700:0.25"')
    expected = ours(without).shapes[0].bsdf.reflectance.rgb
    assert scene.shapes[0].bsdf.reflectance.rgb == expected
