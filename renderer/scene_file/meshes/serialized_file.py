"""Mitsuba's `serialized` format, versions 3 and 4: a sequence of compressed meshes.

All numbers are little endian. Each mesh begins with the magic number and the version (16
bits each), followed by a zlib stream: flags (32 bits); in version 4 a name that ends with a
zero byte; the numbers of vertices and of faces (64 bits each); positions; other attributes
by the flags; and three 32-bit indices per face. The file ends with the positions of all
meshes (32 bits in version 3, 64 in version 4) and their number (32 bits).

A file may be damaged or malicious: no more memory is allocated than its bytes can fill.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.meshes.mesh_data import (
    MeshData,
    first_out_of_range,
    judged_mesh,
    read_mesh_bytes,
    show_numbers,
)

_MARK = 0x041C
_OFFSETS = {3: "<I", 4: "<Q"}  # format of the position of a mesh, by version
_HEADER = 4  # bytes: mark and version

_HAS_NORMALS, _HAS_UVS, _HAS_COLORS, _FACE_NORMALS = 0x1, 0x2, 0x8, 0x10
_DOUBLE = 0x2000  # otherwise single precision, with or without the flag for it

_MOST_EXPANSION = 1032  # largest number of bytes that deflate makes of one
_LONGEST_NAME = 65536
_MOST = 2**31 - 1  # largest number of vertices or faces for our indices


def read_serialized(
    path: Path, *, shape_index: int = 0, face_normals: bool = False
) -> MeshData:
    """Read one mesh of a file.

    As in Mitsuba, double precision is first rounded to single. Vertex colours, and the flag
    that a mesh has no vertex normals, are dropped with a warning. With `face_normals`
    vertex normals are ignored.

    Raises
    ------
    SceneError
        For a missing, truncated or damaged file, another version, a mesh index that does
        not exist, a used position that is not finite, an index out of range, or no face.
    """
    content = read_mesh_bytes(path)
    begin, end, version = _find_mesh(content, shape_index, path)
    stream = _Stream(content[begin:end], f"{path}: mesh {shape_index}")
    (flags,) = struct.unpack("<I", stream.read(4, "the flags"))
    if version == 4:
        stream.skip_name()
    counts = struct.unpack("<QQ", stream.read(16, "the numbers of vertices and faces"))
    for count, what in zip(counts, ("vertices", "faces"), strict=True):
        if not 1 <= count <= _MOST:
            raise SceneError(f"{stream.what} has {count} {what}; possible are 1 to {_MOST}")
    vertex_count, face_count = counts
    number = np.dtype("<f8" if flags & _DOUBLE else "<f4")
    vertices = _rows(stream, vertex_count, 3, number, "positions")
    normals = uvs = None
    if flags & _HAS_NORMALS:
        normals = _rows(stream, vertex_count, 3, number, "normals")
        normals = None if face_normals else normals
    if flags & _HAS_UVS:
        uvs = _rows(stream, vertex_count, 2, number, "uv")
    if flags & _HAS_COLORS:
        stream.read(vertex_count * 3 * number.itemsize, "the colours")
    data = stream.read(face_count * 12, "the faces")
    faces = np.frombuffer(data, "<u4").reshape(-1, 3)
    bad = first_out_of_range(faces, vertex_count)
    if bad >= 0:
        raise SceneError(
            f"{stream.what}: face {bad} has the vertices {show_numbers(faces[bad])}; "
            f"possible are integers from 0 to {vertex_count - 1}"
        )
    mesh = judged_mesh(vertices, faces.astype(np.int32), normals, uvs, stream.what)
    warnings = list(mesh.warnings)
    if flags & _HAS_COLORS:
        warnings.append(f"{stream.what}: the vertices' colours are not read, as in Mitsuba")
    if flags & _FACE_NORMALS and not face_normals:
        warnings.append(
            f"{stream.what}: the file's mark for face normals is not looked at, as in "
            "Mitsuba; possible is face_normals in the scene"
        )
    return replace(mesh, warnings=tuple(warnings))


def _find_mesh(content: bytes, index: int, path: Path) -> tuple[int, int, int]:
    """Return start and end of the stream of a mesh, and the version."""
    version = _version(content, 0, f"{path}:")
    # as in Mitsuba, the first mesh needs no table of positions; some files lack it
    if index == 0:
        return _HEADER, len(content), version
    if len(content) < 2 * _HEADER:
        raise SceneError(f"{path}: the file ends before its table of meshes")
    (count,) = struct.unpack_from("<I", content, len(content) - 4)
    entry = struct.calcsize(_OFFSETS[version])
    table = len(content) - 4 - count * entry
    if table < _HEADER:
        raise SceneError(
            f"{path}: the last four bytes promise {count} meshes; a file of "
            f"{len(content)} bytes has no room for a table of so many"
        )
    if index >= count:
        raise SceneError(
            f"{path}: shape_index {index} does not exist; the file has {count} meshes, "
            "counted from 0"
        )
    (begin,) = struct.unpack_from(_OFFSETS[version], content, table + index * entry)
    if begin + _HEADER > table:
        raise SceneError(
            f"{path}: mesh {index} is said to begin at byte {begin}, and the meshes end "
            f"at byte {table}"
        )
    found = _version(content, begin, f"{path}: mesh {index}, at byte {begin},")
    if found != version:
        raise SceneError(
            f"{path}: mesh {index} is of version {found}, the file of version {version}"
        )
    return begin + _HEADER, table, version


def _version(content: bytes, at: int, what: str) -> int:
    """Return the version of the mesh at a byte position."""
    if len(content) < at + _HEADER:
        raise SceneError(f"{what} the file ends within the first four bytes of a mesh")
    mark, version = struct.unpack_from("<HH", content, at)
    if mark != _MARK:
        raise SceneError(
            f"{what} begins with 0x{mark:04x}; a serialized mesh begins with 0x{_MARK:04x}"
        )
    if version not in _OFFSETS:
        raise SceneError(f"{what} is of version {version}; possible are 3 and 4")
    return int(version)


class _Stream:
    """A zlib stream that is decompressed only as far as it is read."""

    def __init__(self, packed: bytes, what: str) -> None:
        self.what = what  # for messages
        self._packed = packed
        self._most = len(packed) * _MOST_EXPANSION
        self._inflate = zlib.decompressobj()
        self._ahead = b""  # decompressed and not read yet

    def read(self, count: int, what: str) -> bytes:
        """Return the next bytes; `what` names them for messages."""
        if count > self._most:
            raise SceneError(
                f"{self.what} promises {count} bytes of {what.removeprefix('the ')}; its "
                f"stream cannot hold more than {self._most}"
            )
        # decompressed, copied, and converted
        memory.require(6 * count, f"{self.what}: {what}")
        self._unpack(count - len(self._ahead))
        if len(self._ahead) < count:
            raise SceneError(
                f"{self.what}: the stream ends after {len(self._ahead)} of {count} bytes "
                f"of {what.removeprefix('the ')}"
            )
        found, self._ahead = self._ahead[:count], self._ahead[count:]
        return found

    def skip_name(self) -> None:
        """Skip text that ends with a zero byte."""
        self._unpack(_LONGEST_NAME - len(self._ahead))
        name, zero, rest = self._ahead.partition(b"\0")
        if not zero:
            raise SceneError(
                f"{self.what}: no zero ends its name within {len(name)} bytes; "
                f"the longest possible has {_LONGEST_NAME - 1}"
            )
        self._ahead = rest

    def _unpack(self, count: int) -> None:
        """Decompress `count` more bytes, or all that are left."""
        if count <= 0 or self._inflate.eof:
            return
        try:
            self._ahead += self._inflate.decompress(self._packed, count)
        except zlib.error as error:
            raise SceneError(f"{self.what}: the stream is damaged: {error}") from None
        self._packed = self._inflate.unconsumed_tail


def _rows(
    stream: _Stream, count: int, width: int, number: np.dtype, what: str
) -> NDArray[np.float64]:
    data = stream.read(count * width * number.itemsize, what)
    with np.errstate(over="ignore", invalid="ignore"):  # values are checked later
        rows = np.frombuffer(data, number).astype(np.float32).astype(np.float64)
    return rows.reshape(-1, width)
