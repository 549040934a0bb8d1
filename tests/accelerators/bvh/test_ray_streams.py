"""Streams through the wide tree: how rays are shared out, and what it counts.

That the hits are brute force's is shown for all ways of all structures elsewhere
(test_accelerators_agree.py, test_accelerators_awkward_rays.py): their rays are streams.
"""

from __future__ import annotations

import numpy as np
import pytest
from agreement import assert_agrees, assert_same, extents_for, reach_of
from kernel_probes import (
    Found,
    accelerator,
    blocked,
    closest,
    directions,
    fill,
    soup,
    trace,
    workspace,
)
from soups import awkward_rays

from renderer.accelerators.bvh.streams.ray_streams import SHORT
from renderer.accelerators.bvh.wide.octants import STREAM
from renderer.accelerators.bvh.wide_bvh import FEW
from renderer.kernels.records.tally import BOXES, NODES, PRIMITIVES, STACK, make_tally

NAN, INF = np.nan, np.inf
SURFACES = soup("triangles", 500, np.random.default_rng(1), size=0.4)


@pytest.fixture(scope="module")
def brute():
    return accelerator("triangles", SURFACES, "brute")


@pytest.fixture(scope="module")
def wide():
    return accelerator("triangles", SURFACES, "wide", reach=5.0)


def rays(n, seed=2):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (n, 3)), directions(n, rng)


def few(n):
    """Slices of so few rays that none is a stream."""
    return [slice(k, k + FEW - 1) for k in range(0, n, FEW - 1)]


@pytest.mark.parametrize(
    "count", [0, FEW - 1, FEW, FEW + 1, STREAM - 1, STREAM, STREAM + 1, 2 * STREAM + FEW]
)
def test_any_number_of_rays(brute, wide, count):
    """Around each border; some rays have no answer: they are in nobody's octant."""
    origin, direction = rays(count)
    origin[::7, 0], direction[1::11, 2], direction[2::13] = NAN, INF, 0.0
    direction[3::5, 1] *= 0.0  # of either sign
    truth = closest(brute, origin, direction)
    assert_agrees(wide, truth, origin, direction, INF, f"{count} rays")


@pytest.mark.parametrize("same", [SHORT, SHORT + 1, 16, 17, FEW, 500])
def test_rays_that_all_go_the_same_way(brute, wide, same):
    """One octant and one list down to each leaf: its length is at every border."""
    some = rays(STREAM // same + 1)
    origin, direction = (np.repeat(row, same, axis=0)[:STREAM] for row in some)
    truth = closest(brute, origin, direction)
    assert_agrees(wide, truth, origin, direction, INF, f"{same} alike")


def test_ends_of_rays_and_what_is_blocked_already(brute, wide):
    """Each ray has an end of its own: none, before the hit, at it, negative, NaN."""
    origin, direction = rays(STREAM)
    hit = closest(brute, origin, direction)
    end = np.array([INF, 0.0, -1.0, NAN])[np.arange(STREAM) % 4].astype(np.float32)
    end[::3] = np.where(hit.prim >= 0, hit.t, 1.0)[::3]
    end[1::3] = np.nextafter(end[1::3], np.float32(0))
    truth = closest(brute, origin, direction, t_max=end)
    assert (truth.prim >= 0).sum() > 50 < (truth.prim != hit.prim).sum()
    assert_agrees(wide, truth, origin, direction, end, "ends")
    before = np.arange(STREAM) % 5 == 0
    for coherent in (False, True):
        found = blocked(
            wide, origin, direction, t_max=end, before=before, coherent=coherent
        )
        np.testing.assert_array_equal(found, before | (truth.prim >= 0))


def test_rays_from_afar_among_near_ones(brute):
    """All boxes are larger by the margin of the farthest origin: nobody may lose by it."""
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


def test_a_part_in_the_middle_of_a_batch_is_a_stream_too(brute, wide):
    """From no multiple of 16 on; what lies before and behind is left alone."""
    first, count = 7, 3 * FEW
    found = []
    for accel in (brute, wide):
        work = workspace(STREAM)
        fill(work.rays, *rays(STREAM))
        work.hits.t[:] = INF
        work.hits.prim[:] = -1
        trace(accel, work, first, count, False, None)
        found.append(Found(*(row[:STREAM] for row in work.hits[:4])))
    truth, mine = found
    assert_same(mine, truth, "a part")
    hit = np.flatnonzero(mine.prim >= 0)
    assert len(hit) > 10 and first <= hit.min() and hit.max() < first + count


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
    found = ask(wide, origin, direction, tally=counts)
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
    np.testing.assert_array_equal(same, found)


def test_the_answer_does_not_depend_on_the_way(wide):
    origin, direction = rays(STREAM)
    whole = closest(wide, origin, direction)
    parts = [closest(wide, origin[part], direction[part]) for part in few(STREAM)]
    joined = type(whole)(*(np.concatenate(row) for row in zip(*parts, strict=True)))
    assert_same(joined, whole, "one by one")
