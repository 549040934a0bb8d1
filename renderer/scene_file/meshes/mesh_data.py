"""MeshData: triangles as a mesh file gives them, before any transform."""

from __future__ import annotations

import codecs
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory

_BLANKS = bytes(b for b in range(256) if chr(b).isspace())  # between words of latin-1


@dataclass(frozen=True, eq=False)
class MeshData:
    """Triangles in local coordinates; every index is in range."""

    vertices: NDArray[np.float64]  # (V, 3) finite
    faces: NDArray[np.int32]  # (F, 3) in [0, V); degenerate ones still in
    normals: NDArray[np.float64] | None = None  # (V, 3), any length; a NaN row: not given
    uvs: NDArray[np.float64] | None = None  # (V, 2) finite
    source: str = "<memory>"  # for messages: the file
    warnings: tuple[str, ...] = ()  # for the log
    # "vertex_..." (V, size) and "face_..." (F, size), of any value until a texture uses it
    attributes: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


def read_mesh_bytes(path: Path) -> bytes:
    """Read a whole mesh file but for a byte order mark, or say why that cannot be."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"{path}: no such mesh file") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot read it: {error.strerror}") from None
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise SceneError(f"{path}: the mesh file is UTF-16 text; expected ASCII or UTF-8")
    content = content.removeprefix(codecs.BOM_UTF8)
    if not content:
        raise SceneError(f"{path}: the mesh file is empty")
    return content


def require_for_words(content: bytes, each: int, path: Path) -> None:
    """Refuse a text of more words than there is memory, `each` bytes for one at the peak.

    Raises
    ------
    NotAllowed
        With both numbers.
    """
    gaps = len(content) - len(content.translate(None, _BLANKS))
    memory.require(each * gaps + 3 * len(content), f"{path}: the mesh")


def first_not_finite(rows: NDArray[np.float64]) -> int:
    """Return the first row with a value that float32 cannot hold (NaN, infinite), or -1.

    Parameters
    ----------
    rows
        (N, K) values, about to become float32.
    """
    good = _finite(rows)
    return -1 if good.all() else int(np.argmin(good))


def _finite(rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    # Written with <= so that a NaN, which compares false, counts as bad.
    return np.asarray((np.abs(rows) <= np.finfo(np.float32).max).all(axis=1))


def flipped(v: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return 1 - v, rounded as Mitsuba rounds it."""
    with np.errstate(over="ignore", invalid="ignore"):  # judged later
        return np.asarray(np.float32(1.0) - v.astype(np.float32))


def first_out_of_range(faces: NDArray[np.float64], vertex_count: int) -> int:
    """Return the first face with an index not among 0, 1, ..., vertex_count - 1, or -1."""
    good = ((faces >= 0) & (faces < vertex_count) & (faces == np.floor(faces))).all(axis=1)
    return -1 if good.all() else int(np.argmin(good))


def judged_mesh(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    normals: NDArray[np.float64] | None,
    uvs: NDArray[np.float64] | None,
    source: str,
    lines: Mapping[str, NDArray[np.int64]] | None = None,
) -> MeshData:
    """Return the mesh of a file whose numbers may be NaN or infinite.

    What can be done without is replaced, in place, and counted in a warning: positions that
    no face uses, normals without a direction, uv.

    Parameters
    ----------
    lines
        Of text files: in which line of the file each vertex has its "position", "normal"
        and "uv", (V,) each; 0 if it has none.

    Raises
    ------
    SceneError
        If a position that a face uses is not finite.
    """

    def place(what: str, vertex: int) -> str:
        return f"of vertex {vertex}" if lines is None else f"in line {lines[what][vertex]}"

    def count(what: str, rows: NDArray[np.float64], bad: NDArray[np.bool_]) -> str:
        first = int(np.argmax(bad))
        shown = f"{show_numbers(rows[first])} {place(what, first)}"
        return f"{source}: {bad.sum()} of {len(bad)} vertices have a {what} like {shown}"

    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    warnings = [] if len(faces) else [f"{source}: no faces, so that nothing is seen"]
    if (bad := ~_finite(vertices)).any():
        if (bad & used).any():
            first = int(np.argmax(bad & used))
            shown = show_numbers(vertices[first])
            where = f"{source}: position {shown} of vertex {first}"
            if lines is not None:
                where = f"{source}:{lines['position'][first]}: vertex {shown}"
            raise SceneError(f"{where} is not finite")
        warnings.append(count("position", vertices, bad) + "; no face uses them")
        vertices[bad] = vertices[faces[0, 0]] if len(faces) else 0.0
    if normals is not None:
        bad = ~_finite(normals) | ~normals.any(axis=1)
        if lines is not None:
            bad &= lines["normal"] > 0
        if bad.any():
            warnings.append(
                count("normal", normals, bad) + ", which has no direction; faces use "
                f"{(bad & used).sum()} of them, which are computed from the faces"
            )
        normals[bad] = np.nan
    if uvs is not None and (bad := ~_finite(uvs)).any():
        warnings.append(count("uv", uvs, bad) + ", which is not finite; it becomes (0, 0)")
        uvs[bad] = 0.0
    return MeshData(vertices, faces, normals, uvs, source, tuple(warnings))


def show_numbers(values: Sequence[float] | NDArray[np.float64]) -> str:
    """Return `(1, nan, 0.5)`, the form of a point in messages."""
    return "(" + ", ".join(f"{value:.9g}" for value in values) + ")"
