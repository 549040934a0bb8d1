"""How many cells a grid has along x, y and z: the cube root rule [Cleary1988]."""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.local import local_i32

# Cells for each primitive. A density of one makes the cube root of n cells along each
# edge, as the lecture has it; the best one is a constant [Cleary1988]. Cells visited and
# primitives tested per ray from afar, mesh of 81,920 triangles: 17 and 45 at a density of
# 1, 27 and 25 at 4, 34 and 19 at 8; a step costs a third to half of a test.
DENSITY = 4.0


@kernel
def choose_resolution(low, high, wanted, shortest, resolution):
    """Write the numbers of cells along x, y, z of a box: at most `wanted` in all.

    The cells are as near to cubes as can be. An axis too short for one such cube gets one
    cell, and the others share what is wanted: its square root along each edge of a flat
    scene. No cell gets edges below `shortest`.
    """
    shares = local_i32(3)
    shares[:] = 1
    sharing = 3
    per_length = 0.0
    while sharing > 0:
        measure = 1.0
        least = 0
        for axis in range(3):
            if shares[axis]:
                measure *= high[axis] - low[axis]
                if not shares[least] or high[axis] - low[axis] < high[least] - low[least]:
                    least = axis
        per_length = (wanted / measure) ** (1.0 / sharing)
        if (high[least] - low[least]) * per_length >= 1.0:
            break
        shares[least] = 0
        sharing -= 1
    for axis in range(3):
        edge = high[axis] - low[axis]
        cells = min(edge * per_length, edge / shortest)
        resolution[axis] = max(np.int64(cells), 1) if shares[axis] else 1


@kernel
def coarsen(resolution):
    """Halve the numbers of cells; return False if there is just one."""
    if cell_count(resolution) == 1:
        return False
    for axis in range(3):
        resolution[axis] = (resolution[axis] + 1) // 2
    return True


@kernel
def cell_count(resolution):
    """Return the number of cells of a grid."""
    return np.int64(resolution[0]) * resolution[1] * resolution[2]
