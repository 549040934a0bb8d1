"""Volumes: the numbers of grids, inside of their cubes and beyond, against NumPy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.functions import first_lanes
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import load3, store3
from renderer.plugins.media.volumes import grid_tables, look_up_grid
from renderer.scene_file.media_description import GridVolume

WRAPS = {
    "clamp": lambda k, n: np.clip(k, 0, n - 1),
    "repeat": lambda k, n: k % n,
    "mirror": lambda k, n: np.minimum(k % (2 * n), 2 * n - 1 - k % (2 * n)),
}
SHAPES = (2, 3, 4, 1), (3, 1, 5, 3)  # z, y, x, channels
KINDS = list(itertools.product(("trilinear", "nearest"), WRAPS, range(len(SHAPES))))


@entry_kernel
def look_up(grids, grid, position, found):
    for i in range(0, grid.size, 16):
        color = look_up_grid(
            grids, load_row(grid, 0, i), load3(position, i), first_lanes(16)
        )
        store3(found, i, color)


def volume(filter_type, wrap, which):
    """Return a grid of random numbers, turned, stretched and moved."""
    rng = np.random.default_rng(which)
    to_world = np.eye(4)
    to_world[:3, :3] = [[1.8, -0.4, 0.0], [0.3, 0.9, 0.2], [0.0, 0.1, -1.2]]
    to_world[:3, 3] = [0.5, -1.0, 2.0]
    values = rng.uniform(0.1, 1.0, SHAPES[which]).astype(np.float32)
    return GridVolume(values, to_world, filter_type, wrap)


def expected_at(grid, local):
    """Return colours (n, channels) at points (n, 3) of the unit cube, and beyond it."""
    counts = np.array(grid.values.shape[2::-1])
    wrap = WRAPS[grid.wrap_mode]

    def of_cells(cells):
        x, y, z = (wrap(k, n) for k, n in zip(cells.T, counts, strict=True))
        return grid.values[z, y, x]

    if grid.filter_type == "nearest":
        return of_cells(np.floor(local * counts).astype(int))
    place = local * counts - 0.5
    low = np.floor(place).astype(int)
    part, total = place - low, 0.0
    for corner in itertools.product((0, 1), repeat=3):
        weights = np.where(corner, part, 1.0 - part).prod(axis=1)
        total = total + weights[:, None] * of_cells(low + corner)
    return total


@pytest.mark.parametrize("reach", [0.0, 2.5])
def test_numbers_are_those_of_numpy(reach):
    """In the cube and up to 2.5 of its edges beyond, not next to a face."""
    rng = np.random.default_rng(7)
    grids = [volume(*kind) for kind in KINDS]
    local = rng.uniform(-reach, 1.0 + reach, (256, 3))
    near = np.array([local * n for n in (1, 2, 3, 4, 5)])
    local = local[(np.abs(near - np.round(near)) > 1e-4).all(axis=(0, 2))]
    local = local[: len(local) // 16 * 16]
    (to_world,) = {grid.to_world.tobytes(): grid.to_world for grid in grids}.values()
    world = local @ to_world[:3, :3].T + to_world[:3, 3]
    position = np.ascontiguousarray(world.T, np.float32)
    tables = grid_tables(grids)
    for k, grid in enumerate(grids):
        found = np.zeros_like(position)
        look_up(tables, np.full(len(local), k, np.int32), position, found)
        expected = np.broadcast_to(expected_at(grid, local), (len(local), 3))
        np.testing.assert_allclose(found.T, expected, atol=2e-5, err_msg=str(KINDS[k]))
