"""Hierarchical grid, second construction: clusters with grids of their own, in one grid.

Primitives of about the same size that lie near each other form a cluster [Cazals1995]: they
are sorted into classes by size, and of each class, those in neighbouring cells of a coarse
raster belong together. Each cluster gets a uniform grid. One grid of the whole scene holds
the clusters, as if they were large primitives, and what is in none [Klimaszewski1997].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.grids.grid_cells import (
    COLUMNS,
    MOST_COPIES,
    Grids,
    count_in_grid,
    covers_of,
    enclose,
    make_grids,
    pad_of,
    write_grid,
)
from renderer.accelerators.grids.grid_resolution import DENSITY, cell_count
from renderer.accelerators.grids.hierarchical_grid import HierarchicalGrid
from renderer.kernels.jit import builder_kernel, kernel
from renderer.plugins.shapes.extents import Extents, PrimitiveGroup

GAP = 2.0  # factor between two sizes, with none in between, that parts two classes
LINK = 4.0  # edge of the raster's cells, in median sizes of the class
FEW = 16  # primitives that make no cluster
_RASTER = 2**19  # most cells along an edge of the raster: three numbers in 64 bits


def build_clustered_grids(extents: Extents, group: PrimitiveGroup) -> HierarchicalGrid:
    """Build a grid for each cluster and one that holds them."""
    count = extents.lower.shape[1]
    cluster = clusters(extents)
    order = np.argsort(cluster, kind="stable")
    first = np.searchsorted(cluster[order], np.arange(cluster.max() + 2))
    grids = _build(covers_of(extents), order.astype(np.int32), first, pad_of(extents))
    return HierarchicalGrid(grids, np.float32(extents.reach), group(np.arange(count)))


def clusters(extents: Extents) -> NDArray[np.int64]:
    """Return the number of each primitive's cluster, (n,); -1 for those in none."""
    low, high = extents.lower.astype(np.float64), extents.upper.astype(np.float64)
    size = np.maximum((high - low).max(axis=0), pad_of(extents))
    kind, usual = _size_classes(size)
    centre = (low + high) / 2
    corner = centre.min(axis=1, keepdims=True)
    whole = (centre - corner).max()
    edge = np.maximum(LINK * usual[kind], whole / (_RASTER - 2))
    x, y, z = ((centre - corner) / edge).astype(np.int64) + 1  # neighbours are never < 0
    key = ((kind * _RASTER + x) * _RASTER + y) * _RASTER + z
    cells, cell = np.unique(key, return_inverse=True)
    component = _components(cells)[cell]
    _, component, members = np.unique(component, return_inverse=True, return_counts=True)
    kept = np.cumsum(members > FEW) - 1
    return np.where(members > FEW, kept, -1)[component]


def _size_classes(
    size: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return each primitive's class, and the median size of each class.

    A class ends where the histogram of sizes has a gap: no size within a factor of `GAP`.
    """
    rank = np.argsort(size, kind="stable")
    begins = np.concatenate(([True], size[rank[1:]] > GAP * size[rank[:-1]]))
    kind = np.empty(len(size), np.int64)
    kind[rank] = np.cumsum(begins) - 1
    ends = np.append(np.flatnonzero(begins), len(size))
    return kind, size[rank[(ends[:-1] + ends[1:]) // 2]]


@builder_kernel
def _components(cells):
    """Return for each cell, keys ascending, the first of those it hangs together with."""
    parent = np.arange(len(cells))
    for dx in range(-1, 1):
        for dy in range(-1, 2):
            for dz in range(-1, 2):
                offset = (dx * _RASTER + dy) * _RASTER + dz
                if offset < 0:
                    _join(cells, offset, parent)
    for k in range(len(cells)):
        parent[k] = _root(parent, k)
    return parent


@kernel
def _join(cells, offset, parent):
    """Unite each cell with the one whose key is `offset` less, if there is one."""
    j = 0
    for k in range(len(cells)):
        while cells[j] < cells[k] + offset:
            j += 1
        if cells[j] == cells[k] + offset:
            a, b = _root(parent, j), _root(parent, k)
            parent[max(a, b)] = min(a, b)


@kernel
def _root(parent, k):
    """Return the first cell that k hangs together with; halves the way to it."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@builder_kernel
def _build(covers, order, first, pad):
    """Build grid 0 of clusters and single primitives, and grid c + 1 of cluster c.

    `order` has the single primitives first, then those of cluster c from first[c] on.
    """
    n, alone, count = len(covers), first[0], len(first) - 1
    boxes = np.zeros((n + 1 + count, COLUMNS))
    boxes[:n] = covers
    top = np.empty(alone + count, np.int32)
    top[:alone] = order[:alone]
    for c in range(count):
        top[alone + c] = n + 1 + c
        box = boxes[n + 1 + c]
        enclose(covers, order[first[c] : first[c + 1]], pad, box[:3], box[3:6])

    most = n + count  # items that grids are built over, of all grids together
    grids = make_grids(count + 1, np.int64(DENSITY * most) + 1, MOST_COPIES * most)
    low, high = np.empty(3), np.empty(3)
    cells = used = np.int64(0)
    for g in range(count + 1):
        columns = top
        if g > 0:
            columns = order[first[g - 1] : first[g]]
        enclose(boxes, columns, pad, low, high)
        grids.first[g] = cells
        most = MOST_COPIES * len(columns)
        count_in_grid(grids, g, boxes, columns, low, high, DENSITY, pad, most)
        used = write_grid(grids, g, boxes, columns, used)
        cells += cell_count(grids.resolution[g])
    grids.start[cells] = used
    start, items = grids.start[: cells + 1].copy(), grids.items[:used].copy()
    rows = grids.lower, grids.size, grids.resolution, grids.first
    return Grids(rows[0], rows[1], rows[2], rows[3], start, items)
