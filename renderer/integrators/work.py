"""`work`: the traversal counters of the camera rays instead of radiance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.kind import Case, Decision, IntegratorKind, Shown
from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.film import heat_map
from renderer.integrators.stages.intersect import intersect
from renderer.kernels.jit import method_kernel
from renderer.kernels.records.batch import ROWS
from renderer.scene_file.description import Integrator

COLOURS = (
    "box tests and primitive tests per ray, from 0 (black) to the pixel with the most "
    "(pale yellow), whose number is printed with the picture and kept in its metadata"
)


@method_kernel
def trace_work(scene, tile, sample, work):
    """Write the counters of one camera ray per pixel of a tile to `work.radiance`."""
    rays, tally = work.rays, work.tally
    count = camera_rays(scene, tile, sample, work, np.int64(0))
    tally[:] = 0
    intersect(scene.camera_groups, rays, work.hits, np.int64(0), count, True, tally)
    for i in range(count):
        for row in range(ROWS):
            work.radiance[row, rays.slot[i]] = tally[row, i]


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    say("method", "work: what camera rays cost; nothing is shaded")
    say("colours", COLOURS)
    say("filter", "box, whatever the file names: counts stay in their pixel")
    return Decision("work")


def _show(film: NDArray[Any], requested: Integrator) -> Shown:
    pixels, aovs, brightest = heat_map(film)
    tests = f"{brightest:.6g} box and primitive tests per ray"
    return Shown(pixels, aovs, notes={"brightest": tests})


INTEGRATOR = IntegratorKind(
    "nodes, box tests and primitive tests of the search for the nearest hit",
    trace_work,
    _decide,
    channels=ROWS,  # channels of `work.radiance`: the rows of the tally
    show=_show,
    counts_work=True,
)
