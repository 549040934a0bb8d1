"""Files of the format `serialized`: as in Mitsuba, and one error for each damage."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from scene_file_samples import error_of, ours
from serialized_files import (
    Mesh,
    ball,
    file_of,
    plugin_scene_meshes,
    serialized,
    stream,
)

mi.set_variant("scalar_rgb")

from renderer.errors import SceneError  # noqa: E402
from renderer.scene_file.meshes.serialized_file import read_serialized  # noqa: E402

PLUGINS = Path(__file__).parents[2] / "plugins"
TURNED = (
    '<transform name="to_world"><scale x="-2" y="1" z="0.5"/><rotate y="1" angle="30"/>'
    '<translate x="3"/></transform>'
)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("index", [0, 1, 2])
@pytest.mark.parametrize(
    "more", ["", TURNED, TURNED + '<boolean name="face_normals" value="true"/>']
)
def test_it_is_read_as_mitsuba_reads_it(tmp_path, version, double, index, more):
    """Normals given, computed where there are none, dropped for `face_normals`; uv."""
    meshes = plugin_scene_meshes()
    for mesh in meshes:
        mesh.double = double
    path = tmp_path / "meshes.serialized"
    path.write_bytes(serialized(meshes, version))
    text = (
        f'<shape type="serialized"><string name="filename" value="{path}"/>'
        f'<integer name="shape_index" value="{index}"/>{more}</shape>'
    )
    scene = ours(text, folder=tmp_path)
    mine = scene.shapes[0]
    xml = f'<scene version="3.0.0">{text}</scene>'
    loaded = mi.load_string(xml, optimize=False).shapes()[0]
    theirs = mi.traverse(loaded)

    def rows(name, width):
        return np.array(theirs[name]).reshape(-1, width)

    assert np.array_equal(mine.faces, rows("faces", 3))
    assert np.array_equal(mine.vertices, rows("vertex_positions", 3).astype(np.float32))
    if mine.uvs is None:
        assert not len(theirs["vertex_texcoords"])
    else:
        assert np.array_equal(mine.uvs, rows("vertex_texcoords", 2))
    if mine.normals is None:
        assert not loaded.has_vertex_normals()
    else:
        np.testing.assert_allclose(mine.normals, rows("vertex_normals", 3), atol=2e-6)
    expected = ["mark for face normals"] * (index == 1 and mine.normals is not None)
    expected += ["vertices' colours"] * (index == 2)
    assert len(scene.warnings) == len(expected)
    assert all(words in line for words, line in zip(expected, scene.warnings, strict=True))


def test_a_file_without_a_table_has_a_first_mesh(tmp_path):
    """Mitsuba takes such, whatever comes after the stream."""
    path = tmp_path / "one.serialized"
    data = zlib.compress(stream(ball(3, 4), 4))
    path.write_bytes(struct.pack("<HH", 0x041C, 4) + data + b"more")
    assert len(read_serialized(path).faces) == len(ball(3, 4).faces)


def test_the_file_of_the_plugin_scene_is_what_is_written_here():
    for version in (3, 4):
        content = (PLUGINS / "meshes" / f"version-{version}.serialized").read_bytes()
        expected = serialized(plugin_scene_meshes(), version)
        assert len(content) == len(expected)  # the packing itself is zlib's business
        assert content[:4] == expected[:4]


TRIANGLE = Mesh(np.eye(3), np.array([[0, 1, 2]]), np.eye(3), np.zeros((3, 2)))
GOOD = serialized([TRIANGLE, TRIANGLE], 4)


def with_counts(vertices, faces):
    return file_of([stream(TRIANGLE, 4, (vertices, faces))], 4)


def changed(**changes):
    return serialized([Mesh(**{**vars(TRIANGLE), **changes})], 4)


FAULTS = [
    (b"", 0, "the mesh file is empty"),
    (b"\x1c\x04\x04", 0, "the file ends within the first four bytes of a mesh"),
    (b"ply\n" + GOOD, 0, "begins with 0x6c70; a serialized mesh begins with 0x041c"),
    (b"\x1c\x04\x02\x00" + GOOD[4:], 0, "is of version 2; possible are 3 and 4"),
    (GOOD, 2, "shape_index 2 does not exist; the file has 2 meshes, counted from 0"),
    (GOOD[:-4] + b"\xff" * 4, 1, "promise 4294967295 meshes; a file of"),
    (GOOD[:-12] + b"\x00\x00\x00\x7f" + GOOD[-8:], 1, "is said to begin at byte 21307"),
    (GOOD[:-12] + b"\x05\x00\x00\x00" + GOOD[-8:], 1, "mesh 1, at byte 5, begins with"),
    (GOOD[:4] + b"\xff" * 40, 0, "the stream is damaged"),
    (GOOD[:20], 0, "mesh 0: the stream ends after"),
    (with_counts(0, 1), 0, "has 0 vertices; possible are 1 to 2147483647"),
    (with_counts(3, 2**63), 0, "has 9223372036854775808 faces; possible are 1 to"),
    (with_counts(2**31 - 1, 1), 0, "promises 25769803764 bytes of positions; its stream"),
    (with_counts(5, 1), 0, "bytes of"),
    (with_counts(3, 2), 0, "the stream ends after 12 of 24 bytes of faces"),
    (changed(faces=[[0, 1, 3]]), 0, "face 0 has the vertices (0, 1, 3); possible are"),
    (changed(faces=[[0, 1, 2**32 - 1]]), 0, "possible are integers from 0 to 2"),
    (changed(vertices=np.eye(3) * np.nan), 0, "position (nan, nan, nan) of vertex 0"),
    (changed(vertices=np.eye(3) * 1e300, double=True), 0, "position (inf, 0, 0) of vert"),
    (changed(name=b"x" * 70000), 0, "no zero ends its name within 65536 bytes"),
]


@pytest.mark.parametrize(("content", "index", "message"), FAULTS, ids=range(len(FAULTS)))
def test_a_fault_is_one_line(tmp_path, content, index, message):
    path = tmp_path / "bad.serialized"
    path.write_bytes(content)
    text = (
        f'<shape type="serialized"><string name="filename" value="{path}"/>'
        f'<integer name="shape_index" value="{index}"/></shape>'
    )
    found = error_of(text, folder=tmp_path)
    assert message in found
    assert str(path) in found


def test_a_negative_index_is_refused():
    text = '<shape type="serialized"><integer name="shape_index" value="-1"/></shape>'
    assert "found -1, expected at least 0" in error_of(text)


def read_or_refuse(path, content, index):
    """Read content that may be damaged: a mesh whose indices are in range, or one line."""
    path.write_bytes(content)
    try:
        mesh = read_serialized(path, shape_index=index)
    except SceneError as error:
        assert "\n" not in str(error)
        assert str(path) in str(error)
        return False
    assert 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    return True


@pytest.mark.parametrize("index", [0, 1])
def test_a_file_cut_anywhere_is_refused(tmp_path, index):
    """The first mesh is whole before its table is; the second never."""
    whole = [
        n for n in range(len(GOOD)) if read_or_refuse(tmp_path / "cut", GOOD[:n], index)
    ]
    # what zlib adds at the end of a stream (a checksum) is not needed to unpack it
    assert whole == ([] if index else list(range(min(whole), len(GOOD))))


@settings(
    max_examples=300,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@example([(82, 129), (83, 127)], 3, 0)  # a signalling NaN, of which a cast warns
@given(
    st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=6),
    st.sampled_from([3, 4]),
    st.integers(0, 2),
)
def test_flipped_bytes_end_in_a_mesh_or_an_error(tmp_path, flips, version, index):
    """In the file as it is, and before packing, so that the counts are reached too."""
    plain = stream(TRIANGLE, version)
    for target in ("file", "stream"):
        data = bytearray(serialized([TRIANGLE] * 2, version) if target == "file" else plain)
        for place, value in flips:
            data[place % len(data)] = value
        content = bytes(data) if target == "file" else file_of([bytes(data)] * 2, version)
        read_or_refuse(tmp_path / "flipped", content, index)
