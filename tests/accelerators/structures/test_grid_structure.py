"""Uniform and hierarchical grids: what they hold, how much of it, and who would notice."""

from __future__ import annotations

import numpy as np
import pytest
from grid_probes import (
    HIERARCHIES,
    NAMES,
    built,
    coincident,
    extents,
    mixed_sizes,
    nested_triangles,
    rows,
    validate,
)
from kernel_probes import KINDS, rectangles, soup, spheres

from renderer.accelerators.grids import clustered_grids, nested_grids
from renderer.accelerators.grids.grid_cells import MOST_COPIES, Grids
from renderer.accelerators.grids.grid_resolution import DENSITY
from renderer.accelerators.grids.grid_validation import validate_grids
from renderer.accelerators.grids.grid_walk import LEVELS
from renderer.accelerators.grids.uniform_grid import UniformGrid, build_uniform_grid
from renderer.plugins.shapes.extents import Extents, Hulls

every_name = pytest.mark.parametrize("name", NAMES)


# ---------------------------------------------------------------------------- soundness


SOUPS = {
    "one": lambda kind, rng: soup(kind, 1, rng),
    "small": lambda kind, rng: soup(kind, 800, rng, size=0.05),
    "large": lambda kind, rng: soup(kind, 150, rng, size=2.0),
    "far from the origin": lambda kind, rng: soup(kind, 200, rng, center=1e3),
    "mixed sizes": mixed_sizes,
}


@every_name
@pytest.mark.parametrize("kind", KINDS)
def test_each_primitive_is_where_rays_look_for_it(kind, name):
    """The proof of validate_*, with rays from near and from 20 times as far."""
    rng = np.random.default_rng(0)
    for make in SOUPS.values():
        surfaces = make(kind, rng)
        for reach in (0.0, 20.0):
            validate(built(kind, surfaces, name, reach), kind, surfaces, reach)


def test_hierarchies_are_hierarchies():
    """Or else the proofs above, and the rays below, are those of one grid."""
    surfaces = mixed_sizes("triangles", np.random.default_rng(0))
    for name in HIERARCHIES:
        assert len(built("triangles", surfaces, name).grids.first) > 1, name


def lattice_quads(n):
    """n x n unit squares side by side in the plane z = 0."""
    x, y = np.indices((n, n)).reshape(2, -1)
    corner = np.stack((x, y, np.zeros(n * n)), axis=1)
    e1, e2 = np.eye(3)[:2]
    return rectangles(corner, np.tile(e1, (n * n, 1)), np.tile(e2, (n * n, 1)))


def test_the_resolution_follows_the_cube_root():
    """n^(1/3) along each edge of a cube, n^(1/2) in a plane, n on a line."""
    n = 27 * 64
    centre = np.stack(np.indices((12, 12, 12)).reshape(3, -1), axis=1)
    cube = spheres(centre, np.full(n, 0.5))
    side = int(np.cbrt(DENSITY * n))
    assert built("spheres", cube, "grid").resolution.tolist() == [side] * 3
    flat = built("rectangles", lattice_quads(20), "grid").resolution
    assert flat.tolist() == [40, 40, 1]
    line = spheres(np.arange(500.0)[:, None] * [1, 0, 0], np.full(500, 1e-3))
    assert built("spheres", line, "grid").resolution.tolist() == [DENSITY * 500, 1, 1]


# ------------------------------------------------------------------- faults are found


def without_item(grids, k):
    """Item k is gone, and the cells close up."""
    start = grids.start - (grids.start > k).astype(np.int32)
    return grids._replace(start=start, items=np.delete(grids.items, k))


def changed(grids, field, place, value):
    array = getattr(grids, field).copy()
    array[place] = value
    return grids._replace(**{field: array})


def swapped_starts(grids):
    cell = np.diff(grids.start).argmax()
    start = grids.start.copy()
    start[[cell, cell + 1]] = start[[cell + 1, cell]]
    return grids._replace(start=start)


def swapped_items(grids):
    k = grids.start[np.diff(grids.start).argmax()]
    items = grids.items.copy()
    items[[k, k + 1]] = items[[k + 1, k]]
    return grids._replace(items=items)


FAULTS = {
    "lacks primitive": lambda g: without_item(g, len(g.items) // 2),
    "starts before": swapped_starts,
    "not after the one before it": swapped_items,
    "neither a primitive nor a grid": lambda g: changed(g, "items", 7, 10**6),
    "cells hold items": lambda g: g._replace(items=np.append(g.items, np.int32(0))),
    "has no cells": lambda g: changed(g, "size", (0, 1), 0),
    "cells and": lambda g: changed(g, "resolution", (0, 0), g.resolution[0, 0] + 1),
    "does not begin": lambda g: changed(g, "first", 0, 1),
    "grid 0 does not enclose": lambda g: changed(g, "lower", (0, 2), g.lower[0, 2] + 0.5),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_a_grid_is_found(fault):
    surfaces = soup("triangles", 300, np.random.default_rng(1), size=0.3)
    where = extents("triangles", surfaces)
    good = rows(built("triangles", surfaces, "grid"))
    validate_grids(good, where)
    with pytest.raises(ValueError, match=fault):
        validate_grids(FAULTS[fault](good), where)


def test_cells_that_are_shifted_by_one_lack_what_they_held():
    """All arrays are in order, and every item is in the wrong place."""
    surfaces = soup("spheres", 300, np.random.default_rng(1), size=0.1)
    good = rows(built("spheres", surfaces, "grid"))
    sizes = np.roll(np.diff(good.start), 1)
    start = np.append(0, np.cumsum(sizes)).astype(np.int32)
    with pytest.raises(ValueError, match="lacks primitive"):
        validate_grids(good._replace(start=start), extents("spheres", surfaces))


@pytest.mark.parametrize("name", HIERARCHIES)
def test_each_item_that_is_missing_is_missed(name):
    """Of primitives and of grids, whichever is taken away."""
    surfaces = mixed_sizes("spheres", np.random.default_rng(2))
    where = extents("spheres", surfaces)
    good = built("spheres", surfaces, name).grids
    places = np.linspace(0, len(good.items) - 1, 40).astype(int)
    inner = np.flatnonzero(good.items >= 905)
    for k in [*places, *inner[:3]]:
        with pytest.raises(ValueError, match=r"lacks|lies in no other"):
            validate_grids(without_item(good, k), where)


def test_a_fault_of_a_hierarchy_is_found():
    surfaces = mixed_sizes("triangles", np.random.default_rng(2))
    n = surfaces.end - surfaces.first
    where = extents("triangles", surfaces)
    good = built("triangles", surfaces, "grid-nested").grids
    a, b = np.flatnonzero(good.items >= n)[:2]
    inner = good.items[a] - n
    inside = good.start[good.first[inner]]
    faults = {
        "in no other": changed(good, "items", a, good.items[b]),
        "around its own": changed(good, "items", a, n),
        "does not enclose": changed(good, "lower", (inner, 0), good.lower[inner, 0] + 1),
        "neither": changed(good, "items", a, n + len(good.first)),
        f"grid {inner} lacks": without_item(good, inside),
    }
    for fault, broken in faults.items():
        with pytest.raises(ValueError, match=fault):
            validate_grids(broken, where)


def test_a_grid_in_two_grids_and_too_many_in_each_other():
    """Rays keep `LEVELS` places, and a grid belongs to one other."""
    surfaces = soup("spheres", 1, np.random.default_rng(3))
    where = extents("spheres", surfaces)
    one = rows(built("spheres", surfaces, "grid"))
    span = one.resolution * one.size

    def grids_of_one_cell(*held):
        number = len(held)
        ends = np.cumsum([0, *map(len, held)])
        return Grids(
            np.repeat(one.lower, number, axis=0),
            np.repeat(span.astype(np.float32), number, axis=0),
            np.ones((number, 3), np.int32),
            np.arange(number, dtype=np.int32),
            ends.astype(np.int32),
            np.concatenate(held).astype(np.int32),
        )

    def chain(depth):
        return grids_of_one_cell(*([1 + g] for g in range(1, depth)), [0])

    validate_grids(chain(LEVELS), where)
    with pytest.raises(ValueError, match="lies in more than"):
        validate_grids(chain(LEVELS + 1), where)
    with pytest.raises(ValueError, match="grid 2 lies in two others"):
        validate_grids(grids_of_one_cell([2, 3], [3], [0]), where)


# ------------------------------------------------------------------------- bad scenes


def in_a_line():
    return spheres(np.arange(100_000.0)[:, None] * [1, 0, 0], np.full(100_000, 0.4))


def huge_and_tiny():
    """Twenty spheres that fill all cells, and points."""
    rng = np.random.default_rng(10)
    centre = rng.uniform(-1, 1, (5000, 3))
    radius = np.where(np.arange(5000) < 20, 5.0, 1e-5)
    return spheres(centre, radius)


BAD_SCENES = {
    "coincident": ("triangles", coincident),
    "one centroid": ("triangles", nested_triangles),
    "a line": ("spheres", in_a_line),
    "huge and tiny": ("spheres", huge_and_tiny),
}


def size_in_bytes(accel):
    if isinstance(accel, UniformGrid):
        return sum(a.nbytes for a in rows(accel))
    return sum(a.nbytes for a in accel.grids)


# bytes for each primitive: cells and items; and of grids in grids, the grids
MOST_BYTES = {
    "grid": 4 * (DENSITY + MOST_COPIES),
    "grid-nested": 4 * (nested_grids.MOST_CELLS + MOST_COPIES)
    + 40 * nested_grids.MOST_CELLS // 2,
    "grid-clusters": 4 * (DENSITY + MOST_COPIES) * (1 + 1 / clustered_grids.FEW) + 40,
}


@pytest.mark.parametrize("name", MOST_BYTES)
@pytest.mark.parametrize("scene", BAD_SCENES)
def test_builders_end_and_memory_is_bounded(scene, name):
    """Where nothing can be parted, or all lies in one cell, or fills them all."""
    kind, make = BAD_SCENES[scene]
    surfaces = make()
    accel = built(kind, surfaces, name)
    n = surfaces.end - surfaces.first
    assert size_in_bytes(accel) <= MOST_BYTES[name] * n + 200
    validate(accel, kind, surfaces)


def test_all_at_the_origin():
    """Boxes without extent, in a world without extent."""
    zero = np.zeros((3, 2), np.float32)
    hulls = Hulls(np.zeros((3, 4, 2), np.float32), zero[0], zero)
    nowhere = Extents(zero, zero, 0.0, 0.0, lambda: hulls)
    for build in (
        build_uniform_grid,
        nested_grids.build_nested_grids,
        clustered_grids.build_clustered_grids,
    ):
        accel = build(nowhere, lambda columns: None)
        validate_grids(
            rows(accel) if isinstance(accel, UniformGrid) else accel.grids, nowhere
        )
