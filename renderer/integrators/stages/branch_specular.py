"""Stage 6 of `whitted`: both the reflected and the refracted ray are followed."""

from __future__ import annotations

import numpy as np

from renderer.integrators.stages.scatter import append_rays, largest
from renderer.integrators.stages.surface import local_wo, world_direction
from renderer.kernels.jit import count_of, kernel, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits, splat_f32
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import load3
from renderer.kernels.records.kernel_scene import RECORD, SPLIT
from renderer.plugins.bsdfs.kind import SMOOTH, Numbers, lobe_of, sample_bsdf
from renderer.plugins.bsdfs.parameters import parameters_at

_LARGEST = np.float32(1.0 - 2.0**-24)  # the largest random number in [0, 1)


@kernel
def _append_branch(bsdf, settings, branch, frame, points, i, mine, rays, end):
    """Append the rays of a delta lobe above the cutoff; return the new end."""
    # weight * pdf: the lobe's value without its selection probability
    throughput = load3(points.throughput, i) * branch.weight * branch.pdf
    brightest, lobe = largest(throughput), lobe_of(branch)
    heavy = mine & (brightest > 0.0) & (brightest >= np.float32(settings.cutoff))
    heavy &= lobe != SMOOTH
    direction = world_direction(bsdf, frame, branch.wi)
    none, eta = splat_f32(0.0), load_row(points.eta, 0, i) * branch.eta
    return append_rays(rays, end, points, i, direction, throughput, none, eta, lobe, heavy)


@method_kernel
def split(bsdf, settings, points, start, stop, rays, end):
    """Append the delta lobes of one kind of BSDF, at most two each; return the new end.

    The lobe-selection number 0 gives one lobe of `sample`, the largest gives the other.
    """
    none = splat_f32(0.0)
    for i in range(start, stop, 16):
        mine = first_lanes(stop - i) & (load_row(points.bsdf, 0, i) >= 0)
        if mask_bits(mine) == 0:
            continue
        frame, wo = local_wo(bsdf, points, i)
        parameters = parameters_at(bsdf.form, points, i)
        least = Numbers(none, none, none, bsdf.arithmetic)
        one = sample_bsdf(parameters, wo, least)
        end = _append_branch(bsdf, settings, one, frame, points, i, mine, rays, end)
        if bsdf.both_sides is not None:  # compile-time constant
            most = Numbers(none, none, none + _LARGEST, bsdf.arithmetic)
            other = sample_bsdf(parameters, wo, most)
            both = mine & ((one.wi.z > 0.0) ^ (other.wi.z > 0.0))
            end = _append_branch(bsdf, settings, other, frame, points, i, both, rays, end)
    return end


@kernel
def branch_specular(scene, work, start):
    """Append all branches to `work.rays` from `start` on; return their number."""
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
