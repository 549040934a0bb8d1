"""Stage 6, scattering: the path goes on in a direction that the BSDF chooses.

There is one kernel for each kind of BSDF, and it is empty for a scene without that kind: it
is given None for its table then, as it is where rays end at diffuse surfaces. `kinds` are
those of all BSDFs, by BSDF id.
"""

from __future__ import annotations

import numpy as np

from renderer.bsdfs.diffuse import diffuse_albedo, pdf_diffuse, sample_diffuse
from renderer.bsdfs.fresnel import fresnel_conductor, fresnel_dielectric
from renderer.bsdfs.mirror import reflect, refract
from renderer.jit import kernel
from renderer.kernel_scene import CONDUCTOR, DIELECTRIC, DIFFUSE
from renderer.lanes.functions import (
    first_lanes,
    lane_index,
    mask_bits,
    maximum,
    minimum,
    popcount,
    select,
    splat_f32,
)
from renderer.lanes.memory import append_row, gather_row, load_row
from renderer.sampling import BLOCKS_PER_BOUNCE, draw4
from renderer.stages.shading_frame import facing, leave_surface, tangents_of
from renderer.stages.tile import pixel_key
from renderer.vectors import append3, dot, gather3, load3, select3, vec3

_MOST = np.float32(0.95)  # a path never survives roulette for certain


@kernel
def _largest(color):
    return maximum(maximum(color.x, color.y), color.z)


@kernel
def _heavy(weight, cutoff):
    """Return where a ray of some weight is worth following."""
    largest = _largest(weight)
    return (largest > 0.0) & (largest >= cutoff)


@kernel
def _survive(roulette_depth, depth, throughput, eta, number, alive):
    """Play Russian roulette; return who survives and their raised throughput.

    The survival probability undoes the eta^2 that radiance loses on entering glass, as
    it will be gained again on leaving.
    """
    if roulette_depth is None:
        return alive, throughput
    if depth < roulette_depth:
        return alive, throughput
    survival = minimum(_largest(throughput) * eta * eta, splat_f32(_MOST))
    return alive & (number < survival), throughput / survival


@kernel
def _append_previous(previous, rays, end, points, i, alive):
    if previous is None:
        return
    append3(previous, end, load3(points.position, i), alive)
    append_row(rays.point, 0, end, lane_index() + i, alive)


@kernel
def append_rays(rays, end, points, i, direction, throughput, pdf, eta, alive):
    """Append the rays of the masked lanes to `rays`; return the new end."""
    append3(rays.origin, end, leave_surface(points, i, direction), alive)
    append3(rays.direction, end, direction, alive)
    append3(rays.throughput, end, throughput, alive)
    append_row(rays.pdf, 0, end, pdf, alive)
    append_row(rays.eta, 0, end, eta, alive)
    append_row(rays.slot, 0, end, load_row(points.slot, 0, i), alive)
    _append_previous(rays.previous, rays, end, points, i, alive)
    return end + popcount(mask_bits(alive))


@kernel
def scatter_diffuse(
    diffuse,
    sampler,
    settings,
    shapes,
    kinds,
    tile,
    sample,
    bounce,
    points,
    start,
    stop,
    rays,
    end,
):
    """Send paths on from diffuse points, by the cosine; return the new end of `rays`."""
    if diffuse is None:
        return end
    block = 1 + bounce * BLOCKS_PER_BOUNCE
    for i in range(start, stop, 16):
        face = facing(shapes, kinds, points, i, first_lanes(stop - i), DIFFUSE)
        if mask_bits(face.mine) == 0:
            continue
        slot = load_row(points.slot, 0, i)
        x, y, _, roulette = draw4(sampler, pixel_key(tile, slot), sample, block)
        normal = load3(points.shading_normal, i)
        s, t = tangents_of(points.tangent, i, normal)
        normal = select3(face.front, normal, -normal)
        direction, cos_i = sample_diffuse(settings.replay, s, t, normal, x, y)
        u = load_row(points.uv, 0, i)
        v = load_row(points.uv, 1, i)
        albedo = diffuse_albedo(diffuse, face.bsdf, u, v, face.mine)
        throughput = load3(points.throughput, i) * albedo
        eta = load_row(points.eta, 0, i)
        alive = face.mine & (_largest(throughput) > 0.0) & (cos_i > 0.0)
        alive, throughput = _survive(
            settings.roulette_depth, bounce + 1, throughput, eta, roulette, alive
        )
        pdf = pdf_diffuse(cos_i)
        end = append_rays(rays, end, points, i, direction, throughput, pdf, eta, alive)
    return end


@kernel
def conductor_reflectance(conductor, bsdf, cos_i, mask):
    """Return Fresnel's reflectance of 16 metals, for each colour."""
    eta = gather3(conductor.eta, bsdf, mask)
    k = gather3(conductor.k, bsdf, mask)
    fresnel = vec3(
        fresnel_conductor(cos_i, eta.x, k.x),
        fresnel_conductor(cos_i, eta.y, k.y),
        fresnel_conductor(cos_i, eta.z, k.z),
    )
    return gather3(conductor.reflectance, bsdf, mask) * fresnel


@kernel
def scatter_conductor(
    conductor,
    sampler,
    settings,
    shapes,
    kinds,
    tile,
    sample,
    bounce,
    points,
    start,
    stop,
    rays,
    end,
):
    """Send paths on by mirror reflection; return the new end of `rays`."""
    if conductor is None:
        return end
    block = 1 + bounce * BLOCKS_PER_BOUNCE
    for i in range(start, stop, 16):
        face = facing(shapes, kinds, points, i, first_lanes(stop - i), CONDUCTOR)
        if mask_bits(face.mine) == 0:
            continue
        slot = load_row(points.slot, 0, i)
        _, _, _, roulette = draw4(sampler, pixel_key(tile, slot), sample, block)
        normal = load3(points.shading_normal, i)
        normal = select3(face.front, normal, -normal)
        wo = load3(points.wo, i)
        reflectance = conductor_reflectance(
            conductor, face.bsdf, dot(wo, normal), face.mine
        )
        throughput = load3(points.throughput, i) * reflectance
        eta = load_row(points.eta, 0, i)
        alive = face.mine & _heavy(throughput, np.float32(settings.cutoff))
        alive, throughput = _survive(
            settings.roulette_depth, bounce + 1, throughput, eta, roulette, alive
        )
        mirrored = reflect(wo, normal)
        none = splat_f32(0.0)
        end = append_rays(rays, end, points, i, mirrored, throughput, none, eta, alive)
    return end


@kernel
def scatter_dielectric(
    dielectric,
    sampler,
    settings,
    shapes,
    kinds,
    tile,
    sample,
    bounce,
    points,
    start,
    stop,
    rays,
    end,
):
    """Send each path on by reflection or refraction, at random in proportion."""
    if dielectric is None:
        return end
    block = 1 + bounce * BLOCKS_PER_BOUNCE
    for i in range(start, stop, 16):
        face = facing(shapes, kinds, points, i, first_lanes(stop - i), DIELECTRIC)
        if mask_bits(face.mine) == 0:
            continue
        slot = load_row(points.slot, 0, i)
        _, _, choice, roulette = draw4(sampler, pixel_key(tile, slot), sample, block)
        normal = load3(points.shading_normal, i)
        wo = load3(points.wo, i)
        index = gather_row(dielectric.eta, 0, face.bsdf, face.mine)
        fresnel, cos_t, crossing = fresnel_dielectric(dot(wo, normal), index)
        reflected = choice < fresnel
        direction = select3(
            reflected, reflect(wo, normal), refract(wo, normal, cos_t, crossing)
        )
        # radiance is squeezed by eta^2 where the light comes from a denser medium
        squeeze = 1.0 / (crossing * crossing)
        weight = select3(
            reflected,
            gather3(dielectric.reflectance, face.bsdf, face.mine),
            gather3(dielectric.transmittance, face.bsdf, face.mine) * squeeze,
        )
        throughput = load3(points.throughput, i) * weight
        eta = load_row(points.eta, 0, i)
        eta = select(reflected, eta, eta * crossing)
        alive = face.mine & (_largest(throughput) > 0.0)
        alive, throughput = _survive(
            settings.roulette_depth, bounce + 1, throughput, eta, roulette, alive
        )
        none = splat_f32(0.0)
        end = append_rays(rays, end, points, i, direction, throughput, none, eta, alive)
    return end


@kernel
def split_dielectric(dielectric, settings, shapes, kinds, points, start, stop, rays, end):
    """Follow both the reflected and the refracted ray (Whitted); return the new end.

    A ray of less weight than the cut-off is dropped.
    """
    if dielectric is None:
        return end
    cutoff = np.float32(settings.cutoff)
    for i in range(start, stop, 16):
        face = facing(shapes, kinds, points, i, first_lanes(stop - i), DIELECTRIC)
        if mask_bits(face.mine) == 0:
            continue
        normal = load3(points.shading_normal, i)
        wo = load3(points.wo, i)
        index = gather_row(dielectric.eta, 0, face.bsdf, face.mine)
        fresnel, cos_t, crossing = fresnel_dielectric(dot(wo, normal), index)
        throughput = load3(points.throughput, i)
        eta = load_row(points.eta, 0, i)
        none = splat_f32(0.0)

        reflection = (
            throughput * gather3(dielectric.reflectance, face.bsdf, face.mine) * fresnel
        )
        heavy = face.mine & _heavy(reflection, cutoff)
        mirrored = reflect(wo, normal)
        end = append_rays(rays, end, points, i, mirrored, reflection, none, eta, heavy)

        squeeze = (1.0 - fresnel) / (crossing * crossing)
        refraction = (
            throughput * gather3(dielectric.transmittance, face.bsdf, face.mine) * squeeze
        )
        heavy = face.mine & _heavy(refraction, cutoff)
        bent = refract(wo, normal, cos_t, crossing)
        end = append_rays(
            rays, end, points, i, bent, refraction, none, eta * crossing, heavy
        )
    return end
