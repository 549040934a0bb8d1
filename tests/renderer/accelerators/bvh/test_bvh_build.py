"""The SAH builder: its trees are trees, enclose what they hold, and are worth building."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from renderer.accelerators.bvh import bvh_build, bvh_split
from renderer.accelerators.bvh.bvh_build import (
    MAX_DEPTH,
    BvhTree,
    build_tree,
    bvh_cost,
    bvh_depth,
    validate_bvh,
)
from renderer.kernels.jit import entry_kernel


def soup(n, seed=0, size=0.02):
    """Random boxes in the unit cube."""
    rng = np.random.default_rng(seed)
    centre, half = rng.random((3, n)), size * rng.random((3, n))
    return (centre - half).astype(np.float32), (centre + half).astype(np.float32)


def line(x, size=0.0):
    """Boxes along the x axis."""
    lower = np.zeros((3, len(x)), np.float32)
    lower[0] = x
    return lower, lower + np.float32(size)


def check(lower, upper, leaf_size=8):
    """Build, validate, and bound leaf size and depth."""
    tree = build_tree(lower, upper, leaf_size)
    validate_bvh(tree, lower, upper)
    assert tree.count.max() <= leaf_size
    assert bvh_depth(tree) <= MAX_DEPTH
    return tree


@pytest.mark.parametrize("leaf_size", [1, 2, 8, 16])
@pytest.mark.parametrize("n", [1, 2, 3, 8, 9, 17, 1000, 20_000])
def test_random_soups(n, leaf_size):
    check(*soup(n, seed=n), leaf_size)


@settings(max_examples=100, deadline=None)
@given(
    arrays.arrays(
        np.float32,
        st.tuples(st.just(3), st.integers(1, 40), st.just(2)),
        elements=st.floats(width=32, allow_nan=False, allow_infinity=False)
        | st.sampled_from([0.0, -0.0, 1.0, 1.0000001]),
    ),
    st.integers(1, 9),
)
def test_any_finite_boxes(corners, leaf_size):
    """Up to the largest floats, whose extents and areas exceed float32."""
    check(corners.min(axis=2), corners.max(axis=2), leaf_size)


def median_tree(lower, upper, leaf_size):
    """The same record, split at the median of the longest axis."""
    centres = lower + upper
    bounds, child, count, order = [None], [0], [0], []
    waiting = [(0, np.arange(lower.shape[1]))]
    while waiting:
        node, held = waiting.pop()
        bounds[node] = np.concatenate((lower[:, held].min(1), upper[:, held].max(1)))
        if held.size <= leaf_size:
            child[node], count[node] = len(order), held.size
            order.extend(held)
            continue
        held = held[np.argsort(centres[np.ptp(centres[:, held], axis=1).argmax(), held])]
        child[node] = len(child)
        half = held.size // 2
        waiting += [(len(child) + 1, held[half:]), (len(child), held[:half])]
        bounds, child, count = bounds + [None] * 2, child + [0] * 2, count + [0] * 2
    whole = (np.array(a, np.int32) for a in (child, count, order))
    return BvhTree(np.array(bounds, np.float32), *whole)


def test_the_heuristic_beats_the_median():
    """A dense cluster in a wide room: the teapot in the stadium."""
    wide, dense = soup(2000, 1), soup(2000, 2, size=1e-4)
    lower, upper = (
        np.hstack((w, 0.3 + 0.01 * d)) for w, d in zip(wide, dense, strict=True)
    )
    tree, median = build_tree(lower, upper), median_tree(lower, upper, 8)
    validate_bvh(median, lower, upper)
    assert bvh_cost(tree) < 0.9 * bvh_cost(median)


def test_cost_of_a_tree_worked_by_hand():
    """Two unit cubes 3 apart: root 4 x 1 x 1 (half area 9), two leaves (half area 3)."""
    lower, upper = line([0, 3], 1)
    assert bvh_cost(build_tree(lower, upper, leaf_size=1)) == pytest.approx(1 + 2 * 3 / 9)
    assert bvh_cost(build_tree(lower[:, :1], upper[:, :1])) == 1


def test_a_full_leaf_is_split_only_where_that_pays():
    """Eight boxes are one block of work; two halves far apart spare most rays one."""
    together = line(np.arange(8), 1)
    assert len(build_tree(*together).child) == 1
    two_blocks = line(np.arange(16) + np.repeat([0, 1000], 8), 1)
    assert sorted(build_tree(*two_blocks, leaf_size=16).count.tolist()) == [0, 8, 8]


@pytest.mark.parametrize(
    ("lower", "upper", "leaf_size"),
    [
        (np.zeros((3, 0)), np.zeros((3, 0)), 8),
        (np.zeros((3, 2)), np.zeros((3, 3)), 8),
        (np.zeros((4, 3)), np.zeros((4, 3)), 8),
        (np.zeros((3, 2)), np.zeros((3, 2)), 0),
    ],
)
def test_what_cannot_be_built(lower, upper, leaf_size):
    with pytest.raises(ValueError):
        build_tree(lower, upper, leaf_size)


def broken(tree, field, index, value):
    array = getattr(tree, field).copy()
    array[index] = value
    return tree._replace(**{field: array})


def test_validation_sees_every_kind_of_damage():
    """The check itself must be able to fail, or it proves nothing."""
    lower, upper = soup(200)
    tree = build_tree(lower, upper)
    leaf = int(np.flatnonzero(tree.count)[0])
    damages = {
        "permutation": broken(tree, "order", 0, tree.order[1]),
        "does not hold its boxes": broken(tree, "bounds", (leaf, 0), 0.9),
        "does not hold its children": broken(tree, "bounds", (0, 4), 0.5),
        "comes after its children": broken(tree, "child", 0, 0),
        "do not exist": broken(tree, "child", 0, len(tree.child) - 1),
        "not the child of exactly one": broken(tree, "child", 0, 3),
        "gap or overlap": broken(tree, "count", leaf, tree.count[leaf] + 1),
        "differ in length": tree._replace(count=tree.count[:-1]),
        "do not end": tree._replace(order=np.arange(201, dtype=np.int32)),
    }
    for message, damaged in damages.items():
        with pytest.raises(ValueError, match=message):
            n = len(damaged.order)
            validate_bvh(damaged, np.resize(lower, (3, n)), np.resize(upper, (3, n)))


@entry_kernel
def _median_of(boxes, order, middle, centres):
    bvh_split.split_at_median(boxes, order, 0, len(order), middle, centres)


def test_the_median_split_alone_builds_a_tree(monkeypatch):
    """The way out at great depth is right by itself, also where nothing is degenerate."""
    lower, upper = soup(777)
    boxes = bvh_build.side_by_side(lower, upper)
    middles = (lower + upper) / 2
    centres = np.concatenate((middles.min(axis=1), middles.max(axis=1)))
    order = np.arange(777, dtype=np.int32)
    _median_of(boxes, order, 388, centres.astype(np.float32))
    axis = np.argmax(centres[3:] - centres[:3])
    middle = boxes[:, axis] - boxes[:, axis + 4]
    assert middle[:388].max() <= middle[388:].min()
    np.testing.assert_array_equal(boxes[:, :3].T, lower[:, order])


@pytest.mark.parametrize("rule", ["sah", "median", "middle"])
def test_the_tree_is_the_same_for_any_number_of_threads(monkeypatch, rule):
    """Large parts are split one by one and built side by side, in no fixed order."""
    monkeypatch.setattr(bvh_build, "JOB", 100)
    lower, upper = soup(3000, seed=5)
    trees = []
    for threads in (1, 4):
        monkeypatch.setattr(bvh_build, "default_threads", lambda n=threads: n)
        trees.append(build_tree(lower, upper, rule=rule))
        validate_bvh(trees[-1], lower, upper)
    for one, four in zip(*trees, strict=True):
        np.testing.assert_array_equal(one, four)


@pytest.mark.parametrize("rule", ["median", "middle"])
def test_the_other_rules_build_valid_trees(rule):
    """In the middle of 1, 2, 4, 8, ... is all but the last: the depth is bounded still."""
    for lower, upper in (soup(2000, seed=1), line(2.0 ** np.arange(0, 60))):
        tree = build_tree(lower, upper, 1, rule)
        validate_bvh(tree, lower, upper)
        assert bvh_depth(tree) <= MAX_DEPTH
        assert tree.count.max() <= 1
