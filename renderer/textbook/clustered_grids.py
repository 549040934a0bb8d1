"""Hierarchical grid, second construction: one grid of clusters with grids of their own.

Primitives of similar size that are close together form a cluster [Cazals1995]. They are
sorted into classes by size; within a class, primitives in neighbouring cells of a coarse
raster are connected. Each cluster gets a uniform grid. One grid of the whole scene holds
the clusters, like large primitives, and all other primitives [Klimaszewski1997].

Neither this construction nor nested grids are always better. Cells visited + primitives
tested per ray:

==============================================  ==========  ==========  ==========
scene                                           one grid    nested      clusters
==============================================  ==========  ==========  ==========
mesh of 81,920 triangles, seen from afar        24 + 24     23 + 11     25 + 24
20,000 triangles everywhere                     50 + 29     39 + 40     51 + 29
ten swarms of 2000 triangles, rays at them      51 + 400    58 + 20     26 + 14
a ball of 5000 triangles in a stadium           1 + 5000    32 + 24     27 + 19
==============================================  ==========  ==========  ==========

Clusters cross empty space in the fewest steps. Nested grids do not depend on clusters, and
refine where a mesh is dense.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.shapes.extents import Extents, PrimitiveGroup
from renderer.textbook.grid_walk import Grids
from renderer.textbook.uniform_grid import (
    DENSITY,
    MOST_COPIES,
    boxes_of,
    enclose,
    join_grids,
    make_grid,
    pad_of,
)

GAP = 2.0  # ratio of two consecutive sizes that separates two classes
LINK = 4.0  # edge of the raster's cells, in median sizes of the class
FEW = 16  # a cluster has more primitives than this
_RASTER = 2**19  # most cells along an edge of the raster: three indices in 64 bits


def build_clustered_grids(extents: Extents, group: PrimitiveGroup) -> Grids:
    """Build grid 0 of clusters and single primitives, and grid c + 1 of cluster c."""
    boxes, pad = boxes_of(extents), pad_of(extents)
    n, cluster = len(boxes), clusters(extents)
    order = np.argsort(cluster, kind="stable").astype(np.int32)
    alone, *members = np.split(
        order, np.searchsorted(cluster[order], np.arange(cluster.max() + 1))
    )
    # items refer to cluster c's grid by the row of the cluster
    clustered = [enclose(boxes[columns], pad) for columns in members]
    rows = np.concatenate((boxes, np.zeros((1, 6)), np.reshape(clustered, (-1, 6))))
    top = np.concatenate((alone, n + 1 + np.arange(len(members), dtype=np.int32)))
    grids = []
    for columns in (top, *members):
        box, most = enclose(rows[columns], pad), MOST_COPIES * len(columns)
        grids.append(make_grid(rows, columns, box, DENSITY, pad, most))
    return join_grids(grids, extents, group)


def clusters(extents: Extents) -> NDArray[np.int64]:
    """Return the cluster of each primitive, (n,); -1 if it is in none."""
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

    A class ends at a gap between sorted sizes: a ratio of more than `GAP`.
    """
    rank = np.argsort(size, kind="stable")
    begins = np.concatenate(([True], size[rank[1:]] > GAP * size[rank[:-1]]))
    kind = np.empty(len(size), np.int64)
    kind[rank] = np.cumsum(begins) - 1
    ends = np.append(np.flatnonzero(begins), len(size))
    return kind, size[rank[(ends[:-1] + ends[1:]) // 2]]


def _components(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for each cell, keys ascending, the first cell of its connected component.

    Each cell takes the least label of its neighbours, and then the label of that label, so
    a chain of n cells takes log n rounds.
    """
    steps = itertools.product((-1, 0, 1), repeat=3)
    offsets = [
        (x * _RASTER + y) * _RASTER + z for x, y, z in steps if (x, y, z) > (0, 0, 0)
    ]
    links = []
    for offset in offsets:
        at = np.searchsorted(cells, cells + offset)
        one = np.flatnonzero(np.append(cells, -1)[at] == cells + offset)
        links.append(np.stack((one, at[one])))
    one, other = np.concatenate(links, axis=1)
    label = np.arange(len(cells))
    while True:
        found = label.copy()
        np.minimum.at(found, label[one], label[other])
        np.minimum.at(found, label[other], label[one])
        found = found[found]
        if np.array_equal(found, label):
            return label
        label = found
