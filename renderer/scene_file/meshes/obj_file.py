"""Wavefront OBJ files: `v`, `vt`, `vn` and `f` lines, as Mitsuba's `obj` plugin reads them.

Most files are read in blocks (`obj_blocks`), unusual and invalid ones line by line.

Unlike Mitsuba, negative (relative) indices and lines continued by a backslash are
supported.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.meshes.mesh_data import (
    MeshData,
    flipped,
    judged_mesh,
    parse_numbers,
    read_mesh_bytes,
    require_for_words,
)
from renderer.scene_file.meshes.obj_blocks import KINDS, Blocks, distinct, read_blocks

# Keywords without an effect on triangles; any other word is reported.
_NOT_GEOMETRY = frozenset(("g", "o", "s", "usemtl", "mtllib", "mg", "lod", "bevel"))


@dataclass
class _Table:
    """The numbers of all lines of one kind, as text, with their line numbers."""

    what: str  # for messages
    width: int  # numbers that are used on each line
    texts: list[str] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.lines)


@dataclass
class _Tables:
    """The content of a file by kind of line, before numbers are parsed."""

    v: _Table = field(default_factory=lambda: _Table("vertex", 3))
    vt: _Table = field(default_factory=lambda: _Table("texture coordinate", 2))
    vn: _Table = field(default_factory=lambda: _Table("normal", 3))
    corners: list[str] = field(default_factory=list)  # "7/2/3", of all faces in order
    face_sizes: list[int] = field(default_factory=list)  # number of corners of each face
    face_lines: list[int] = field(default_factory=list)
    # corners whose relative indices are out of range -> their text in the file
    unresolved: dict[str, str] = field(default_factory=dict)
    skipped: list[tuple[int, str]] = field(default_factory=list)  # unknown (line, word)


def read_obj(
    path: Path, *, flip_tex_coords: bool = True, face_normals: bool = False
) -> MeshData:
    """Read an OBJ file.

    Vertices are in the order of their first use by faces. Polygons become fans around their
    first corner. A corner without `vt` gets uv (0, 0), one without `vn` a computed normal.
    Groups and materials do not split the mesh.

    Parameters
    ----------
    path
        The file.
    flip_tex_coords
        Replace v by 1 - v. True is Mitsuba's default for obj.
    face_normals
        Ignore the normals of the file and their indices.

    Raises
    ------
    SceneError
        With file and line: a missing or unreadable file, text in place of a number, a used
        position that is not finite, an index out of range, a face with less than three
        corners, or no face.
    """
    # latin-1 decodes every byte: names may be in any encoding
    content = read_mesh_bytes(path)
    memory.require(7 * len(content), f"{path}: the mesh")  # of short lines
    blocks = read_blocks(content, face_normals=face_normals, what=f"{path}: the mesh")
    parsed = None if blocks is None else _of_blocks(blocks, content)
    if parsed is None:
        require_for_words(content, 95, path)  # lists of texts, and the numbers
        parsed = _read_lines(content.decode("latin-1"), path, face_normals)
    vertices, uvs, normals, keys, corner_vertex, face_sizes, line_of, skipped = parsed
    if face_normals:
        keys[:, 2] = 0

    normal = uv = None
    if keys[:, 2].any():
        # Row 0 stands for "absent"; index 1 of the file is row 1.
        normal = np.vstack((np.full((1, 3), np.nan), normals))[keys[:, 2]]
    if keys[:, 1].any():
        if flip_tex_coords:
            uvs[:, 1] = flipped(uvs[:, 1])
        uv = np.vstack((np.zeros((1, 2)), uvs))[keys[:, 1]]

    def line(what: str, vertex: int) -> int:
        column = ("position", "uv", "normal").index(what)
        return line_of(column, int(keys[vertex, column]) - 1)

    triangles = corner_vertex.reshape(-1, 3) if (face_sizes == 3).all() else None
    mesh = judged_mesh(
        vertices[keys[:, 0] - 1],
        corner_vertex[_fan(face_sizes)] if triangles is None else triangles,
        normal,
        uv,
        str(path),
        line,
        keys[:, 2] > 0,
    )
    warnings = (*_warnings(skipped, path), *_missing(keys, path), *mesh.warnings)
    return replace(mesh, warnings=warnings)


class _Parsed(NamedTuple):
    """The numbers of a file."""

    vertices: NDArray[np.float64]
    uvs: NDArray[np.float64]
    normals: NDArray[np.float64]
    keys: NDArray[Any]  # (V, 3): index of v, vt, vn of each vertex; 0: absent
    corner_vertex: NDArray[np.int32]  # (corners,): vertex of each corner
    face_sizes: NDArray[Any]
    line_of: Callable[[int, int], int]  # (0 for v, 1 for vt, 2 for vn; index) -> line
    skipped: list[tuple[int, str]]  # unknown (line, word)


def _of_blocks(blocks: Blocks, content: bytes) -> _Parsed | None:
    """Return the numbers that were read in blocks; check the other lines.

    None if one of these is geometry, such as an indented line.
    """
    skipped = []
    for number, begin in blocks.other:
        end = content.find(b"\n", begin)
        line = content[begin : end if end >= 0 else None].decode("latin-1")
        words = line.partition("#")[0].split()
        if words and words[0] in KINDS:
            return None
        if words and words[0] not in _NOT_GEOMETRY:
            skipped.append((int(number), words[0]))

    def line_of(column: int, row: int) -> int:
        return content.count(b"\n", 0, blocks.begins[column][row]) + 1

    corners = distinct(blocks.corners, len(blocks.v))
    return _Parsed(*blocks[:3], *corners, blocks.face_sizes, line_of, skipped)


def _read_lines(text: str, path: Path, face_normals: bool) -> _Parsed:
    """Read a file line by line."""
    tables = _Tables()
    if face_normals:
        tables.vn.width = 0  # their numbers are not parsed
    _split_lines(text, tables, path)
    each = (tables.v, tables.vt, tables.vn)
    vertices, uvs, normals = (
        parse_numbers(t.texts, t.lines, t.width, f"a {t.what}", path) for t in each
    )
    if not tables.corners:
        raise SceneError(f"{path}: no `f` line; an OBJ mesh needs at least one face")
    keys, corner_vertex = _distinct_corners(tables, path)
    return _Parsed(
        vertices,
        uvs,
        normals,
        keys,
        corner_vertex.astype(np.int32),
        np.array(tables.face_sizes),
        lambda column, row: each[column].lines[row],
        tables.skipped,
    )


def _split_lines(text: str, tables: _Tables, path: Path) -> None:
    """Sort the lines of a file by kind. This loop runs over all lines: keep it fast."""
    lines = text.split("\n")
    if "\\" in text:
        _join_continued(lines)
    number_tables = {"v": tables.v, "vt": tables.vt, "vn": tables.vn}
    for number, line in enumerate(lines, start=1):
        if "#" in line:
            line = line[: line.index("#")]
        words = line.split()
        if not words:
            continue
        if (table := number_tables.get(words[0])) is not None:
            if len(words) <= table.width:
                raise SceneError(
                    f"{path}:{number}: a {table.what} needs {table.width} numbers, "
                    f"found {len(words) - 1}"
                )
            table.texts += words[1 : table.width + 1]
            table.lines.append(number)
        elif words[0] == "f":
            if len(words) < 4:
                raise SceneError(
                    f"{path}:{number}: a face needs 3 corners or more, "
                    f"found {len(words) - 1}"
                )
            if "-" in line:
                words[1:] = [_absolute(word, tables) for word in words[1:]]
            tables.corners += words[1:]
            tables.face_sizes.append(len(words) - 1)
            tables.face_lines.append(number)
        elif words[0] not in _NOT_GEOMETRY:
            tables.skipped.append((number, words[0]))


def _join_continued(lines: list[str]) -> None:
    """Move each line that ends in a backslash to the front of the next, in place."""
    for index in range(len(lines) - 1):
        bare = lines[index].rstrip("\r")
        if bare.endswith("\\"):
            lines[index] = ""  # keeps the line numbers
            lines[index + 1] = bare[:-1] + " " + lines[index + 1]


def _absolute(corner: str, tables: _Tables) -> str:
    """Replace negative indices of a corner: -1 is the newest of its kind so far.

    An index out of range stays negative, and is reported later.
    """
    parts = corner.split("/")
    too_far = False
    for place, table in enumerate((tables.v, tables.vt, tables.vn)):
        if place < len(parts) and parts[place].startswith("-"):
            try:
                index = len(table) + 1 + int(parts[place])
            except ValueError:
                continue  # reported with other corners that are not integers
            if 0 < index <= len(table):  # not -0
                parts[place] = str(index)
            else:
                too_far = True
    text = "/".join(parts)
    if too_far:
        tables.unresolved[text] = corner
    return text


def _distinct_corners(
    tables: _Tables, path: Path
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Merge equal corners into vertices.

    Returns
    -------
    keys
        (V, 3): index of v, vt, vn of each vertex, from 1; 0 if absent.
    corner_vertex
        (corners,): vertex of each corner.
    """
    # Texts are merged first, then parsed: a mesh has about six corners per distinct one.
    text_ids: dict[str, int] = {}
    corner_text = [text_ids.setdefault(text, len(text_ids)) for text in tables.corners]
    key_ids: dict[tuple[int, int, int], int] = {}
    key_of_text = np.empty(len(text_ids), dtype=np.int64)
    for text, text_id in text_ids.items():
        key = _parse_corner(text)
        if key is None:
            raise SceneError(
                f"{path}:{_line_of_corner(tables, text)}: face corner `{text[:40]}` is not "
                "of the form v, v/vt, v//vn or v/vt/vn with integers"
            )
        for index, table in zip(key, (tables.v, tables.vt, tables.vn), strict=True):
            lowest = 1 if table is tables.v else 0
            if not lowest <= index <= len(table) and table.width:
                line = _line_of_corner(tables, text)
                shown = tables.unresolved.get(text, text)
                there = f"the file has {len(table)}"
                if index < 0:
                    there = f"{bisect.bisect_left(table.lines, line)} come before it"
                raise SceneError(
                    f"{path}:{line}: face corner `{shown[:40]}`: "
                    f"{table.what} {index} does not exist, {there}"
                )
        key_of_text[text_id] = key_ids.setdefault(key, len(key_ids))
    return np.array(list(key_ids), dtype=np.int64), key_of_text[corner_text]


def _parse_corner(text: str) -> tuple[int, int, int] | None:
    """Parse `v/vt/vn` to three integers, 0 for absent ones; None if it is invalid."""
    parts = text.split("/")
    if len(parts) > 3:
        return None
    try:
        indices = [int(part) if part else 0 for part in parts]
    except ValueError:
        return None
    v, vt, vn = indices + [0] * (3 - len(indices))
    return v, vt, vn


def _line_of_corner(tables: _Tables, text: str) -> int:
    """Return the line of the first face with this corner, for messages."""
    ends = np.cumsum(tables.face_sizes)
    face = int(np.searchsorted(ends, tables.corners.index(text), side="right"))
    return tables.face_lines[face]


def _fan(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cut polygons into triangles (0, i, i + 1) around their first corner.

    Parameters
    ----------
    sizes
        (P,) corners of each polygon, 3 or more.

    Returns
    -------
    triangles
        (T, 3) positions in the list of all corners.
    """
    starts = np.cumsum(sizes) - sizes
    counts = sizes - 2
    first = np.repeat(starts, counts)
    # number of each triangle within its polygon: 0, 1, ...
    within = np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.column_stack((first, first + within + 1, first + within + 2))


def _missing(keys: NDArray[np.int64], path: Path) -> list[str]:
    """Warn of corners that lack what others have: Mitsuba's result is then undefined."""
    found = []
    for column, word, instead in ((1, "vt", "uv (0, 0)"), (2, "vn", "a computed normal")):
        lacking = int((keys[:, column] == 0).sum())
        if 0 < lacking < len(keys):
            found.append(
                f"{path}: {lacking} of {len(keys)} vertices have no {word} and get "
                f"{instead}; Mitsuba reads uninitialised memory there"
            )
    return found


def _warnings(skipped: list[tuple[int, str]], path: Path) -> tuple[str, ...]:
    if not skipped:
        return ()
    number, word = skipped[0]
    return (
        f"{path}:{number}: `{word[:40]}` lines are not read "
        f"({len(skipped)} lines of kinds other than v, vt, vn and f)",
    )
