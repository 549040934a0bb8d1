"""Grids over soups, shared by the tests of their structure and of their rays."""

from __future__ import annotations

import numpy as np
from kernel_probes import soup, triangles

from renderer.accelerators.build import build_accelerator
from renderer.accelerators.grids.grid_cells import Grids
from renderer.accelerators.grids.hierarchical_grid import validate_hierarchical_grid
from renderer.accelerators.grids.uniform_grid import UniformGrid, validate_uniform_grid
from renderer.plugins.shapes.extents import Extents, extents_of

NAMES = ("grid", "grid-without-mailboxes", "grid-nested", "grid-clusters")
HIERARCHIES = ("grid-nested", "grid-clusters")


def extents(kind, surfaces, reach=0.0) -> Extents:
    return extents_of(kind, surfaces, np.arange(surfaces.end - surfaces.first), reach)


def built(kind, surfaces, name, reach=0.0):
    order = np.arange(surfaces.end - surfaces.first)
    return build_accelerator(kind, surfaces, order, name, reach)


def validate(accel, kind, surfaces, reach=0.0):
    uniform = isinstance(accel, UniformGrid)
    prove = validate_uniform_grid if uniform else validate_hierarchical_grid
    prove(accel, extents(kind, surfaces, reach))


def rows(grid: UniformGrid) -> Grids:
    return Grids(
        grid.lower[None],
        grid.size[None],
        grid.resolution[None],
        np.zeros(1, np.int32),
        grid.start,
        grid.items,
    )


def mixed_sizes(kind, rng):
    """A few large ones around two swarms of small ones."""
    parts = [soup(kind, n, rng, size=s, center=c) for n, s, c in MIXTURE]
    fields = [f for f in parts[0]._fields[2:] if getattr(parts[0], f) is not None]
    joined = {f: np.concatenate([getattr(p, f) for p in parts], axis=-1) for f in fields}
    first = parts[0].first
    return parts[0]._replace(first=first, end=first + sum(n for n, *_ in MIXTURE), **joined)


MIXTURE = ((5, 9.0, 0.0), (300, 0.3, 0.0), (600, 0.3, 4.0))


def coincident():
    one = np.array([[0.0, 0, 0], [1, 0.2, 0.1], [0.3, 1, 0.7]])
    return triangles(np.tile(one, (10_000, 1, 1)))


def nested_triangles():
    """Ten thousand about one centre, from small to large."""
    angle = 2 * np.pi * np.arange(3) / 3
    one = np.stack((np.cos(angle), np.sin(angle), 0.3 * np.sin(2 * angle)), axis=1)
    one -= one.mean(axis=0)
    return triangles(one * np.geomspace(1e-4, 1, 10_000)[:, None, None])
