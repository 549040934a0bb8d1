"""The octree: sound whatever it is built over, bounded, and exact.

The big comparison of all structures is elsewhere; here are the cases that an octree in
particular can get wrong (failure modes 6, 7, 9 and 13 of the project's list).
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import FIRST_ID, KINDS, accelerator, directions, soup, triangles
from tree_cases import (
    RAYS,
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

from renderer.accelerators.octree_and_bsp.octree import STACK, validate_octree
from renderer.accelerators.octree_and_bsp.octree_build import (
    EMPTY,
    LEAF_SIZE,
    MAX_DEPTH,
    ROOM,
)
from renderer.accelerators.octree_and_bsp.octree_checks import octree_cells
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES
from renderer.kernels.records.tally import STACK as WAITING


def check(kind, surfaces):
    """Build, validate, and bound what is built."""
    tree = build("octree", kind, surfaces)
    n = surfaces.end - surfaces.first
    validate_octree(tree, extents(kind, surfaces))
    assert len(tree.items) + len(tree.centre) <= ROOM * n
    assert octree_cells(tree)[1].max() <= MAX_DEPTH
    return tree


def planes_of(tree):
    """Coordinate and axis of every plane between cells."""
    return tree.centre.ravel(), np.tile([0, 1, 2], len(tree.centre))


# ------------------------------------------------------------------------ what is built


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "size"), [(1, 1.0), (9, 0.1), (500, 0.1), (300, 2.0)])
def test_soups_of_every_kind(kind, n, size):
    check(kind, soup(kind, n, np.random.default_rng(n), size=size))


def test_cells_of_eight_clusters():
    """Nine small triangles in each corner of a cube: eight cells, cut no further."""
    rng = np.random.default_rng(0)
    corners = np.indices((2, 2, 2)).reshape(3, -1).T * 2.0 - 1
    c = np.repeat(corners, LEAF_SIZE, axis=0)
    tree = check("triangles", triangles(c[:, None] + 0.1 * rng.random((len(c), 3, 3))))
    assert len(tree.centre) == 1
    assert np.diff(tree.first).tolist() == [0] + 8 * [LEAF_SIZE]
    for octant, leaf in enumerate(-1 - tree.link[1:]):  # 4 z + 2 y + x
        held = tree.items[tree.first[leaf] : tree.first[leaf + 1]] // LEAF_SIZE
        x, y, z = corners[held[0]] > 0
        assert (held == held[0]).all() and octant == 4 * z + 2 * y + x


def test_coincident_triangles_stay_together():
    """Cells that all hold all of them do not help."""
    tree = check("triangles", coincident(10_000))
    assert len(tree.centre) == 0 and len(tree.items) == 10_000


def test_a_hundred_thousand_duplicates_between_others():
    """Row 13: the build ends, and the smallest id of the duplicates is hit."""
    surfaces = coincident(100_000)
    few = soup("triangles", 100, np.random.default_rng(0), size=0.5)
    for field in ("corner", "edge1", "edge2", "normal"):
        getattr(surfaces, field)[:, 5::1000] = getattr(few, field)
    tree = build("octree", "triangles", surfaces)
    assert len(tree.items) + len(tree.centre) <= ROOM * 100_000
    rng = np.random.default_rng(1)
    origin = rng.uniform(-1.5, 1.5, (64, 3))
    direction = rng.uniform(0.3, 0.6, (64, 3)) - origin
    truth = assert_same_hits(tree, "triangles", surfaces, origin, direction)
    assert (truth.prim == FIRST_ID).any()


def test_equal_centroids():
    tree = check("spheres", concentric(500))
    rng = np.random.default_rng(2)
    origin = rng.uniform(-4, 4, (RAYS, 3))
    assert_same_hits(tree, "spheres", concentric(500), origin, directions(RAYS, rng))


@pytest.mark.slow
def test_a_line_of_a_hundred_thousand():
    """Each level halves it: 2^14 cells along it would hold six, were they not grown.

    The cube's own middle is also that of every square, so that the first cut copies all.
    """
    tree = check("rectangles", line(100_000))
    assert 14 <= octree_cells(tree)[1].max() <= MAX_DEPTH
    assert np.diff(tree.first).max() <= 2 * LEAF_SIZE


def test_the_depth_ends_where_it_must():
    """Two heaps of 20, 10^6 times as far apart as they are large."""
    rng = np.random.default_rng(3)
    heaps = np.repeat([[0.1, 0.1, 0.1], [1.0, 1, 1]], 20, axis=0)[:, None]
    surfaces = triangles(heaps + 1e-6 * rng.random((40, 3, 3)))
    tree = accelerator("triangles", surfaces, "octree")
    assert octree_cells(tree)[1].max() == MAX_DEPTH
    assert len(tree.centre) < 2 * MAX_DEPTH


def test_the_same_primitives_give_the_same_tree():
    surfaces = soup("triangles", 2000, np.random.default_rng(4), size=0.2)
    first, second = (build("octree", "triangles", surfaces) for _ in range(2))
    for a, b in zip(first[:5], second[:5], strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_grid_of_cells_adapts_to_a_ball_in_a_stadium():
    """Row 12: a small share of 5002 primitives, where a uniform grid tests nearly all."""
    surfaces = ball_in_a_stadium()
    tree = check("triangles", surfaces)
    rays = rays_into_the_ball(RAYS, np.random.default_rng(7))
    assert counts(tree, *rays)[PRIMITIVES].mean() < 100


# ------------------------------------------------------------------------------- the hits


@pytest.mark.parametrize("kind", ["triangles", "spheres"])
def test_hits_of_a_soup(kind):
    rng = np.random.default_rng(10)
    surfaces = soup(kind, 400, rng, size=0.5)
    tree = build("octree", kind, surfaces)
    origin = rng.uniform(-1.5, 1.5, (RAYS, 3))
    truth = assert_same_hits(tree, kind, surfaces, origin, directions(RAYS, rng))
    assert 0.1 < np.mean(truth.prim >= 0) < 1
    for _ in range(3):
        origin, direction = rays_in_planes(*planes_of(tree), RAYS, rng)
        truth = assert_same_hits(tree, kind, surfaces, origin, direction)
        assert 0.1 < np.mean(truth.prim >= 0) < 1


def test_rays_through_centres_edges_and_corners_of_cells():
    """Where a ray meets two or three planes at once, cells of no length are passed over."""
    rng = np.random.default_rng(20)
    surfaces = soup("triangles", 400, rng, size=0.5)
    tree = build("octree", "triangles", surfaces)
    target = tree.centre[rng.integers(0, len(tree.centre), RAYS)]
    signs = rng.choice([-1.0, 0.0, -0.0, 1.0], (RAYS, 3))
    signs[~signs.any(axis=1)] = 1
    for distance in (0.0, 0.5, 2.0):
        origin = target - distance * signs
        truth = assert_same_hits(tree, "triangles", surfaces, origin, signs)
        assert 0.1 < np.mean(truth.prim >= 0) < 1


def test_walls_between_cells():
    """Walls where cells meet, and rays along, in and across them (rows 6, 7, 13)."""
    rng = np.random.default_rng(11)
    surfaces = walls()
    tree = check("rectangles", surfaces)
    assert (np.abs(tree.centre[0]) < 1e-6).all()
    heights, axes = np.array([-2.0, 0.0, 2.0] * 3), np.repeat([0, 1, 2], 3)
    for _ in range(4):
        origin, direction = rays_in_planes(heights, axes, RAYS, rng)
        truth = assert_same_hits(tree, "rectangles", surfaces, origin, direction)
        assert 0.2 < np.mean(truth.prim >= 0)
        lattice = np.round(2 * origin) / 2
        assert_same_hits(tree, "rectangles", surfaces, lattice, direction)


@pytest.mark.parametrize("distance", [1e2, 1e4, 1e6])
def test_rays_from_beyond_the_reach_test_all(distance):
    """Their rounding may exceed the pad; rays from inside do not pay for that."""
    rng = np.random.default_rng(13)
    surfaces = soup("triangles", 300, rng, size=0.5)
    tree = build("octree", "triangles", surfaces)
    direction = directions(RAYS, rng)
    origin = rng.uniform(-1, 1, (RAYS, 3)) - distance * direction
    truth = assert_same_hits(tree, "triangles", surfaces, origin, direction)
    assert (truth.prim >= 0).sum() > 50
    far = counts(tree, origin, direction)
    assert (far[PRIMITIVES] == len(tree.items)).all() and not far[NODES].any()
    near = counts(tree, origin + distance * direction, direction)
    assert near[PRIMITIVES].mean() < 0.5 * len(tree.items)


def test_rays_that_are_no_rays_miss():
    """NaN, infinity, direction zero (row 9): no hit, and each cell visited once at most."""
    rng = np.random.default_rng(14)
    surfaces = soup("triangles", 300, rng, size=0.5)
    tree = build("octree", "triangles", surfaces)
    places = [(k, x) for k in range(3) for x in (np.nan, np.inf, -np.inf)]
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
    """Eight clusters; a ray along the diagonal of an octant visits that and no more.

    Root and cells count as nodes, the root's three planes as boxes. Along x between the
    clusters, a ray visits two of the eight cells; along no axis, through four of them.
    """
    rng = np.random.default_rng(0)
    corners = np.indices((2, 2, 2)).reshape(3, -1).T * 2.0 - 1
    c = np.repeat(corners, LEAF_SIZE, axis=0)
    tree = build(
        "octree", "triangles", triangles(c[:, None] + 0.1 * rng.random((64, 3, 3)))
    )
    origin = np.array([[-2, 0.6, 0.6], [-0.2, 0.6, 0.6], [0.9, 0.8, 0.5]])
    direction = np.array([[1.0, 0, 0], [-1, 0, 0], [-0.9, -1.1, -1.3]])
    tally = counts(tree, origin, direction)
    np.testing.assert_array_equal(tally[NODES], [3, 2, 5])
    np.testing.assert_array_equal(tally[BOXES], [3, 3, 3])
    np.testing.assert_array_equal(tally[PRIMITIVES], [16, 8, 32])
    np.testing.assert_array_equal(tally[WAITING], [2, 1, 4])


def test_the_stack_is_large_enough():
    """A visited cell makes room for at most four, and paths are MAX_DEPTH long."""
    assert 3 * MAX_DEPTH + 1 <= STACK


# ---------------------------------------------------------------------------- validation


def broken(tree, field, index, value):
    array = getattr(tree, field).copy()
    array[index] = value
    return tree._replace(**{field: array})


def test_validation_sees_every_kind_of_damage():
    """The check itself must be able to fail, or it proves nothing."""
    surfaces = soup("triangles", 500, np.random.default_rng(15), size=0.3)
    held = extents("triangles", surfaces)
    tree = build("octree", "triangles", surfaces)
    validate_octree(tree, held)
    inner = int(np.flatnonzero(tree.link > 0)[0])
    leaf = int(np.flatnonzero(tree.link < EMPTY)[0])
    outside = tree.centre.copy()
    outside[tree.link[inner]] += 9
    other = np.setdiff1d(range(500), tree.items[:40])[0]
    damages = {
        "blocks, but": tree._replace(link=tree.link[:-1]),
        "do not exist": broken(tree, "link", inner, len(tree.centre)),
        "comes after its children": broken(tree, "link", inner, 0),
        "not part of exactly one": broken(tree, "link", inner, EMPTY),
        "not numbered": broken(tree, "link", leaf, tree.link[leaf] - 1),
        "not empty": broken(tree, "first", 1, 1),
        "outside of the cell": tree._replace(centre=outside),
        "ends too early": broken(tree, "first", 2, 10**6),
        "leaves hold": tree._replace(first=np.minimum(tree.first, len(tree.items) - 1)),
        "no primitive": broken(tree, "items", 0, -1),
        "twice": broken(tree, "items", 1, tree.items[0]),
        "beside it": broken(tree, "items", 0, other),
        "out of bounds": tree._replace(bounds=tree.bounds * np.float32(0.9)),
        "primitives, ": tree._replace(
            primitives=tree.primitives._replace(count=tree.primitives.count - 1)
        ),
        "does not list": broken(tree, "centre", (0, 0), tree.centre[0, 0] + 0.1),
    }
    for message, damaged in damages.items():
        with pytest.raises(ValueError, match=message):
            validate_octree(damaged, held)


def test_validation_sees_a_leaf_that_was_emptied():
    """A cell that says it is empty, its leaf dropped with all that it listed."""
    surfaces = soup("spheres", 300, np.random.default_rng(16), size=0.2)
    tree = build("octree", "spheres", surfaces)
    cell = int(np.argmin(tree.link))  # the last leaf
    last = -1 - tree.link[cell]
    kept = tree.first[last]
    damaged = broken(tree, "link", cell, EMPTY)._replace(
        first=tree.first[:-1],
        items=tree.items[:kept],
        primitives=tree.primitives._replace(count=int(kept)),
    )
    with pytest.raises(ValueError, match=rf"cell {cell} does not list primitive"):
        validate_octree(damaged, extents("spheres", surfaces))


def test_a_tree_deeper_than_the_stack_is_refused():
    """A chain of 17 blocks, in each of which the last cell goes on."""
    length = MAX_DEPTH + 1
    link = np.full(1 + 8 * length, EMPTY, np.int32)
    link[0] = 0
    link[8 : 8 * length : 8] = np.arange(1, length)
    link[-1] = EMPTY - 1
    centre = np.repeat(-(0.5 ** np.arange(length, dtype=np.float32))[:, None], 3, axis=1)
    surfaces = soup("spheres", 1, np.random.default_rng(18))
    tree = build("octree", "spheres", surfaces)
    chain = tree._replace(centre=centre, link=link)
    with pytest.raises(ValueError, match="too deep"):
        validate_octree(chain, extents("spheres", surfaces))
