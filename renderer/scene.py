"""Scene: a SceneDescription as flat arrays, one group for each kind of primitive.

Primitive ids run through the kinds (triangles, rectangles, disks, spheres, cylinders), in
the order of the file within each; ids and shape ids are all that later stages see.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kernel_scene import (
    ANY,
    EMIT,
    CylinderSurfaces,
    DiskSurfaces,
    RectangleSurfaces,
    Shapes,
    SphereSurfaces,
    TriangleSurfaces,
)
from renderer.materials import MaterialTables, shape_stages
from renderer.scene_file.description import (
    Cylinder,
    Disk,
    Mesh,
    Rectangle,
    SceneDescription,
    Shape,
    Sphere,
)

_FARTHEST = 1e18  # largest coordinate: squares of distances still fit float32
KINDS = ("triangles", "rectangles", "disks", "spheres", "cylinders")


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything about a scene that does not depend on how it is rendered."""

    description: SceneDescription
    surfaces: dict[str, Any]  # kind -> record of renderer.kernel_scene, present kinds only
    shape: NDArray[np.int32]  # (primitives,) shape id
    face: NDArray[np.int32]  # (primitives,) index within the file's mesh
    stages: NDArray[np.int32]  # (primitives,) bits of renderer.kernel_scene
    shapes: Shapes
    materials: MaterialTables

    @property
    def primitive_count(self) -> int:
        """Number of triangles and analytic shapes."""
        return int(self.shape.size)

    @functools.cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the world, (2, 3); empty scenes give a point at 0."""
        boxes = [
            primitive_bounds(kind, surfaces) for kind, surfaces in self.surfaces.items()
        ]
        if not boxes:
            return np.zeros((2, 3))
        lower = np.min([low.min(axis=1) for low, _ in boxes], axis=0)
        upper = np.max([high.max(axis=1) for _, high in boxes], axis=0)
        return np.array([lower, upper], dtype=np.float64)


def _float32(rows: Any) -> NDArray[np.float32]:
    return np.ascontiguousarray(rows, dtype=np.float32)


def unit_normals(edge1: Any, edge2: Any) -> NDArray[np.float32]:
    """Return edge1 x edge2 / |edge1 x edge2|, all (3, n).

    In double precision: the square of an area leaves float32 for edges beyond 4e9. What
    has no area has the normal 0; no ray hits it.
    """
    n = np.cross(np.asarray(edge1, np.float64).T, np.asarray(edge2, np.float64).T)
    area = np.linalg.norm(n, axis=1, keepdims=True)
    return _float32((n / np.where(area > 0.0, area, 1.0)).T)


def _triangles(meshes: list[Mesh], first: int, with_uv: bool) -> TriangleSurfaces:
    """Concatenate meshes; normals are kept if any mesh has them, uvs if they are used."""
    corners, edges1, edges2, normals, uvs = [], [], [], [], []
    smooth = any(mesh.normals is not None for mesh in meshes)
    for mesh in meshes:
        p = mesh.vertices[mesh.faces].astype(np.float32)  # (F, 3 vertices, 3)
        corners.append(p[:, 0].T)
        edges1.append((p[:, 1] - p[:, 0]).T)
        edges2.append((p[:, 2] - p[:, 0]).T)
        if smooth:
            normals.append(_vertex_normals(mesh, p))
        if with_uv:
            corner_uvs = (
                np.broadcast_to(np.array([[0, 0], [1, 0], [0, 1]]), (len(p), 3, 2))
                if mesh.uvs is None
                else mesh.uvs[mesh.faces]
            )
            uvs.append(corner_uvs.reshape(len(p), 6).T)
    count = sum(mesh.faces.shape[0] for mesh in meshes)
    edge1, edge2 = np.concatenate(edges1, axis=1), np.concatenate(edges2, axis=1)
    return TriangleSurfaces(
        first,
        first + count,
        _float32(np.concatenate(corners, axis=1)),
        _float32(edge1),
        _float32(edge2),
        unit_normals(edge1, edge2),
        _float32(np.concatenate(normals, axis=1)) if smooth else None,
        _float32(np.concatenate(uvs, axis=1)) if with_uv else None,
    )


def _vertex_normals(mesh: Mesh, p: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return (9, F) vertex normals; a faceted mesh beside a smooth one repeats its own."""
    if mesh.normals is not None:
        return mesh.normals[mesh.faces].reshape(len(p), 9).T.astype(np.float64)
    q = p.astype(np.float64)
    n = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return np.tile(-n if mesh.flip_normals else n, 3).T


def _flat(shapes: list[Any], first: int, record: Any) -> Any:
    """Return rectangles or disks as corner and edges; a disk's corner is its centre."""
    is_rectangle = record is RectangleSurfaces
    matrices = np.array([shape.to_world for shape in shapes])
    x, y, center = matrices[:, :3, 0], matrices[:, :3, 1], matrices[:, :3, 3]
    corner, edge1, edge2 = (
        (center - x - y, 2 * x, 2 * y) if is_rectangle else (center, x, y)
    )
    return record(
        first,
        first + len(shapes),
        _float32(corner.T),
        _float32(edge1.T),
        _float32(edge2.T),
        unit_normals(edge1.T, edge2.T),
    )


def _spheres(shapes: list[Sphere], first: int) -> SphereSurfaces:
    matrices = np.array([shape.to_world for shape in shapes])
    scale = np.linalg.norm(matrices[:, :3, 0], axis=1)
    frame = matrices[:, :3, :3] / scale[:, None, None]  # columns are the local axes
    return SphereSurfaces(
        first,
        first + len(shapes),
        _float32(matrices[:, :3, 3].T),
        _float32(scale),
        _float32(frame.transpose(0, 2, 1).reshape(-1, 9).T),
    )


def _cylinders(shapes: list[Cylinder], first: int) -> CylinderSurfaces:
    matrices = np.array([shape.to_world for shape in shapes])
    lengths = np.linalg.norm(matrices[:, :3, :3], axis=1)  # of the three columns
    frame = matrices[:, :3, :3] / lengths[:, None, :]
    return CylinderSurfaces(
        first,
        first + len(shapes),
        _float32(matrices[:, :3, 3].T),
        _float32(lengths[:, 0]),
        _float32(lengths[:, 2]),
        _float32(frame.transpose(0, 2, 1).reshape(-1, 9).T),
    )


def _orientation(shape: Shape) -> float:
    """Return -1 where the shape's normal is opposite to the one the kernels compute.

    The normal of a flat shape is the transformed +z, which is not edge1 x edge2 when the
    transform mirrors; that of curved ones points away from the centre or axis.
    """
    if isinstance(shape, Mesh | Sphere | Cylinder):
        return -1.0 if shape.flip_normals else 1.0
    if isinstance(shape, Rectangle | Disk):
        mirrored = np.linalg.det(shape.to_world[:3, :3]) < 0
        return -1.0 if mirrored != shape.flip_normals else 1.0
    raise AssertionError(f"unknown shape {type(shape).__name__}")


def primitive_bounds(kind: str, s: Any) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return lower and upper corners, (3, n) each, of a kind's primitives."""
    if kind == "triangles":
        points = [s.corner, s.corner + s.edge1, s.corner + s.edge2]
    elif kind == "rectangles":
        points = [s.corner, s.corner + s.edge1, s.corner + s.edge2]
        points.append(s.corner + s.edge1 + s.edge2)
    elif kind == "disks":
        reach = np.hypot(s.edge1, s.edge2)
        points = [s.corner - reach, s.corner + reach]
    elif kind == "spheres":
        points = [s.center - s.radius, s.center + s.radius]
    else:
        axis = s.frame[6:9]
        x, y, z = axis  # not sqrt(1 - axis^2), which is 0 for a slightly tilted axis
        reach = s.radius * np.hypot([y, z, x], [z, x, y])
        top = s.base + axis * s.height
        points = [s.base - reach, s.base + reach, top - reach, top + reach]
    lower = np.minimum.reduce(points)
    upper = np.maximum.reduce(points)
    # the sums above are rounded, and the hit test rounds in another way: pad by that
    slack = np.float32(32 * 2.0**-24) * np.maximum(np.abs(lower), np.abs(upper)).max(axis=0)
    return _float32(lower - slack), _float32(upper + slack)


def build_scene(description: SceneDescription) -> Scene:
    """Turn a description into flat arrays.

    Raises
    ------
    SceneError
        If a coordinate is too large for single precision.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return _build_scene(description)


def _build_scene(description: SceneDescription) -> Scene:
    members: dict[str, list[tuple[int, Any]]] = {kind: [] for kind in KINDS}
    kind_of = {
        Mesh: "triangles",
        Rectangle: "rectangles",
        Disk: "disks",
        Sphere: "spheres",
        Cylinder: "cylinders",
    }
    for index, shape in enumerate(description.shapes):
        members[kind_of[type(shape)]].append((index, shape))

    materials = MaterialTables.of(description)
    surfaces: dict[str, Any] = {}
    shape_ids, faces = [], []
    first = 0
    for kind, entries in members.items():
        if not entries:
            continue
        shapes = [shape for _, shape in entries]
        if kind == "triangles":
            record = _triangles(shapes, first, with_uv=True)
        elif kind == "rectangles":
            record = _flat(shapes, first, RectangleSurfaces)
        elif kind == "disks":
            record = _flat(shapes, first, DiskSurfaces)
        elif kind == "spheres":
            record = _spheres(shapes, first)
        else:
            record = _cylinders(shapes, first)
        surfaces[kind] = record
        for index, shape in entries:
            if isinstance(shape, Mesh):
                count = len(shape.faces)
                faces.append(np.arange(count) if shape.face_ids is None else shape.face_ids)
            else:
                count = 1
                faces.append(np.zeros(1))
            shape_ids.append(np.full(count, index))
        first = record.end
        finite = all(f is None or np.isfinite(f).all() for f in record[2:])
        if not (finite and np.abs(primitive_bounds(kind, record)).max() < _FARTHEST):
            raise SceneError(
                f"{description.source}: {kind} reach farther than {_FARTHEST:g}, where "
                "single precision cannot square distances any more; scale the scene down"
            )

    shape = np.concatenate([*shape_ids, np.zeros(0)]).astype(np.int32)
    stages = np.array([shape_stages(s) for s in description.shapes] or [0], np.int32)
    orientation = [_orientation(s) for s in description.shapes] or [1.0]
    return Scene(
        description,
        surfaces,
        shape,
        np.concatenate([*faces, np.zeros(0)]).astype(np.int32),
        (stages[shape] | ANY).astype(np.int32),
        Shapes(
            materials.front,
            materials.back,
            materials.light,
            _float32(orientation),
        ),
        materials,
    )


def emits(scene: Scene, kind: str) -> bool:
    """Return whether a primitive of a kind is an area light."""
    surfaces = scene.surfaces.get(kind)
    if surfaces is None:
        return False
    return bool((scene.stages[surfaces.first : surfaces.end] & EMIT).any())
