"""Samples that have met nothing but holes: in Mitsuba's `path` they count for nothing.

A ray goes straight on through `null`, `thindielectric` and the holes of a `mask`. If a path
has done no more than that when it ends, at no lamp, and if there is no environment or
`hide_emitters` hides it, then its sample is transparent, and black: through the holes of a
leaf the sky is hidden as it is beside the leaf. Light that was sampled at the rim of a hole
is lost with it, as in Mitsuba. `direct` and `whitted` have no such rule.

A negative density marks such a ray. Where Russian roulette or a black tint ends the path at
the hole itself, the light sampled there stays.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.records.kernel_scene import EMIT


@kernel
def mark_camera_rays(rays, count):
    """Mark rays that have met nothing at all yet."""
    for k in range(count):
        rays.pdf[k] = np.float32(-1.0)


@kernel
def keep_marks(rays, points, count):
    """Let those rays alone be marked that have gone straight on since the camera."""
    for k in range(count):
        if rays.pdf[k] < 0.0 and not points.pdf[rays.point[k]] < 0.0:
            rays.pdf[k] = np.float32(0.0)


@kernel
def drop_transparent(scene, work, count, last):
    """Blacken the samples of marked rays that end here; `last`: also those that hit."""
    rays, hits, radiance = work.rays, work.hits, work.radiance
    for k in range(count):
        if not rays.pdf[k] < 0.0:
            continue
        prim = hits.prim[k]
        if prim >= 0:
            lamp = (scene.primitives.stages[prim] & EMIT) != 0
            if not last or (lamp and scene.settings.hide_emitters == 0):
                continue
        for channel in range(radiance.shape[0]):
            radiance[channel, rays.slot[k]] = 0.0
