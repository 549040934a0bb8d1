"""The coarse cells of heterogeneous media hold bounds of what is in them."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.plugins.media.majorants import cell_bounds, world_box
from renderer.scene_file.media_description import ConstantVolume, GridVolume, Medium


@pytest.mark.parametrize("filter_type", ["trilinear", "nearest"])
@pytest.mark.parametrize("wrap", ["clamp", "repeat", "mirror"])
def test_the_bounds_of_a_cell_hold_in_it(wrap, filter_type):
    """At 20000 places in the world's box of a turned grid, by the grid's own numbers."""
    rng = np.random.default_rng(8)
    turned = np.eye(4)
    turned[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] @ np.diag([3.0, 1.0, 2.0])
    turned[:3, 3] = 0.4, -0.2, 0.1
    values = (rng.uniform(0.0, 1.0, (5, 7, 6, 3)) ** 4).astype(np.float32)
    grid = GridVolume(values, turned, filter_type, wrap)
    size, bounds = cell_bounds(
        Medium("heterogeneous", grid, ConstantVolume((1.0,) * 3), 9.0)
    )
    assert size.min() > 3
    low, high = np.split(world_box(turned), 2)
    places = rng.uniform(low, high, (20000, 3))
    x, y, z = np.minimum((places - low) / (high - low) * size, size - 1).astype(int).T
    largest, smallest = bounds[:, (z * size[1] + y) * size[0] + x]
    found = 9.0 * numbers_at(grid, places)
    assert (found.max(axis=1) <= largest).all()
    assert (found.min(axis=1) >= smallest).all()
    assert (largest < 0.99 * 9.0 * values.max()).any()


def numbers_at(grid, places):
    """Return a grid's colours at places of the world, one cell after the other."""
    counts = np.array(grid.values.shape[2::-1])
    inverse = np.linalg.inv(grid.to_world)
    local = (places @ inverse[:3, :3].T + inverse[:3, 3]) * counts
    local = local if grid.filter_type == "nearest" else local - 0.5
    first = np.floor(local).astype(int)
    part = np.where(grid.filter_type == "nearest", 0.0, local - first)
    total = np.zeros_like(places)
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(corner, part, 1.0 - part).prod(axis=1)
        cell = first + corner
        if grid.wrap_mode == "clamp":
            cell = np.clip(cell, 0, counts - 1)
        elif grid.wrap_mode == "repeat":
            cell %= counts
        else:
            cell %= 2 * counts
            cell = np.where(cell >= counts, 2 * counts - 1 - cell, cell)
        total += weight[:, None] * grid.values[cell[:, 2], cell[:, 1], cell[:, 0]]
    return total


def test_the_bounds_hold_where_coordinates_are_large():
    """At 10^5 a float32 has steps of 0.008, and cells are 0.0125 wide.

    A ray may be in the next cell already: all places within a step are bounded.
    """
    place = np.eye(4)
    place[:3, :3] *= 0.2
    place[:3, 3] = 1e5
    values = np.zeros((2, 2, 40, 1), np.float32)
    values[:, :, 21:] = 1.0  # from x = 0.105 on
    grid = GridVolume(values, place, "nearest")
    medium = Medium("heterogeneous", grid, ConstantVolume((1.0,) * 3), 100.0)
    size, bounds = cell_bounds(medium)
    edges = np.linspace(0.0, 0.2, size[0] + 1)
    dense = edges[1:] + 2.0**-7 > 0.105
    assert (bounds[0].reshape(size[::-1])[0, 0] > 0.0)[dense].all()
    assert not (bounds[0] > 0.0).all()
