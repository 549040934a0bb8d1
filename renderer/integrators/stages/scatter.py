"""Stage 6, scattering: sample the BSDF and append the next ray of each path.

The local frame, Russian roulette and compaction are the same for all BSDFs. The stage is
compiled once for each kind of BSDF, with the formulas of that kind.
"""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.surface import leave_surface, local_wo, world_direction
from renderer.kernels.jit import call, count_of, kernel, method_kernel
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    lane_index,
    mask_bits,
    maximum,
    minimum,
    popcount,
    select,
    splat_f32,
)
from renderer.kernels.lanes.memory import append_row, load_row
from renderer.kernels.lanes.vectors import append3, load3, vec3
from renderer.kernels.records.kernel_scene import (
    AFTER_SCATTERING,
    DRAW,
    RECORD,
    SCATTER,
)
from renderer.plugins.bsdfs.kind import SMOOTH, Numbers, lobe_of, sample_bsdf
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.sampling.numbers_and_warps import BLOCKS_PER_BOUNCE

MOST_SURVIVAL = np.float32(0.95)  # upper bound of the survival probability


@kernel
def largest(color):
    """Return the largest component of colours."""
    return maximum(maximum(color.x, color.y), color.z)


@kernel
def survive(settings, depth, throughput, eta, number, alive):
    """Play Russian roulette; return the surviving lanes and the compensated throughput.

    The factor eta^2 in the survival probability cancels the loss of radiance on entering
    glass, which is regained on leaving. Before `roulette_depth` only paths whose
    throughput is below 1 / `survival_scale` may end.
    """
    if depth < settings.dim_depth:
        return alive, throughput
    survival, most = largest(throughput) * eta * eta, MOST_SURVIVAL
    if depth < settings.roulette_depth:
        size = vec3(fabs(throughput.x), fabs(throughput.y), fabs(throughput.z))
        survival, most = largest(size) * eta * eta, np.float32(1.0)
    survival = minimum(survival * settings.survival_scale, splat_f32(most))
    return alive & (number < survival), throughput / survival


@kernel
def append_rays(rays, end, points, i, direction, throughput, pdf, eta, lobe, alive):
    """Append the rays of the masked lanes to `rays`; return the new end."""
    append3(rays.origin, end, leave_surface(points, i, direction), alive)
    append3(rays.direction, end, direction, alive)
    append3(rays.throughput, end, throughput, alive)
    append_row(rays.pdf, 0, end, pdf, alive)
    append_row(rays.eta, 0, end, eta, alive)
    append_row(rays.lobe, 0, end, lobe, alive)
    append_row(rays.slot, 0, end, load_row(points.slot, 0, i), alive)
    append_row(rays.point, 0, end, lane_index() + np.int32(i), alive)
    return end + popcount(mask_bits(alive))


@method_kernel
def scatter_kind(bsdf, settings, bounce, points, numbers, start, stop, rays, end):
    """Sample the BSDFs at points start .. stop - 1 of one kind; return the new end."""
    for i in range(start, stop, 16):
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        # BSDF sample, in the local frame
        frame, wo = local_wo(bsdf, points, i)
        drawn = Numbers(
            load_row(numbers, 0, i),
            load_row(numbers, 1, i),
            load_row(numbers, 2, i),
            bsdf.arithmetic,
        )
        parameters = parameters_at(bsdf.form, points, i)
        chosen = sample_bsdf(parameters, wo, drawn)

        # throughput and roulette
        throughput = load3(points.throughput, i) * chosen.weight
        eta = load_row(points.eta, 0, i) * chosen.eta
        # images may give negative reflectances; as in Mitsuba only 0 ends a path
        alive = mine & (chosen.pdf > 0.0) & (fabs(largest(throughput)) > 0.0)
        alive, throughput = survive(
            settings, bounce + 1, throughput, eta, load_row(numbers, 3, i), alive
        )

        # the next ray
        direction = world_direction(bsdf, frame, chosen.wi)
        lobe = lobe_of(chosen)
        pdf = select(lobe == SMOOTH, chosen.pdf, 0.0)  # pdf 0 marks a delta lobe: no MIS
        end = append_rays(
            rays, end, points, i, direction, throughput, pdf, eta, lobe, alive
        )
    return end


@kernel
def scatter(scene, tile, sample, bounce, work):
    """Sample the BSDFs at the surface points; return how many paths continue."""
    block = 1 + bounce * BLOCKS_PER_BOUNCE
    return scatter_by(scene, tile, sample, block, bounce, work)


@kernel
def scatter_by(scene, tile, sample, block, bounce, work):
    """Do so with the random numbers of `block`; bounce -1 plays no roulette."""
    methods, points, ends = scene.bsdfs.methods, work.points, work.ends
    kinds = methods.shape[0]
    call(
        scene.sampler[0, DRAW],
        scene.sampler[0, RECORD],
        (
            tile,
            sample,
            block,
            points.slot,
            ends[kinds],
            work.numbers,
        ),
    )
    end = np.int64(0)
    for kind in range(kinds):
        if methods[kind, SCATTER] != 0:
            end = count_of(
                methods[kind, SCATTER],
                methods[kind, RECORD],
                (
                    scene.settings,
                    bounce,
                    points,
                    work.numbers,
                    ends[kind],
                    ends[kind + 1],
                    work.rays,
                    end,
                ),
            )
    after = scene.hooks
    if after[AFTER_SCATTERING, 1] != 0:
        call(
            after[AFTER_SCATTERING, 1],
            after[AFTER_SCATTERING, RECORD],
            (scene.settings, work.rays, end, points),
        )
    return end
