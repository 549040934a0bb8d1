"""The binary space partitioning tree: its planes, its proof of itself, and its hits.

Every comparison is with brute force, bit for bit; a tree is validated before it is asked.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import (
    FIRST_ID,
    KINDS,
    blocked,
    closest,
    directions,
    fill,
    rectangles,
    soup,
    trace,
    triangles,
    unit,
    workspace,
)

from renderer.accelerators.build import build_accelerator
from renderer.accelerators.octree_and_bsp.bsp import Bsp, validate_bsp
from renderer.accelerators.octree_and_bsp.bsp_build import EXTRA, LEAF, MAX_DEPTH
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, STACK, make_tally
from renderer.plugins.shapes.extents import extents_of

RAYS = 2000
every_kind = pytest.mark.parametrize("kind", KINDS)


def build(kind, surfaces, reach=0.0):
    """Return the tree, proven, and the extents it was built over."""
    order = np.arange(surfaces.end - surfaces.first)
    tree = build_accelerator(kind, surfaces, order, "bsp", reach)
    extents = extents_of(kind, surfaces, order, reach)
    validate_bsp(tree, extents)
    return tree, extents


def depth_of(tree: Bsp) -> int:
    depth = np.zeros(len(tree.child), int)
    for node in np.flatnonzero(tree.count == 0):
        depth[tree.child[node]] = depth[tree.child[node] + 1] = depth[node] + 1
    return int(depth.max())


def assert_same_hits(kind, surfaces, origin, direction, reach=None):
    """Compare with brute force, whose hits are returned; all rays start within reach."""
    if reach is None:
        reach = 1.001 * float(np.abs(origin).sum(axis=-1).max())
    tree, _ = build(kind, surfaces, reach)
    brute = build_accelerator(kind, surfaces, np.arange(tree.items.max() + 1), "brute")
    truth, found = (closest(accel, origin, direction) for accel in (brute, tree))
    hit = truth.prim >= 0
    np.testing.assert_array_equal(found.prim, truth.prim)
    for got, expected in zip(found, truth, strict=True):
        np.testing.assert_array_equal(got[hit].view(np.int32), expected[hit].view(np.int32))
    np.testing.assert_array_equal(blocked(tree, origin, direction), hit)
    return truth


def some(truth, least=0.01):
    """Both hits and misses must be there, or the comparison shows nothing."""
    assert least < np.mean(truth.prim >= 0) < 1


def icosphere(levels):
    """Triangles (20 * 4^levels, 3, 3) of a unit sphere, corners shared bit for bit."""
    g = (1 + 5**0.5) / 2
    v = unit([[a, b * g, 0] for a in (-1, 1) for b in (-1, 1)])
    v = np.concatenate((v, np.roll(v, 1, axis=1), np.roll(v, 2, axis=1)))
    near = np.linalg.norm(v[:, None] - v, axis=2) < 1.2
    mesh = [
        (i, j, k)
        for i in range(12)
        for j in range(i)
        for k in range(j)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    p = v[np.array(mesh)]
    for _ in range(levels):
        a, b, c = p[:, 0], p[:, 1], p[:, 2]
        ab, bc, ca = unit(a + b), unit(b + c), unit(c + a)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        p = np.concatenate([np.stack(t, 1) for t in parts])
    return p


def stack_of_sheets(n, rng):
    """n parallel squares of edge 1, 1/n apart, tilted; and their common unit normal."""
    frame, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    x, y, z = frame.T
    corner = -0.5 * (x + y) + (np.arange(n)[:, None] / n - 0.5) * z
    return rectangles(corner, np.tile(x, (n, 1)), np.tile(y, (n, 1))), frame.T


# --------------------------------------------------------------------------------- hits


@every_kind
@pytest.mark.parametrize("size", [0.1, 1.0])
def test_random_soups(kind, size):
    """At size 1 nearly every plane has most primitives on both sides."""
    rng = np.random.default_rng(0)
    origin = rng.uniform(-1.5, 1.5, (RAYS, 3))
    some(
        assert_same_hits(
            kind, soup(kind, 300, rng, size=size), origin, directions(RAYS, rng)
        )
    )


@every_kind
@pytest.mark.parametrize("distance", [30.0, 1e3])
def test_far_origins_within_reach_and_beyond(kind, distance):
    """Within reach wide pads make up for lost digits; beyond it, all are tried."""
    rng = np.random.default_rng(1)
    surfaces = soup(kind, 300, rng, size=0.3)
    direction = directions(RAYS, rng)
    origin = rng.uniform(-1, 1, (RAYS, 3)) - distance * direction
    for reach in (None, 0.0):
        some(assert_same_hits(kind, surfaces, origin, direction, reach))


@pytest.mark.parametrize("distance", [0.5, 5.0, 1e4])
@pytest.mark.parametrize("walls", [1, 2])
def test_walls_and_grazing_rays(walls, distance):
    """16 x 16 squares of one plane, and a second such wall that begins amid the first.

    Rays aim at edges, most of them nearly within the plane. With hulls that were not
    grown, 1 in 300 of these rays lost its hit on one wall from afar.
    """
    rng = np.random.default_rng(2)
    x, y = np.indices((16, 16)).reshape(2, -1)
    floor = np.stack((x, y, np.zeros(256)), 1)
    corner = np.concatenate((floor, floor[:, [0, 2, 1]] + [0, 8, -8]))[: 256 * walls]
    e1, e2, e3 = np.eye(3)
    edge2 = np.repeat([e2, e3], 256, axis=0)[: 256 * walls]
    surfaces = rectangles(corner, np.tile(e1, (256 * walls, 1)), edge2)
    n = 2 * RAYS
    target = np.zeros((n, 3))
    target[:, 0] = rng.integers(0, 17, n)
    target[:, 1] = rng.integers(0, 17, n) + rng.random(n) * rng.integers(0, 2, n)
    direction = rng.standard_normal((n, 3))
    direction[:, 2] *= rng.choice([1, 0.1, 1e-2, 1e-3, 1e-4, 0.0], n)
    direction[:, 1] *= rng.integers(0, 2, n)
    direction = unit(direction)
    some(assert_same_hits("rectangles", surfaces, target - distance * direction, direction))


def test_rays_on_along_and_across_planes_of_the_tree():
    """Origins on planes in general position; directions within, and across them."""
    rng = np.random.default_rng(3)
    surfaces = soup("triangles", 500, rng, size=0.3)
    tree, _ = build("triangles", surfaces)
    inner = np.flatnonzero(tree.count == 0)
    normal, offset = np.split(
        tree.plane[rng.choice(inner, RAYS)].astype(float), [3], axis=1
    )
    assert (np.abs(normal).max(axis=1) < 0.999).mean() > 0.2
    within = np.cross(normal, directions(RAYS, rng))
    way = rng.integers(0, 3, (RAYS, 1))
    across = normal * rng.choice([-1.0, 1.0], (RAYS, 1))
    direction = unit(np.choose(way, [within, across, within + 1e-5 * across]))
    point = rng.uniform(-1, 1, (RAYS, 3))
    origin = point - normal * (np.sum(point * normal, axis=1, keepdims=True) - offset)
    some(assert_same_hits("triangles", surfaces, origin, direction))


@pytest.mark.parametrize("kind", ["rectangles", "spheres"])
def test_axis_parallel_rays_on_a_lattice(kind):
    """Zeros of both signs; rays within the planes of box faces, where 0 * inf is NaN."""
    rng = np.random.default_rng(4)
    c = rng.integers(-4, 5, (200, 3)).astype(float)
    e = np.eye(3)[np.array([rng.permutation(3) for _ in c])]
    surfaces = rectangles(c, e[:, 0], e[:, 1])
    if kind == "spheres":
        surfaces = soup(kind, 200, rng)._replace(
            center=c.T.astype(np.float32).copy(), radius=np.full(200, 0.5, np.float32)
        )
    direction = rng.choice([-1.0, 0.0, -0.0, 1.0], (RAYS, 3))
    direction[np.arange(RAYS), rng.integers(0, 3, RAYS)] = 1.0
    origin = rng.choice([-6.0, -1.0, -0.5, 0.0, 0.25, 2.0], (RAYS, 3))
    some(assert_same_hits(kind, surfaces, origin, unit(direction)))


def test_of_equal_distances_the_smallest_id_wins():
    """Copies lie in many leaves together; a tie may wait in the half that comes later."""
    rng = np.random.default_rng(5)
    quads = rng.random((40, 3)) * [1, 1, 0]
    copy_of = rng.permutation(np.repeat(np.arange(40), 10))
    w, h = rng.uniform(0.1, 1, (2, 400, 1))
    surfaces = rectangles(quads[copy_of], w * [1.0, 0, 0], h * [0, 1.0, 0])
    direction = directions(RAYS, rng)
    target = np.stack((*rng.random((2, RAYS)), np.zeros(RAYS)), 1)
    truth = assert_same_hits("rectangles", surfaces, target - direction, direction)
    some(truth, 0.5)


@pytest.mark.parametrize("length", [1e-25, 1e-16, 1e-14, 1e14, 1e16, 1e25])
def test_directions_of_any_length(length):
    """Brute force's answer, though distances to planes would leave single precision."""
    rng = np.random.default_rng(13)
    surfaces = soup("rectangles", 300, rng, size=0.5)
    origin = rng.uniform(-1.5, 1.5, (RAYS, 3))
    assert_same_hits("rectangles", surfaces, origin, length * directions(RAYS, rng))


def test_what_is_no_ray_takes_no_step():
    """NaN and infinity miss, and so does a direction of 0: not one node is visited."""
    rng = np.random.default_rng(6)
    tree, _ = build("triangles", soup("triangles", 300, rng, size=0.5))
    faults = [(array, k, x) for array in (0, 1) for k in range(3) for x in (np.nan, np.inf)]
    rays = np.stack((rng.uniform(-1, 1, (13, 3)), directions(13, rng)))
    for i, (array, k, x) in enumerate(faults):
        rays[array, i, k] = x
    rays[1, 12] = 0.0
    found, tally = counted(tree, *rays)
    assert (found == -1).all() and (tally == 0).all()
    assert not blocked(tree, *rays).any()


# -------------------------------------------------------------------------------- planes


def counted(tree, origin, direction):
    """Return what is hit and the tally."""
    work = workspace(len(origin))
    n = fill(work.rays, origin, direction)
    work.hits.t[:] = np.inf
    work.hits.prim[:] = -1
    tally = make_tally(n)
    trace(tree, work, 0, n, False, tally)
    return work.hits.prim[:n], tally[:, :n]


def test_planes_of_polygons_part_what_no_box_can():
    """Parallel tilted sheets: every plane across an axis cuts most of them, their own none.

    So no sheet is named twice. A ray along the sheets, between two of them, never leaves
    the halves that it starts in: one leaf, nothing waits, at most `LEAF` tests.
    """
    n = 256
    sheets, (x, _, z) = stack_of_sheets(n, np.random.default_rng(7))
    tree, _ = build("rectangles", sheets)
    assert len(tree.items) == n
    planes = tree.plane[tree.count == 0]
    np.testing.assert_allclose(np.abs(planes[:, :3] @ z), 1.0, atol=1e-6)
    between = (np.arange(n - 1)[:, None] + 0.5) / n - 0.5
    found, tally = counted(tree, between * z - x, np.tile(x, (n - 1, 1)))
    assert (found == -1).all()
    assert (tally[STACK] == 0).all() and tally[PRIMITIVES].max() <= LEAF
    assert (tally[NODES] == tally[BOXES]).all()  # one box or plane before each node
    # across: the outermost sheet is met in the first leaf
    found, tally = counted(tree, [-0.6 * z, 0.6 * z], [z, -z])
    np.testing.assert_array_equal(found - FIRST_ID, [0, n - 1])
    assert (tally[PRIMITIVES] <= LEAF).all() and (tally[STACK] > 0).all()


def test_a_convex_mesh_needs_planes_across_the_axes():
    """Every polygon of a sphere has all others behind it; halving is left to box faces."""
    mesh = icosphere(4)
    tree, _ = build("triangles", triangles(mesh))
    n = len(mesh)
    assert n == 5120 and depth_of(tree) <= 20 and tree.count.max() <= 40
    assert len(tree.items) < 5 * n
    root = np.abs(tree.plane[0, :3])
    np.testing.assert_array_equal(np.sort(root), [0, 0, 1])
    rng = np.random.default_rng(8)
    truth = assert_same_hits(
        "triangles",
        triangles(mesh),
        rng.uniform(-0.5, 0.5, (RAYS, 3)),
        directions(RAYS, rng),
    )
    assert (truth.prim >= 0).all()


# --------------------------------------------------------------------- builds that must end


def test_ten_thousand_coincident_triangles():
    """No plane parts them: one leaf, each named once."""
    surfaces = triangles(np.tile(np.eye(3), (10_000, 1, 1)))
    tree, _ = build("triangles", surfaces)
    assert len(tree.child) == 1 and len(tree.items) == 10_000
    truth = assert_same_hits("triangles", surfaces, np.zeros((4, 3)), unit(np.ones((4, 3))))
    np.testing.assert_array_equal(truth.prim, FIRST_ID)


@pytest.mark.parametrize("size", [0.5, 3.0])
def test_a_row_of_triangles(size):
    """Apart, no reference is spent twice; overlapping, the budget holds."""
    n = 50_000
    corner = np.stack((np.arange(n), np.zeros(n), np.zeros(n)), 1)
    x, y, _ = size * np.eye(3)
    surfaces = triangles(np.stack((corner, corner + x, corner + y), 1))
    tree, _ = build("triangles", surfaces)
    assert depth_of(tree) <= 30
    # the pads of coordinates up to 50000 make neighbours overlap at last
    assert len(tree.items) <= (2 if size < 1 else 4) * n


def test_depth_and_references_stay_bounded():
    """Sizes over many powers of two around one point: planes peel off one at a time."""
    n = 3000
    size = np.exp2(-np.linspace(0, 40, n))[:, None, None]
    surfaces = triangles(size * np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]))
    big = soup("triangles", n, np.random.default_rng(9), size=2.0)
    for made in (surfaces, big):
        tree, _ = build("triangles", made)
        assert depth_of(tree) <= MAX_DEPTH
        assert len(tree.items) <= (1 + EXTRA) * n
        assert len(tree.child) <= 2 * (1 + EXTRA) * n


def test_the_same_tree_every_time():
    surfaces = soup("triangles", 2000, np.random.default_rng(10))
    one, two = (build("triangles", surfaces)[0] for _ in range(2))
    for a, b in zip(one[:5], two[:5], strict=True):
        np.testing.assert_array_equal(a, b)


# ---------------------------------------------------------------------------------- proof


def broken(tree, field, at, value):
    array = getattr(tree, field).copy()
    array[at] = value
    return tree._replace(**{field: array})


def test_broken_trees_are_caught():
    """Each fault would lose hits, read beyond an array, or never end."""
    rng = np.random.default_rng(11)
    tree, extents = build("triangles", soup("triangles", 300, rng))
    leaf = int(np.flatnonzero(tree.count)[0])
    inner = int(np.flatnonzero(tree.count == 0)[3])
    first = tree.child[leaf]
    other = (tree.items[first] + 1) % 300
    aside = tree.plane[0] + np.array([0, 0, 0, 0.3], np.float32)
    faults = {
        "lacks primitive": [
            broken(tree, "items", first, other),
            broken(tree, "plane", 0, aside),
            broken(tree, "plane", inner, -tree.plane[inner]),
            broken(tree, "count", leaf, tree.count[leaf] - 1)
            if tree.count[leaf] > 1
            else broken(tree, "items", slice(None), 0),
        ],
        "comes after its children": [broken(tree, "child", inner, 0)],
        "children that do not exist": [broken(tree, "child", inner, len(tree.child))],
        "child of exactly one node": [broken(tree, "child", 0, len(tree.child) - 2)],
        "items that do not exist": [
            broken(tree, "child", leaf, -1),
            broken(tree, "count", leaf, 10_000),
        ],
        "name primitives that are none": [broken(tree, "items", 5, 300)],
        "no unit normal": [
            broken(tree, "plane", (0, slice(0, 3)), 0.0),
            broken(tree, "plane", 0, np.nan),
        ],
        "out of reach": [broken(tree, "plane", (0, 3), 1e6)],
        "do not hold all boxes": [
            broken(tree, "bounds", 3, tree.bounds[3] / 2),
            broken(tree, "bounds", 1, np.nan),
        ],
        "beyond that of the pads": [tree._replace(reach=np.float32(100.0))],
        "differ in length": [tree._replace(count=tree.count[:-1])],
    }
    for message, trees in faults.items():
        for fault in trees:
            with pytest.raises(ValueError, match=message):
                validate_bsp(fault, extents)


def test_too_deep_a_tree_is_caught():
    """A chain of more nodes than the traversal's stack holds."""
    tree, extents = build("triangles", soup("triangles", 1, np.random.default_rng(12)))
    steps = MAX_DEPTH + 1
    plane = np.zeros((2 * steps + 1, 4), np.float32)
    plane[:, 0] = 1.0
    count = np.ones(2 * steps + 1, np.int32)
    child = np.zeros(2 * steps + 1, np.int32)
    inner = np.concatenate(([0], 2 * np.arange(1, steps)))
    child[inner], count[inner] = 2 * np.arange(steps) + 1, 0
    with pytest.raises(ValueError, match="deeper than"):
        validate_bsp(tree._replace(plane=plane, child=child, count=count), extents)
