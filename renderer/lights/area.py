"""Area lights: a point on the shape, chosen by area; on a sphere, by the cone it fills.

From density per area to density per solid angle: pdf = r^2 / (|cos| A).
"""

from __future__ import annotations

from renderer.jit import kernel
from renderer.kernel_scene import AREA
from renderer.lanes.functions import fabs, mask_bits, select, splat_f32
from renderer.lanes.mathematics import sincos
from renderer.lanes.memory import gather_row
from renderer.lights.light_sample import LightSample
from renderer.lights.point import chosen
from renderer.lights.spheres import is_kind, pdf_on_spheres, sample_spheres
from renderer.lights.triangles import mesh_or, sample_triangles
from renderer.sampling import TWO_PI, square_to_disk
from renderer.vectors import dot, gather3, gather_rows3, length, select3, vec3


@kernel
def _patch_point(patches, index, mask, u, v):
    """Return the point at (u, v) of flat primitives and their normal."""
    edge1 = gather3(patches.edge1, index, mask)
    edge2 = gather3(patches.edge2, index, mask)
    point = gather3(patches.corner, index, mask) + edge1 * u + edge2 * v
    return point, gather3(patches.normal, index, mask)


@kernel
def _sample_rectangles(present, surfaces, prim, mask, x, y, point, normal):
    if present is None:
        return point, normal
    mine = is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return point, normal
    p, n = _patch_point(surfaces, prim - surfaces.first, mine, x, y)
    return select3(mine, p, point), select3(mine, n, normal)


@kernel
def _sample_disks(present, surfaces, prim, mask, x, y, point, normal):
    if present is None:
        return point, normal
    mine = is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return point, normal
    u, v = square_to_disk(x, y)
    p, n = _patch_point(surfaces, prim - surfaces.first, mine, u, v)
    return select3(mine, p, point), select3(mine, n, normal)


@kernel
def _sample_cylinders(present, surfaces, prim, mask, x, y, point, normal):
    if present is None:
        return point, normal
    mine = is_kind(surfaces, prim, mask)
    if mask_bits(mine) == 0:
        return point, normal
    index = prim - surfaces.first
    sine, cosine = sincos(TWO_PI * y)
    frame = surfaces.frame
    local_x = gather_rows3(frame, 0, index, mine)
    local_y = gather_rows3(frame, 3, index, mine)
    axis = gather_rows3(frame, 6, index, mine)
    n = local_x * cosine + local_y * sine
    along = axis * (gather_row(surfaces.height, 0, index, mine) * x)
    p = gather3(surfaces.base, index, mine) + along
    p = p + n * gather_row(surfaces.radius, 0, index, mine)
    return select3(mine, p, point), select3(mine, n, normal)


@kernel
def pdf_area_light(areas, surfaces, light, prim, mask, position, distance, cosine):
    """Return the density [1/sr] with which an area light is sampled in a direction.

    Parameters are lanes: the light and the primitive that it meets, the point that asks,
    the distance to the light and the |cosine| at it.
    """
    inverse_area = gather_row(areas.inverse_area, 0, light, mask)
    pdf = distance * distance * inverse_area / cosine
    return pdf_on_spheres(
        areas.spheres,
        areas,
        surfaces.spheres,
        light,
        prim,
        mask,
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
    p, n, mesh_side = sample_triangles(
        areas.triangles,
        areas.replay,
        surfaces.triangles,
        light,
        orientation,
        x,
        y,
        z,
        none,
        none,
    )
    p, n = _sample_rectangles(areas.rectangles, surfaces.rectangles, prim, mine, x, y, p, n)
    p, n = _sample_disks(areas.disks, surfaces.disks, prim, mine, x, y, p, n)
    p, n = _sample_cylinders(areas.cylinders, surfaces.cylinders, prim, mine, x, y, p, n)
    to_light, n = sample_spheres(
        areas.spheres,
        areas.replay,
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
    side = mesh_or(areas.triangles, light, mesh_side, n * orientation)
    usable = (dot(wi, side) < 0.0) & (pdf > 0.0)
    radiance = gather3(areas.radiance, light, mine) * select(usable, 1.0 / pdf, zero)
    return chosen(mine, LightSample(wi, r, radiance, pdf), sample)
