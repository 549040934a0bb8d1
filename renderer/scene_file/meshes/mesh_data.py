"""`MeshData`: checked arrays of a mesh; surface areas; grids of texture coordinates."""

from __future__ import annotations

import codecs
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.description import Cylinder, Disk, Mesh, Rectangle, Shape, Sphere

# ------------------------------------------------------------------------- surface area
# Surface areas of shapes in world space.


def surface_area(shape: Shape) -> float:
    """Return the area of one side of a shape, caps of a cylinder not included.

    Raises
    ------
    TypeError
        If there is no formula for this kind of shape.
    """
    with np.errstate(over="ignore"):
        match shape:
            case Mesh():
                a, b, c = (
                    shape.vertices[shape.faces[:, k]].astype(float) for k in range(3)
                )
                twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
                return 0.5 * float(twice.sum())
            case Rectangle() | Disk():
                x, y = shape.to_world[:3, 0], shape.to_world[:3, 1]
                unit = 4.0 if isinstance(shape, Rectangle) else math.pi
                return unit * float(np.linalg.norm(np.cross(x, y)))
            case Sphere():
                return 4.0 * math.pi * float(np.linalg.norm(shape.to_world[:3, 0])) ** 2
            case Cylinder():
                radius, length = np.linalg.norm(shape.to_world[:3, [0, 2]], axis=0)
                return 2.0 * math.pi * float(radius) * float(length)
            case _:
                raise TypeError(f"no area for {type(shape).__name__}")


# ------------------------------------------------------------------------------ uv grid
# A uniform grid of triangles over (u, v), and a test for overlapping triangles.

_MOST_CELLS = 512  # along each axis
_MOST_CENTERS = 4096  # number of centroids that are tested


class UvGrid(NamedTuple):
    """Cells of equal size, row by row, and the triangles in each."""

    low: NDArray[np.float64]  # (2,) smallest u and v
    scale: NDArray[np.float64]  # (2,) cells per unit
    cells: int  # along each axis
    start: NDArray[np.int64]  # (cells^2 + 1,) first entry of each cell
    entries: NDArray[np.int64]  # triangles

    def cell_of(self, p: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cells of points (n, 2)."""
        i, j = np.clip(((p - self.low) * self.scale).astype(int), 0, self.cells - 1).T
        return np.asarray(j * self.cells + i)

    def members(self, cell: int) -> NDArray[np.int64]:
        """Return the triangles whose box overlaps a cell."""
        return self.entries[self.start[cell] : self.start[cell + 1]]


def uv_grid(points: NDArray[np.float64]) -> UvGrid:
    """Return a grid of triangles (n, 3, 2), listed in all cells that boxes overlap."""
    cells = int(min(max(np.ceil(np.sqrt(len(points))), 1), _MOST_CELLS))
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    size = np.maximum(high - low, 1e-30)
    scale = cells / size
    margin = 1e-5  # of a cell: kernels compute the cell in float32
    first = (points.min(axis=1) - low) * scale - margin
    last = (points.max(axis=1) - low) * scale + margin
    first = np.clip(np.floor(first), 0, cells - 1).astype(np.int64)
    last = np.clip(np.floor(last), 0, cells - 1).astype(np.int64)
    wide = last - first + 1
    owners = np.repeat(np.arange(len(points)), wide[:, 0] * wide[:, 1])
    ends = np.cumsum(wide[:, 0] * wide[:, 1])
    place = np.arange(len(owners)) - (ends - wide[:, 0] * wide[:, 1])[owners]
    i = first[owners, 0] + place % wide[owners, 0]
    j = first[owners, 1] + place // wide[owners, 0]
    cell = j * cells + i
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], np.arange(cells * cells + 1))
    return UvGrid(low, scale, cells, start, owners[order])


def overlap(points: NDArray[np.float64]) -> bool:
    """Return whether triangles (n, 3, 2) overlap.

    Only the centroids of some triangles are tested. This finds the sides of a box that
    share a square, and triangles that overlap by half; a sliver may be missed.
    """
    grid = uv_grid(points)
    centers = points[:: len(points) // _MOST_CENTERS + 1].mean(axis=1)
    cells = grid.cell_of(centers)
    return any(
        _inside(points[grid.members(cell)], center).sum() > 1
        for cell, center in zip(cells, centers, strict=True)
    )


def _inside(points: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.bool_]:
    a, b, c = (points[:, k] - p for k in range(3))
    areas = [_cross(a, b), _cross(b, c), _cross(c, a)]
    total = areas[0] + areas[1] + areas[2]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.all([part / total > 1e-3 for part in areas], axis=0)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


# ---------------------------------------------------------------------------- mesh data
# MeshData: the triangles of a mesh file before any transform.

_BLANKS = bytes(b for b in range(256) if chr(b).isspace())  # between words of latin-1


@dataclass(frozen=True, eq=False)
class MeshData:
    """Triangles in local coordinates; every index is in range."""

    vertices: NDArray[np.float64]  # (V, 3) finite
    faces: NDArray[np.int32]  # (F, 3) in [0, V); may be degenerate
    normals: NDArray[np.float64] | None = None  # (V, 3), any length; NaN: not given
    uvs: NDArray[np.float64] | None = None  # (V, 2) finite
    source: str = "<memory>"  # for messages: the file
    warnings: tuple[str, ...] = ()  # for the log
    # "vertex_..." (V, size) and "face_..." (F, size), checked when a texture uses them
    attributes: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


def read_mesh_bytes(path: Path, what: str = "mesh") -> bytes:
    """Read a mesh file as a whole, without a byte order mark, or raise SceneError.

    `what` names the kind of file in messages.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"{path}: no such {what} file") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot read it: {error.strerror}") from None
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise SceneError(f"{path}: the {what} file is UTF-16 text; expected ASCII or UTF-8")
    content = content.removeprefix(codecs.BOM_UTF8)
    if not content:
        raise SceneError(f"{path}: the {what} file is empty")
    return content


def require_for_words(content: bytes, each: int, path: Path, what: str = "mesh") -> None:
    """Refuse a text with more words than fit into memory, at `each` bytes per word.

    Raises
    ------
    NotAllowed
        With the needed and the available memory.
    """
    gaps = len(content) - len(content.translate(None, _BLANKS))
    memory.require(each * gaps + 3 * len(content), f"{path}: the {what}")


def parse_numbers(
    texts: Sequence[str], lines: Sequence[int], width: int, what: str, path: Path
) -> NDArray[np.float64]:
    """Return the numbers of a text file, (N, width).

    Parameters
    ----------
    texts
        Words of N lines, `width` words per line.
    lines
        Line numbers in the file, (N,).
    what
        What a line of the file is, for messages: "a vertex".

    Raises
    ------
    SceneError
        With file and line of the first word that is not a number.
    """
    try:
        if "_" in "".join(texts):  # Python would read 1_0 as 10
            raise ValueError
        values = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        index = next(i for i, text in enumerate(texts) if not is_number(text))
        raise SceneError(
            f"{path}:{lines[index // width]}: {what} needs numbers, "
            f"found `{texts[index][:40]}`"
        ) from None
    return values.reshape(len(lines), width)


def is_number(word: str | bytes) -> bool:
    """Return whether a word of a file is a number; `1_0` is not, unlike in Python."""
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in repr(word)


def first_not_finite(rows: NDArray[np.float64]) -> int:
    """Return the first row with a value that float32 cannot hold (NaN, infinite), or -1.

    Parameters
    ----------
    rows
        (N, K) values that will be converted to float32.
    """
    good = _finite(rows)
    return -1 if good.all() else int(np.argmin(good))


def _finite(rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    # Written with <= so that NaN, which compares false, is not finite.
    most = np.finfo(np.float32).max
    if rows.max(initial=0.0) <= most and rows.min(initial=0.0) >= -most:
        return np.ones(len(rows), np.bool_)  # a tenth of the time for nearly all meshes
    return np.asarray((np.abs(rows) <= most).all(axis=1))


def flipped(v: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return 1 - v, rounded as in Mitsuba."""
    with np.errstate(over="ignore", invalid="ignore"):  # values are checked later
        return np.asarray(np.float32(1.0) - v.astype(np.float32))


def first_out_of_range(faces: NDArray[Any], vertex_count: int) -> int:
    """Return the first face with an index outside of [0, vertex_count), or -1."""
    whole = faces.dtype.kind in "iu"
    if whole and faces.min(initial=0) >= 0 and faces.max(initial=0) < vertex_count:
        return -1
    good = ((faces >= 0) & (faces < vertex_count) & (faces == np.floor(faces))).all(axis=1)
    return -1 if good.all() else int(np.argmin(good))


def judged_mesh(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    normals: NDArray[np.float64] | None,
    uvs: NDArray[np.float64] | None,
    source: str,
    line_of: Callable[[str, int], int] | None = None,
    has_normal: NDArray[np.bool_] | None = None,
) -> MeshData:
    """Return the mesh of a file whose numbers may be NaN or infinite.

    Invalid values that are not essential are replaced in place and counted in a warning:
    positions that no face uses, normals without a direction, uv.

    Parameters
    ----------
    line_of
        For text files: (a vertex's "position", "normal" or "uv"; its index) -> its line.
    has_normal
        (V,) whether the file gives the vertex a normal; None: all or no vertices have one.

    Raises
    ------
    SceneError
        If a position that a face uses is not finite.
    """

    def place(what: str, vertex: int) -> str:
        return (
            f"of vertex {vertex}" if line_of is None else f"in line {line_of(what, vertex)}"
        )

    def count(what: str, rows: NDArray[np.float64], bad: NDArray[np.bool_]) -> str:
        first = int(np.argmax(bad))
        shown = f"{show_numbers(rows[first])} {place(what, first)}"
        return f"{source}: {bad.sum()} of {len(bad)} vertices have a {what} like {shown}"

    def used() -> NDArray[np.bool_]:
        found = np.zeros(len(vertices), dtype=bool)
        found[faces] = True
        return found

    warnings = [] if len(faces) else [f"{source}: no faces, so that nothing is seen"]
    if (bad := ~_finite(vertices)).any():
        if (bad & used()).any():
            first = int(np.argmax(bad & used()))
            shown = show_numbers(vertices[first])
            where = f"{source}: position {shown} of vertex {first}"
            if line_of is not None:
                where = f"{source}:{line_of('position', first)}: vertex {shown}"
            raise SceneError(f"{where} is not finite")
        warnings.append(count("position", vertices, bad) + "; no face uses them")
        vertices[bad] = vertices[faces[0, 0]] if len(faces) else 0.0
    if normals is not None:
        bad = ~_finite(normals) | ~normals.any(axis=1)
        if has_normal is not None:
            bad &= has_normal
        if bad.any():
            warnings.append(
                count("normal", normals, bad) + ", which has no direction; faces use "
                f"{(bad & used()).sum()} of them, which are computed from the faces"
            )
        normals[bad] = np.nan
    if uvs is not None and (bad := ~_finite(uvs)).any():
        warnings.append(count("uv", uvs, bad) + ", which is not finite; it becomes (0, 0)")
        uvs[bad] = 0.0
    return MeshData(vertices, faces, normals, uvs, source, tuple(warnings))


def show_numbers(values: Sequence[float] | NDArray[np.float64]) -> str:
    """Return `(1, nan, 0.5)`: a point as messages show it."""
    return "(" + ", ".join(f"{value:.9g}" for value in values) + ")"
