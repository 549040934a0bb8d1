"""The walk of one ray through each structure does what the structure's kernel does."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.accelerators.build import BUILDERS
from renderer.textbook.bounding_volumes import BoundingSphere
from reports.trials import inside
from reports.trials.inside import Looks, Ray, kernel_counts, walked
from reports.trials.meshes import soup, teapot, teapot_in_a_stadium, triangle_surfaces
from reports.trials.rays import camera_rays, in_batches, random_rays
from reports.trials.structure_cells import (
    as_octree,
    box_edges,
    drawn_cells,
    edges_between,
    edges_of_cells,
    volume_edges,
)
from reports.trials.structures import NAIVE, build, reach_of
from reports.trials.tracing import make_query, trace

RAYS = 24


@pytest.fixture(scope="module", params=[teapot(2), soup(500), teapot_in_a_stadium()],
                ids=lambda mesh: mesh.name)  # fmt: skip
def mesh(request):
    return request.param


def built(name, mesh):
    return build(name, triangle_surfaces(mesh), reach_of(mesh))[0]


def rays_at(mesh):
    """Return camera rays, random rays, and two along an axis, one of them in a face."""
    camera, random = camera_rays(mesh.view, 32, 24).rows(), random_rays(mesh, RAYS).rows()
    chosen = np.random.default_rng(1).choice(len(camera[0]), RAYS, replace=False)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    rows = [*zip(camera[0][chosen], camera[1][chosen], strict=True)]
    rows += zip(random[0], random[1], strict=True)
    along = np.array([1, 0, 0], np.float32)
    rows += [(low, along), ((low + high) / 2, along)]
    return [Ray("a ray", np.float32(origin), np.float32(way)) for origin, way in rows]


@pytest.mark.parametrize("name", BUILDERS)
def test_walk_counts_and_hits_as_the_kernel(name, mesh):
    """Nodes, box tests, primitive tests, saved tests, and the hit bit for bit."""
    accel, brute = built(name, mesh), built(NAIVE, mesh)
    for ray in rays_at(mesh):
        walk = walked(accel, ray, brute)
        assert walk.counts == kernel_counts(accel, ray)
        query = make_query("random", in_batches([ray.origin], [ray.direction], np.inf))
        trace(accel, query, query.batches)
        assert (walk.t, walk.prim) == (query.hits.t[0, 0], query.hits.prim[0, 0])


@pytest.mark.parametrize("name", BUILDERS)
def test_steps_of_a_walk_add_up(name):
    """The last step has all counts; no count falls; what is tested is counted."""
    mesh = teapot(2)
    accel, brute = built(name, mesh), built(NAIVE, mesh)
    cells = drawn_cells(accel)
    for ray in rays_at(mesh)[:8]:
        walk = walked(accel, ray, brute)
        counts = np.array([step[4:8] for step in walk.steps])
        assert tuple(counts[-1]) == walk.counts
        assert (np.diff(counts, axis=0) >= 0).all()
        assert sum(len(step.tested) for step in walk.steps) == walk.primitives
        assert all(-1 <= step.item < len(cells.boxes) for step in walk.steps)


# ----------------------------------------------------------------------------- the cells


@pytest.mark.parametrize("name", [name for name in BUILDERS if name != NAIVE])
def test_drawn_cells_hold_what_the_walk_tests_in_them(name):
    """Each triangle that a ray tests in a leaf reaches into the box that is drawn."""
    mesh = teapot(2)
    accel, brute = built(name, mesh), built(NAIVE, mesh)
    cells = drawn_cells(accel)
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    for ray in rays_at(mesh)[:8]:
        for step in walked(accel, ray, brute).steps:
            box, tested = cells.boxes[step.item], list(step.tested)
            if tested:
                assert cells.shown[step.item]
                assert (high[tested] >= box[:3] - 1e-3).all()
                assert (low[tested] <= box[3:] + 1e-3).all()
                assert cells.held[step.item] >= len(tested)


def test_levels_follow_from_the_root():
    """Of a binary tree; of the wide tree each level is a third as many steps or less."""
    mesh = teapot(2)
    bvh, wide = (drawn_cells(built(name, mesh)) for name in ("bvh", "wide"))
    assert bvh.level[0] == wide.level[0] == 0
    for cells in (bvh, wide):
        assert cells.held[0] == cells.held[cells.leaf & cells.shown].sum() == mesh.triangles
    assert wide.level.max() < bvh.level.max()
    octree = as_octree(drawn_cells(built("octree", mesh)))
    inner = octree.shown & ~octree.leaf
    for level in range(3):
        size = np.ptp(
            octree.boxes[inner & (octree.level == level)].reshape(-1, 2, 3), axis=1
        )
        assert size.max() == pytest.approx(size[0].max(), rel=1e-3)


def test_grids_in_grids_are_one_level_deeper():
    mesh = teapot_in_a_stadium()
    cells = drawn_cells(built("grid-nested", mesh))
    grids = len(built("grid-nested", mesh).first)
    assert grids > 1
    assert cells.level[0] == 0 and cells.level[1] == 1
    assert cells.level[grids] == 1  # a cell of the outermost grid


def test_edges_of_a_cube_cut_at_a_corner():
    """12 edges without the cut; with it three of them are shorter, and three are new."""
    walls = np.vstack((np.eye(3), -np.eye(3))), np.array([1.0, 1, 1, 0, 0, 0])
    edges, used = edges_between(*walls)
    assert len(edges) == 12 and used.all()
    assert np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1) == pytest.approx(np.ones(12))
    assert len(box_edges([0, 0, 0, 1, 1, 1])) == 12
    cut = np.vstack((walls[0], np.full(3, 3**-0.5))), np.append(walls[1], 2.5 * 3**-0.5)
    edges, used = edges_between(*cut)
    assert len(edges) == 15 and used.all()
    lengths = np.sort(np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1))
    assert lengths == pytest.approx([0.5] * 3 + [0.5**0.5] * 3 + [1.0] * 9)
    far = np.vstack((walls[0], np.full(3, 3**-0.5))), np.append(walls[1], 5.0)
    assert edges_between(*far)[1].tolist() == [True] * 6 + [False]


def test_cells_of_oblique_planes_lie_behind_all_planes_above():
    tree = built("bsp", teapot(2))
    depth = drawn_cells(tree).level
    edges = edges_of_cells(tree, np.flatnonzero(depth == 4))
    for node in np.flatnonzero(tree.child):
        for side, sign in ((0, 1.0), (1, -1.0)):
            child = int(tree.child[node]) + side
            if child in edges and len(edges[child]):
                away = (
                    edges[child] @ tree.plane[node, :3].astype(float) - tree.plane[node, 3]
                )
                assert (sign * away).max() < 1e-3


def test_circles_of_a_sphere_lie_on_it():
    sphere = BoundingSphere(np.float32([[1], [2], [3]]), np.float32([0.5]))
    points = volume_edges(sphere).reshape(-1, 3)
    assert np.linalg.norm(points - [1, 2, 3], axis=1) == pytest.approx(np.full(288, 0.5))


# --------------------------------------------------------------------------- the files


def test_files_of_the_structures_are_small_and_whole():
    """All of them below 2 MB; rays hit and miss; every walk ends with its counts."""
    looks = Looks(teapot(5))
    total = len(inside.script("scene", looks.scene()))
    brute = {ray.title: walked(looks.brute, ray, looks.brute).prim for ray in looks.rays}
    assert brute["a usual hit"] >= 0 and brute["a costly hit"] >= 0
    assert brute["a near miss"] == -1
    names = []
    for one in looks.structures():
        names.append(one.name)
        total += len(inside.script(one.name, one.data))
        for walk, steps in zip(one.walks, one.data["walks"], strict=True):
            assert len(walk.steps) == len(steps)
            assert tuple(steps[-1][4:8]) == walk.counts
    assert names == [*BUILDERS, inside.VOLUME_NAME]
    assert total < 2_000_000
