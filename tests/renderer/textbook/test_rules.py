"""How the textbook's builders choose: worked by hand, or against a slow search."""

from __future__ import annotations

import numpy as np
import pytest
from agreement import proved
from kernel_probes import accelerator, rectangles, soup, spheres, triangles, unit
from textbook_cases import REACH, axis_directions, ball_in_a_stadium, counts

from renderer.kernels.jit import entry_kernel
from renderer.kernels.records.batch import BOXES, NODES, PRIMITIVES, SAVED, STACK
from renderer.plugins.shapes.extents import extents_of
from renderer.textbook.cell_tree import CellTree, cells_of, tree_cost
from renderer.textbook.cell_tree_build import LEAF, Places
from renderer.textbook.kd_tree import BINS, CHEAPEST, KdRule, cheapest_plane, split_cost
from renderer.textbook.uniform_grid import DENSITY, build_uniform_grid
from renderer.textbook.validate import validate_structure

# ------------------------------------------------------------ the surface area heuristic


@entry_kernel
def run_split_cost(cell, axis, position, below, above):
    return split_cost(cell, axis, position, below, above)


@entry_kernel
def run_cheapest_plane(rule, places, columns, cell, plane):
    return cheapest_plane(rule, places, columns, cell, plane)


def test_cost_of_a_split_worked_by_hand():
    """A cell of 4 x 1 x 1 has half area 9; cut at 1: parts of half area 3 and 7.

    A test costs 2, a step 1, and cutting off an empty part makes it a fifth cheaper.
    """
    cell, one = np.array([0, 0, 0, 4, 1, 1], np.float32), np.float32(1)
    cost = run_split_cost(cell, 0, one, 8, 16)
    assert cost == pytest.approx(1 + 3 / 9 * 16 + 7 / 9 * 32)
    cost = run_split_cost(cell, 0, one, 8, 0)
    assert cost == pytest.approx(0.8 * (1 + 3 / 9 * 16))
    cost = run_split_cost(cell, 1, one / 4, 0, 9)
    assert cost == pytest.approx(0.8 * (1 + (4 + 5 * 0.75) / 9 * 18))


def test_cost_of_a_tree_worked_by_hand():
    """The same cell, its first quarter full of 8 spheres and the rest empty."""
    plane = np.zeros((3, 4), np.float32)
    plane[0] = 1, 0, 0, 1
    tree = CellTree(
        plane=plane,
        child=np.array([1, 0, 0], np.int32),
        first=np.array([0, 0, 8], np.int32),
        end=np.array([0, 8, 8], np.int32),
        items=np.arange(8, dtype=np.int32),
        bounds=np.array([0, 0, 0, 4, 1, 1], np.float32),
        reach=np.float32(5),
        primitives=None,
    )
    assert tree_cost(tree) == pytest.approx(1 + 3 / 9 * 16)
    tilted = plane.copy()
    tilted[0, :3] = 0.6, 0.8, 0
    assert tree_cost(tree._replace(plane=tilted)) is None


@pytest.mark.parametrize("n", [9, 500])
def test_bins_are_nearly_as_good_as_all_sides(n):
    """The plane found costs within 5 % of the best one at the side of a box."""
    rng = np.random.default_rng(n)
    low = rng.random((n, 3)) ** 3
    boxes = np.hstack((low, low + 0.02)).astype(np.float32)
    cell = np.concatenate((boxes[:, :3].min(0), boxes[:, 3:].max(0)))
    rule = KdRule(CHEAPEST, np.zeros(BINS, np.int64), np.zeros(BINS, np.int64))
    empty = np.zeros((n, 4, 3), np.float32), np.zeros(n, np.float32), boxes[:, :3]
    plane = np.zeros(4, np.float32)
    assert run_cheapest_plane(rule, Places(boxes, *empty), np.arange(n), cell, plane)

    def cost(axis, position):
        below = int((boxes[:, axis] < position).sum())
        above = int((boxes[:, axis + 3] > position).sum())
        return run_split_cost(cell, axis, position, below, above)

    costs = [
        cost(axis, position)
        for axis in range(3)
        for position in np.unique(boxes[:, [axis, axis + 3]])
        if cell[axis] < position < cell[axis + 3]
    ]
    assert cost(int(plane[:3].argmax()), plane[3]) <= 1.05 * min(costs)


def test_the_heuristic_beats_middle_and_median():
    surfaces = ball_in_a_stadium()
    names = ("kd-sah", "kd-middle", "kd-median")
    cost = [tree_cost(proved(name, "triangles", surfaces)) for name in names]
    assert cost[0] < min(cost[1:])


def test_counts_of_a_tree_worked_by_hand():
    """Four triangles at x = -1 and four at 1: a root and two leaves.

    A ray along x that misses them visits all three nodes, and one waits meanwhile; one that
    hits the first four is done there. A ray across, at x = 1, goes to one leaf only.
    """
    shape = np.array([[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0, 0.1]])
    where = np.repeat([-1.0, 1.0], LEAF)[:, None] * np.eye(3)[:1]
    tree = proved("kd-middle", "triangles", triangles(where[:, None] + shape), REACH)
    assert (tree.end - tree.first)[tree.child == 0].tolist() == [LEAF, LEAF]
    origin = np.array([[-2, 0.09, 0.09], [-2, 0, 0], [1, 0.05, 1]])
    tally = counts(tree, origin, np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, -1]]))
    np.testing.assert_array_equal(tally[NODES], [3, 2, 2])
    np.testing.assert_array_equal(tally[BOXES], [2, 2, 2])
    np.testing.assert_array_equal(tally[PRIMITIVES], [8, 4, 4])
    np.testing.assert_array_equal(tally[STACK], [1, 1, 0])


# ------------------------------------------------------------------------------ octree


def test_cells_of_eight_clusters():
    """Small triangles in each corner of a cube: eight equal cells, cut no further."""
    rng = np.random.default_rng(0)
    corners = np.indices((2, 2, 2)).reshape(3, -1).T * 2.0 - 1
    c = np.repeat(corners, LEAF, axis=0)
    made = triangles(c[:, None] + 0.1 * rng.random((len(c), 3, 3)))
    tree = proved("octree", "triangles", made)
    leaves = np.flatnonzero(tree.child == 0)
    assert len(leaves) == 8 and (tree.end - tree.first)[leaves].tolist() == 8 * [LEAF]
    cells, depth = cells_of(tree)
    assert (depth[leaves] == 3).all()
    for leaf in leaves:
        held = corners[tree.items[tree.first[leaf] : tree.end[leaf]] // LEAF]
        assert (held == held[0]).all()
        middle = held[0] + 0.05
        assert ((cells[leaf, :3] < middle) & (middle < cells[leaf, 3:])).all()


# ------------------------------------------------------------------------------- grids


def test_the_resolution_follows_the_cube_root():
    """n^(1/3) along each edge of a cube, n^(1/2) in a plane, n on a line."""
    n = 27 * 64
    cube = spheres(np.indices((12, 12, 12)).reshape(3, -1).T, np.full(n, 0.5))
    side = int(np.cbrt(DENSITY * n))
    x, y = np.indices((20, 20)).reshape(2, -1)
    corner, (e1, e2, _) = np.stack((x, y, np.zeros(400)), axis=1), np.eye(3)
    flat = rectangles(corner, np.tile(e1, (400, 1)), np.tile(e2, (400, 1)))
    line = spheres(np.arange(500.0)[:, None] * [1, 0, 0], np.full(500, 1e-3))
    for kind, surfaces, expected in (
        ("spheres", cube, [side] * 3),
        ("rectangles", flat, [40, 40, 1]),
        ("spheres", line, [DENSITY * 500, 1, 1]),
    ):
        assert proved("grid", kind, surfaces).resolution[0].tolist() == expected


def test_the_number_of_steps_is_bounded():
    """At most nx + ny + nz cells, whichever way; exactly nx along x (failure mode 10)."""
    rng = np.random.default_rng(6)
    grid = proved("grid", "triangles", soup("triangles", 3000, rng, size=1e-3), 40.0)
    (nx, ny, nz), size = grid.resolution[0].tolist(), grid.size[0]
    direction = axis_directions()[rng.integers(0, 56, 3000)] * size
    corner = grid.lower[0] + rng.integers(0, grid.resolution + 1, (3000, 3)) * size
    cells = counts(grid, corner - 100 * direction, unit(direction))[NODES]
    assert nx + ny < cells.max() <= nx + ny + nz
    y, z = np.indices((ny, nz)).reshape(2, -1) + 0.5
    places = np.stack((np.full(ny * nz, -1.0), y, z), 1)
    rows_of_cells = grid.lower[0] + places * size
    along_x = counts(grid, rows_of_cells, np.tile([1.0, 0, 0], (ny * nz, 1)))
    np.testing.assert_array_equal(along_x[NODES][along_x[PRIMITIVES] == 0], nx)
    above = rows_of_cells + np.array([0.0, 0.0, 3.0])
    passing = counts(grid, above, np.tile([1.0, -0.0, 0.0], (ny * nz, 1)))
    assert (passing[NODES] == 0).all() and (passing[BOXES] == 1).all()


def test_mailboxes_save_all_tests_but_one():
    """Failure mode 11: a triangle across 32^3 cells, and rays in its plane.

    Each cell on their way holds the triangle, so that without mailboxes there are as many
    tests as cells, and one with them.
    """
    big = triangles([[[0, 0, 0], [1, 1, 0], [0.5, 0.5, 1.0]]])
    height = np.linspace(0.05, 0.4, 50)
    origin = np.stack((np.full(50, -0.5), np.full(50, -0.5), height), axis=1)
    direction = np.tile(unit([1.0, 1.0, 0.1]), (50, 1))
    extents = extents_of("triangles", big, np.arange(1), 4.0)
    tallies = []
    for mailboxed in (None, 64):
        accel = build_uniform_grid(
            extents,
            lambda columns: accelerator("triangles", big, "brute").primitives,
            mailboxed,
            density=33_000,
        )
        assert accel.resolution.tolist() == [[32, 32, 32]]
        validate_structure(accel, extents)
        tallies.append(counts(accel, origin, direction))
    without, with_mailboxes = tallies
    assert without[NODES].min() >= 32
    np.testing.assert_array_equal(without[PRIMITIVES], without[NODES])
    np.testing.assert_array_equal(with_mailboxes[PRIMITIVES], 1)
    np.testing.assert_array_equal(with_mailboxes[SAVED], without[NODES] - 1)
