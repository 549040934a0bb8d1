"""The work that the camera rays cost: counters of the accelerators instead of light."""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.records.tally import ROWS
from renderer.stages.camera_rays import camera_rays
from renderer.stages.intersect import intersect

CHANNELS = ROWS  # of `work.radiance` in this integrator: the tally's rows


@kernel
def trace_work(scene, tile, sample, work):
    """Write the counts of one camera ray for each pixel of a tile to `work.radiance`."""
    rays, tally = work.rays, work.tally
    count = camera_rays(scene, tile, sample, work)
    tally[:] = 0
    intersect(scene.camera_groups, rays, work.hits, np.int64(0), count, True, tally)
    for i in range(count):
        for row in range(ROWS):
            work.radiance[row, rays.slot[i]] = tally[row, i]
