"""Area lights: a point on the shape, chosen by area; on a sphere, by the cone it fills.

From density per area to density per solid angle: pdf = r^2 / (|cos| A).
"""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.kernel_scene import AREA
from renderer.lanes.functions import (
    fabs,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.lanes.mathematics import sincos
from renderer.lanes.memory import gather_row
from renderer.lights.light_sample import LightSample
from renderer.lights.point import chosen
from renderer.sampling import TWO_PI, square_to_disk, square_to_sphere
from renderer.stages.surface import interpolated_normal
from renderer.vectors import (
    dot,
    gather3,
    length,
    normalize,
    orthonormal_basis,
    select3,
    vec3,
)


@kernel
def _patch_point(patches, index, mask, u, v):
    """Return the point at (u, v) of flat primitives and their normal."""
    edge1 = gather3(patches.edge1, index, mask)
    edge2 = gather3(patches.edge2, index, mask)
    point = gather3(patches.corner, index, mask) + edge1 * u + edge2 * v
    return point, gather3(patches.normal, index, mask)


@kernel
def _sample_triangles(table, surfaces, light, orientation, x, y, z, point, normal):
    """Choose a triangle of the mesh by its area, then a point in it, uniformly.

    Returns point, geometric normal and the normal of the side that shines: the shading
    normal, as where a path arrives by itself (`add_emission`).
    """
    if table is None:
        return point, normal, normal
    count = gather_row(table.count, 0, light, light >= 0)
    mine = count > 0
    if mask_bits(mine) == 0:
        return point, normal, normal
    scaled = z * to_f32(count)
    column = to_i32(minimum(scaled, to_f32(count) - 1.0))
    entry = gather_row(table.first, 0, light, mine) + column
    stay = scaled - to_f32(column) < gather_row(table.keep, 0, entry, mine)
    entry = select(stay, entry, gather_row(table.alias, 0, entry, mine))
    index = gather_row(table.prim, 0, entry, mine) - surfaces.first
    root = sqrt(1.0 - x)
    u, v = 1.0 - root, y * root
    p, n = _patch_point(surfaces, index, mine, u, v)
    s = interpolated_normal(surfaces.normals, index, mine, u, v, n * orientation)
    return select3(mine, p, point), select3(mine, n, normal), s


@kernel
def _mesh_or(table, light, mesh_side, side):
    """Return `mesh_side` where the light is a mesh, else `side`."""
    if table is None:
        return side
    return select3(gather_row(table.count, 0, light, light >= 0) > 0, mesh_side, side)


@kernel
def _is_kind(surfaces, prim, mask):
    return mask & (prim >= surfaces.first) & (prim < surfaces.end)


@kernel
def _sample_rectangles(present, surfaces, prim, mask, x, y, point, normal):
    if present is None:
        return point, normal
    mine = _is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return point, normal
    p, n = _patch_point(surfaces, prim - surfaces.first, mine, x, y)
    return select3(mine, p, point), select3(mine, n, normal)


@kernel
def _sample_disks(present, surfaces, prim, mask, x, y, point, normal):
    if present is None:
        return point, normal
    mine = _is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return point, normal
    u, v = square_to_disk(x, y)
    p, n = _patch_point(surfaces, prim - surfaces.first, mine, u, v)
    return select3(mine, p, point), select3(mine, n, normal)


@kernel
def _sample_cylinders(present, surfaces, prim, mask, x, y, point, normal):
    if present is None:
        return point, normal
    mine = _is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return point, normal
    index = prim - surfaces.first
    sine, cosine = sincos(TWO_PI * y)
    frame = surfaces.frame
    local_x = vec3(
        gather_row(frame, 0, index, mine),
        gather_row(frame, 1, index, mine),
        gather_row(frame, 2, index, mine),
    )
    local_y = vec3(
        gather_row(frame, 3, index, mine),
        gather_row(frame, 4, index, mine),
        gather_row(frame, 5, index, mine),
    )
    axis = vec3(
        gather_row(frame, 6, index, mine),
        gather_row(frame, 7, index, mine),
        gather_row(frame, 8, index, mine),
    )
    n = local_x * cosine + local_y * sine
    along = axis * (gather_row(surfaces.height, 0, index, mine) * x)
    p = gather3(surfaces.base, index, mine) + along
    p = p + n * gather_row(surfaces.radius, 0, index, mine)
    return select3(mine, p, point), select3(mine, n, normal)


@kernel
def _cone(distance2, radius):
    """Return 1 - cos of the half angle under which a sphere is seen, and its sine squared.

    1 - sqrt(1 - s^2) cancels for a small sphere; s^2 / (1 + sqrt(1 - s^2)) does not.
    """
    sine2 = minimum(radius * radius / distance2, splat_f32(1.0))
    cosine = sqrt(maximum(1.0 - sine2, splat_f32(0.0)))
    return sine2 / (1.0 + cosine), sine2


_ROUNDING = np.float32(1e-5)
_TOUCHING = np.float32(1e-7)  # of the radius: a light that is touched is still somewhere


@kernel
def _outside(distance2, radius, orientation):
    """Return the mask of points that see the sphere from outside.

    On the surface itself the side that shines decides, not rounding.
    """
    return distance2 > radius * radius * (1.0 - _ROUNDING * orientation)


@kernel
def sphere_light_pdf(center, radius, orientation, inverse_area, position, distance, cosine):
    """Return the density [1/sr] with which `_sample_spheres` chooses a direction."""
    to_center = center - position
    distance2 = dot(to_center, to_center)
    one_minus_cos, _ = _cone(distance2, radius)
    outside = _outside(distance2, radius, orientation)
    by_area = distance * distance * inverse_area / cosine
    return select(outside, 1.0 / (TWO_PI * one_minus_cos), by_area)


@kernel
def _sample_spheres(
    present, surfaces, prim, mask, orientation, position, x, y, to_light, normal
):
    """Choose a direction in the cone of the sphere; from inside, a point by area."""
    if present is None:
        return to_light, normal
    mine = _is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return to_light, normal
    index = prim - surfaces.first
    center = gather3(surfaces.center, index, mine)
    radius = gather_row(surfaces.radius, 0, index, mine)
    to_center = center - position
    distance2 = dot(to_center, to_center)
    distance = sqrt(distance2)
    one_minus_cos, sine2_max = _cone(distance2, radius)
    small = x * one_minus_cos  # 1 - cos theta
    sine2 = small * (2.0 - small)
    sine_theta = sqrt(sine2)
    sine, cosine = sincos(TWO_PI * y)
    s, t = orthonormal_basis(to_center / distance)
    wi = s * (sine_theta * cosine) + t * (sine_theta * sine)
    wi = wi + to_center / distance * (1.0 - small)
    # the nearer root as a quotient: as a difference it would be 0 close to the surface
    inner = sqrt(maximum(1.0 - sine2 / sine2_max, splat_f32(0.0)))
    excess = (distance - radius) * (distance + radius)
    near = excess / (distance * (1.0 - small) + radius * inner)
    near = maximum(near, radius * _TOUCHING)
    cap = wi * near - to_center
    ball = square_to_sphere(x, y)
    outside = _outside(distance2, radius, orientation)
    chosen_light = select3(outside, wi * near, to_center + ball * radius)
    n = select3(outside, normalize(cap), ball)
    return select3(mine, chosen_light, to_light), select3(mine, n, normal)


@kernel
def _pdf_on_spheres(
    present, surfaces, prim, mask, orientation, inverse_area, position, r, cosine, pdf
):
    if present is None:
        return pdf
    mine = _is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return pdf
    index = prim - surfaces.first
    center = gather3(surfaces.center, index, mine)
    radius = gather_row(surfaces.radius, 0, index, mine)
    on_sphere = sphere_light_pdf(
        center, radius, orientation, inverse_area, position, r, cosine
    )
    return select(mine, on_sphere, pdf)


@kernel
def pdf_area_light(areas, surfaces, light, prim, mask, position, distance, cosine):
    """Return the density [1/sr] with which an area light is sampled in a direction.

    Parameters are lanes: the light and the primitive that it meets, the point that asks,
    the distance to the light and the |cosine| at it.
    """
    inverse_area = gather_row(areas.inverse_area, 0, light, mask)
    pdf = distance * distance * inverse_area / cosine
    return _pdf_on_spheres(
        areas.spheres,
        surfaces.spheres,
        prim,
        mask,
        gather_row(areas.orientation, 0, light, mask),
        inverse_area,
        position,
        distance,
        cosine,
        pdf,
    )


@kernel
def sample_area_lights(areas, surfaces, light, kind, position, x, y, z, sample):
    """Return `sample` with the lanes whose light has an area replaced.

    A light shines on the side of its normal only; from behind the radiance is 0.
    """
    if areas is None:
        return sample
    mine = kind == AREA
    if mask_bits(mine) == 0:
        return sample
    prim = gather_row(areas.prim, 0, light, mine)
    orientation = gather_row(areas.orientation, 0, light, mine)
    zero = splat_f32(0.0)
    none = vec3(zero, zero, zero)
    p, n, mesh_side = _sample_triangles(
        areas.triangles, surfaces.triangles, light, orientation, x, y, z, none, none
    )
    p, n = _sample_rectangles(areas.rectangles, surfaces.rectangles, prim, mine, x, y, p, n)
    p, n = _sample_disks(areas.disks, surfaces.disks, prim, mine, x, y, p, n)
    p, n = _sample_cylinders(areas.cylinders, surfaces.cylinders, prim, mine, x, y, p, n)
    to_light, n = _sample_spheres(
        areas.spheres,
        surfaces.spheres,
        prim,
        mine,
        orientation,
        position,
        x,
        y,
        p - position,
        n,
    )
    r = length(to_light)
    wi = to_light / r
    pdf = pdf_area_light(areas, surfaces, light, prim, mine, position, r, fabs(dot(wi, n)))
    side = _mesh_or(areas.triangles, light, mesh_side, n * orientation)
    usable = (dot(wi, side) < 0.0) & (pdf > 0.0)
    radiance = gather3(areas.radiance, light, mine) * select(usable, 1.0 / pdf, zero)
    return chosen(mine, LightSample(wi, r, radiance, pdf), sample)
