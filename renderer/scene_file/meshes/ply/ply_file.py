"""PLY files, ascii and both binary forms, as Mitsuba's `ply` plugin reads them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.meshes.mesh_data import (
    MeshData,
    first_out_of_range,
    flipped,
    judged_mesh,
    read_mesh_bytes,
    require_for_words,
    show_numbers,
)
from renderer.scene_file.meshes.ply.ply_attributes import ply_attributes
from renderer.scene_file.meshes.ply.ply_header import PlyHeader, parse_ply_header
from renderer.scene_file.meshes.ply.ply_records import Columns, read_records

_UV_NAMES = (("u", "v"), ("texture_u", "texture_v"), ("s", "t"))  # the first pair counts
_INDEX_NAMES = ("vertex_index", "vertex_indices")


def read_ply(
    path: Path, *, flip_tex_coords: bool = False, face_normals: bool = False
) -> MeshData:
    """Read a PLY file of triangles; other elements and properties are skipped.

    Parameters
    ----------
    path
        The file.
    flip_tex_coords
        Read v as 1 - v. False is Mitsuba's default for ply (and True for obj).
    face_normals
        Do not look at the normals of the file.

    Raises
    ------
    SceneError
        Missing, truncated or unreadable file, data left over, a polygon that is no
        triangle, a used position that is not finite, an index out of range, no face. With
        the line where it is in the header or an ascii value.
    """
    content = read_mesh_bytes(path)
    header = parse_ply_header(content, path)
    if header.byte_order:
        memory.require(8 * len(content), f"{path}: the mesh")  # float64 of the bytes
    else:
        require_for_words(content[header.size :], 55, path)
    elements = read_records(content, header, path)
    if not elements.get("vertex") or "face" not in elements:
        missing = "face" if elements.get("vertex") else "vertex"
        raise SceneError(f"{path}: no `{missing}` records; a mesh needs at least one")
    vertex = elements["vertex"]
    vertices = _columns(vertex, ("x", "y", "z"), path)
    faces = _triangles(elements["face"], len(vertices), path)
    normals = None
    if {"nx", "ny", "nz"} <= vertex.keys() and not face_normals:
        normals = _columns(vertex, ("nx", "ny", "nz"), path)
    uvs = None
    if pair := next((pair for pair in _UV_NAMES if set(pair) <= vertex.keys()), None):
        uvs = _columns(vertex, pair, path)
        if flip_tex_coords:
            uvs[:, 1] = flipped(uvs[:, 1])
    of_vertices, dropped = ply_attributes(vertex, "vertex", path)
    of_faces, dropped_too = ply_attributes(elements["face"], "face", path)
    mesh = judged_mesh(vertices, faces, normals, uvs, str(path))
    return replace(
        mesh,
        warnings=(*_warnings(header, path), *dropped, *dropped_too, *mesh.warnings),
        attributes=of_vertices | of_faces,
    )


def _columns(vertex: Columns, names: tuple[str, ...], path: Path) -> NDArray[np.float64]:
    """Put scalar properties side by side, (V, len(names))."""
    for name in names:
        if name not in vertex or vertex[name].ndim != 1:
            raise SceneError(
                f"{path}: the vertices have no number `{name}`; they have: "
                + ", ".join(vertex)
            )
    return np.column_stack([vertex[name] for name in names])


def _triangles(face: Columns, vertex_count: int, path: Path) -> NDArray[np.int32]:
    """Return the checked vertex indices, (F, 3)."""
    if not face:  # no records; Mitsuba has nothing to show either
        return np.zeros((0, 3), np.int32)
    name = next((name for name in _INDEX_NAMES if name in face), None)
    if name is None or face[name].ndim != 2:
        raise SceneError(
            f"{path}: the faces have no list `vertex_index` or `vertex_indices`; "
            "they have: " + ", ".join(face)
        )
    if face[name].shape[1] != 3:
        raise SceneError(
            f"{path}: face 0 has {face[name].shape[1]} corners; only triangles are possible"
        )
    bad = first_out_of_range(face[name], vertex_count)
    if bad >= 0:
        raise SceneError(
            f"{path}: face {bad} has the vertices {show_numbers(face[name][bad])}; "
            f"possible are integers from 0 to {vertex_count - 1}"
        )
    return face[name].astype(np.int32)


def _warnings(header: PlyHeader, path: Path) -> tuple[str, ...]:
    return tuple(
        f"{path}: element `{element.name}` is not read"
        for element in header.elements
        if element.name not in ("vertex", "face")
    )
