"""Streams through instances: any number of rays, lists of any length, and what is counted.

The scene is that of test_instances.py, where trees are compared with brute force and with
explicit copies. Here a ray that is traced alone is the truth for one among others.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import blocked, fill, trace, workspace
from scene_file_samples import scene_text
from test_instances import accelerators_of, content, rays
from test_surface_points import write_meshes

import renderer
from renderer.accelerators.bvh.wide.octants import STREAM
from renderer.accelerators.instances.instance_boxes import SHORT
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, STACK, make_tally

NAN, INF = np.nan, np.inf


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("placed")
    write_meshes(folder)
    (folder / "scene.xml").write_text(scene_text(content()))
    return renderer.load_file(folder / "scene.xml")


@pytest.fixture(scope="module")
def tree(scene):
    return accelerators_of(scene).instances


@pytest.fixture(scope="module")
def brute(scene):
    return accelerators_of(scene, "brute").instances


def found(instances, origin, direction, *, end=INF, tally=None):
    """t, prim, u, v and instance of the nearest hits, as bits."""
    work = workspace(len(origin))
    n = fill(work.rays, origin, direction)
    work.hits.t[:n] = end
    work.hits.prim[:] = -1
    work.hits.instance[:] = 77
    trace(instances, work, 0, n, False, tally)
    hits = [row[:n].copy() for row in work.hits]
    for k in (2, 3):
        hits[k][hits[1] < 0] = 0.0
    return np.array([row.view(np.int32) for row in hits])


def alone(instances, origin, direction, *, end=INF):
    end = np.broadcast_to(np.float32(end), len(origin))
    one = [slice(k, k + 1) for k in range(len(origin))]
    parts = [found(instances, origin[k], direction[k], end=end[k]) for k in one]
    return np.concatenate([np.zeros((5, 0), np.int32), *parts], axis=1)


COUNTS = [0, 1, SHORT, SHORT + 1, 16, 17, STREAM - 1, STREAM, STREAM + 1]


@pytest.mark.parametrize("count", COUNTS)
def test_any_number_of_rays(tree, brute, count):
    """Around each border; some have no answer, some come from beyond the reach of boxes."""
    origin, direction = (row[:count] for row in rays(11, STREAM + 1))
    origin[1::5] -= 2e4 * direction[1::5]
    origin[::7, 0], direction[3::11, 2], direction[4::13] = NAN, INF, 0.0
    truth = alone(tree, origin, direction)
    np.testing.assert_array_equal(found(tree, origin, direction), truth)
    np.testing.assert_array_equal(found(brute, origin, direction), truth)
    shut = blocked(tree, origin, direction)
    np.testing.assert_array_equal(shut, truth[1] >= 0)
    assert count < 16 or 0.3 < (truth[4] >= 0).mean() < 0.9


@pytest.mark.parametrize("same", [SHORT, SHORT + 1, 16, 17, STREAM])
def test_lists_of_every_length(tree, same):
    """Equal rays take one way down to each leaf, as one list."""
    some = rays(12, STREAM // same + 1)
    origin, direction = (np.repeat(row, same, axis=0)[:STREAM] for row in some)
    truth = np.repeat(alone(tree, *some), same, axis=1)[:, :STREAM]
    np.testing.assert_array_equal(found(tree, origin, direction), truth)


def test_rays_that_meet_nothing(tree):
    origin, direction = rays(13, STREAM)
    hits = found(tree, origin + np.array([0, 0, 50]), np.abs(direction))
    assert (hits[1] == -1).all() and (hits[4] == -1).all()


def test_ends_of_rays_and_what_is_blocked_already(tree):
    """Each ray has an end of its own: none, before the hit, at it, negative, NaN."""
    origin, direction = rays(14, STREAM)
    whole = found(tree, origin, direction)
    hit = whole[1] >= 0
    t = whole[0].view(np.float32)
    end = np.array([INF, 0.0, -1.0, NAN])[np.arange(STREAM) % 4].astype(np.float32)
    end[::3] = np.where(hit, t, 1.0)[::3]
    end[1::3] = np.where(hit, 0.999 * t, 1.0)[1::3]
    truth = alone(tree, origin, direction, end=end)
    np.testing.assert_array_equal(found(tree, origin, direction, end=end), truth)
    shut = blocked(tree, origin, direction, t_max=end)
    np.testing.assert_array_equal(shut, truth[1] >= 0)
    assert 0.1 < shut.mean() < 0.6
    before = np.arange(STREAM) % 2 == 0
    again = blocked(tree, origin, direction, t_max=end, before=before)
    np.testing.assert_array_equal(again, shut | before)


def test_a_nearer_hit_found_before_stays(tree):
    """Also at the same distance, if that primitive comes first."""
    origin, direction = rays(15, STREAM)
    whole = found(tree, origin, direction)
    work = workspace(STREAM)
    n = fill(work.rays, origin, direction)
    share = np.where(np.arange(n) % 2 == 0, 1.0, 0.99).astype(np.float32)
    hit = whole[1] >= 0
    work.hits.t[:n] = np.where(hit, whole[0].view(np.float32) * share, 1.0)
    work.hits.prim[:n] = 0
    trace(tree, work, 0, n, False, None)
    assert (work.hits.prim[:n] == 0).all() and (work.hits.instance[:n] == -1).all()


def test_the_tally_says_what_was_tested(scene, tree, brute):
    """Brute force: every primitive of every copy; a tree: few, and more than none."""
    origin, direction = rays(16, STREAM + 3)
    origin[5] = NAN
    n = len(origin)
    groups = len(next(iter(scene.starts.values()))) - 1
    sizes = sum(np.diff(starts) for starts in scene.starts.values())
    assert len(sizes) == groups
    counted = {}
    for name, instances in (("brute", brute), ("tree", tree)):
        counted[name] = make_tally(n)
        found(instances, origin, direction, tally=counted[name])
        assert (counted[name][:, 5] == 0).all()
        assert (counted[name][:, n:] == 0).all()
    every = sizes[scene.placements.group].sum()
    finite = np.arange(n) != 5
    np.testing.assert_array_equal(counted["brute"][PRIMITIVES, :n], every * finite)
    assert (counted["brute"][[NODES, BOXES]] == 0).all()
    a_tree = counted["tree"][:, :n][:, finite]
    assert (a_tree[NODES] >= 1).all() and (a_tree[BOXES] == 8 * a_tree[NODES]).all()
    assert (a_tree[STACK] >= 1).mean() > 0.9
    assert 0 < a_tree[PRIMITIVES].mean() < 0.1 * every
