"""Mesh lights: a triangle chosen by its area, then a point in it, uniformly.

There are two ways to choose, by the record that the scene comes with: alias tables, in
constant time and with a number of their own, or Mitsuba's search in the cumulated areas,
which uses up a part of the point's own number and returns the rest (for a replay).
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from renderer.jit import kernel, record_class
from renderer.kernel_scene import TriangleLights, TriangleShares
from renderer.lanes.functions import mask_bits, minimum, select, to_f32, to_i32
from renderer.lanes.memory import gather_row
from renderer.sampling import square_to_triangle
from renderer.stages.surface import interpolated_normal
from renderer.vectors import gather3, select3


def choose_triangle(table: Any, light: Any, mask: Any, y: Any, z: Any) -> Any:
    """Return a primitive of each mesh light, and what is left of y as a random number."""
    raise TypeError("inside kernels only")


@kernel
def _by_alias(table, light, mask, y, z):
    count = to_f32(gather_row(table.count, 0, light, mask))
    scaled = z * count
    column = to_i32(minimum(scaled, count - 1.0))
    entry = gather_row(table.first, 0, light, mask) + column
    stay = scaled - to_f32(column) < gather_row(table.keep, 0, entry, mask)
    entry = select(stay, entry, gather_row(table.alias, 0, entry, mask))
    return gather_row(table.prim, 0, entry, mask), y


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


@overload(choose_triangle)
def _choose_triangle(table, light, mask, y, z):
    kernels = {TriangleLights: _by_alias, TriangleShares: _by_search}
    choose = kernels.get(record_class(table))
    if choose is None:
        return None
    return lambda table, light, mask, y, z: choose(table, light, mask, y, z)


@kernel
def density_normal(replay, flat, smooth):
    """Return the normal whose cosine turns a density per area into one per solid angle.

    That is the geometric one, which the area belongs to. Mitsuba takes the one between the
    vertices, so its smooth mesh lights are a little too bright here and too dark there.
    """
    if replay is None:
        return flat
    return smooth


@kernel
def sample_triangles(table, replay, surfaces, light, orientation, x, y, z, point, normal):
    """Choose a triangle of the mesh by its area, then a point in it, uniformly.

    Returns point, the normal of the density and the normal of the side that shines: the
    shading normal, as where a path arrives by itself (`add_emission`).
    """
    if table is None:
        return point, normal, normal
    mine = gather_row(table.count, 0, light, light >= 0) > 0
    if mask_bits(mine) == 0:
        return point, normal, normal
    prim, y = choose_triangle(table, light, mine, y, z)
    index = prim - surfaces.first
    u, v = square_to_triangle(x, y)
    edge1 = gather3(surfaces.edge1, index, mine)
    edge2 = gather3(surfaces.edge2, index, mine)
    p = gather3(surfaces.corner, index, mine) + edge1 * u + edge2 * v
    n = gather3(surfaces.normal, index, mine)
    side = interpolated_normal(surfaces.normals, index, mine, u, v, n * orientation)
    n = density_normal(replay, n, side)
    return select3(mine, p, point), select3(mine, n, normal), side


@kernel
def mesh_or(table, light, mesh_side, side):
    """Return `mesh_side` where the light is a mesh, else `side`."""
    if table is None:
        return side
    return select3(gather_row(table.count, 0, light, light >= 0) > 0, mesh_side, side)
