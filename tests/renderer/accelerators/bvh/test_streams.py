"""Streams through the wide tree and through instances: batches and lists of any length.

That the hits of the wide tree are brute force's is shown for all ways of all structures
elsewhere (test_accelerators_agree.py, test_accelerators_awkward_rays.py): their rays are
streams. The scene of instances is that of test_instances.py.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from agreement import assert_agrees, extents_for, reach_of, ways_of
from instances import accelerators_of, content
from instances import rays as rays_at_instances
from kernel_probes import (
    accelerator,
    blocked,
    closest,
    directions,
    fill,
    soup,
    trace,
    workspace,
)
from scene_file_samples import scene_text
from small_meshes import write_meshes
from soups import awkward_rays

import renderer
from renderer.accelerators.bvh.streams import ray_streams
from renderer.accelerators.bvh.wide.octants import STREAM
from renderer.accelerators.bvh.wide_bvh import FEW
from renderer.accelerators.instances import instance_rays as instance_boxes
from renderer.kernels.records.batch import BOXES, NODES, PRIMITIVES, STACK, make_tally

NAN, INF = np.nan, np.inf
SURFACES = soup("triangles", 500, np.random.default_rng(1), size=0.4)
# lists of as many rays are treated in another way than shorter ones
BORDERS = {ray_streams.SHORT, instance_boxes.SHORT, 16, FEW, STREAM}


def rays(n, seed=2):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (n, 3)), directions(n, rng)


@pytest.fixture(scope="module")
def brute():
    return accelerator("triangles", SURFACES, "brute")


@pytest.fixture(scope="module")
def wide():
    return accelerator("triangles", SURFACES, "wide", reach=5.0)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("placed")
    write_meshes(folder)
    (folder / "scene.xml").write_text(scene_text(content()))
    return renderer.load_file(folder / "scene.xml")


@pytest.fixture(scope="module")
def instances(scene):
    tree, brute = (accelerators_of(scene, name).instances for name in ("auto", "brute"))
    return SimpleNamespace(
        tree=tree,
        brute=brute,
        rays=lambda n, seed=11: [row[:n] for row in rays_at_instances(seed, max(n, 1))],
    )


@pytest.fixture(scope="module", params=["wide", "instances"])
def case(request, wide, brute, instances):
    """A tree, the truth, and rays of which some hit and some miss."""
    if request.param == "instances":
        return instances
    return SimpleNamespace(tree=wide, brute=brute, rays=rays)


def found(accel, origin, direction, *, end=INF, coherent=False, tally=None):
    """t, prim, u, v and instance of the nearest hits, as bits."""
    work = workspace(len(origin))
    n = fill(work.rays, origin, direction)
    work.hits.t[:n] = end
    work.hits.prim[:] = -1
    work.hits.instance[:] = 77
    trace(accel, work, 0, n, coherent, tally)
    hits = [row[:n].copy() for row in work.hits]
    for k in (2, 3):
        hits[k][hits[1] < 0] = 0.0
    return np.array([row.view(np.int32) for row in hits])


def assert_right(case, origin, direction, end=INF):
    """Compare all ways of a tree with brute force, bit for bit; return the truth."""
    truth = found(case.brute, origin, direction, end=end)
    before = np.arange(len(origin)) % 5 == 0
    for coherent in ways_of(case.tree):
        mine = found(case.tree, origin, direction, end=end, coherent=coherent)
        np.testing.assert_array_equal(mine, truth)
        for first in (np.zeros_like(before), before):
            shut = blocked(
                case.tree, origin, direction, t_max=end, before=first, coherent=coherent
            )
            np.testing.assert_array_equal(shut, first | (truth[1] >= 0))
    return truth


@pytest.mark.parametrize(
    "count",
    sorted({0, 1, 17, 2 * STREAM + FEW} | {n + k for n in BORDERS for k in (-1, 0, 1)}),
)
def test_any_number_of_rays(case, count):
    """Around each border; some have no answer, some come from beyond the reach of boxes."""
    origin, direction = case.rays(count)
    origin[4::5] -= 2e4 * direction[4::5]
    origin[::7, 0], direction[1::11, 2], direction[2::13] = NAN, INF, 0.0
    direction[3::5, 1] *= 0.0  # of either sign
    truth = assert_right(case, origin, direction)
    assert count < 16 or 0.03 < (truth[1] >= 0).mean() < 0.9


@pytest.mark.parametrize("same", sorted(BORDERS | {n + 1 for n in BORDERS if n < STREAM}))
def test_lists_of_every_length(case, same):
    """Equal rays take one way down to each leaf, as one list."""
    some = case.rays(STREAM // same + 1)
    origin, direction = (np.repeat(row, same, axis=0)[:STREAM] for row in some)
    assert_right(case, origin, direction)


def test_ends_of_rays_and_what_is_blocked_already(case):
    """Each ray has an end of its own: none, before the hit, at it, negative, NaN."""
    origin, direction = case.rays(STREAM)
    t, prim, *_ = found(case.brute, origin, direction)
    end = np.array([INF, 0.0, -1.0, NAN])[np.arange(STREAM) % 4].astype(np.float32)
    end[::3] = np.where(prim >= 0, t.view(np.float32), 1.0)[::3]
    end[1::3] = np.nextafter(end[1::3], np.float32(0))
    truth = assert_right(case, origin, direction, end)
    assert (truth[1] >= 0).sum() > 50 < (truth[1] != prim).sum()


@pytest.mark.parametrize("first", [0, 7])
def test_a_part_in_the_middle_of_a_batch_is_a_stream_too(case, first):
    """From no multiple of 16 on; what lies before and behind is left alone."""
    count = 3 * FEW
    parts = []
    for accel in (case.brute, case.tree):
        work = workspace(STREAM)
        fill(work.rays, *case.rays(STREAM))
        work.hits.t[:] = INF
        work.hits.prim[:] = -1
        trace(accel, work, first, count, False, None)
        parts.append(np.array([work.hits.t.view(np.int32), work.hits.prim]))
    np.testing.assert_array_equal(*parts)
    hit = np.flatnonzero(parts[1][1] >= 0)
    assert len(hit) > 10 and first <= hit.min() and hit.max() < first + count


# ------------------------------------------------------------------------- the wide tree


def few(n):
    """Slices of so few rays that none is a stream."""
    return [slice(k, k + FEW - 1) for k in range(0, n, FEW - 1)]


def test_rays_from_afar_among_near_ones(brute):
    """Boxes are larger by the margin of the farthest origin: no ray may lose by it."""
    origin, direction = awkward_rays(
        extents_for("triangles", SURFACES), 200, np.random.default_rng(3)
    )
    shuffled = np.random.default_rng(4).permutation(len(origin))
    origin, direction = origin[shuffled], direction[shuffled]
    wide = accelerator("triangles", SURFACES, "wide", reach_of(origin))
    truth = closest(brute, origin, direction)
    assert_agrees(wide, truth, origin, direction, INF, "from afar")


@pytest.mark.parametrize("distance", [30.0, 1e3, 1e6])
def test_a_ray_from_afar_costs_the_others_nothing(wide, distance):
    """One in each octant. It would make all boxes larger by the rounding of its origin."""
    origin, direction = rays(STREAM)
    alone = make_tally(STREAM)
    closest(wide, origin, direction, tally=alone)
    far = np.zeros(STREAM, bool)
    for octant in range(8):
        signs = [1.0 - 2.0 * (octant >> axis & 1) for axis in range(3)]
        far[np.flatnonzero((direction * signs > 0.0).all(axis=1))[0]] = True
    origin[far] = -distance * direction[far]
    mixed = make_tally(STREAM)
    closest(wide, origin, direction, tally=mixed)
    for row in (NODES, BOXES, PRIMITIVES):
        others = mixed[row, :STREAM][~far].sum() / alone[row, :STREAM][~far].sum()
        assert 0.9 < others < 1.2, row


@pytest.mark.parametrize("ask", [closest, blocked])
def test_a_stream_visits_what_rays_one_by_one_visit(wide, ask):
    """A list costs each of its rays what it would alone.

    But for the order of children, which is that of the octant and not the ray's own, and
    for the margins of boxes. Measured: 1.04 times as many nodes and 1.03 times as many
    primitives for nearest hits, 1.08 and 1.02 for any hit. From far to near it would be
    1.15 times as many primitives.
    """
    origin, direction = rays(2 * STREAM)
    counts = make_tally(len(origin))
    answers = ask(wide, origin, direction, tally=counts)
    alone = []
    for part in few(len(origin)):
        tally = make_tally(len(origin[part]))
        ask(wide, origin[part], direction[part], tally=tally)
        alone.append(tally[:, : len(origin[part])])
    alone, counts = np.concatenate(alone, axis=1), counts[:, : len(origin)]
    assert (counts[[NODES, BOXES]] >= 1).all() and (counts[STACK] >= 0).all()
    for row in (NODES, BOXES, PRIMITIVES):
        assert 0.9 < counts[row].sum() / alone[row].sum() < 1.12, row
    again = make_tally(len(origin))
    same = ask(wide, origin, direction, tally=again)
    np.testing.assert_array_equal(again[:, : len(origin)], counts)
    np.testing.assert_array_equal(same, answers)


# ------------------------------------------------------------------------- instances


def test_rays_that_meet_nothing(instances):
    origin, direction = instances.rays(STREAM, 13)
    hits = found(instances.tree, origin + np.array([0, 0, 50]), np.abs(direction))
    assert (hits[1] == -1).all() and (hits[4] == -1).all()


def test_a_nearer_hit_found_before_stays(instances):
    """Also at the same distance, if that primitive comes first."""
    origin, direction = instances.rays(STREAM, 15)
    whole = found(instances.tree, origin, direction)
    work = workspace(STREAM)
    n = fill(work.rays, origin, direction)
    share = np.where(np.arange(n) % 2 == 0, 1.0, 0.99).astype(np.float32)
    hit = whole[1] >= 0
    work.hits.t[:n] = np.where(hit, whole[0].view(np.float32) * share, 1.0)
    work.hits.prim[:n] = 0
    trace(instances.tree, work, 0, n, False, None)
    assert (work.hits.prim[:n] == 0).all() and (work.hits.instance[:n] == -1).all()


def test_the_tally_says_what_was_tested(scene, instances):
    """Brute force: every primitive of every copy; a tree: few, and more than none."""
    origin, direction = instances.rays(STREAM + 3, 16)
    origin[5] = NAN
    n = len(origin)
    groups = len(next(iter(scene.starts.values()))) - 1
    sizes = sum(np.diff(starts) for starts in scene.starts.values())
    assert len(sizes) == groups
    counted = {}
    for name, accel in (("brute", instances.brute), ("tree", instances.tree)):
        counted[name] = make_tally(n)
        found(accel, origin, direction, tally=counted[name])
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
