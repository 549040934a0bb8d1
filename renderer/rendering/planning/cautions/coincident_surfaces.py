"""Flat surfaces of different material in one plane, where rounding decides what is seen."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.planning.cautions.caution import Caution, listed, name_of
from renderer.rendering.planning.cautions.closed_meshes import is_closed
from renderer.rendering.planning.cautions.overlap import overlap
from renderer.scene.materials import kind_of, sides
from renderer.scene.scene import Scene
from renderer.scene_file.description import Disk, Mesh, Rectangle, Shape

if TYPE_CHECKING:
    from renderer.rendering.planning.plan import Plan

Floats = NDArray[np.float64]

GAP = 1e-7  # of the coordinates and of the distance from the camera
ALIKE = 2e-5  # normals are taken together within this
MOST_FACES = 400_000  # in all; more are not looked at
MOST_IN_A_PLANE = 2000
LEAST_SHARE = 1e-3  # of the smaller triangle, that the overlap must have
_TURNS = 2.0 * np.pi * np.arange(24) / 24
_POLYGON = np.stack([np.cos(_TURNS), np.sin(_TURNS), 0 * _TURNS, 0 * _TURNS + 1], axis=1)
_SQUARE = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]], float)


def coincident_surfaces(scene: Scene, plan: Plan) -> Iterator[Caution]:
    """Find rectangles, disks and faces of meshes that lie on one another.

    Where an opaque closed mesh stands on something, the place where they touch is not
    seen from its side, so that nothing is said if the camera is on that side.
    """
    shapes = scene.description.shapes
    triangles, owner = _triangles(shapes)
    looks = _looks(shapes)
    if not 0 < len(triangles) <= MOST_FACES or looks.max(initial=0) == 0:
        return
    eye = scene.description.camera.to_world[:3, 3]
    pairs: set[tuple[int, int]] = set()
    for members in _planes(triangles, owner, looks, eye):
        pairs |= _overlapping(triangles, owner, looks, members, eye)
    seen = sorted(
        pair for pair in pairs if not _hidden(shapes, triangles, owner, pair, eye)
    )
    if seen:
        named = [f"{name_of(shapes[a])} on {name_of(shapes[b])}" for a, b in seen]
        yield Caution(
            f"pairs of surfaces of different material in one plane: {len(seen)} "
            f"({listed(named)}); rounding decides which of the two is seen",
            "coincident-surfaces",
        )


def _triangles(shapes: tuple[Shape, ...]) -> tuple[Floats, NDArray[np.int64]]:
    """Return the corners (n, 3, 3) of all that is flat, and whose they are (n,)."""
    corners, owner = [np.zeros((0, 3, 3))], [np.zeros(0, np.int64)]
    for index, shape in enumerate(shapes):
        if isinstance(shape, Rectangle):
            placed = (_SQUARE @ shape.to_world.T)[:, :3]
            faces = placed[[[0, 1, 2], [0, 2, 3]]]
        elif isinstance(shape, Disk):
            placed = (_POLYGON @ shape.to_world.T)[:, :3]
            faces = placed[[[0, k, k + 1] for k in range(1, len(placed) - 1)]]
        elif isinstance(shape, Mesh):
            faces = shape.vertices.astype(np.float64)[shape.faces]
        else:
            continue
        corners.append(faces)
        owner.append(np.full(len(faces), index))
    return np.concatenate(corners), np.concatenate(owner)


def _looks(shapes: tuple[Shape, ...]) -> NDArray[np.int64]:
    """Return a number for each shape, equal where material and light are."""
    known: dict[Any, int] = {}
    return np.array(
        [
            known.setdefault(_values((shape.bsdf, shape.radiance)), len(known))
            for shape in shapes
        ],
        np.int64,
    )


def _values(look: Any) -> Any:
    """Return something equal for equal descriptions; textures count by identity."""
    if dataclasses.is_dataclass(look):
        return type(look), _values(vars(look))
    if isinstance(look, Mapping):
        return tuple((name, _values(value)) for name, value in look.items())
    if isinstance(look, tuple):
        return tuple(_values(value) for value in look)
    return id(look) if isinstance(look, np.ndarray) else look


def _planes(
    triangles: Floats, owner: NDArray[np.int64], looks: NDArray[np.int64], eye: Floats
) -> Iterator[NDArray[np.int64]]:
    """Yield the triangles of each plane in which there are different materials."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    # either side is the same plane; no usual angle has this as a cosine
    leading = np.argmax(np.abs(normals) > 0.3713, axis=1)
    normals *= np.sign(np.take_along_axis(normals, leading[:, None], axis=1))
    offset = np.einsum("ij,ij->i", normals, triangles[:, 0])
    keys = np.round(normals / ALIKE).astype(np.int64)
    order = np.lexsort((offset, *keys.T))
    tolerance = _tolerance(triangles, eye)
    step = np.diff(offset[order]) > tolerance[order[1:]]
    step |= np.any(np.diff(keys[order], axis=0) != 0, axis=1)
    for members in np.split(order, np.flatnonzero(step) + 1):
        if 1 < len(members) <= MOST_IN_A_PLANE and np.ptp(looks[owner[members]]) > 0:
            yield members


def _tolerance(triangles: Floats, eye: Floats) -> Floats:
    middle = triangles.mean(axis=1)
    far = np.abs(middle).max(axis=1) + np.linalg.norm(middle - eye, axis=1)
    return np.asarray(GAP * far)


def _overlapping(
    triangles: Floats,
    owner: NDArray[np.int64],
    looks: NDArray[np.int64],
    members: NDArray[np.int64],
    eye: Floats,
) -> set[tuple[int, int]]:
    """Return the pairs of shapes that share some area of a plane."""
    corners, shape = triangles[members], owner[members]
    low, high = corners.min(axis=1), corners.max(axis=1)
    tolerance = _tolerance(corners, eye)
    found: set[tuple[int, int]] = set()
    for i in range(len(members) - 1):
        rest = slice(i + 1, None)
        near = looks[shape[rest]] != looks[shape[i]]
        near &= np.all(low[rest] <= high[i] + tolerance[i], axis=1)
        near &= np.all(high[rest] >= low[i] - tolerance[i], axis=1)
        for j in np.flatnonzero(near) + i + 1:
            pair = (int(min(shape[i], shape[j])), int(max(shape[i], shape[j])))
            if pair in found or not _in_one_plane(corners[i], corners[j], tolerance[i]):
                continue
            if overlap(corners[i], corners[j]) > LEAST_SHARE:
                found.add(pair)
    return found


def _in_one_plane(a: Floats, b: Floats, tolerance: float) -> bool:
    """Return whether all corners of either are in the plane of the other."""
    return all(
        float(np.abs((second - first[0]) @ _unit_normal(first)).max()) <= tolerance
        for first, second in ((a, b), (b, a))
    )


def _unit_normal(triangle: Floats) -> Floats:
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    return np.asarray(normal / np.linalg.norm(normal))


def _hidden(
    shapes: tuple[Shape, ...],
    triangles: Floats,
    owner: NDArray[np.int64],
    pair: tuple[int, int],
    eye: Floats,
) -> bool:
    """Return whether closed opaque meshes hide the place from the camera."""
    bodies = [k for k in pair if _is_opaque_body(shapes[k])]
    if len(bodies) != 1:
        return len(bodies) == 2
    body = triangles[owner == bodies[0]]
    other = triangles[owner == sum(pair) - bodies[0]]
    normal = _unit_normal(other[0])
    inside = float((body.mean(axis=(0, 1)) - other[0, 0]) @ normal)
    return inside * float((eye - other[0, 0]) @ normal) > 0.0


def _is_opaque_body(shape: Shape) -> bool:
    seen = [side for side in sides(shape.bsdf) if side is not None]
    passes = any(kind_of(side).transmits for side in seen)
    return isinstance(shape, Mesh) and not passes and is_closed(shape)
