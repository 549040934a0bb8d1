"""Samples that pass through holes only: Mitsuba's `path` makes them black.

A ray passes undeflected through `null`, `thindielectric` and the holes of a `mask`. A
sample is transparent, and black, if its path has only done so when it ends without hitting
a lamp, and if there is no environment or `hide_emitters` hides it. With a hidden sky a
hole in a leaf is as black as the sky around the leaf. Light sampled at the blurred rim
of a hole is lost with the sample, as in Mitsuba. `direct` and `whitted` have no such
rule.

Where Russian roulette or a black tint ends the path at the hole itself, the light sampled
there stays.
"""

from __future__ import annotations

from renderer.kernels.jit import kernel
from renderer.kernels.records.batch import HOLES_ALONE
from renderer.kernels.records.kernel_scene import EMIT
from renderer.plugins.bsdfs.kind import STRAIGHT


@kernel
def keep_marks(rays, count):
    """Unmark the paths that have scattered; only paths through holes stay marked."""
    for k in range(count):
        if rays.lobe[k] != STRAIGHT:
            rays.met[rays.slot[k]] &= ~HOLES_ALONE


@kernel
def drop_transparent(scene, work, count, last):
    """Blacken the marked samples whose paths end here; with `last`, at surfaces too."""
    rays, hits, radiance = work.rays, work.hits, work.radiance
    for k in range(count):
        if rays.met[rays.slot[k]] & HOLES_ALONE == 0:
            continue
        prim = hits.prim[k]
        if prim >= 0:
            lamp = (scene.primitives.stages[prim] & EMIT) != 0
            if not last or (lamp and scene.settings.hide_emitters == 0):
                continue
        for channel in range(radiance.shape[0]):
            radiance[channel, rays.slot[k]] = 0.0
