"""Paths without caustics: light that mirrors or glass have thrown on a rough surface.

Seen from the camera: after a smooth lobe come mirrors or glass, and then a lamp or the sky.
Going straight on, through a hole or a thin pane, is neither. Such paths go on; what they
find there is not added. These methods stand in the tables of simplified scenes alone.
"""

from __future__ import annotations

from typing import NamedTuple

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.records.batch import CAUSTIC, ROUGH
from renderer.plugins.bsdfs.kind import DELTA, SMOOTH
from renderer.plugins.lights.finite.area import add_emission
from renderer.plugins.lights.infinite.environment import add_environment


class CausticMarks(NamedTuple):
    """The record that the hook belongs to; it holds nothing."""


@method_kernel
def mark_caustics(marks, settings, rays, end, points):
    """Note what the paths of the first `end` rays have met, which have just left it."""
    for k in range(end):
        slot, lobe = rays.slot[k], rays.lobe[k]
        if lobe == SMOOTH:
            rays.met[slot] = (rays.met[slot] | ROUGH) & ~CAUSTIC
        elif lobe == DELTA and rays.met[slot] & ROUGH != 0:
            rays.met[slot] |= CAUSTIC


@kernel
def _blacken(throughput, i):
    for c in range(3):
        throughput[c, i] = 0.0


@method_kernel
def add_emission_but_caustics(kind, settings, lights, shapes, points, count, radiance):
    """Do as `add_emission`; the points are there for it alone."""
    for i in range(count):
        if points.met[points.slot[i]] & CAUSTIC != 0:
            _blacken(points.throughput, i)
    add_emission(kind, settings, lights, shapes, points, count, radiance)


@method_kernel
def add_environment_but_caustics(
    kind, settings, lights, rays, hits, first, count, radiance
):
    """Do as `add_environment`; rays that have hit nothing end here."""
    for i in range(first, first + count):
        if hits.prim[i] < 0 and rays.met[rays.slot[i]] & CAUSTIC != 0:
            _blacken(rays.throughput, i)
    add_environment(kind, settings, lights, rays, hits, first, count, radiance)
