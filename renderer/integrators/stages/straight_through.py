"""Samples that have met nothing but holes: in Mitsuba's `path` they count for nothing.

A ray goes straight on through `null`, `thindielectric` and the holes of a `mask`. If a path
has done no more than that when it ends, at no lamp, and if there is no environment or
`hide_emitters` hides it, then its sample is transparent, and black: through the holes of a
leaf the sky is hidden as it is behind the leaf. Light that was sampled at the rim of a hole
is lost with it, as in Mitsuba. `direct` and `whitted` have no such rule.

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
    """Let those paths alone be marked that have gone straight on since the camera."""
    for k in range(count):
        if rays.lobe[k] != STRAIGHT:
            rays.met[rays.slot[k]] &= ~HOLES_ALONE


@kernel
def drop_transparent(scene, work, count, last):
    """Blacken the samples of marked paths that end here; `last`: also those that hit."""
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
