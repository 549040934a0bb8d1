"""Shapes: ray intersection, surface points, and sampling of points.

Each is a unit shape g(x') = 0 under an affine map x = A x' + a. The ray is transformed to
the unit shape: p' + t d' with p' = A^-1 (p - a) and d' = A^-1 d. As d' is not normalised, t
is the same in both spaces. The normal is the gradient of g, transformed by the inverse
transpose. A mesh is one unit triangle per face.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from renderer.scene_file.description import Cylinder, Disk, Mesh, Rectangle, Sphere
from renderer.scene_file.meshes.mesh_data import surface_area
from renderer.simple.camera import (
    Vector,
    normalize,
    orthonormal_basis,
    square_to_disk,
    square_to_sphere,
    square_to_triangle,
)

TURN = 2.0 * math.pi


class UnitShape(NamedTuple):
    """A shape in its own coordinates; x, y, z are those of a point with g = 0."""

    roots: Callable[[Vector, Vector], Vector]  # p', d' (n, 3) -> t (n, roots), NaN if none
    contains: Callable[..., Any]  # x, y, z -> whether the shape reaches there
    gradient: Callable[..., tuple[float, float, float]]  # of g at x, y, z
    uv: Callable[..., tuple[float, float]]  # texture coordinates of x, y, z
    along_u: Callable[..., tuple[float, float, float]]  # derivative of x, y, z by u
    along_v: Callable[..., tuple[float, float, float]]  # and by v
    point: Callable[..., tuple[float, float, float]]  # [0, 1)^2 -> x, y, z, by area


def plane(p: Vector, d: Vector) -> Vector:
    """Return t with g(p + t d) = 0 for g(x) = z."""
    return -p[:, 2:] / d[:, 2:]


def quadric(*axes: float) -> Callable[[Vector, Vector], Vector]:
    """Return a function for both t with g(p + t d) = 0 for g(x) = sum of axes x^2 - 1."""

    def roots(p: Vector, d: Vector) -> Vector:
        a, b, c = d**2 @ axes, (p * d) @ axes, p**2 @ axes - 1.0
        root = np.sqrt(b * b - a * c)
        both: Vector = (np.multiply.outer(root, (-1.0, 1.0)) - b[:, None]) / a[:, None]
        return both

    return roots


def upwards(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the gradient of g(x) = z."""
    return 0.0, 0.0, 1.0


def turn(x: float, y: float) -> float:
    """Return the angle of (x, y) as a fraction of a full turn, in [0, 1)."""
    return math.atan2(y, x) / TURN % 1.0


def around(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the derivative of a rotation about the z axis, per full turn."""
    return -TURN * y, TURN * x, 0.0


def outwards(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the unit vector away from the z axis; x on the axis itself."""
    radius = math.hypot(x, y)
    return (x / radius, y / radius, 0.0) if radius else (1.0, 0.0, 0.0)


UNIT_SHAPES: dict[type, UnitShape] = {
    Mesh: UnitShape(  # each of its triangles: (0, 0), (1, 0), (0, 1)
        plane,
        lambda x, y, z: (x >= 0) & (y >= 0) & (x + y <= 1),
        upwards,
        lambda x, y, z: (x, y),
        lambda x, y, z: (1.0, 0.0, 0.0),
        lambda x, y, z: (0.0, 1.0, 0.0),
        lambda u, v: (*square_to_triangle(u, v), 0.0),
    ),
    Rectangle: UnitShape(
        plane,
        lambda x, y, z: (abs(x) <= 1) & (abs(y) <= 1),
        upwards,
        lambda x, y, z: ((x + 1) / 2, (y + 1) / 2),
        lambda x, y, z: (2.0, 0.0, 0.0),
        lambda x, y, z: (0.0, 2.0, 0.0),
        lambda u, v: (2 * u - 1, 2 * v - 1, 0.0),
    ),
    Disk: UnitShape(
        plane,
        lambda x, y, z: x**2 + y**2 <= 1,
        upwards,
        lambda x, y, z: (math.hypot(x, y), turn(x, y)),
        outwards,
        around,
        lambda u, v: (*square_to_disk(u, v), 0.0),
    ),
    Sphere: UnitShape(
        quadric(1.0, 1.0, 1.0),
        lambda x, y, z: np.isfinite(x),
        lambda x, y, z: (x, y, z),
        lambda x, y, z: (turn(x, y), math.acos(min(max(z, -1.0), 1.0)) / math.pi),
        around,
        lambda x, y, z: tuple(
            math.pi * (z * np.array(outwards(x, y, z)) - (0, 0, math.hypot(x, y)))
        ),
        square_to_sphere,
    ),
    Cylinder: UnitShape(
        quadric(1.0, 1.0, 0.0),
        lambda x, y, z: (z >= 0) & (z <= 1),
        lambda x, y, z: (x, y, 0.0),
        lambda x, y, z: (turn(x, y), z),
        around,
        lambda x, y, z: (0.0, 0.0, 1.0),
        lambda u, v: (math.cos(TURN * v), math.sin(TURN * v), u),
    ),
}


@dataclass(frozen=True)
class Hit:
    """A surface point, as seen from a viewpoint."""

    t: float  # distance to the viewpoint
    x: Vector  # position
    wo: Vector  # unit, towards the viewpoint
    geometric_normal: Vector  # unit
    normal: Vector  # unit, for shading: interpolated if a mesh has vertex normals
    uv: tuple[float, float]
    surface: Surface
    local: Vector  # x' on the unit shape
    face: int  # of a mesh

    @property
    def light(self) -> Surface | None:
        """The area light on the visible side; it emits on the side of the normal."""
        front = self.wo @ self.normal > 0
        return self.surface if front and self.surface.radiance else None

    def derivatives(self) -> tuple[Vector, Vector]:
        """Return dx/du and dx/dv."""
        unit, A = self.surface.unit, self.surface.A[self.face]
        along = np.array([unit.along_u(*self.local), unit.along_v(*self.local)]) @ A.T
        shape = self.surface.shape
        if isinstance(shape, Mesh) and shape.uvs is not None:
            # the edges are derivatives by x' and y'; u and v are linear in these
            a, b, c = shape.uvs[shape.faces[self.face]].astype(np.float64)
            uv_by_local = np.array([b - a, c - a])
            if np.linalg.det(uv_by_local) == 0.0:
                return orthonormal_basis(normalize(np.cross(*along)))
            along = np.linalg.inv(uv_by_local) @ along
        return along[0], along[1]

    def frame(self, *, along_u: bool) -> Vector:
        """Return the local frame: rows s, t and the normal, unit and right-handed.

        With `along_u`, s is along dp/du; otherwise it is any tangent.
        """
        n = self.normal
        s, t = orthonormal_basis(n)
        if along_u:
            dp_du, _ = self.derivatives()
            across = dp_du - n * (n @ dp_du)
            if across.any():  # not at the pole of a sphere
                s = normalize(across)
                t = np.cross(n, s)
        return np.array([s, t, n])


def first_met(
    unit: UnitShape,
    inverse: Any,
    a: Vector,
    p: Vector,
    d: Vector,
    near: float,
    far: float,
) -> tuple[int, Vector] | None:
    """Return the index of the first of n unit shapes hit with near < t < far, and x' there.

    `inverse` (n, 3, 3) and `a` (n, 3) are of the shapes' maps.
    """
    p_ = (inverse @ (p - a)[..., None])[..., 0]
    d_ = inverse @ d
    with np.errstate(divide="ignore", invalid="ignore"):
        t = unit.roots(p_, d_)
        x_ = p_[:, None] + t[..., None] * d_[:, None]
        met = (near < t) & (t < far) & unit.contains(*x_.transpose(2, 0, 1))
    if not met.any():
        return None
    first = np.unravel_index(np.argmin(np.where(met, t, np.inf)), t.shape)
    return int(first[0]), x_[first]


class Surface:
    """A shape with its maps A (n, 3, 3) and a (n, 3), one per face of a mesh."""

    def __init__(self, shape: Any) -> None:
        self.shape, self.radiance = shape, shape.radiance
        self.unit = UNIT_SHAPES[type(shape)]
        self.area = surface_area(shape)
        if isinstance(shape, Mesh):
            corners = shape.vertices[shape.faces].astype(np.float64)  # (n, 3, 3)
            self.a = corners[:, 0]
            e1, e2 = corners[:, 1] - self.a, corners[:, 2] - self.a
            self.A = np.stack([e1, e2, np.cross(e1, e2)], axis=2)
        else:
            self.a, self.A = shape.to_world[None, :3, 3], shape.to_world[None, :3, :3]
        self.face_areas = np.linalg.norm(self.A[:, :, 2], axis=1) / 2  # of a mesh
        self.inverse = np.linalg.inv(self.A)

    def hit(self, p: Vector, d: Vector, near: float, far: float) -> Hit | None:
        """Return the first hit of p + t d with near < t < far."""
        found = first_met(self.unit, self.inverse, self.a, p, d, near, far)
        return None if found is None else self.at(found[1], found[0], p)

    def at(self, x_: Vector, face: int, p: Vector) -> Hit:
        """Return the world-space surface point for x' on the unit shape, or on a face."""
        x = self.A[face] @ x_ + self.a[face]
        n = normalize(self.inverse[face].T @ self.unit.gradient(*x_))
        n = -n if self.shape.flip_normals else n
        shading_normal, uv = n, self.unit.uv(*x_)
        if isinstance(self.shape, Mesh):
            vertices = self.shape.faces[face]
            weights = np.array([1.0 - x_[0] - x_[1], x_[0], x_[1]])
            if self.shape.normals is not None:
                shading_normal = normalize(weights @ self.shape.normals[vertices])
            if self.shape.uvs is not None:
                uv = tuple(weights @ self.shape.uvs[vertices])
        t = float(np.linalg.norm(p - x))
        return Hit(t, x, (p - x) / t, n, shading_normal, uv, self, x_, face)


class Group:
    """Surfaces of one kind: NumPy tests all their faces at once, in half of the time."""

    def __init__(self, surfaces: list[Surface]) -> None:
        self.unit = surfaces[0].unit
        self.a = np.concatenate([surface.a for surface in surfaces])
        self.inverse = np.concatenate([surface.inverse for surface in surfaces])
        self.faces = [(surface, k) for surface in surfaces for k in range(len(surface.a))]

    def hit(self, p: Vector, d: Vector, near: float, far: float) -> Hit | None:
        """Return the first hit of p + t d on any of them with near < t < far."""
        found = first_met(self.unit, self.inverse, self.a, p, d, near, far)
        if found is None:
            return None
        surface, face = self.faces[found[0]]
        return surface.at(found[1], face, p)

    def blocks(self, p: Vector, d: Vector, near: float, far: float) -> bool:
        """Return whether p + t d hits any of them with near < t < far."""
        return first_met(self.unit, self.inverse, self.a, p, d, near, far) is not None
