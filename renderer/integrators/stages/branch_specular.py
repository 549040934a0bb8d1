"""Stage 6 of a tree of rays: every mirrored and every refracted ray is followed."""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.scatter import append_rays, largest
from renderer.integrators.stages.surface.shading_frame import frame_at
from renderer.kernels.jit import count_of, kernel, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits, splat_f32, splat_i32
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import load3, vec3
from renderer.kernels.records.kernel_scene import RECORD, SPLIT
from renderer.plugins.bsdfs.kind import (
    DELTA,
    BsdfSample,
    outgoing,
    reflection_of,
    transmission_of,
)
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.sampling.arithmetic import to_local


@kernel
def append_branch(bsdf, settings, branch, frame, points, i, mine, rays, end):
    """Append the rays of a branch that are worth following; return the new end."""
    wo = load3(points.wo, i)
    throughput = load3(points.throughput, i) * branch.weight * branch.share
    brightest = largest(throughput)
    heavy = mine & (brightest > 0.0) & (brightest >= np.float32(settings.cutoff))
    none = splat_f32(0.0)
    local = vec3(none, none, branch.cos_t)  # a delta direction goes by its sign alone
    lobe = splat_i32(DELTA)
    chosen = BsdfSample(local, branch.weight, none, branch.eta, lobe)
    direction = outgoing(bsdf.form, bsdf.arithmetic, frame, wo, chosen)
    eta = load_row(points.eta, 0, i) * branch.eta
    return append_rays(rays, end, points, i, direction, throughput, none, eta, lobe, heavy)


@method_kernel
def split_mirror(bsdf, settings, points, start, stop, rays, end):
    """Follow the reflected rays of one kind; return the new end."""
    for i in range(start, stop, 16):
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        frame = frame_at(bsdf, points, i)
        wo = to_local(frame, load3(points.wo, i))
        parameters = parameters_at(bsdf.form, points, i)
        branch = reflection_of(parameters, wo)
        end = append_branch(bsdf, settings, branch, frame, points, i, mine, rays, end)
    return end


@method_kernel
def split_glass(bsdf, settings, points, start, stop, rays, end):
    """Follow the reflected and the refracted rays of one kind; return the new end."""
    for i in range(start, stop, 16):
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        frame = frame_at(bsdf, points, i)
        wo = to_local(frame, load3(points.wo, i))
        parameters = parameters_at(bsdf.form, points, i)
        branch = reflection_of(parameters, wo)
        end = append_branch(bsdf, settings, branch, frame, points, i, mine, rays, end)
        branch = transmission_of(parameters, wo)
        end = append_branch(bsdf, settings, branch, frame, points, i, mine, rays, end)
    return end


@kernel
def branch_specular(scene, work, start):
    """Append all branches to `work.rays` from `start` on; return how many there are."""
    methods, ends = scene.bsdfs.methods, work.ends
    end = start
    for kind in range(methods.shape[0]):
        if methods[kind, SPLIT] != 0:
            end = count_of(
                methods[kind, SPLIT],
                methods[kind, RECORD],
                (scene.settings, work.points, ends[kind], ends[kind + 1], work.rays, end),
            )
    return end - start
