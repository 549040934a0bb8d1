"""Surfaces that lie in one another, so that rounding decides which one a ray hits."""

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
# Whether two shapes look the same wherever they lie on one another.

Digests = dict[int, bytes]  # of arrays by their id, as long as their scene lives


class Look(NamedTuple):
    """What tells a shape's surface from another's; equal values may still differ by these.

    The direction of brushed materials is not among them.
    """

    values: Any  # of material and light; equal where they are
    one_sided: bool  # it is another one from behind
    textured: bool  # it is another one from place to place


def look_of(shape: Shape, digests: Digests) -> Look:
    """Return what a shape looks like; `digests` is filled, for images that shapes share."""
    given = (shape.bsdf, shape.radiance)
    textured = any(is_textured(part) for part in _parts(given))
    values = values_of(given, digests)
    if textured:  # the places in a disk's texture are no other shape's
        attributes = shape.attributes if isinstance(shape, Mesh) else {}
        values = values, isinstance(shape, Disk), values_of(attributes, digests)
    return Look(values, shape.radiance is not None or _one_sided(shape.bsdf), textured)


def values_of(look: Any, digests: Digests) -> Any:
    """Return something hashable that is equal for equal descriptions, arrays by value."""
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
    except TypeError:  # of a plugin that is not ours
        return id(look)
    return look


def _fields(look: Any) -> Mapping[Any, Any] | None:
    if dataclasses.is_dataclass(look):
        return {f.name: getattr(look, f.name) for f in dataclasses.fields(look)}
    return look if isinstance(look, Mapping) else None


def _parts(look: Any) -> Iterator[Any]:
    """Yield a description and all that is in it."""
    yield look
    inside = _fields(look)
    for value in inside.values() if inside is not None else ():
        yield from _parts(value)
    if isinstance(look, tuple | list):
        for value in look:
            yield from _parts(value)


def _one_sided(bsdf: Any) -> bool:
    """Return whether a BSDF is known to look another way from behind.

    Of what lets light through, nothing is known here.
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
# Which triangles of a plane cover one another, and how much [Sutherland1974].

Ints = NDArray[np.int64]


def overlapping_boxes(corners: Floats, tolerance: Floats) -> tuple[Ints, Ints, Floats]:
    """Return the pairs of triangles (n, 3, 2) whose boxes share some area, and that area.

    By a sweep along the first axis; boxes that share an edge do not overlap, within the
    tolerance (n,) of their coordinates.
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
    """Return the area that two triangles share, over that of the smaller one.

    Parameters
    ----------
    a, b : ndarray of shape (3, 3)
        Corners, in one plane; they are looked at along its normal's main axis.
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
# Flat surfaces of different material in one plane, where rounding decides what is seen.


GAP = 1e-7  # of the coordinates and of the distance from the camera
ALIKE = 2e-5  # normals are taken together within this
MOST_FACES = 400_000  # in all; more are not looked at
MOST_IN_A_PLANE = 2000  # faces; a plane of more is not looked at
MOST_TRIED = 64  # pairs of faces of two shapes in one plane
MOST_TRIED_IN_ALL = 5_000  # as many take 0.4 s
LEAST_SHARE = 1e-3  # of the smaller triangle, that the overlap must have
LEAST_APART = 1e-3  # of a texture's square


def coincident_surfaces(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find rectangles, disks and faces of meshes that lie on one another.

    Where an opaque closed mesh stands on something, the place where they touch is not
    seen from its side, so that nothing is said if the camera is on that side and not
    inside of the mesh. Curved surfaces and instances are not looked at, nor faces of one
    mesh on one another, and no more than the numbers above.
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
    """Finds the pairs of shapes that share some area of a plane which the eye may see."""

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
        """Return them, of each the lesser index first."""
        found: set[tuple[int, int]] = set()
        for members in self._planes():
            for i, j in self._candidates(members):
                first, second = sorted((int(self.faces.owner[i]), int(self.faces.owner[j])))
                if (first, second) not in found and self._is_seen(i, j):
                    found.add((first, second))
        return found

    def _planes(self) -> Iterator[Ints]:
        """Yield the faces of each plane in which there are several shapes."""
        faces = self.faces
        # either side is the same plane; no usual angle has this as a cosine
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
        """Yield the pairs of faces worth a look, of each two shapes the largest first."""
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
        """Return whether two faces lie on one another, look different and can be seen."""
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
        """Return whether all corners of either are in the plane of the other."""
        corners, normal = self.faces.corners, self.faces.normal
        return all(
            float(np.abs((corners[m] - corners[k, 0]) @ normal[k]).max())
            <= self.tolerance[i]
            for k, m in ((i, j), (j, i))
        )

    def _places_differ(self, i: int, j: int) -> bool:
        """Return whether a point in the plane has another place in the other's texture.

        Whole squares apart counts as the same place: most textures repeat.
        """
        corners, place = self.faces.corners, self.faces.place
        edges = (corners[i, 1:] - corners[i, 0]).T
        inside = np.linalg.lstsq(edges, (corners[j] - corners[i, 0]).T, rcond=None)[0]
        expected = place[i, 0] + inside.T @ (place[i, 1:] - place[i, 0])
        apart = expected - place[j]
        return float(np.abs(apart - np.round(apart)).max()) > LEAST_APART

    def _is_hidden(self, face: int) -> bool:
        """Return whether a face's own opaque body is between it and the eye.

        Where it is not known whether a mesh is closed, it counts as that.
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
    outward: float | None  # as `outward` says; 0 for what is not opaque
    around_eye: bool  # so that its inside is what is seen


def _body(shape: Shape, eye: Floats) -> _Body:
    seen = [side for side in sides(shape.bsdf) if side is not None]
    if not isinstance(shape, Mesh) or any(kind_of(side).transmits for side in seen):
        return _Body(0.0, False)
    out = outward(shape)
    return _Body(out, bool(out) and encloses(shape, eye))
