"""kd-trees: sound whatever they are built over, bounded, worth their cost, and exact.

The big comparison of all structures is elsewhere; here are the cases that a kd-tree in
particular can get wrong (failure modes 6, 7, 9, 12 and 13 of the project's list).
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import FIRST_ID, KINDS, closest, directions, soup, triangles
from tree_cases import (
    RAYS,
    REACH,
    assert_same_hits,
    ball_in_a_stadium,
    build,
    coincident,
    concentric,
    counts,
    extents,
    line,
    rays_in_planes,
    rays_into_the_ball,
    walls,
)

from renderer.accelerators.kd_tree.kd_tree import KdTree, validate_kd_tree
from renderer.accelerators.kd_tree.kd_tree_build import ROOM, depth_limit
from renderer.accelerators.kd_tree.kd_tree_checks import kd_cells, kd_cost
from renderer.accelerators.kd_tree.kd_tree_nodes import LEAF, MAX_DEPTH
from renderer.accelerators.kd_tree.kd_tree_split import (
    BINS,
    CHEAPEST,
    EXACT_UP_TO,
    MEDIAN,
    MIDDLE,
    cheapest_split,
    split_cost,
)
from renderer.accelerators.references import Hulls, fits, hulls_of
from renderer.kernels.jit import entry_kernel
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, STACK

RULES = {"kd-middle": MIDDLE, "kd-median": MEDIAN, "kd-sah": CHEAPEST}
every_name = pytest.mark.parametrize("name", RULES)


def check(name, kind, surfaces):
    """Build, validate, and bound what is built."""
    tree = build(name, kind, surfaces)
    n = surfaces.end - surfaces.first
    validate_kd_tree(tree, extents(kind, surfaces))
    assert len(tree.items) <= ROOM * n
    assert len(tree.link) // 2 < 2 * ROOM * n or n == 1
    assert kd_cells(tree)[1].max() <= depth_limit(n, RULES[name])
    return tree


def planes_of(tree):
    """Coordinate and axis of every split."""
    axis = tree.link[1::2] & 3
    return tree.split[::2][axis != LEAF], axis[axis != LEAF]


# ------------------------------------------------------------------------ what is built


@every_name
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "size"), [(1, 1.0), (2, 0.1), (300, 0.1), (300, 2.0)])
def test_soups_of_every_kind(name, kind, n, size):
    check(name, kind, soup(kind, n, np.random.default_rng(n), size=size))


@every_name
def test_coincident_triangles_stay_together(name):
    """No plane tells them apart, and some splits cut off empty space: few leaves."""
    tree = check(name, "triangles", coincident(10_000))
    assert np.diff(tree.first).max() == 10_000
    assert len(tree.first) < 30


@every_name
def test_a_hundred_thousand_duplicates_between_others(name):
    """Row 13: the build ends, and the smallest id of the duplicates is hit."""
    surfaces = coincident(100_000)
    few = soup("triangles", 100, np.random.default_rng(0), size=0.5)
    for field in ("corner", "edge1", "edge2", "normal"):
        getattr(surfaces, field)[:, 5::1000] = getattr(few, field)
    tree = build(name, "triangles", surfaces)
    assert len(tree.items) <= ROOM * 100_000
    rng = np.random.default_rng(1)
    origin = rng.uniform(-1.5, 1.5, (64, 3))
    direction = rng.uniform(0.3, 0.6, (64, 3)) - origin
    truth = assert_same_hits(tree, "triangles", surfaces, origin, direction)
    assert (truth.prim == FIRST_ID).any()


@every_name
def test_equal_centroids(name):
    tree = check(name, "spheres", concentric(500))
    rng = np.random.default_rng(2)
    origin = rng.uniform(-4, 4, (RAYS, 3))
    assert_same_hits(tree, "spheres", concentric(500), origin, directions(RAYS, rng))


@every_name
def test_a_line_of_a_hundred_thousand(name):
    tree = check(name, "rectangles", line(100_000))
    assert len(tree.items) < 2 * 100_000


def test_only_the_middle_may_go_to_any_depth():
    assert depth_limit(1, CHEAPEST) == 8
    assert depth_limit(1024, MEDIAN) == 21
    assert depth_limit(2**50, CHEAPEST) == MAX_DEPTH == depth_limit(2, MIDDLE)


def test_the_same_primitives_give_the_same_tree():
    surfaces = soup("triangles", 2000, np.random.default_rng(4), size=0.2)
    first, second = (build("kd-sah", "triangles", surfaces) for _ in range(2))
    for a, b in zip(first[:5], second[:5], strict=True):
        np.testing.assert_array_equal(a, b)


# ------------------------------------------------------------------------------ the cost


@entry_kernel
def run_split_cost(cell, axis, plane, below, above):
    return split_cost(cell, axis, plane, below, above)


@entry_kernel
def run_cheapest_split(boxes, cell, starts, ends, bins):
    return cheapest_split(boxes, 0, len(boxes), cell, starts, ends, bins)


def find_cheapest(boxes, cell):
    n = len(boxes)
    scratch = np.empty(n, np.float32), np.empty(n, np.float32)
    return run_cheapest_split(boxes, cell, *scratch, np.empty((2, BINS), np.int64))


def test_cost_of_a_split_worked_by_hand():
    """A cell of 4 x 1 x 1 has half area 9; cut at 1: parts of half area 3 and 7.

    8 and 16 primitives are one and two blocks of cost 2, a step costs 1, and cutting off
    an empty part makes it a fifth cheaper.
    """
    cell = np.array([0, 0, 0, 4, 1, 1], np.float32)
    one = np.float32(1)
    assert run_split_cost(cell, 0, one, 8, 16) == pytest.approx(1 + 3 / 9 * 2 + 7 / 9 * 4)
    assert run_split_cost(cell, 0, one, 8, 0) == pytest.approx(0.8 * (1 + 3 / 9 * 2))
    assert run_split_cost(cell, 1, one / 4, 0, 9) == pytest.approx(
        0.8 * (1 + (4 + 5 * 0.75) / 9 * 4)
    )


def test_cost_of_a_tree_worked_by_hand():
    """The same cell, its first quarter full of 8 spheres and the rest empty: 5 / 3."""
    tree = KdTree(
        bounds=np.array([0, 0, 0, 4, 1, 1], np.float32),
        split=np.array([1, 0, 0, 0, 0, 0], np.float32),
        link=np.array([0, 4 * 1 + 0, 0, 0 + LEAF, 0, 4 + LEAF], np.int32),
        first=np.array([0, 8, 8], np.int32),
        items=np.arange(8, dtype=np.int32),
        primitives=None,
        reach=1.0,
    )
    assert kd_cost(tree) == pytest.approx(1 + 3 / 9 * 2)


def all_costs(boxes, cell):
    """The cost of a split at each side of each box, by counting anew each time."""
    costs = {}
    for axis in range(3):
        for plane in np.unique(boxes[:, [axis, axis + 3]]):
            if cell[axis] < plane < cell[axis + 3]:
                below = int((boxes[:, axis] < plane).sum())
                above = int((boxes[:, axis + 3] > plane).sum())
                costs[axis, plane] = run_split_cost(cell, axis, plane, below, above)
    return costs


@pytest.mark.parametrize("n", [9, 60, EXACT_UP_TO])
def test_the_sweep_finds_the_cheapest_of_all_sides(n):
    """Sorted once a cell, against counting anew for each candidate; some sides coincide."""
    rng = np.random.default_rng(n)
    low = rng.integers(0, 12, (n, 3))
    boxes = np.hstack((low, low + rng.integers(1, 4, (n, 3)))).astype(np.float32)
    cell = np.concatenate((boxes[:, :3].min(0), boxes[:, 3:].max(0))).astype(np.float32)
    costs = all_costs(boxes, cell)
    cost, axis, plane = find_cheapest(boxes, cell)
    assert cost == min(costs.values()) == costs[axis, plane]


def test_bins_are_nearly_as_good_as_the_sweep():
    """Large cells count in bins; the split found costs within 2 % of the best one."""
    rng = np.random.default_rng(5)
    low = rng.random((2 * EXACT_UP_TO, 3)) ** 3
    boxes = np.hstack((low, low + 0.02)).astype(np.float32)
    cell = np.concatenate((boxes[:, :3].min(0), boxes[:, 3:].max(0)))
    cost, axis, plane = find_cheapest(boxes, cell)
    below = int((boxes[:, axis] < plane).sum())
    above = int((boxes[:, axis + 3] > plane).sum())
    exact = run_split_cost(cell, axis, plane, below, above)
    assert exact == pytest.approx(cost, rel=0.01)
    best = min(all_costs(boxes, cell).values())
    assert best <= exact <= 1.02 * best


def test_the_heuristic_beats_middle_and_median():
    surfaces = ball_in_a_stadium()
    cost = {name: kd_cost(check(name, "triangles", surfaces)) for name in RULES}
    assert cost["kd-sah"] < cost["kd-middle"] and cost["kd-sah"] < cost["kd-median"]


def test_no_split_is_left_that_costs_more_than_a_leaf():
    """Bad splits were retracted: a tree never costs more than all in one leaf."""
    rng = np.random.default_rng(6)
    for surfaces in (soup("spheres", 64, rng, size=2.0), soup("spheres", 9, rng)):
        n = surfaces.end - surfaces.first
        assert kd_cost(check("kd-sah", "spheres", surfaces)) <= 2 * -(-n // 8)


def test_a_ball_in_a_stadium_is_found_quickly():
    """Row 12: at most 50 primitive tests a ray, of 5002."""
    surfaces = ball_in_a_stadium()
    rays = rays_into_the_ball(RAYS, np.random.default_rng(7))
    for name in ("kd-middle", "kd-sah"):
        tests = counts(build(name, "triangles", surfaces), *rays)[PRIMITIVES]
        assert tests.mean() < 50


# ------------------------------------------------------------------------ split clipping


@entry_kernel
def run_fits(hulls, k, box, axis):
    return fits(hulls, k, box, axis)


def test_a_box_shrinks_to_the_part_of_a_triangle_in_a_slab():
    """(0 0 0) (4 0 4) (4 2 4), where x is from 1 to 2: y from 0 to 1, z from 1 to 2."""
    points = np.float32([[[0, 0, 0], [4, 0, 4], [4, 2, 4], [0, 0, 0]]])
    normal = np.float32([[np.sqrt(0.5), 0, -np.sqrt(0.5)]])
    hulls = Hulls(points, np.zeros(1, np.float32), normal)
    box = np.float32([1, 0, 0, 2, 2, 4])
    assert run_fits(hulls, 0, box, 0)
    np.testing.assert_array_equal(box, [1, 0, 1, 2, 1, 2])
    grown = Hulls(points, np.float32([0.5]), normal)
    box = np.float32([1, 0, 0, 2, 2, 4])
    assert run_fits(grown, 0, box, 0)
    np.testing.assert_array_equal(box, [1, 0, 0, 2, 1.75, 3])


def test_a_plane_that_passes_a_box_by():
    """x + y + z = 3 does not meet the unit cube, but for its far corner."""
    points = np.float32([[[3, 0, 0], [0, 3, 0], [0, 0, 3], [3, 0, 0]]])
    hulls = Hulls(points, np.float32([0.01]), np.full((1, 3), np.sqrt(1 / 3), np.float32))
    for side, meets in ((0.98, False), (1.0, True)):
        box = np.float32([0, 0, 0, side, side, side])
        assert run_fits(hulls, 0, box, 0) == meets


def test_a_needle_across_space_is_in_few_cells():
    """Diagonals of a cube: by their boxes alone they would be in nearly all cells."""
    rng = np.random.default_rng(8)
    start = rng.uniform(-1, -0.9, (200, 3))
    end = -start + rng.uniform(-0.1, 0.1, (200, 3))
    needles = triangles(np.stack((start, end, end + 1e-3), 1))
    tree = check("kd-middle", "triangles", needles)
    cells, _ = kd_cells(tree)
    leaves = np.flatnonzero(tree.link[1::2] & 3 == LEAF)
    cell, box = cells[leaves], extents("triangles", needles)
    lower, upper = box.lower.T[:, None], box.upper.T[:, None]
    overlaps = ((lower < cell[:, 3:]) & (upper > cell[:, :3])).all(axis=2)
    assert len(leaves) > 30
    assert len(tree.items) < 0.25 * overlaps.sum()


def test_hulls_hold_the_radius_and_the_pad():
    surfaces = soup("spheres", 3, np.random.default_rng(9))
    hulls = hulls_of(extents("spheres", surfaces))
    assert (hulls.growth > surfaces.radius + 0.9 * 32 * 2**-24 * REACH).all()


# ------------------------------------------------------------------------------- the hits


@every_name
@pytest.mark.parametrize("kind", ["triangles", "spheres"])
def test_hits_of_a_soup(name, kind):
    rng = np.random.default_rng(10)
    surfaces = soup(kind, 400, rng, size=0.5)
    tree = build(name, kind, surfaces)
    origin = rng.uniform(-1.5, 1.5, (RAYS, 3))
    truth = assert_same_hits(tree, kind, surfaces, origin, directions(RAYS, rng))
    assert 0.1 < np.mean(truth.prim >= 0) < 1
    origin, direction = rays_in_planes(*planes_of(tree), RAYS, rng)
    truth = assert_same_hits(tree, kind, surfaces, origin, direction)
    assert 0.1 < np.mean(truth.prim >= 0) < 1


@every_name
def test_walls_in_split_planes(name):
    """Walls where cells are halved, and rays along, in and across them (rows 6, 7, 13)."""
    rng = np.random.default_rng(11)
    surfaces = walls()
    tree = check(name, "rectangles", surfaces)
    if name == "kd-middle":
        assert (planes_of(tree)[0] == 0).any()
    heights = np.array([-2.0, 0.0, 2.0] * 3)
    axes = np.repeat([0, 1, 2], 3)
    for _ in range(4):
        origin, direction = rays_in_planes(heights, axes, RAYS, rng)
        truth = assert_same_hits(tree, "rectangles", surfaces, origin, direction)
        assert 0.2 < np.mean(truth.prim >= 0)
        lattice = np.round(2 * origin) / 2
        assert_same_hits(tree, "rectangles", surfaces, lattice, direction)


@every_name
def test_ends_of_rays(name):
    """A hit at t_max counts; one unit before it, it does not."""
    rng = np.random.default_rng(12)
    surfaces = soup("triangles", 300, rng, size=0.5)
    tree = build(name, "triangles", surfaces)
    origin, direction = rng.uniform(-1.5, 1.5, (RAYS, 3)), directions(RAYS, rng)
    t = closest(tree, origin, direction).t
    hit = np.isfinite(t)
    assert hit.sum() > 100
    origin, direction, t = origin[hit], direction[hit], t[hit]
    at_end = assert_same_hits(tree, "triangles", surfaces, origin, direction, t)
    assert (at_end.prim >= 0).all()
    before = np.nextafter(t, np.float32(0))
    short = assert_same_hits(tree, "triangles", surfaces, origin, direction, before)
    assert (short.prim < 0).all()


@pytest.mark.parametrize("distance", [1e2, 1e4, 1e6])
def test_rays_from_beyond_the_reach_test_all(distance):
    """Their rounding may exceed the pad; rays from inside do not pay for that."""
    rng = np.random.default_rng(13)
    surfaces = soup("triangles", 300, rng, size=0.5)
    tree = build("kd-sah", "triangles", surfaces)
    direction = directions(RAYS, rng)
    origin = rng.uniform(-1, 1, (RAYS, 3)) - distance * direction
    truth = assert_same_hits(tree, "triangles", surfaces, origin, direction)
    assert (truth.prim >= 0).sum() > 50
    far = counts(tree, origin, direction)
    assert (far[PRIMITIVES] == len(tree.items)).all() and not far[NODES].any()
    near = counts(tree, origin + distance * direction, direction)
    assert near[PRIMITIVES].mean() < 0.5 * len(tree.items)


@every_name
def test_rays_that_are_no_rays_miss(name):
    """NaN, infinity, direction zero (row 9): no hit, and no more work than others."""
    rng = np.random.default_rng(14)
    surfaces = soup("triangles", 300, rng, size=0.5)
    tree = build(name, "triangles", surfaces)
    bad = [np.nan, np.inf, -np.inf]
    places = [(k, x) for k in range(3) for x in bad]
    origin = np.full((2 * len(places) + 1, 3), 0.1)
    direction = np.tile([0.6, 0.48, 0.64], (len(origin), 1))
    for row, (k, x) in enumerate(places):
        origin[row, k] = x
        direction[len(places) + row, k] = x
    direction[-1] = 0
    truth = assert_same_hits(tree, "triangles", surfaces, origin, direction)
    assert (truth.prim < 0).all()
    assert (counts(tree, origin, direction)[NODES] < len(tree.link) // 4).all()


def test_counts_of_a_tree_worked_by_hand():
    """Eight triangles at x = -1 and eight at 1: a root and two leaves.

    A ray along x that misses them visits all three nodes, and one waits meanwhile; one that
    hits the first eight is done there. A ray across, at x = 1, goes to one leaf only.
    """
    shape = np.array([[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0, 0.1]])
    where = np.repeat([-1.0, 1.0], 8)[:, None] * np.eye(3)[:1]
    tree = build("kd-middle", "triangles", triangles(where[:, None] + shape))
    assert np.diff(tree.first).tolist() == [8, 8]
    origin = np.array([[-2, 0.09, 0.09], [-2, 0, 0], [1, 0.05, 1]])
    tally = counts(tree, origin, np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, -1]]))
    np.testing.assert_array_equal(tally[NODES], [3, 2, 2])
    np.testing.assert_array_equal(tally[BOXES], [1, 1, 1])
    np.testing.assert_array_equal(tally[PRIMITIVES], [16, 8, 8])
    np.testing.assert_array_equal(tally[STACK], [1, 1, 0])


# ---------------------------------------------------------------------------- validation


def broken(tree, field, index, value):
    array = getattr(tree, field).copy()
    array[index] = value
    return tree._replace(**{field: array})


def test_validation_sees_every_kind_of_damage():
    """The check itself must be able to fail, or it proves nothing."""
    surfaces = soup("triangles", 300, np.random.default_rng(15), size=0.3)
    held = extents("triangles", surfaces)
    tree = build("kd-sah", "triangles", surfaces)
    validate_kd_tree(tree, held)
    axis = tree.link[1::2] & 3
    leaf = int(np.flatnonzero(axis == LEAF)[0])
    outer = np.flatnonzero((axis[1:] != LEAF) & (axis[1:] == axis[0]))[0] + 1
    last = len(axis) - 1
    fewer = tree._replace(first=np.minimum(tree.first, len(tree.items) - 1))
    damages = {
        "splits": tree._replace(split=tree.split[:-1]),
        "comes after its children": broken(tree, "link", 1, 0),
        "do not exist": broken(tree, "link", 1, 4 * last),
        "not the child of exactly one": broken(tree, "link", 1, 4 * 3),
        "not numbered": broken(tree, "link", 2 * leaf + 1, 4 * 10**6 + LEAF),
        "plane outside": broken(tree, "split", 0, 7.0),
        "outside of its cell": broken(tree, "split", 2 * outer, tree.split[0] + 9),
        "ends too early": broken(tree, "first", 1, 10**6),
        "leaves hold": fewer,
        "no primitive": broken(tree, "items", 0, 300),
        "twice": broken(tree, "items", 1, tree.items[0]),
        "beside it": broken(tree, "items", 0, np.setdiff1d(range(300), tree.items[:40])[0]),
        "out of bounds": tree._replace(bounds=tree.bounds * np.float32(0.9)),
        "primitives, ": tree._replace(
            primitives=tree.primitives._replace(count=tree.primitives.count - 1)
        ),
    }
    for message, damaged in damages.items():
        with pytest.raises(ValueError, match=message):
            validate_kd_tree(damaged, held)


def test_validation_sees_a_moved_plane():
    """All links in place, but what lies between the old plane and the new one is lost."""
    surfaces = soup("spheres", 300, np.random.default_rng(16), size=0.2)
    tree = build("kd-sah", "spheres", surfaces)
    moved = broken(tree, "split", 0, tree.split[0] + np.float32(0.1))
    with pytest.raises(ValueError, match=r"node \d+ does not list primitive \d+"):
        validate_kd_tree(moved, extents("spheres", surfaces))


def test_validation_sees_a_dropped_reference():
    """A leaf without one of its primitives; the others as they were."""
    surfaces = soup("rectangles", 100, np.random.default_rng(17), size=0.5)
    tree = build("kd-median", "rectangles", surfaces)
    held = extents("rectangles", surfaces)
    full = int(np.flatnonzero(np.diff(tree.first) == np.diff(tree.first).max())[0])
    lost = 0
    for place in range(tree.first[full], tree.first[full + 1]):
        kept = np.delete(np.arange(len(tree.items)), place)
        ids = tree.primitives.id[kept]
        primitives = tree.primitives._replace(id=ids, count=len(kept))
        first = tree.first - (np.arange(len(tree.first)) > full).astype(np.int32)
        damaged = tree._replace(first=first, items=tree.items[kept], primitives=primitives)
        try:
            validate_kd_tree(damaged, held)
        except ValueError as error:
            assert "does not list" in str(error)
            lost += 1
    assert lost >= 0.8 * np.diff(tree.first).max()


def test_a_tree_deeper_than_the_stack_is_refused():
    """A chain of 61 splits."""
    length = MAX_DEPTH + 1
    split = np.zeros(2 * (2 * length + 1), np.float32)
    link = np.empty_like(split, np.int32)
    for k in range(length):
        node = 0 if k == 0 else 2 * k
        split[2 * node] = 1 - 0.7**k
        link[2 * node + 1] = 4 * (2 * k + 1)
        link[2 * (2 * k + 1) + 1] = 4 * k + LEAF
    link[2 * (2 * length) + 1] = 4 * length + LEAF
    surfaces = soup("spheres", 1, np.random.default_rng(18))
    tree = build("kd-sah", "spheres", surfaces)
    chain = tree._replace(
        split=split, link=link, first=np.repeat([0, 1], [1, length + 1]).astype(np.int32)
    )
    with pytest.raises(ValueError, match="too deep"):
        validate_kd_tree(chain, extents("spheres", surfaces))
