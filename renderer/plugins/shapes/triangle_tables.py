"""Tables of triangles: from meshes to table columns, boxes, and rows of accelerators.

Each is a single parallel pass. NumPy takes six to ten times as long for a mesh of two
million triangles, mostly for intermediate results that do not fit into the cache.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import column_rows, entry_kernel, kernel, table_columns
from renderer.kernels.lanes.vectors import cross, dot, vec3
from renderer.plugins.shapes import flat
from renderer.plugins.shapes.primitives import ROUNDING, empty_rows, float32
from renderer.process.worker_pool import in_parts
from renderer.scene_file.description import Diffuse, Mesh


@flat.with_parts
@table_columns("places", "normals", "uvs")
class TriangleSurfaces(NamedTuple):
    """Triangles first .. end - 1 by primitive id; columns are relative to `first`."""

    first: int
    end: int
    places: NDArray[np.float32]  # (12, n) corner, edge1, edge2, unit edge1 x edge2
    ends: NDArray[np.float32]  # (6, n) second and third vertex: corner + edge has rounding
    # the following tables have no columns if no mesh has them or no kernel reads them
    normals: NDArray[np.float32] = empty_rows(9)  # (9, n) of the vertices, any length
    uvs: NDArray[np.float32] = empty_rows(6)  # (6, n) u, v of each vertex
    tangents: NDArray[np.float32] = np.zeros((3, 0), np.float32)  # (3, n) dp/du


def surfaces(meshes: list[Mesh], first: int) -> TriangleSurfaces:
    """Concatenate meshes; vertex normals are kept if any mesh has them."""
    count = sum(len(mesh.faces) for mesh in meshes)
    smooth = any(mesh.normals is not None for mesh in meshes)
    places, uvs = column_rows(12, count), column_rows(6, count)
    normals = column_rows(9, count if smooth else 0)
    ends = np.empty((6, count), np.float32)
    at = 0
    for mesh in meshes:
        faces = np.ascontiguousarray(mesh.faces, np.int32)
        vertices = float32(mesh.vertices)
        given = (
            np.zeros((0, size), np.float32) if rows is None else float32(rows)
            for rows, size in ((mesh.normals, 3), (mesh.uvs, 2))
        )
        turn = -1.0 if mesh.flip_normals else 1.0
        tables = places, ends, normals, uvs
        in_parts(len(faces), _write_columns, vertices, faces, *given, turn, at, *tables)
        at += len(faces)
    return TriangleSurfaces(
        first, first + count, places[:-1].T, ends, normals[:-1].T, uvs[:-1].T
    )


def triangles_of(vertices: NDArray[np.float32], first: int = 0) -> TriangleSurfaces:
    """Return triangles of vertices (n, 3, 3), with primitive ids from `first` on."""
    corners = float32(vertices).reshape(-1, 3)
    faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    triangles = surfaces([Mesh(bsdf=Diffuse(), vertices=corners, faces=faces)], first)
    return triangles._replace(uvs=empty_rows(6))


@entry_kernel
def _write_columns(
    begin, end, vertices, faces, given, given_uvs, turn, at, places, ends, normals, uvs
):
    """Write faces begin .. end - 1 of a mesh to the columns from `at` on."""
    for k in range(begin, end):
        to = at + k
        a, b, c = faces[k, 0], faces[k, 1], faces[k, 2]
        for j in range(3):
            places[to, j] = vertices[a, j]
            places[to, 3 + j] = vertices[b, j] - vertices[a, j]
            places[to, 6 + j] = vertices[c, j] - vertices[a, j]
            ends[j, to] = vertices[b, j]
            ends[3 + j, to] = vertices[c, j]
        # in double precision: for edges beyond 4e9 the squared area overflows float32
        n = _cross_of_edges(places, to)
        area = np.sqrt(dot(n, n))
        scale = area if area > 0.0 else 1.0
        places[to, 9] = np.float32(n.x / scale)
        places[to, 10] = np.float32(n.y / scale)
        places[to, 11] = np.float32(n.z / scale)
        if given.shape[0] > 0:
            for j in range(3):
                normals[to, j] = given[a, j]
                normals[to, 3 + j] = given[b, j]
                normals[to, 6 + j] = given[c, j]
        elif normals.shape[0] > 1:
            _write_flat_normals(vertices, a, b, c, turn, normals, to)
        if given_uvs.shape[0] > 0:
            for j in range(2):
                uvs[to, j] = given_uvs[a, j]
                uvs[to, 2 + j] = given_uvs[b, j]
                uvs[to, 4 + j] = given_uvs[c, j]
        else:  # (0, 0), (1, 0), (0, 1)
            uvs[to, 2] = uvs[to, 5] = np.float32(1.0)


@kernel
def _in_double(rows, k, j):
    """Return three numbers of a column as a vector in double precision."""
    x, y, z = rows[k, j], rows[k, j + 1], rows[k, j + 2]
    return vec3(np.float64(x), np.float64(y), np.float64(z))


@kernel
def _cross_of_edges(places, k):
    return cross(_in_double(places, k, 3), _in_double(places, k, 6))


@kernel
def _write_flat_normals(vertices, a, b, c, turn, normals, to):
    """Write the face normal for each vertex, for a faceted mesh in a table with normals."""
    corner = _in_double(vertices, a, 0)
    n = cross(_in_double(vertices, b, 0) - corner, _in_double(vertices, c, 0) - corner)
    length = np.sqrt(dot(n, n))
    for j in range(0, 9, 3):
        normals[to, j] = np.float32(turn * (n.x / length))
        normals[to, j + 1] = np.float32(turn * (n.y / length))
        normals[to, j + 2] = np.float32(turn * (n.z / length))


# ---------------------------------------------------------------------- for accelerators


def fill_rows(s: TriangleSurfaces, columns: NDArray[np.int64], rows: Any) -> None:
    """Write the fields of `Triangle` into rows, see `fill` of `kind.ShapeKind`."""
    places = np.ascontiguousarray(s.places.T)
    in_parts(len(columns), _write_rows, np.asarray(columns), places, s.ends, rows)


@entry_kernel
def _write_rows(begin, end, columns, places, ends, rows):
    for k in range(begin, end):
        column = columns[k]
        for j in range(9):
            rows[j, k] = places[column, j]
        n = _cross_of_edges(places, column)
        x, y, z = np.float32(n.x), np.float32(n.y), np.float32(n.z)
        rows[9, k], rows[10, k], rows[11, k] = x, y, z
        for j in range(6):
            rows[12 + j, k] = ends[j, column]
        rows[18, k] = abs(x) + abs(y) + abs(z)
        size = _sum_of_absolutes(places, column, 3) + _sum_of_absolutes(places, column, 6)
        rows[19, k] = size
        rows[20, k] = size * (_sum_of_absolutes(places, column, 0) + size)


@kernel
def _sum_of_absolutes(places, column, j):
    return abs(places[column, j]) + abs(places[column, j + 1]) + abs(places[column, j + 2])


def boxes(s: TriangleSurfaces) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return lower and upper corners, see `extents.primitive_bounds`."""
    places = np.ascontiguousarray(s.places.T)
    lower, upper = np.empty((2, 3, len(places)), np.float32)
    in_parts(len(places), _write_boxes, places, lower, upper)
    return lower, upper


@entry_kernel
def _write_boxes(begin, end, places, lower, upper):
    for k in range(begin, end):
        largest = np.float32(0.0)
        for j in range(3):
            a = places[k, j]
            b, c = a + places[k, 3 + j], a + places[k, 6 + j]
            low, high = min(min(a, b), c), max(max(a, b), c)
            lower[j, k], upper[j, k] = low, high
            largest = max(largest, max(abs(low), abs(high)))
        # the sums above and the hit test round differently: pad by the largest rounding
        # error
        slack = ROUNDING * largest
        for j in range(3):
            lower[j, k] -= slack
            upper[j, k] += slack
