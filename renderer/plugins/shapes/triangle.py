"""Ray against triangle, by both methods of the lecture.

The renderer uses `hit_triangle`, the plane method with the normal stored for each triangle:
29 multiplications and additions, against 38 for Moeller-Trumbore. Near an edge the test
by the vertices decides (`watertight`), so that a closed mesh has no gaps.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import always_inline, interface, kernel, never_inline
from renderer.kernels.lanes.fields import Bound, Derived, Vector
from renderer.kernels.lanes.functions import any_of, fabs, minimum, select, to_f32, to_i32
from renderer.kernels.lanes.memory import gather_columns, gather_row
from renderer.kernels.lanes.vectors import cross, dot, gather3, normalize, vec3
from renderer.plugins.sampling.numbers_and_warps import density_normal, square_to_triangle
from renderer.plugins.shapes import flat, triangle_tables
from renderer.plugins.shapes.flat import (
    MARGIN,
    ONE,
    divided,
    grazing,
    meet_plane,
    meet_plane_in_double,
)
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.mesh_plugins import MESH_PLUGINS
from renderer.plugins.shapes.primitives import Intersection, empty_rows
from renderer.plugins.shapes.surface import (
    LightPoint,
    SurfacePoint,
    flat_point,
    gather_flat,
    nowhere,
)
from renderer.plugins.shapes.triangle_tables import TriangleSurfaces
from renderer.plugins.shapes.uv import (
    derivatives_of_triangles,
    point_of_mesh,
    texture_tangents,
)
from renderer.plugins.shapes.watertight import edge_margin, in_doubt, meet_by_vertices
from renderer.scene_file.description import Mesh


class Triangle(NamedTuple):
    """One triangle, or 16 in lanes."""

    corner: Vector  # p1 of the lecture; this and the other fields as in `flat.Patch`
    edge1: Vector
    edge2: Vector
    normal: Vector
    second: Vector  # the other vertices: corner + edge1 has rounding error
    third: Vector
    breadth: Derived  # as in `flat.Patch`
    size: Bound  # |edge1| + |edge2|, each the sum of absolute components
    slack: Bound  # size (|corner| + size)


@kernel
def _depth_inside(p):
    """Return the minimum of the barycentric coordinates u, v, w, times scale.

    w is the last operand: it is NaN if u or v is NaN, and then so is the result.
    """
    return minimum(minimum(p.u, p.v), p.scale - (p.u + p.v))


@kernel
def hit_triangle(triangle, origin, direction, t_max):
    """Intersect plane, then test: 0 < t <= t_max, u >= 0, v >= 0 and u + v <= 1."""
    always_inline()
    p = meet_plane(triangle, origin, direction)
    depth = _depth_inside(p)
    grazes = grazing(triangle, p, direction) & (depth >= MARGIN * p.scale)
    near = fabs(depth) < edge_margin(triangle, origin, direction)
    if any_of(grazes | near):
        p = _meet_again(triangle, origin, direction, grazes, p)
        depth = _depth_inside(p)
    return divided(p, depth >= 0.0, t_max)


@kernel
def _meet_again(triangle, origin, direction, grazes, p):
    """Return the `PlaneHit` recomputed where single precision is insufficient, else `p`."""
    never_inline()
    if any_of(grazes):
        p = meet_plane_in_double(triangle, origin, direction, grazes, p)
    doubtful = in_doubt(triangle, origin, direction, _depth_inside(p))
    if any_of(doubtful):
        p = meet_by_vertices(triangle, origin, direction, doubtful, p)
    return p


@kernel
def hit_triangle_moeller_trumbore(triangle, origin, direction, t_max):
    """Intersect without a stored normal [Moeller1997]; the same result within rounding."""
    p = cross(direction, triangle.edge2)
    determinant = dot(triangle.edge1, p)
    inverse = ONE / determinant
    to_origin = origin - triangle.corner
    u = dot(to_origin, p) * inverse
    q = cross(to_origin, triangle.edge1)
    v = dot(direction, q) * inverse
    t = dot(triangle.edge2, q) * inverse
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    return Intersection(inside & (t > 0.0) & (t <= t_max), t, u, v)


# ------------------------------------------------------------------ surface and light


@kernel
def interpolated_normal(normals, index, mask, u, v, flat):
    """Return interpolated unit vertex normals; `flat` where there are none."""
    if normals.shape[1] == 0:
        return flat
    a = gather_columns(normals, 0, index, mask)
    b = gather_columns(normals, 4, index, mask)
    c = gather_columns(normals, 5, index, mask)  # row 8 is its last
    return normalize(
        vec3(a[0], a[1], a[2]) * (1.0 - u - v)
        + vec3(a[3], b[0], b[1]) * u
        + vec3(b[2], b[3], c[3]) * v
    )


@kernel
def _interpolated_uv(uvs, index, mask, u, v):
    if uvs.shape[1] == 0:
        return u, v
    w = 1.0 - u - v
    u0, v0, u1, v1 = gather_columns(uvs, 0, index, mask)
    _, _, u2, v2 = gather_columns(uvs, 2, index, mask)
    return u0 * w + u1 * u + u2 * v, v0 * w + v1 * u + v2 * v


@kernel
def _point_on_triangle(triangles, index, mask, u, v, hit_point, with_uv):
    position, normal, offset = flat_point(triangles, index, mask, u, v)
    shading_normal = interpolated_normal(triangles.normals, index, mask, u, v, normal)
    smooth = mask if triangles.normals.shape[1] != 0 else nowhere(mask)
    u, v = _interpolated_uv(triangles.uvs, index, mask, u, v)
    return SurfacePoint(position, normal, shading_normal, smooth, offset, u, v)


@kernel
def _tangent_of_triangle(triangles, index, mask, u, v, normal):
    return gather3(triangles.tangents, index, mask)


class TriangleLights(NamedTuple):
    """Alias tables [Walker1977] that choose a triangle of a mesh light by its area."""

    first: NDArray[np.int32]  # (n,) first column below of each light
    count: NDArray[np.int32]  # (n,)
    keep: NDArray[np.float32]  # (total,) probability to accept the column drawn
    alias: NDArray[np.int32]  # (total,) the column that is used otherwise
    prim: NDArray[np.int32]  # (total,) primitive id


@interface
def choose_triangle(table: Any, light: Any, mask: Any, y: Any, z: Any) -> Any:
    """Return a primitive of each mesh light, and y rescaled to a new random number."""


@choose_triangle.by(TriangleLights)
@kernel
def _choose_by_alias(table, light, mask, y, z):
    """Use the alias method: constant time, with z as a second random number."""
    count = to_f32(gather_row(table.count, 0, light, mask))
    scaled = z * count
    column = to_i32(minimum(scaled, count - 1.0))
    entry = gather_row(table.first, 0, light, mask) + column
    stay = scaled - to_f32(column) < gather_row(table.keep, 0, entry, mask)
    entry = select(stay, entry, gather_row(table.alias, 0, entry, mask))
    return gather_row(table.prim, 0, entry, mask), y


@kernel
def _sample_mesh(triangles, kind, light, mask, position, x, y, z):
    """Sample a triangle of the mesh by area, then a point in it, uniformly.

    The shading normal determines the emitting side, as for BSDF samples that hit the light.
    """
    areas = kind.lights
    prim, y = choose_triangle(areas.choice, light, mask, y, z)
    index = prim - triangles.first
    u, v = square_to_triangle(x, y)
    p = gather_flat(triangles, index, mask)
    point, n = p.corner + p.edge1 * u + p.edge2 * v, p.normal
    outwards = n * gather_row(areas.orientation, 0, light, mask)
    side = interpolated_normal(triangles.normals, index, mask, u, v, outwards)
    return LightPoint(point - position, density_normal(kind.arithmetic, n, side), side)


# ---------------------------------------------------------------------------- tables


def _corners(s: Any) -> list[NDArray[np.float32]]:
    return [s.corner, s.corner + s.edge1, s.corner + s.edge2]


def _faces(mesh: Mesh) -> NDArray[Any]:
    count = len(mesh.faces)
    return np.arange(count, dtype=np.int32) if mesh.face_ids is None else mesh.face_ids


def prepared(
    triangles: TriangleSurfaces, *, with_uv: bool, with_tangents: bool
) -> TriangleSurfaces:
    """Return the table, with dp/du only if needed and without unused uv."""
    if with_tangents and triangles.tangents.shape[1] == 0:
        triangles = triangles._replace(tangents=texture_tangents(triangles))
    return triangles if with_uv else triangles._replace(uvs=empty_rows(6))


TRIANGLES = ShapeKind(
    name="triangles",
    plugins=MESH_PLUGINS,
    description=Mesh,
    record=TriangleSurfaces,
    surfaces=triangle_tables.surfaces,
    primitive=Triangle,
    fill=triangle_tables.fill_rows,
    intersect=hit_triangle,
    surface_point=_point_on_triangle,
    tangent=_tangent_of_triangle,
    sample=_sample_mesh,
    point_at_uv=point_of_mesh,
    corners=_corners,
    boxes=triangle_tables.boxes,
    hull=flat.hull(((0, 0), (1, 0), (0, 1), (0, 0))),
    areas=flat.areas(0.5),
    derivatives=derivatives_of_triangles,
    faces=_faces,
    mesh=True,
    prepared=prepared,
)
