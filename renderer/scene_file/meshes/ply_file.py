"""Meshes of PLY files, with their attributes."""

from __future__ import annotations

from dataclasses import replace
from itertools import takewhile
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
from renderer.scene_file.meshes.ply_records import (
    Columns,
    PlyHeader,
    parse_ply_header,
    read_records,
)

# ----------------------------------------------------------------------- ply attributes
# Attributes of PLY meshes: properties other than positions, combined by their names.
#
# As in Mitsuba's `ply` plugin, `r g b` or `red green blue` are the attribute
# `vertex_color`. Others are a name, `_` and a letter or digit, in the order of one of the
# sequences below: `heat_x` ... is `vertex_heat`; with the letters of a colour it is
# `vertex_heat_color`.

_COLORS = (("r", "g", "b", "a"), ("red", "green", "blue", "alpha"))
_SEQUENCES = ("xyz", "rgb", "012", "123")
_KNOWN = {"x", "y", "z", "nx", "ny", "nz", "u", "v", "s", "t", "texture_u", "texture_v"}


def ply_attributes(
    columns: Columns, element: str, path: Path
) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Return the attributes of vertices or faces, (records, size), and warnings."""
    fields = [name for name, column in columns.items() if column.ndim == 1]
    found: dict[str, list[str]] = {}
    for color in _COLORS:
        if set(color[:3]) <= set(fields):
            found[f"{element}_color"] = [name for name in color if name in fields]
            break
    taken = {name for names in found.values() for name in names}
    left = [name for name in fields if name not in taken | _KNOWN]
    warnings = []
    while left:
        run = _next_run(left)
        left = left[len(run) :]
        name = _name_of(run, element)
        if name is None or name in found:
            listed = ", ".join(f"`{field}`" for field in run)
            warnings.append(f"{path}: {element} fields {listed} make no attribute")
        else:
            found[name] = run
    attributes = {}
    for name, names in found.items():
        values = np.column_stack([columns[field] for field in names])
        largest = np.nanmax(values, initial=0.0)
        if name.endswith("_color") and largest > 1.0:
            warnings.append(
                f"{path}: {name} is up to {largest:g}; as in Mitsuba it is not "
                "divided by 255"
            )
        attributes[name] = values
    return attributes, warnings


def _next_run(fields: list[str]) -> list[str]:
    """Return the first fields with the same name before `_`, if they form a sequence."""
    prefix, _, letter = fields[0].rpartition("_")
    if not prefix or letter not in {sequence[0] for sequence in _SEQUENCES}:
        return fields[:1]
    same = (field.rpartition("_")[0] == prefix for field in fields)
    return [field for field, _ in zip(fields, takewhile(bool, same), strict=False)]


def _name_of(run: list[str], element: str) -> str | None:
    """Return the attribute's name for some fields, or None if they are no attribute."""
    prefix = run[0].rpartition("_")[0]
    letters = "".join(field.rpartition("_")[2] for field in run)
    possible = [s for s in _SEQUENCES if letters in (s, s[:1])]
    if not prefix or not possible or len(letters) != len(run):
        return None
    return f"{element}_{prefix}" + ("_color" if possible[0] == "rgb" else "")


# ----------------------------------------------------------------------------- ply file
# PLY files, ASCII and both binary forms, as Mitsuba's `ply` plugin reads them.

_UV_NAMES = (("u", "v"), ("texture_u", "texture_v"), ("s", "t"))  # the first match is used
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
        Replace v by 1 - v. False is Mitsuba's default for ply (but True for obj).
    face_normals
        Ignore the normals of the file.

    Raises
    ------
    SceneError
        For a missing, truncated or unreadable file, data after its end, a polygon that is
        not a triangle, a used position that is not finite, an index out of range, or no
        face. With the line if it is in the header or an ASCII value.
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
    """Return scalar properties as columns, (V, len(names))."""
    for name in names:
        if name not in vertex or vertex[name].ndim != 1:
            raise SceneError(
                f"{path}: the vertices have no number `{name}`; they have: "
                + ", ".join(vertex)
            )
    return np.column_stack([vertex[name] for name in names])


def _triangles(face: Columns, vertex_count: int, path: Path) -> NDArray[np.int32]:
    """Return the checked vertex indices, (F, 3)."""
    if not face:  # no records; Mitsuba shows nothing either
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
    return face[name].astype(np.int32, copy=False)


def _warnings(header: PlyHeader, path: Path) -> tuple[str, ...]:
    return tuple(
        f"{path}: element `{element.name}` is not read"
        for element in header.elements
        if element.name not in ("vertex", "face")
    )
