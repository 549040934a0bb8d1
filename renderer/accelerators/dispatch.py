"""`closest_hit(accel, ...)` and `any_hit(accel, ...)`: resolved by the accelerator's type.

There is no branch at run time; a scene that has no group of some kind passes None and
nothing is compiled for it.
"""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.extending import overload

from renderer.accelerators.brute_force import (
    BruteForce,
    any_hit_brute_force,
    closest_hit_brute_force,
)
from renderer.accelerators.bvh import (
    Bvh,
    any_hit_bvh,
    any_hit_bvh_packets,
    closest_hit_bvh,
    closest_hit_bvh_packets,
)
from renderer.jit import record_class

# accelerator -> (closest hit of coherent, of incoherent rays, any hit of both)
_TRAVERSALS = {
    BruteForce: (
        closest_hit_brute_force,
        closest_hit_brute_force,
        any_hit_brute_force,
        any_hit_brute_force,
    ),
    Bvh: (closest_hit_bvh_packets, closest_hit_bvh, any_hit_bvh_packets, any_hit_bvh),
}


def closest_hit(
    accel: Any, rays: Any, hits: Any, first: int, count: int, coherent: bool
) -> None:
    """Update the hits of `count` rays with the nearer ones among this group."""
    raise TypeError("inside kernels only")


def any_hit(accel: Any, shadow_rays: Any, count: int, coherent: bool) -> None:
    """Set `blocked` of the shadow rays that meet something of this group."""
    raise TypeError("inside kernels only")


@overload(closest_hit)
def _closest_hit(accel, rays, hits, first, count, coherent):
    if isinstance(accel, types.NoneType):
        return lambda accel, rays, hits, first, count, coherent: None
    traversals = _TRAVERSALS.get(record_class(accel))
    if traversals is None:
        return None
    together, single = traversals[:2]

    def choose(accel, rays, hits, first, count, coherent):
        if coherent:
            together(accel, rays, hits, first, count)
        else:
            single(accel, rays, hits, first, count)

    return choose


@overload(any_hit)
def _any_hit(accel, shadow_rays, count, coherent):
    if isinstance(accel, types.NoneType):
        return lambda accel, shadow_rays, count, coherent: None
    traversals = _TRAVERSALS.get(record_class(accel))
    if traversals is None:
        return None
    together, single = traversals[2:]

    def choose(accel, shadow_rays, count, coherent):
        if coherent:
            together(accel, shadow_rays, count)
        else:
            single(accel, shadow_rays, count)

    return choose
