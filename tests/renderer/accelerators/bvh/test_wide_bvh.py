"""The wide tree: what it is made of, and that a fault in it is found.

That it returns brute force's hits is shown for all structures alike elsewhere.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import accelerator, closest, directions, soup, triangles

from renderer.accelerators.bvh.wide.wide_bvh_build import (
    BOX_BYTES,
    CHILD,
    PAIR_COUNT,
    PAIR_WORDS,
)
from renderer.accelerators.bvh.wide.wide_bvh_checks import validate_wide
from renderer.plugins.shapes.extents import extents_of


def built(surfaces, kind="triangles"):
    order = np.arange(surfaces.end - surfaces.first)
    return accelerator(kind, surfaces, "wide"), extents_of(kind, surfaces, order)


@pytest.fixture
def tree():
    return built(soup("triangles", 500, np.random.default_rng(1)))


@pytest.mark.parametrize("n", [1, 2, 8, 9, 64, 3000])
def test_every_primitive_is_in_one_block(n):
    accel, extents = built(soup("triangles", n, np.random.default_rng(n)))
    validate_wide(accel, extents)
    # or a node is three cache lines, not two, and a block seven, not six
    assert accel.octets.ctypes.data % 128 == 0
    assert accel.blocks.rows.ctypes.data % 64 == 0


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e6, 1e15])
@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_bytes_hold_boxes_of_any_size(scale, shift):
    """Far from the origin a byte counts what float32 can still tell apart."""
    rng = np.random.default_rng(2)
    points = scale * (rng.uniform(-1, 1, (300, 3, 3)) + shift)
    points[::2, :, 1] = points[0, 0, 1]  # flat ones, too
    validate_wide(*built(triangles(points)))


def narrow_a_box(accel):
    accel.octets[[BOX_BYTES, BOX_BYTES + 16]] += 3


def differ_between_copies(accel):
    accel.octets[BOX_BYTES + 16] += 1


def lose_a_child(accel):
    accel.integers[CHILD] = 0


def visit_twice(accel):
    accel.integers[CHILD + 1] = accel.integers[CHILD]


def forget_a_child_in_an_order(accel):
    accel.order[3] = (accel.order[3] & ~15) | ((accel.order[3] >> 4) & 15)


def lose_a_primitive(accel):
    accel.blocks.id[0] = -1


def shrink_a_pair(accel):
    accel.pairs.floats[2 * PAIR_WORDS] += 1.0


def lose_a_leafs_last(accel):
    counts = accel.pairs.integers[PAIR_COUNT::PAIR_WORDS]
    counts[np.flatnonzero(counts > 1)[0]] -= 1


def shrink_a_primitives_box(accel):
    accel.boxes[0, 0] += 1.0


def lead_across_to_another(accel):
    accel.pair_of[0] = accel.pair_of[1]


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (narrow_a_box, "does not hold"),
        (differ_between_copies, "copies"),
        (lose_a_child, "not once"),
        (visit_twice, "not once"),
        (forget_a_child_in_an_order, "wide node 0: the order of octant 3"),
        (lose_a_primitive, "499 of 500"),
        (shrink_a_pair, "pairs: BVH node 1 .* does not hold its"),
        (lose_a_leafs_last, "pairs: BVH node .* gap or overlap"),
        (shrink_a_primitives_box, "boxes of other primitives"),
        (lead_across_to_another, "hold other blocks"),
    ],
)
def test_a_broken_tree_is_found(tree, fault, message):
    accel, extents = tree
    fault(accel)
    with pytest.raises(ValueError, match=message):
        validate_wide(accel, extents)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 100])
def test_any_number_of_rays_at_once(count):
    """Fewer rays than are under way at the same time; some of them without an answer."""
    rng = np.random.default_rng(3)
    surfaces = soup("triangles", 500, rng)
    origin, direction = rng.uniform(-1.5, 1.5, (count, 3)), directions(count, rng)
    origin[::3, 0] = np.nan
    direction[1::4, 2] = np.inf
    truth = closest(accelerator("triangles", surfaces, "brute"), origin, direction)
    found = closest(accelerator("triangles", surfaces, "wide"), origin, direction)
    np.testing.assert_array_equal(found.prim, truth.prim)
    assert (found.prim[::3] == -1).all() and (found.prim[1::4] == -1).all()
