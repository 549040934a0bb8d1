"""Makes the `Mesh` record from local triangles: transform, normals, degenerate faces.

All mesh plugins (obj, ply, serialized, cube) use it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory
from renderer.process.worker_pool import default_threads, in_parts, in_threads
from renderer.scene_file import transforms
from renderer.scene_file.description import NOWHERE, Location, Mesh
from renderer.scene_file.meshes.mesh_data import MeshData, first_not_finite, show_numbers
from renderer.scene_file.meshes.mesh_passes import (
    add_at_corners,
    mark_flat,
    measure_corners,
    place_vertices,
    unit_sums,
)

# A triangle whose height is less than this fraction of its longest edge is degenerate. That
# is far below the rounding of float32 vertices: only exactly collinear ones are found.
_FLAT = 1e-12
# At the peak, measured, with float64 corners and angles for missing vertex normals.
_BYTES_A_FACE, _BYTES_A_VERTEX = 260, 110


def build_mesh(
    data: MeshData,
    *,
    to_world: NDArray[np.float64],
    face_normals: bool = False,
    flip_normals: bool = False,
    location: Location = NOWHERE,
    **common: Any,
) -> tuple[Mesh, tuple[str, ...]]:
    """Transform `data` to world space.

    A `to_world` with a reflection flips the geometric normals but not the normals of the
    file; only `flip_normals` flips both. Both are as in Mitsuba.

    Parameters
    ----------
    data
        Result of `read_obj`, `read_ply`, `read_serialized` or `cube_mesh`.
    to_world
        (4, 4), affine, acts on column vectors.
    face_normals
        Ignore vertex normals and compute none. Mitsuba's cube ignores this property: pass
        False there.
    flip_normals
        Flip the geometric and the vertex normals.
    location, **common
        Fields of all shapes (`Shape`), copied to the record.

    Returns
    -------
    Mesh
        Without degenerate triangles. If all are, the mesh is invisible, as in Mitsuba.
        `face_ids` is None if there were none.
    warnings
        One line each, for the log.

    Raises
    ------
    SceneError
        If the transform is singular or sends a vertex to infinity, or if no triangle is
        left of a mesh that emits light.
    """
    size = _BYTES_A_FACE * len(data.faces) + _BYTES_A_VERTEX * len(data.vertices)
    memory.require(size, f"{location}: the {len(data.faces)} triangles of {data.source}")
    linear = np.asarray(to_world, dtype=np.float64)[:3, :3]
    offset = np.asarray(to_world, dtype=np.float64)[:3, 3]
    finite = np.isfinite(linear).all() and np.isfinite(offset).all()
    if not finite or np.linalg.det(linear) == 0.0:
        raise SceneError(f"{location}: to_world is singular, it has no inverse")

    vertices = _placed(data, linear, offset, location)
    keep = ~_degenerate(vertices, data.faces)
    faces = data.faces if keep.all() else data.faces[keep]
    warnings = list(data.warnings)
    dropped = len(keep) - len(faces)
    if dropped:
        warnings.append(
            f"{data.source}: dropped {dropped} degenerate of {len(keep)} triangles"
        )
    if len(faces) == 0 and common.get("radiance") is not None:
        raise SceneError(
            f"{location}: all {dropped} triangles of {data.source} are degenerate "
            "(no area); at least one must be left to emit light"
        )

    normals = None if face_normals else _vertex_normals(data, linear, vertices, faces)
    if normals is not None and flip_normals:
        normals = -normals
    with np.errstate(over="ignore", invalid="ignore"):  # checked where values are used
        attributes = {
            name: (of[keep] if name.startswith("face_") else of).astype(np.float32)
            for name, of in data.attributes.items()
        }
    mesh = Mesh(
        **common,
        location=location,
        vertices=vertices,
        faces=np.ascontiguousarray(faces, dtype=np.int32),
        normals=None if normals is None else normals.astype(np.float32),
        uvs=None if data.uvs is None else data.uvs.astype(np.float32),
        face_ids=np.flatnonzero(keep).astype(np.int32) if dropped else None,
        flip_normals=flip_normals,
        attributes=attributes,
    )
    return mesh, tuple(warnings)


def _placed(
    data: MeshData,
    linear: NDArray[np.float64],
    offset: NDArray[np.float64],
    location: Location,
) -> NDArray[np.float32]:
    """Return the vertices in world space, rounded as in Mitsuba if that is accurate."""
    vertices = np.empty(data.vertices.shape, np.float32)
    points = np.ascontiguousarray(data.vertices)
    matrix = np.column_stack((linear, offset))
    found = in_parts(len(points), place_vertices, points, matrix, vertices)
    largest, error = np.reshape(found, (-1, 2)).max(axis=0, initial=0.0)
    # far from the origin single precision would lose digits that cancel in the transform
    if error <= 16 * 2.0**-24 * largest and largest <= np.finfo(np.float32).max:
        return vertices
    with np.errstate(over="ignore", invalid="ignore"):
        placed = data.vertices @ linear.T + offset
    bad = first_not_finite(placed)
    if bad >= 0:
        raise SceneError(
            f"{location}: vertex {bad} of {data.source} becomes "
            f"{show_numbers(placed[bad])} under to_world; a finite point is needed"
        )
    return placed.astype(np.float32)


def _degenerate(
    vertices: NDArray[np.float32], faces: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Return the mask (F,) of triangles without area: equal or collinear corners."""
    flat = np.empty(len(faces), np.bool_)
    # A triangle with a smaller area has a normal that float32 kernels cannot normalise.
    settings = _FLAT, np.finfo(np.float32).tiny
    in_parts(len(faces), mark_flat, vertices, faces, *settings, flat)
    return flat


def _vertex_normals(
    data: MeshData,
    linear: NDArray[np.float64],
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
) -> NDArray[np.float64]:
    """Return unit vertex normals (V, 3): those of the file, or computed ones."""
    if (given := data.normals) is None:
        return smooth_normals(vertices, faces)
    # Normals are transformed by the inverse transpose (rows, so from the right). Only
    # directions matter, and the scaling keeps extreme transforms from overflowing.
    inverse = np.linalg.inv(linear / np.abs(linear).max())

    def turned(begin: int, end: int) -> NDArray[np.float64]:
        rows = given[begin:end]
        return _as_mitsuba_rounds(_unit(_unit(rows) @ inverse), linear, rows)

    normals = np.concatenate(in_parts(len(given), turned) or [given])
    missing = np.isnan(normals[:, 0])
    if missing.any():
        normals[missing] = smooth_normals(vertices, faces)[missing]
    return normals


def _as_mitsuba_rounds(
    exact: NDArray[np.float64], linear: NDArray[np.float64], given: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return unit normals with Mitsuba's rounding, where they differ by rounding only.

    A path with a hundred bounces inside of a ring amplifies the last bit.
    """
    rounded = transforms.place_normals(linear, given)
    close = np.abs(rounded - exact).max(axis=1, keepdims=True) <= 16 * 2.0**-24
    return np.where(close, rounded, exact)  # NaN is never close: `exact` is kept


def _unit(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows of length 1; NaN rows stay NaN. No row may be zero."""
    rows = rows / np.abs(rows).max(axis=1, keepdims=True)  # so that squares do not overflow
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def smooth_normals(
    vertices: NDArray[np.float32], faces: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Average the face normals around each vertex, weighted by the angle there.

    The rule that Mitsuba uses where a file has no normals (Thuermer and Wuethrich 1998).

    Parameters
    ----------
    vertices
        (V, 3), world space.
    faces
        (F, 3), none degenerate.

    Returns
    -------
    normals
        (V, 3) unit; (1, 0, 0) at a vertex that no face uses, as in Mitsuba.
    """
    face_normals, angles = np.empty((2, len(faces), 3))

    def measure(begin: int, end: int) -> None:
        along, part = np.empty((end - begin, 3)), angles[begin:end]
        measure_corners(begin, end, vertices, faces, face_normals, angles, along)
        np.arctan2(np.sqrt(part), np.sqrt(along), out=part)

    in_parts(len(faces), measure)
    sums = np.zeros((3, len(vertices), 3))  # one for each corner: each has its own thread

    def add(corner: int) -> None:
        add_at_corners(corner, faces, face_normals, angles, sums[corner])

    in_threads(default_threads(), 3, add)
    normals = np.empty((len(vertices), 3))
    in_parts(len(vertices), unit_sums, *sums, normals)
    return normals


# --------------------------------------------------------------------------------- cube
# The `cube` plugin: [-1, 1]^3 as a mesh of 24 vertices and 12 triangles.

# The four corners of each side in the order of Mitsuba's cube, so that primitive indices
# and uv agree: two triangles (0, 1, 2) and (3, 0, 2) per side, uv (0,1) (1,1) (1,0) (0,0).
_SIDES = (
    ((0, -1, 0), ((1, -1, -1), (1, -1, 1), (-1, -1, 1), (-1, -1, -1))),
    ((0, 1, 0), ((1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1))),
    ((1, 0, 0), ((1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1))),
    ((0, 0, 1), ((1, -1, 1), (1, 1, 1), (-1, 1, 1), (-1, -1, 1))),
    ((-1, 0, 0), ((-1, -1, 1), (-1, 1, 1), (-1, 1, -1), (-1, -1, -1))),
    ((0, 0, -1), ((1, 1, -1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1))),
)
_UV = ((0, 1), (1, 1), (1, 0), (0, 0))
_TRIANGLES = ((0, 1, 2), (3, 0, 2))


def cube_mesh() -> MeshData:
    """Return the cube of edge 2 around the origin, normals outward.

    Its corners have one normal per side, so `face_normals` has no effect (Mitsuba ignores
    it here): call `build_mesh` with False.
    """
    first_corners = 4 * np.arange(6, dtype=np.int32)[:, None, None]
    return MeshData(
        vertices=np.array([p for _, side in _SIDES for p in side], dtype=np.float64),
        faces=(np.array(_TRIANGLES, dtype=np.int32) + first_corners).reshape(12, 3),
        normals=np.repeat(np.array([n for n, _ in _SIDES], dtype=np.float64), 4, axis=0),
        uvs=np.tile(np.array(_UV, dtype=np.float64), (6, 1)),
        source="cube",
    )
