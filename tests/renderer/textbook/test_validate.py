"""The proof of structures can fail: each defect that would lose a hit, or never end."""

from __future__ import annotations

import numpy as np
import pytest
from agreement import extents_for, proved
from kernel_probes import soup
from textbook_cases import CELL_TREES, GRIDS, HIERARCHIES, mixed_sizes

from renderer.textbook.cell_tree import MAX_DEPTH
from renderer.textbook.grid_walk import LEVELS
from renderer.textbook.validate import validate_structure


def changed(record, field, place, value):
    array = getattr(record, field).copy()
    array[place] = value
    return record._replace(**{field: array})


def refuses(structure, extents, fault):
    with pytest.raises(ValueError, match=fault):
        validate_structure(structure, extents)


# ---------------------------------------------------------------------- trees of cells


def damaged_trees(tree):
    """Of each message, a tree with that fault."""
    inner = int(np.flatnonzero(tree.child)[3])
    leaf = int(np.flatnonzero(tree.end > tree.first)[0])
    other = np.setdiff1d(range(300), tree.items[tree.first[leaf] : tree.end[leaf]])[0]
    aside = tree.plane[0] + np.array([0, 0, 0, 0.3], np.float32)
    group = tree.primitives
    return {
        "does not list": [
            changed(tree, "items", tree.first[leaf], other),
            changed(tree, "plane", 0, aside),
            changed(tree, "plane", inner, -tree.plane[inner]),
            changed(tree, "end", leaf, tree.end[leaf] - 1),
        ],
        "comes after its children": [changed(tree, "child", inner, 1)],
        "children that do not exist": [changed(tree, "child", inner, len(tree.child))],
        "child of exactly one node": [changed(tree, "child", 0, len(tree.child) - 2)],
        "items that do not exist": [
            changed(tree, "first", leaf, -1),
            changed(tree, "end", leaf, 10**6),
        ],
        "no primitive's column": [changed(tree, "items", 5, 300)],
        "no unit normal": [
            changed(tree, "plane", (0, slice(0, 3)), 0.0),
            changed(tree, "plane", 0, np.nan),
        ],
        "out of reach": [changed(tree, "plane", (0, 3), 1e6)],
        "out of bounds": [
            changed(tree, "bounds", 3, tree.bounds[3] / 2),
            changed(tree, "bounds", 1, np.nan),
        ],
        "beyond the pads": [tree._replace(reach=np.float32(100.0))],
        "differ in length": [tree._replace(end=tree.end[:-1])],
        "held once": [tree._replace(primitives=group._replace(count=group.count - 1))],
    }


@pytest.mark.parametrize("name", CELL_TREES)
def test_damaged_trees_are_refused(name):
    surfaces = soup("triangles", 300, np.random.default_rng(15), size=0.2)
    extents = extents_for("triangles", surfaces)
    tree = proved(name, "triangles", surfaces)
    for fault, trees in damaged_trees(tree).items():
        for damaged in trees:
            refuses(damaged, extents, fault)


@pytest.mark.parametrize("name", CELL_TREES)
def test_each_reference_that_is_missing_is_missed(name):
    """Builders list a little more than is needed; of the tests of a proof few are idle."""
    surfaces = soup("spheres", 200, np.random.default_rng(17), size=0.2)
    extents = extents_for("spheres", surfaces)
    tree = proved(name, "spheres", surfaces)
    missed = 0
    places = np.linspace(0, len(tree.items) - 1, 50).astype(int)
    for k in places:
        try:
            validate_structure(
                changed(tree, "items", k, (tree.items[k] + 1) % 200), extents
            )
        except ValueError as error:
            assert "does not list" in str(error)
            missed += 1
    assert missed >= 0.9 * len(places)


def test_a_tree_deeper_than_the_stack_is_refused():
    """A chain of 61 cuts that all leave the only sphere in front."""
    surfaces = soup("spheres", 1, np.random.default_rng(18))
    tree = proved("bsp", "spheres", surfaces)
    steps = MAX_DEPTH + 1
    plane = np.zeros((2 * steps + 1, 4), np.float32)
    plane[:, 0] = 1.0
    child = np.zeros(2 * steps + 1, np.int32)
    child[np.concatenate(([0], 2 * np.arange(1, steps)))] = 2 * np.arange(steps) + 1
    plane[:, 3] = tree.bounds[0]
    first, end = np.zeros((2, 2 * steps + 1), np.int32)
    end[:] = 1
    chain = tree._replace(plane=plane, child=child, first=first, end=end)
    refuses(chain, extents_for("spheres", surfaces), "deeper than")


def test_a_damaged_tree_of_boxes_is_refused():
    surfaces = soup("triangles", 300, np.random.default_rng(15), size=0.2)
    extents = extents_for("triangles", surfaces)
    tree = proved("bvh-middle", "triangles", surfaces)
    inner = int(np.flatnonzero(tree.child)[3])
    leaf = int(np.flatnonzero(tree.child == 0)[0])
    for fault, damaged in {
        "is in no leaf": changed(tree, "items", 0, tree.items[1]),
        "does not hold its primitives": changed(tree, "boxes", (leaf, 3), -9),
        "does not hold its children": changed(tree, "boxes", (inner, 0), 9),
        "comes after its children": changed(tree, "child", inner, 1),
        "children that do not exist": changed(tree, "child", inner, len(tree.child)),
        "items that do not exist": changed(tree, "end", leaf, 10**6),
        "beyond the pads": tree._replace(reach=np.float32(100.0)),
        "differ in length": tree._replace(end=tree.end[:-1]),
    }.items():
        refuses(damaged, extents, fault)


# -------------------------------------------------------------------------------- grids


def without_item(grids, k):
    """Item k is gone, and the cells close up."""
    start = grids.start - (grids.start > k).astype(np.int32)
    return grids._replace(start=start, items=np.delete(grids.items, k))


def swapped(grids, field, k):
    array = getattr(grids, field).copy()
    array[[k, k + 1]] = array[[k + 1, k]]
    return grids._replace(**{field: array})


def shifted(grids):
    """All arrays are in order, and every item is in the next cell."""
    sizes = np.roll(np.diff(grids.start), 1)
    return grids._replace(start=np.append(0, np.cumsum(sizes)).astype(np.int32))


FAULTS = {
    "does not list": lambda g: without_item(g, len(g.items) // 2),
    "does not list primitive": shifted,
    "starts before": lambda g: swapped(g, "start", np.diff(g.start).argmax()),
    "not after the one": lambda g: swapped(g, "items", g.start[np.diff(g.start).argmax()]),
    "neither a primitive nor a grid": lambda g: changed(g, "items", 7, 10**6),
    "other items": lambda g: g._replace(items=np.append(g.items, np.int32(0))),
    "has no cells": lambda g: changed(g, "size", (0, 1), 0),
    "starts are not": lambda g: changed(g, "resolution", (0, 0), g.resolution[0, 0] + 1),
    "does not begin": lambda g: changed(g, "first", 0, 1),
    "does not enclose": lambda g: changed(g, "lower", (0, 2), g.lower[0, 2] + 0.5),
    "beyond the pads": lambda g: g._replace(reach=np.float32(100.0)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_damaged_grid_is_refused(fault):
    surfaces = soup("triangles", 300, np.random.default_rng(1), size=0.3)
    good = proved("grid", "triangles", surfaces)
    refuses(FAULTS[fault](good), extents_for("triangles", surfaces), fault)


@pytest.mark.parametrize("name", GRIDS)
def test_each_item_that_is_missing_is_missed(name):
    """Of primitives and of grids, whichever is taken away."""
    surfaces = mixed_sizes("spheres", np.random.default_rng(2))
    extents = extents_for("spheres", surfaces)
    good = proved(name, "spheres", surfaces)
    places = np.linspace(0, len(good.items) - 1, 40).astype(int)
    inner = np.flatnonzero(good.items >= 905)
    assert (inner.size > 0) == (name in HIERARCHIES)
    missed = 0
    for k in [*places, *inner[:3]]:
        try:
            validate_structure(without_item(good, k), extents)
        except ValueError as error:
            assert "does not list" in str(error) or "lies in no other" in str(error)
            missed += 1
    assert missed >= 0.9 * len(places)


def test_a_damaged_hierarchy_is_refused():
    surfaces = mixed_sizes("triangles", np.random.default_rng(2))
    n = surfaces.end - surfaces.first
    good = proved("grid-nested", "triangles", surfaces)
    a, b = np.flatnonzero(good.items >= n)[:2]
    inner = good.items[a] - n
    for fault, damaged in {
        "in no other": changed(good, "items", a, good.items[b]),
        "around its own": changed(good, "items", a, n),
        "not enclose": changed(good, "lower", (inner, 0), good.lower[inner, 0] + 1),
        "neither": changed(good, "items", a, n + len(good.first)),
    }.items():
        refuses(damaged, extents_for("triangles", surfaces), fault)


def test_a_grid_in_two_grids_and_too_many_in_each_other():
    """Rays keep `LEVELS` places, and a grid belongs to one other."""
    surfaces = soup("spheres", 1, np.random.default_rng(3))
    extents = extents_for("spheres", surfaces)
    one = proved("grid", "spheres", surfaces)
    span = (one.resolution * one.size).astype(np.float32)

    def grids_of_one_cell(*held):
        number = len(held)
        return one._replace(
            lower=np.repeat(one.lower, number, axis=0),
            size=np.repeat(span, number, axis=0),
            resolution=np.ones((number, 3), np.int32),
            first=np.arange(number, dtype=np.int32),
            start=np.cumsum([0, *map(len, held)]).astype(np.int32),
            items=np.concatenate(held).astype(np.int32),
        )

    def chain(depth):
        return grids_of_one_cell(*([1 + g] for g in range(1, depth)), [0])

    validate_structure(chain(LEVELS), extents)
    refuses(chain(LEVELS + 1), extents, "lies in too many others")
    refuses(grids_of_one_cell([2, 3], [3], [0]), extents, "grid 2 .* lies in two others")
