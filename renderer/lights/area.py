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
from renderer.vectors import (
    cross,
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
    return point, normalize(cross(edge1, edge2))


@kernel
def _sample_triangles(table, surfaces, light, x, y, z, point, normal):
    """Choose a triangle of the mesh by its area, then a point in it, uniformly."""
    if table is None:
        return point, normal
    count = gather_row(table.count, 0, light, light >= 0)
    mine = count > 0
    if mask_bits(mine) == 0:
        return point, normal
    scaled = z * to_f32(count)
    column = to_i32(minimum(scaled, to_f32(count) - 1.0))
    entry = gather_row(table.first, 0, light, mine) + column
    stay = scaled - to_f32(column) < gather_row(table.keep, 0, entry, mine)
    entry = select(stay, entry, gather_row(table.alias, 0, entry, mine))
    index = gather_row(table.prim, 0, entry, mine) - surfaces.first
    root = sqrt(1.0 - x)
    p, n = _patch_point(surfaces, index, mine, 1.0 - root, y * root)
    return select3(mine, p, point), select3(mine, n, normal)


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


_INSIDE = np.float32(1.00001)  # this near the surface the cone is a half space: use areas


@kernel
def sphere_light_pdf(center, radius, inverse_area, position, wi, distance, cosine):
    """Return the density [1/sr] with which `_sample_spheres` chooses the direction wi."""
    to_center = center - position
    distance2 = dot(to_center, to_center)
    one_minus_cos, _ = _cone(distance2, radius)
    outside = distance2 > radius * radius * _INSIDE
    by_area = distance * distance * inverse_area / cosine
    return select(outside, 1.0 / (TWO_PI * one_minus_cos), by_area)


@kernel
def _sample_spheres(present, surfaces, prim, mask, position, x, y, point, normal):
    """Choose a direction in the cone that the sphere fills; inside it, a point by area."""
    if present is None:
        return point, normal
    mine = _is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return point, normal
    index = prim - surfaces.first
    center = gather3(surfaces.center, index, mine)
    radius = gather_row(surfaces.radius, 0, index, mine)
    to_center = center - position
    distance2 = dot(to_center, to_center)
    distance = sqrt(distance2)
    one_minus_cos, sine2_max = _cone(distance2, radius)
    # direction in the cone, seen from the centre: cos alpha = sin^2 / s + cos sqrt(1 - ...)
    small = x * one_minus_cos  # 1 - cos theta
    sine2 = small * (2.0 - small)
    inner = sqrt(maximum(1.0 - sine2 / sine2_max, splat_f32(0.0)))
    ratio = sqrt(sine2_max)
    cos_alpha = sine2 / ratio + (1.0 - small) * inner
    sin_alpha = sqrt(maximum(1.0 - cos_alpha * cos_alpha, splat_f32(0.0)))
    sine, cosine = sincos(TWO_PI * y)
    axis = to_center / distance
    s, t = orthonormal_basis(axis)
    cap = s * (sin_alpha * cosine) + t * (sin_alpha * sine) - axis * cos_alpha
    outside = distance2 > radius * radius * _INSIDE
    n = select3(outside, cap, square_to_sphere(x, y))
    return select3(mine, center + n * radius, point), select3(mine, n, normal)


@kernel
def _pdf_on_spheres(
    present, surfaces, prim, mask, inverse_area, position, wi, r, cosine, pdf
):
    if present is None:
        return pdf
    mine = _is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return pdf
    index = prim - surfaces.first
    center = gather3(surfaces.center, index, mine)
    radius = gather_row(surfaces.radius, 0, index, mine)
    on_sphere = sphere_light_pdf(center, radius, inverse_area, position, wi, r, cosine)
    return select(mine, on_sphere, pdf)


@kernel
def pdf_area_light(areas, surfaces, light, prim, mask, position, wi, distance, cosine):
    """Return the density [1/sr] with which an area light is sampled along wi.

    Parameters are lanes: the light and the primitive that wi meets, the point that asks,
    the distance to the light and the |cosine| at it.
    """
    inverse_area = gather_row(areas.inverse_area, 0, light, mask)
    pdf = distance * distance * inverse_area / cosine
    return _pdf_on_spheres(
        areas.spheres,
        surfaces.spheres,
        prim,
        mask,
        inverse_area,
        position,
        wi,
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
    zero = splat_f32(0.0)
    p = vec3(zero, zero, zero)
    n = p
    p, n = _sample_triangles(areas.triangles, surfaces.triangles, light, x, y, z, p, n)
    p, n = _sample_rectangles(areas.rectangles, surfaces.rectangles, prim, mine, x, y, p, n)
    p, n = _sample_disks(areas.disks, surfaces.disks, prim, mine, x, y, p, n)
    p, n = _sample_cylinders(areas.cylinders, surfaces.cylinders, prim, mine, x, y, p, n)
    p, n = _sample_spheres(
        areas.spheres, surfaces.spheres, prim, mine, position, x, y, p, n
    )
    to_light = p - position
    r = length(to_light)
    wi = to_light / r
    cosine = -dot(wi, n) * gather_row(areas.orientation, 0, light, mine)
    shining = cosine > 0.0
    pdf = pdf_area_light(areas, surfaces, light, prim, mine, position, wi, r, fabs(cosine))
    usable = shining & (pdf > 0.0)
    radiance = gather3(areas.radiance, light, mine) * select(usable, 1.0 / pdf, zero)
    return chosen(mine, LightSample(wi, r, radiance, pdf), sample)
