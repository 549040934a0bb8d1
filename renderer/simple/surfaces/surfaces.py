"""Shapes in the scene: where a ray meets them, what is there, points on them at random.

Each is a unit shape g(x') = 0 under an affine map x = A x' + a. A ray is taken to the unit
shape by the inverse: p' + t d' with p' = A^-1 (p - a) and d' = A^-1 d. As d' is not made
unit again, t is the same on both sides. The normal is the gradient of g, and goes back by
the inverse transpose. A mesh is as many unit triangles as it has faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from renderer.scene_file.description import (
    Dielectric,
    Mesh,
    TwoSided,
)
from renderer.scene_file.meshes.surface_area import surface_area
from renderer.simple.surfaces.unit_shapes import UNIT_SHAPES
from renderer.simple.vectors import Vector, normalize


@dataclass(frozen=True)
class Hit:
    """A surface point, as it is seen from another point."""

    t: float  # distance between the two
    x: Vector  # position
    wo: Vector  # unit, towards the other
    geometric_normal: Vector  # unit
    shading_normal: Vector  # unit, between the vertex normals where a mesh has them
    uv: tuple[float, float]
    surface: Surface

    @property
    def front(self) -> bool:
        """Whether the side of the shading normal is seen."""
        return bool(self.wo @ self.shading_normal > 0)

    @property
    def normal(self) -> Vector:
        """The shading normal of the side that is seen."""
        return self.shading_normal if self.front else -self.shading_normal

    @property
    def light(self) -> Surface | None:
        """The area light that is seen; it shines on the side of the normal."""
        return self.surface if self.front and self.surface.radiance else None

    @property
    def bsdf(self) -> Any:
        """The BSDF of the side that is seen; None is black."""
        bsdf = self.surface.shape.bsdf
        if isinstance(bsdf, TwoSided):
            return bsdf.front if self.front else bsdf.back
        return bsdf if self.front or isinstance(bsdf, Dielectric) else None


class Surface:
    """A shape with its maps A (n, 3, 3) and a (n, 3), one for each face of a mesh."""

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
        """Return where p + t d meets the surface first with near < t < far."""
        p_ = np.einsum("nij,nj->ni", self.inverse, p - self.a)
        d_ = np.einsum("nij,j->ni", self.inverse, d)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = self.unit.roots(p_, d_)
            x_ = p_[:, None] + t[..., None] * d_[:, None]
            met = (near < t) & (t < far) & self.unit.contains(*np.moveaxis(x_, -1, 0))
        if not met.any():
            return None
        first = np.unravel_index(np.argmin(np.where(met, t, np.inf)), t.shape)
        return self.at(x_[first], int(first[0]), p)

    def at(self, x_: Vector, face: int, p: Vector) -> Hit:
        """Return the point that x' on the unit shape, or on a face, is in the world."""
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
        return Hit(t, x, (p - x) / t, n, shading_normal, uv, self)
