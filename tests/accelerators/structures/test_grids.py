"""Uniform and hierarchical grids: rays through them, counted where theory has a number.

That all accelerators return the same hits is another file's matter. Here are the rays that
only a grid finds awkward: along the edges and through the corners of its own cells.
Failure modes 9 to 12 of the project's list have a test each.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from grid_probes import (
    HIERARCHIES,
    NAMES,
    built,
    coincident,
    extents,
    nested_triangles,
    validate,
)
from kernel_probes import (
    accelerator,
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

from renderer.accelerators.grids.grid_walk import LEVELS
from renderer.accelerators.grids.uniform_grid import build_uniform_grid
from renderer.kernels.records.tally import (
    BOXES,
    NODES,
    PRIMITIVES,
    SAVED,
    STACK,
    make_tally,
)


def counts(accel, origin, direction):
    """What the rays (n, 3) cost, (rows of the tally, n)."""
    work = workspace(len(origin))
    n = fill(work.rays, origin, direction)
    work.hits.t[:n], work.hits.prim[:] = np.inf, -1
    tally = make_tally(n)
    trace(accel, work, 0, n, False, tally)
    return tally[:, :n]


def assert_same_hits(kind, surfaces, origin, direction, reach, names=NAMES):
    """Compare with brute force, bit for bit; return which rays hit."""
    brute = accelerator(kind, surfaces, "brute")
    truth = closest(brute, origin, direction)
    hit = truth.prim >= 0
    for name in names:
        accel = built(kind, surfaces, name, reach)
        found = closest(accel, origin, direction)
        np.testing.assert_array_equal(found.prim, truth.prim, name)
        for got, expected in zip(found, truth, strict=True):
            got, expected = got[hit].view(np.int32), expected[hit].view(np.int32)
            np.testing.assert_array_equal(got, expected, name)
        np.testing.assert_array_equal(blocked(accel, origin, direction), hit, name)
    return hit


# ------------------------------------------------------------------ rays along the cells


def axis_directions():
    """The 26 neighbours of a cell, zeros with either sign."""
    every = itertools.product((-1.0, 0.0, -0.0, 1.0), repeat=3)
    return unit([signs for signs in every if any(signs)])


def corner_rays(grid, rng, n):
    """Rays through corners of a grid's own cells, in the 26 directions.

    Every other one is on an edge instead; a third starts there, a third one cell before,
    a third outside of the grid.
    """
    k = rng.integers(0, grid.resolution[:, None] + 1, (3, n))
    on_edge = np.arange(n) % 2 * rng.random(n)
    place = k + on_edge * np.eye(3)[rng.integers(0, 3, n)].T
    corner = (grid.lower[:, None] + place.astype(np.float32) * grid.size[:, None]).T
    direction = axis_directions()[rng.integers(0, 56, n)]
    before = np.choose(np.arange(n) % 3, (0.0, grid.size.max(), 10.0))
    # a cell's diagonal, so that rays meet further corners, rounded by a digit or two
    direction = np.where(rng.random((n, 1)) < 0.5, direction * grid.size, direction)
    return corner - before[:, None] * direction, unit(direction)


@pytest.mark.parametrize("kind", ["triangles", "rectangles"])
def test_rays_through_corners_and_along_edges_of_cells(kind):
    """Failure mode 10: ties between planes, origins on planes, zeros of both signs."""
    rng = np.random.default_rng(4)
    surfaces = soup(kind, 600, rng, size=0.4)
    grid = built(kind, surfaces, "grid", 40.0)
    origin, direction = corner_rays(grid, rng, 6000)
    hit = assert_same_hits(kind, surfaces, origin, direction, 40.0)
    assert 0.1 < hit.mean() < 0.9


def test_primitives_on_the_planes_between_cells():
    """Unit squares in all three planes of a lattice, met at their edges and corners."""
    rng = np.random.default_rng(5)
    n = 400
    c = rng.integers(0, 5, (n, 3)).astype(float)
    e = np.eye(3)[np.array([rng.permutation(3) for _ in range(n)])]
    walls = rectangles(c, e[:, 0], e[:, 1])
    origin = rng.integers(-2, 13, (6000, 3)) / 2.0
    direction = axis_directions()[rng.integers(0, 56, 6000)]
    hit = assert_same_hits("rectangles", walls, origin, direction, 30.0)
    assert 0.1 < hit.mean() < 0.9


def test_the_number_of_steps_is_bounded():
    """At most nx + ny + nz cells, whichever way; exactly nx along x (failure mode 10)."""
    rng = np.random.default_rng(6)
    surfaces = soup("triangles", 3000, rng, size=1e-3)
    grid = built("triangles", surfaces, "grid", 40.0)
    nx, ny, nz = grid.resolution.tolist()
    origin, direction = corner_rays(grid, rng, 3000)
    cells = counts(grid, origin, direction)[NODES]
    assert cells.max() <= nx + ny + nz
    assert cells.max() > nx + ny
    y, z = np.indices((ny, nz)).reshape(2, -1) + 0.5
    places = np.stack((np.full(ny * nz, -1.0), y, z), 1)
    rows_of_cells = grid.lower + places * grid.size
    along_x = counts(grid, rows_of_cells, np.tile([1.0, 0, 0], (ny * nz, 1)))
    np.testing.assert_array_equal(along_x[NODES][along_x[PRIMITIVES] == 0], nx)
    beside = rows_of_cells + np.array([0.0, 0.0, 3.0])
    passing = counts(grid, beside, np.tile([1.0, -0.0, 0.0], (ny * nz, 1)))
    assert (passing[NODES] == 0).all() and (passing[BOXES] == 1).all()


NUMBERS = (np.nan, np.inf, -np.inf)


def test_rays_that_are_no_rays_miss_at_once():
    """Failure mode 9: NaN and infinity anywhere, and no direction at all."""
    rng = np.random.default_rng(7)
    surfaces = soup("triangles", 500, rng, size=0.5)
    faults = [(a, k, x) for a in range(2) for k in range(3) for x in NUMBERS]
    rays = np.concatenate((rng.random((19, 1, 3)), directions(19, rng)[:, None]), axis=1)
    for ray, (array, k, x) in zip(rays, faults, strict=False):
        ray[array, k] = x
    rays[18, 1] = 0.0
    for name in NAMES:
        accel = built("triangles", surfaces, name)
        found = closest(accel, rays[:, 0], rays[:, 1])
        assert (found.prim == -1).all(), name
        assert not blocked(accel, rays[:, 0], rays[:, 1]).any(), name
        assert (counts(accel, rays[:, 0], rays[:, 1]) == 0).all(), name
        for t_max in (np.nan, -np.inf, -1.0, 0.0):
            good = np.zeros((64, 3)), directions(64, rng)
            assert (closest(accel, *good, t_max=t_max).prim == -1).all(), (name, t_max)
            assert not blocked(accel, *good, t_max=t_max).any(), (name, t_max)


def test_rays_from_beyond_reach_take_the_slow_way():
    """Their rounding is larger than the cells allow for; those at `reach` are at home."""
    rng = np.random.default_rng(8)
    surfaces = soup("triangles", 400, rng, size=0.5)
    target, direction = rng.uniform(-1, 1, (3000, 3)), directions(3000, rng)
    hit = assert_same_hits("triangles", surfaces, target - 1e4 * direction, direction, 8.0)
    assert 0.2 < hit.mean() < 0.8
    start = np.array([[3.7, 2.1, 2.1]], np.float32)
    exactly = start[0].astype(float).sum()
    assert start[0, 0] + start[0, 1] + start[0, 2] > np.float32(exactly)  # rounded up
    for name in NAMES:
        accel = built("triangles", surfaces, name, exactly)
        at_reach = counts(accel, start, -unit(start))
        beyond = counts(accel, start * np.float32(1.001), -unit(start))
        assert at_reach[PRIMITIVES] < 400 and at_reach[NODES] > 0, name
        assert beyond[PRIMITIVES] == 400 and beyond[NODES] == 0, name


# ---------------------------------------------------------------------- what it is worth


def test_mailboxes_save_all_tests_but_one():
    """Failure mode 11: a triangle across 32^3 cells, and rays in its plane.

    Each cell on their way holds the triangle, so that without mailboxes there are as many
    tests as cells, and one with them.
    """
    big = triangles([[[0, 0, 0], [1, 1, 0], [0.5, 0.5, 1.0]]])
    height = np.linspace(0.05, 0.4, 50)
    origin = np.stack((np.full(50, -0.5), np.full(50, -0.5), height), axis=1)
    direction = np.tile(unit([1.0, 1.0, 0.1]), (50, 1))
    tallies = []
    for mailboxed in (None, 64):
        accel = build_uniform_grid(
            extents("triangles", big, 4.0),
            lambda columns: accelerator("triangles", big, "brute").primitives,
            mailboxed,
            density=33_000,
        )
        assert accel.resolution.tolist() == [32, 32, 32]
        validate(accel, "triangles", big, 4.0)
        tallies.append(counts(accel, origin, direction))
    without, with_mailboxes = tallies
    assert without[NODES].min() >= 32
    np.testing.assert_array_equal(without[PRIMITIVES], without[NODES])
    np.testing.assert_array_equal(with_mailboxes[PRIMITIVES], 1)
    np.testing.assert_array_equal(with_mailboxes[SAVED], without[NODES] - 1)


def ball(rings=51, sectors=50):
    """A sphere of diameter 1 about the origin: 2 sectors (rings - 1) triangles."""
    theta, phi = (
        np.pi * np.arange(rings + 1) / rings,
        2 * np.pi * np.arange(sectors) / sectors,
    )
    t, p = np.meshgrid(theta, phi, indexing="ij")
    v = 0.5 * np.stack((np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)), -1)
    a, b = v[:-1], v[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    lower, upper = np.stack((a, b, c), 2)[:-1], np.stack((a, c, d), 2)[1:]
    return np.concatenate((lower.reshape(-1, 3, 3), upper.reshape(-1, 3, 3)))


def test_a_teapot_in_a_stadium():
    """Failure mode 12: 5000 triangles of a ball of size 1 on two triangles of size 1000.

    The uniform grid has the whole ball in one cell, so that each ray into it tests 5000
    triangles; grids in grids 50 at most. Measured: 5002, and 13 and 15.
    """
    rng = np.random.default_rng(9)
    small = ball()
    assert len(small) == 5000
    square = np.array([[-500.0, -500, -0.5], [500, -500, -0.5], [500, 500, -0.5]])
    other = square * [-1, -1, 1]
    stadium = triangles(np.concatenate((small, [square, other])))
    direction = directions(500, rng)
    direction[:, 2] = -np.abs(direction[:, 2])
    origin = 0.3 * directions(500, rng) - 3 * direction
    tests, levels = {}, {}
    for name in NAMES:
        accel = built("triangles", stadium, name, 10.0)
        tally = counts(accel, origin, direction)
        tests[name], levels[name] = tally[PRIMITIVES].mean(), tally[STACK].max()
    assert tests["grid"] >= 0.9 * 5000
    for name in HIERARCHIES:
        assert tests[name] <= 50, tests
        assert 2 <= levels[name] <= LEVELS
    hit = assert_same_hits("triangles", stadium, origin, direction, 10.0, HIERARCHIES)
    assert hit.all()


def test_the_tally_counts_cells_grids_and_tests():
    """One triangle, met at once: one of each."""
    triangle = triangles([[[-1, -1, 0], [1, -1, 0], [0, 1.0, 0]]])
    for name in NAMES:
        accel = built("triangles", triangle, name)
        tally = counts(accel, np.array([[0.0, 0, 1]]), np.array([[0.0, 0, -1]]))[:, 0]
        assert (tally[NODES], tally[BOXES], tally[PRIMITIVES]) == (1, 1, 1), name


def test_hits_in_bad_scenes():
    """The first of coincident ones; and through 10,000 triangles about one centre."""
    rng = np.random.default_rng(11)
    origin = np.full((300, 3), 0.4) + 2 * directions(300, rng)
    direction = unit(np.full((300, 3), 0.4) + rng.uniform(-0.3, 0.3, (300, 3)) - origin)
    for make in (coincident, nested_triangles):
        hit = assert_same_hits("triangles", make(), origin, direction, 8.0)
        assert 0.1 < hit.mean() <= 1
