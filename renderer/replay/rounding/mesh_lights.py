"""The triangle of a mesh light, chosen as Mitsuba does it: a search in cumulated areas.

It uses up a part of the point's own number and returns the rest; our own way
(`renderer.plugins.shapes.flat.triangle`) takes another number, and constant time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import mask_bits, select
from renderer.kernels.lanes.memory import gather_row
from renderer.plugins.shapes.flat.triangle import choose_triangle
from renderer.replay.rounding.hits.triangle_arithmetic import triangle_areas


class TriangleShares(NamedTuple):
    """Cumulated areas that choose a triangle of a mesh light."""

    first: NDArray[np.int32]  # (n,) of each light, into the columns below
    count: NDArray[np.int32]  # (n,)
    area: NDArray[np.float32]  # (n,) of the whole mesh
    cumulated: NDArray[np.float32]  # (total,) area of a triangle and all before it
    below: NDArray[np.float32]  # (total,) share of the area before a triangle
    lost: NDArray[np.float32]  # (total,) what the rounding of `below` has lost
    share: NDArray[np.float32]  # (total,) of the triangle itself
    prim: NDArray[np.int32]  # (total,) primitive id


def triangle_shares(count: int, triangles: Any, meshes: dict[int, Any]) -> TriangleShares:
    """Return the cumulated areas of mesh lights, rounded as Mitsuba does it."""
    first, number = np.zeros(count, np.int32), np.zeros(count, np.int32)
    area = np.zeros(count, np.float32)
    columns: list[list[NDArray[Any]]] = []
    total = 0
    for light, (ids, _) in meshes.items():
        k = ids - triangles.first
        sizes = triangle_areas(triangles.edge1[:, k], triangles.edge2[:, k])
        cumulated = np.cumsum(sizes, dtype=np.float64).astype(np.float32)
        normalization = np.float32(1.0) / cumulated[-1]
        exact = np.append(0.0, cumulated[:-1].astype(np.float64)) * normalization
        below = exact.astype(np.float32)
        first[light], number[light], area[light] = total, len(ids), cumulated[-1]
        lost = (exact - below).astype(np.float32)
        columns.append([cumulated, below, lost, sizes * normalization, ids])
        total += len(ids)
    rows = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    return TriangleShares(first, number, area, *rows)


@choose_triangle.by(TriangleShares)
@kernel
def _by_search(table, light, mask, y, z):
    """Find the first triangle that reaches y; the rest is its place within the share.

    Mitsuba rounds y - cumulated / area once; small triangles need what `below` has lost.
    """
    first = gather_row(table.first, 0, light, mask)
    wanted = y * gather_row(table.area, 0, light, mask)
    low = first
    high = first + gather_row(table.count, 0, light, mask) - 1
    searching = mask & (low < high)
    while mask_bits(searching) != 0:
        middle = (low + high) >> 1
        short = gather_row(table.cumulated, 0, middle, searching) < wanted
        low = select(searching & short, middle + 1, low)
        high = select(searching & ~short, middle, high)
        searching = mask & (low < high)
    below = gather_row(table.below, 0, low, mask)
    rest = (y - below) - gather_row(table.lost, 0, low, mask)
    rest = rest / gather_row(table.share, 0, low, mask)
    return gather_row(table.prim, 0, low, mask), rest
