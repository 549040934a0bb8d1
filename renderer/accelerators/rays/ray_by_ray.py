"""The two loops over rays that go one by one, for structures that know one traversal.

A shadow ray is a ray with an end, for which the first hit found will do. `any_will_do` is a
number, not a literal, so that Numba types a traversal once for both loops; LLVM knows its
value in each. Beside traversals for shadow rays alone these took 0.98 (grid), 0.99
(kd-tree), 1.02 (octree) and 1.05 times (BSP tree) as long when it was a literal; where it
was more, in a BVH and by brute force, there are two.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.rays.single_ray import RayHit, load_hit, store_hit
from renderer.kernels.jit import interface, kernel, method_kernel
from renderer.kernels.lanes.vectors import column


@interface
def trace_ray(accel, origin, direction, hit, any_will_do, tally, i):
    """Return the nearest hit of one ray, or the first one found if any will do."""


@method_kernel
def closest_hit_ray_by_ray(accel, rays, hits, first, count, tally):
    """Update `hits` of rays first to first + count - 1 with nearer hits."""
    for i in range(first, first + count):
        origin, direction = column(rays.origin, i), column(rays.direction, i)
        hit = trace_ray(accel, origin, direction, load_hit(hits, i), np.int64(0), tally, i)
        store_hit(hits, i, hit)


@method_kernel
def any_hit_ray_by_ray(accel, shadow_rays, count, tally):
    """Set `blocked` of the first `count` shadow rays that meet a primitive before t_max."""
    for i in range(count):
        if shadow_rays.blocked[i] != 0:
            continue
        origin = column(shadow_rays.origin, i)
        direction = column(shadow_rays.direction, i)
        hit = _no_hit_before(shadow_rays.t_max[i])
        hit = trace_ray(accel, origin, direction, hit, np.int64(1), tally, i)
        if hit.prim >= 0:
            shadow_rays.blocked[i] = 1


@kernel
def _no_hit_before(t_max):
    """Return what a ray has found that ends at t_max and has met nothing."""
    return RayHit(t_max, np.int32(-1), np.float32(0.0), np.float32(0.0))
