"""Writes files of the format `serialized`, whole or damaged."""

from __future__ import annotations

import struct
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass
class Mesh:
    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uvs: np.ndarray | None = None
    colors: np.ndarray | None = None
    double: bool = False
    flags: int = 0  # more of them
    name: bytes = b"a mesh"


def stream(mesh: Mesh, version: int, counts: tuple[int, int] | None = None) -> bytes:
    """Return what is compressed; `counts` instead of the true ones."""
    extra = ((0x1, mesh.normals), (0x2, mesh.uvs), (0x8, mesh.colors))
    flags = mesh.flags | (0x2000 if mesh.double else 0x1000)
    flags |= sum(flag for flag, rows in extra if rows is not None)
    data = struct.pack("<I", flags) + (mesh.name + b"\0" if version == 4 else b"")
    data += struct.pack("<QQ", *(counts or (len(mesh.vertices), len(mesh.faces))))
    for rows in (mesh.vertices, *(rows for _, rows in extra)):
        if rows is not None:
            data += np.asarray(rows, "<f8" if mesh.double else "<f4").tobytes()
    return data + np.asarray(mesh.faces, "<u4").tobytes()


def file_of(streams: list[bytes], version: int) -> bytes:
    """Return a file of meshes with given streams, not yet compressed."""
    content, offsets = b"", []
    for data in streams:
        offsets.append(len(content))
        content += struct.pack("<HH", 0x041C, version) + zlib.compress(data, 9)
    table = np.array(offsets, "<u8" if version == 4 else "<u4").tobytes()
    return content + table + struct.pack("<I", len(offsets))


def serialized(meshes: list[Mesh], version: int) -> bytes:
    return file_of([stream(mesh, version) for mesh in meshes], version)


def ball(rows: int, columns: int, **more: object) -> Mesh:
    """Return a ball by latitude and longitude with normals and uv."""
    v, u = np.mgrid[0 : rows + 1, 0 : columns + 1]
    theta, phi = np.pi * v / rows, 2 * np.pi * u / columns
    directions = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 2
    ).reshape(-1, 3)
    a = (v[:-1, :-1] * (columns + 1) + u[:-1, :-1]).ravel()
    b = a + columns + 1
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    corners = directions[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    uvs = np.stack([u / columns, v / rows], 2).reshape(-1, 2)
    return Mesh(directions, faces[area > 1e-9], directions, uvs, **more)


def plugin_scene_meshes() -> list[Mesh]:
    """Return the meshes of tests/plugins/serialized.xml."""
    round_, faceted = ball(8, 12, double=True), ball(4, 6, flags=0x10)
    faceted.normals = None
    tent = Mesh(
        np.array(
            [[-1, -1, 0], [1, -1, 0], [0, -1, 1.5], [-1, 1, 0], [1, 1, 0], [0, 1, 1.5]]
        ),
        np.array([[0, 1, 2], [3, 5, 4], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]]),
        colors=np.ones((6, 3)),
    )
    return [round_, faceted, tent]


if __name__ == "__main__":
    Path(sys.argv[1]).write_bytes(serialized(plugin_scene_meshes(), int(sys.argv[2])))
