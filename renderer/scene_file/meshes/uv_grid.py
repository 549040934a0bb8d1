"""Triangles by their texture coordinates: a grid over (u, v), and whether two overlap."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_MOST_CELLS = 512  # along each axis
_MOST_CENTERS = 4096  # that are looked at


class UvGrid(NamedTuple):
    """Cells of equal size, row by row, and the triangles in each."""

    low: NDArray[np.float64]  # (2,) least u and v
    scale: NDArray[np.float64]  # (2,) cells per unit
    cells: int  # along each axis
    start: NDArray[np.int64]  # (cells^2 + 1,) where the list of a cell begins
    entries: NDArray[np.int64]  # triangles

    def cell_of(self, p: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cells of points (n, 2)."""
        i, j = np.clip(((p - self.low) * self.scale).astype(int), 0, self.cells - 1).T
        return np.asarray(j * self.cells + i)

    def members(self, cell: int) -> NDArray[np.int64]:
        """Return the triangles whose box meets a cell."""
        return self.entries[self.start[cell] : self.start[cell + 1]]


def uv_grid(points: NDArray[np.float64]) -> UvGrid:
    """Return a grid of triangles (n, 3, 2), which are listed where their boxes are."""
    cells = int(min(max(np.ceil(np.sqrt(len(points))), 1), _MOST_CELLS))
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    size = np.maximum(high - low, 1e-30)
    scale = cells / size
    margin = 1e-5  # of a cell: kernels compute the cell in float32
    first = (points.min(axis=1) - low) * scale - margin
    last = (points.max(axis=1) - low) * scale + margin
    first = np.clip(np.floor(first), 0, cells - 1).astype(np.int64)
    last = np.clip(np.floor(last), 0, cells - 1).astype(np.int64)
    wide = last - first + 1
    owners = np.repeat(np.arange(len(points)), wide[:, 0] * wide[:, 1])
    ends = np.cumsum(wide[:, 0] * wide[:, 1])
    place = np.arange(len(owners)) - (ends - wide[:, 0] * wide[:, 1])[owners]
    i = first[owners, 0] + place % wide[owners, 0]
    j = first[owners, 1] + place // wide[owners, 0]
    cell = j * cells + i
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], np.arange(cells * cells + 1))
    return UvGrid(low, scale, cells, start, owners[order])


def overlap(points: NDArray[np.float64]) -> bool:
    """Return whether triangles (n, 3, 2) cover a part of the plane twice.

    By the centres of some of them: it finds the sides of a box that share a square, and
    whatever lies on another by the half; a sliver may pass.
    """
    grid = uv_grid(points)
    centers = points[:: len(points) // _MOST_CENTERS + 1].mean(axis=1)
    cells = grid.cell_of(centers)
    return any(
        _inside(points[grid.members(cell)], center).sum() > 1
        for cell, center in zip(cells, centers, strict=True)
    )


def _inside(points: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.bool_]:
    a, b, c = (points[:, k] - p for k in range(3))
    areas = [_cross(a, b), _cross(b, c), _cross(c, a)]
    total = areas[0] + areas[1] + areas[2]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.all([part / total > 1e-3 for part in areas], axis=0)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
