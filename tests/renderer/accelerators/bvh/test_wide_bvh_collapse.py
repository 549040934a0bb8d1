"""The nodes of eight are the cheapest that a binary tree can be collapsed to."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest

from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.bvh.wide.wide_bvh_build import CHILD, WIDE_WORDS, collapse


def boxes(n, rng):
    """Boxes of sizes from 0.001 to 1, so that areas tell the ways to collapse apart."""
    low = rng.uniform(-1.0, 1.0, (3, n))
    return low, low + rng.uniform(0.0, 1.0, (3, n)) * 10.0 ** rng.uniform(-3.0, 0.0, n)


def tree_of(low, high, rule="median"):
    """A tree whose leaves are blocks; leaves of one, so that small trees have levels."""
    tree = build_tree(low, high, leaf_size=1, rule=rule)
    return tree._replace(child=np.where(tree.count > 0, 8 * tree.child, tree.child))


def shares(tree):
    """Of the rays that meet the root's box, how many meet each node's."""
    a, b, c = (tree.bounds[:, 3:].astype(float) - tree.bounds[:, :3]).T
    area = a * b + b * c + c * a
    return area / area[0] if area[0] > 0 else np.ones_like(area)


def least_cost(tree):
    """The truth: of all ways to give each node its children, all are tried."""
    share = shares(tree)

    def covers(node):
        """All ways to have up to eight descendants take a node's place; itself is one."""
        yield (node,)
        if tree.count[node] == 0:
            first = tree.child[node]
            for left, right in product(covers(first), covers(first + 1)):
                if len(left) + len(right) <= 8:
                    yield left + right

    @cache
    def cost(node):
        if tree.count[node] > 0:
            return 0.0
        ways = (way for way in covers(node) if way != (node,))
        return share[node] + min(sum(map(cost, way)) for way in ways)

    return cost(0)


def found_cost(tree, octets, pair_of):
    """What the nodes cost that `collapse` has made: the root, and all inner children."""
    if tree.count[0] > 0:
        return 0.0
    children = octets.view(np.int32).reshape(-1, WIDE_WORDS)[:, CHILD : CHILD + 8]
    inner = pair_of.reshape(-1, 8)[children > 0]
    return 1.0 + shares(tree)[inner - 1].sum()  # the root is alone in its pair


@pytest.mark.parametrize("rule", ["median", "middle"])
@pytest.mark.parametrize("n", [1, 8, 9, 16, 20, 24])
def test_no_other_nodes_cost_less(n, rule):
    """Halves of equal size and of any. The usual rule fails with 20 and more each time."""
    for seed in range(5):
        tree = tree_of(*boxes(n, np.random.default_rng(seed)), rule)
        cost = found_cost(tree, *collapse(tree.bounds, tree.child, tree.count))
        assert cost == pytest.approx(least_cost(tree), rel=1e-6)


def test_a_line_beside_a_box_has_few_nodes():
    """Nothing below the root has an area, and all ways cost nothing but their nodes."""
    low, high = np.zeros((3, 65)), np.zeros((3, 65))
    low[0] = high[0] = np.arange(65)
    low[1:, -1], high[1:, -1] = -1.0, 1.0
    tree = tree_of(low, high)
    octets, _ = collapse(tree.bounds, tree.child, tree.count)
    assert len(octets) // (4 * WIDE_WORDS) < 20
