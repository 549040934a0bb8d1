"""Coincident surfaces, where rounding decides which one a ray hits."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.advice.cautions import Faces, Floats, flat_faces, listed, name_of
from renderer.advice.closed_shapes import encloses, outward
from renderer.rendering.planning.plan import Plan
from renderer.scene.materials import is_textured, kind_of, sides
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    Blend,
    Disk,
    Location,
    Mask,
    Mesh,
    OrthographicCamera,
    Sensor,
    Shape,
    TwoSided,
)

# ----------------------------------------------------------------------- appearance key
# Whether two shapes look the same wherever they coincide.

Digests = dict[int, bytes]  # digest of an array by its id(), while the scene exists


class Look(NamedTuple):
    """The appearance of a shape, as far as it can be compared.

    The flags tell where equal `values` may still look different. The anisotropic direction
    of materials is ignored.
    """

    values: Any  # of material and light; hashable
    one_sided: bool  # the back looks different
    textured: bool  # the appearance varies over the surface


def look_of(shape: Shape, digests: Digests) -> Look:
    """Return the appearance of a shape; `digests` caches those of shared images."""
    given = (shape.bsdf, shape.radiance)
    textured = any(is_textured(part) for part in _parts(given))
    values = values_of(given, digests)
    if textured:  # the uv of a disk are like those of no other shape
        attributes = shape.attributes if isinstance(shape, Mesh) else {}
        values = values, isinstance(shape, Disk), values_of(attributes, digests)
    return Look(values, shape.radiance is not None or _one_sided(shape.bsdf), textured)


def values_of(look: Any, digests: Digests) -> Any:
    """Return a hashable value, equal for equal descriptions; arrays compare by content."""
    if isinstance(look, Location):
        return None
    if isinstance(look, np.ndarray):
        if id(look) not in digests:
            digests[id(look)] = hashlib.sha256(look.tobytes()).digest()
        return look.shape, look.dtype.str, digests[id(look)]
    if isinstance(look, tuple | list):
        return type(look), tuple(values_of(value, digests) for value in look)
    if (inside := _fields(look)) is not None:
        values = ((name, values_of(value, digests)) for name, value in inside.items())
        return type(look), tuple(values)
    try:
        hash(look)
    except TypeError:  # an object of a user's plugin
        return id(look)
    return look


def _fields(look: Any) -> Mapping[Any, Any] | None:
    if dataclasses.is_dataclass(look):
        return {f.name: getattr(look, f.name) for f in dataclasses.fields(look)}
    return look if isinstance(look, Mapping) else None


def _parts(look: Any) -> Iterator[Any]:
    """Yield a description and all nested ones."""
    yield look
    inside = _fields(look)
    for value in inside.values() if inside is not None else ():
        yield from _parts(value)
    if isinstance(look, tuple | list):
        for value in look:
            yield from _parts(value)


def _one_sided(bsdf: Any) -> bool:
    """Return whether the back of a BSDF is known to look different.

    False for BSDFs that transmit.
    """
    if isinstance(bsdf, TwoSided):
        if bsdf.front is bsdf.back:
            return False
        digests: Digests = {}
        return bool(values_of(bsdf.front, digests) != values_of(bsdf.back, digests))
    if isinstance(bsdf, Mask):
        return _one_sided(bsdf.nested)
    if isinstance(bsdf, Blend):
        return _one_sided(bsdf.first) or _one_sided(bsdf.second)
    kind = kind_of(bsdf)
    return not kind.both_sides


# ------------------------------------------------------------------------------ overlap
# Overlap of triangles in one plane [Sutherland1974].

Ints = NDArray[np.int64]


def overlapping_boxes(corners: Floats, tolerance: Floats) -> tuple[Ints, Ints, Floats]:
    """Return pairs of triangles (n, 3, 2) with overlapping boxes, and the shared areas.

    Uses a sweep along the first axis. Boxes that share only an edge do not overlap, within
    the tolerance (n,) of their coordinates.
    """
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(low[:, 0])
    low, high = low[order], high[order]
    end = np.searchsorted(low[:, 0], high[:, 0] - tolerance[order])
    count = np.maximum(end - np.arange(len(end)) - 1, 0)
    i = np.repeat(np.arange(len(count)), count)
    j = i + 1 + np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)
    shared = np.minimum(high[i], high[j]) - np.maximum(low[i], low[j])
    kept = np.all(shared > tolerance[order[i], None], axis=1)
    return order[i[kept]], order[j[kept]], np.prod(shared[kept], axis=1)


def overlap(a: Floats, b: Floats) -> float:
    """Return the shared area of two triangles, relative to the area of the smaller one.

    Parameters
    ----------
    a, b : ndarray of shape (3, 3)
        Corners, in one plane; they are projected along the main axis of its normal.
    """
    normal = np.cross(a[1] - a[0], a[2] - a[0])
    axes = [k for k in range(3) if k != int(np.argmax(np.abs(normal)))]
    first, second = ([tuple(p) for p in t[:, axes].tolist()] for t in (a, b))
    smaller = min(abs(_area(first)), abs(_area(second)))
    if smaller == 0.0:
        return 0.0
    turn = 1.0 if _area(second) > 0.0 else -1.0
    part = first
    for k in range(3):
        part = _clipped(part, second[k], second[(k + 1) % 3], turn)
    return abs(_area(part)) / smaller


Point = tuple[float, ...]


def _clipped(polygon: list[Point], p: Point, q: Point, turn: float) -> list[Point]:
    """Return the part of a convex polygon on the inner side of the line through p, q."""

    def side(x: Point) -> float:
        return turn * ((q[0] - p[0]) * (x[1] - p[1]) - (q[1] - p[1]) * (x[0] - p[0]))

    kept: list[Point] = []
    for k, end in enumerate(polygon):
        start = polygon[k - 1]
        from_side, to_side = side(start), side(end)
        if from_side * to_side < 0.0:
            t = from_side / (from_side - to_side)
            kept.append(tuple(s + t * (e - s) for s, e in zip(start, end, strict=True)))
        if to_side >= 0.0:
            kept.append(end)
    return kept


def _area(polygon: list[Point]) -> float:
    """Return the signed area."""
    pairs = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return 0.5 * sum(p[0] * q[1] - q[0] * p[1] for p, q in pairs)


# ------------------------------------------------------------------ coincident surfaces
# Flat surfaces of different material in one plane: rounding decides which one is visible.


GAP = 1e-7  # tolerance relative to coordinates and to the distance from the camera
ALIKE = 2e-5  # normals that differ by less are in one group
MOST_FACES = 400_000  # scenes with more faces are not tested
MOST_IN_A_PLANE = 2000  # planes with more faces are not tested
MOST_TRIED = 64  # pairs of faces per two shapes in one plane
MOST_TRIED_IN_ALL = 5_000  # these take 0.4 s
LEAST_SHARE = 1e-3  # minimum overlap, relative to the smaller triangle
LEAST_APART = 1e-3  # minimum difference of uv


def coincident_surfaces(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find rectangles, disks and faces of meshes that coincide.

    Where an opaque closed mesh stands on a surface, the contact area is not visible from
    the side of the mesh: no caution if the camera is on that side and outside of the mesh.
    Curved surfaces, instances, and faces of the same mesh are not tested. The constants
    above limit the number of tests.
    """
    shows_material = "albedo" in (kind for _, kind in scene.description.integrator.aovs)
    if not plan.kind.sees_lights and not shows_material:
        return
    shapes = scene.description.shapes
    faces = flat_faces(shapes)
    if not 0 < len(faces.owner) <= MOST_FACES or np.ptp(faces.owner) == 0:
        return
    seen = sorted(_Touching(shapes, faces, scene.description.camera).pairs())
    if seen:
        named = [f"{name_of(shapes[a])} on {name_of(shapes[b])}" for a, b in seen]
        yield (
            f"pairs of surfaces of different look in one plane: {len(seen)} "
            f"({listed(named)}); rounding decides which of the two is seen"
        )


class _Touching:
    """Finds the pairs of shapes with a shared area that may be visible."""

    def __init__(self, shapes: tuple[Shape, ...], faces: Faces, camera: Sensor) -> None:
        self.shapes, self.faces = shapes, faces
        self.eye = eye = camera.to_world[:3, 3]
        parallel = isinstance(camera, OrthographicCamera)
        self.back: Floats | None = -camera.to_world[:3, 2] if parallel else None
        digests: Digests = {}
        looks = [look_of(shape, digests) for shape in shapes]
        known: dict[object, int] = {}
        self.look = np.array([known.setdefault(v.values, len(known)) for v in looks])
        self.one_sided = np.array([v.one_sided for v in looks])
        self.textured = np.array([v.textured for v in looks])
        middle = faces.corners.mean(axis=1)
        far = np.abs(middle).max(axis=1) + np.linalg.norm(middle - eye, axis=1)
        self.tolerance: Floats = GAP * far
        self.bodies: dict[int, _Body] = {}
        self.tried = 0

    def pairs(self) -> set[tuple[int, int]]:
        """Return the pairs, smaller index first."""
        found: set[tuple[int, int]] = set()
        for members in self._planes():
            for i, j in self._candidates(members):
                first, second = sorted((int(self.faces.owner[i]), int(self.faces.owner[j])))
                if (first, second) not in found and self._is_seen(i, j):
                    found.add((first, second))
        return found

    def _planes(self) -> Iterator[Ints]:
        """Yield the faces of each plane that contains several shapes."""
        faces = self.faces
        # opposite normals are the same plane; 0.3713 is the cosine of no common angle
        leading = np.argmax(np.abs(faces.normal) > 0.3713, axis=1)
        signs = np.sign(np.take_along_axis(faces.normal, leading[:, None], axis=1))
        normals = faces.normal * signs
        offset = np.einsum("ij,ij->i", normals, faces.corners[:, 0])
        keys = np.round(normals / ALIKE).astype(np.int64)
        order = np.lexsort((offset, *keys.T))
        step = np.diff(offset[order]) > self.tolerance[order[1:]]
        step |= np.any(np.diff(keys[order], axis=0) != 0, axis=1)
        for members in np.split(order, np.flatnonzero(step) + 1):
            if len(members) <= MOST_IN_A_PLANE and np.ptp(faces.owner[members]) > 0:
                yield members

    def _candidates(self, members: Ints) -> Iterator[tuple[int, int]]:
        """Yield pairs of faces to test, the largest of each two shapes first."""
        axes = np.argsort(np.abs(self.faces.normal[members[0]]))[:2]
        corners = self.faces.corners[members][:, :, axes]
        i, j, area = overlapping_boxes(corners, self.tolerance[members])
        i, j = members[i], members[j]
        shape_i, shape_j = self.faces.owner[i], self.faces.owner[j]
        same = self.look[shape_i] == self.look[shape_j]
        alike = same & ~self.textured[shape_i]
        opposed = np.einsum("ij,ij->i", self.faces.normal[i], self.faces.normal[j]) < 0.0
        alike &= ~(self.one_sided[shape_i] & opposed)
        worth = np.flatnonzero((shape_i != shape_j) & ~alike)
        low, high = np.minimum(shape_i, shape_j)[worth], np.maximum(shape_i, shape_j)[worth]
        pair = low * len(self.shapes) + high
        order = np.lexsort((-area[worth], pair))
        starts = np.flatnonzero(np.diff(pair[order], prepend=-1))
        rank = np.arange(len(order)) - np.repeat(starts, np.diff([*starts, len(order)]))
        for k in worth[order[rank < MOST_TRIED]]:
            yield int(i[k]), int(j[k])

    def _is_seen(self, i: int, j: int) -> bool:
        """Return whether two faces coincide, look different and may be visible."""
        self.tried += 1
        if self.tried > MOST_TRIED_IN_ALL or not self._in_one_plane(i, j):
            return False
        a, b = self.faces.corners[i], self.faces.corners[j]
        if self._is_hidden(i) or self._is_hidden(j) or overlap(a, b) <= LEAST_SHARE:
            return False
        k, m = self.faces.owner[[i, j]]
        opposed = self.faces.normal[i] @ self.faces.normal[j] < 0.0
        differ = self.look[k] != self.look[m] or (self.one_sided[k] and opposed)
        return bool(differ) or self._places_differ(i, j)

    def _in_one_plane(self, i: int, j: int) -> bool:
        """Return whether all corners of each face are in the plane of the other one."""
        corners, normal = self.faces.corners, self.faces.normal
        return all(
            float(np.abs((corners[m] - corners[k, 0]) @ normal[k]).max())
            <= self.tolerance[i]
            for k, m in ((i, j), (j, i))
        )

    def _places_differ(self, i: int, j: int) -> bool:
        """Return whether points of both faces at the same position have different uv.

        Differences of whole numbers do not count: most textures repeat.
        """
        corners, place = self.faces.corners, self.faces.place
        edges = (corners[i, 1:] - corners[i, 0]).T
        inside = np.linalg.lstsq(edges, (corners[j] - corners[i, 0]).T, rcond=None)[0]
        expected = place[i, 0] + inside.T @ (place[i, 1:] - place[i, 0])
        apart = expected - place[j]
        return float(np.abs(apart - np.round(apart)).max()) > LEAST_APART

    def _is_hidden(self, face: int) -> bool:
        """Return whether the opaque body of a face is between the face and the camera.

        A mesh counts as closed if that is unknown.
        """
        owner = int(self.faces.owner[face])
        if owner not in self.bodies:
            self.bodies[owner] = _body(self.shapes[owner], self.eye)
        body = self.bodies[owner]
        if body.outward is None:
            return True
        corner = self.faces.corners[face, 0]
        to_eye = self.eye - corner if self.back is None else self.back
        towards = self.faces.normal[face] @ to_eye * self.faces.turn[face] * body.outward
        return bool(towards < 0.0) and not body.around_eye


class _Body(NamedTuple):
    outward: float | None  # result of `outward`; 0 if it is not opaque
    around_eye: bool  # the camera is inside: its inner side is visible


def _body(shape: Shape, eye: Floats) -> _Body:
    seen = [side for side in sides(shape.bsdf) if side is not None]
    if not isinstance(shape, Mesh) or any(kind_of(side).transmits for side in seen):
        return _Body(0.0, False)
    out = outward(shape)
    return _Body(out, bool(out) and encloses(shape, eye))
