"""What accelerators do with a batch of rays and with what is there before they begin."""

from __future__ import annotations

import numpy as np
import pytest
from agreement import every_name, proved, ways_of
from kernel_probes import (
    blocked,
    closest,
    directions,
    fill,
    soup,
    trace,
    workspace,
)

RAYS = 2000


@pytest.fixture(scope="module")
def surfaces():
    return soup("triangles", 300, np.random.default_rng(17), size=0.5)


def rays(n, seed=18):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (n, 3)), directions(n, rng)


@every_name
def test_a_part_of_a_batch(name, surfaces):
    """Any first ray and any number of rays; those before the first stay as they were."""
    accel = proved(name, "triangles", surfaces)
    origin, direction = rays(96)
    for coherent in ways_of(accel):
        whole = closest(accel, origin, direction, coherent=coherent)
        for first, count in ((0, 1), (0, 15), (0, 17), (16, 33), (7, 20), (95, 1), (5, 0)):
            work = workspace(96)
            fill(work.rays, origin, direction)
            work.hits.t[:] = np.inf
            work.hits.prim[:] = -1
            trace(accel, work, first, count, coherent, None)
            part = slice(first, first + count)
            np.testing.assert_array_equal(work.hits.prim[part], whole.prim[part])
            np.testing.assert_array_equal(work.hits.t[part], whole.t[part])
            np.testing.assert_array_equal(work.hits.prim[:first], -1)


@every_name
def test_a_nearer_hit_of_another_kind_stays(name, surfaces):
    """Groups are intersected one after the other: what is there already must be beaten."""
    accel = proved(name, "triangles", surfaces)
    origin, direction = rays(RAYS)
    before = np.random.default_rng(19).uniform(0, 2, RAYS).astype(np.float32)
    for coherent in ways_of(accel):
        alone = closest(accel, origin, direction, coherent=coherent)
        beaten = alone.t < before
        assert 0.05 < beaten.mean() < 0.95
        work = workspace(RAYS)
        fill(work.rays, origin, direction)
        work.hits.t[:RAYS], work.hits.prim[:] = before, 9999
        trace(accel, work, 0, RAYS, coherent, None)
        found = work.hits.prim[:RAYS], work.hits.t[:RAYS]
        np.testing.assert_array_equal(found[0], np.where(beaten, alone.prim, 9999))
        np.testing.assert_array_equal(found[1], np.minimum(alone.t, before))


@every_name
def test_at_equal_distance_the_smaller_id_of_two_kinds_wins(name, surfaces):
    """A hit of another kind at exactly the same t: ids decide, not the order of kinds."""
    accel = proved(name, "triangles", surfaces)
    origin, direction = rays(RAYS)
    for coherent in ways_of(accel):
        alone = closest(accel, origin, direction, coherent=coherent)
        hit = alone.prim >= 0
        for before, after in ((0, 0), (9999, alone.prim)):
            work = workspace(RAYS)
            fill(work.rays, origin, direction)
            work.hits.t[:RAYS], work.hits.prim[:] = alone.t, before
            trace(accel, work, 0, RAYS, coherent, None)
            expected = np.where(hit, after, before)
            np.testing.assert_array_equal(work.hits.prim[:RAYS], expected)


@every_name
def test_shadow_rays_that_are_blocked_already_stay_blocked(name, surfaces):
    """The next kind of primitive must not open a ray again."""
    accel = proved(name, "triangles", surfaces)
    origin, direction = np.full((40, 3), 9.0), np.tile([0.0, 0.0, 1.0], (40, 1))
    shut = np.arange(40) % 3 == 0
    for coherent in ways_of(accel):
        assert not blocked(accel, origin, direction, coherent=coherent).any()
        again = blocked(accel, origin, direction, coherent=coherent, before=shut)
        np.testing.assert_array_equal(again, shut)


@every_name
def test_a_ray_does_not_depend_on_its_neighbours(name, surfaces):
    """Rays reversed in order, among rays that are blocked, give the same answers."""
    accel = proved(name, "triangles", surfaces)
    origin, direction = rays(203)
    for coherent in ways_of(accel):
        straight = closest(accel, origin, direction, coherent=coherent)
        turned = closest(accel, origin[::-1], direction[::-1], coherent=coherent)
        np.testing.assert_array_equal(turned.prim[::-1], straight.prim)
        np.testing.assert_array_equal(turned.t[::-1], straight.t)
        shut = np.arange(203) % 5 == 0
        some = blocked(accel, origin, direction, coherent=coherent, before=shut)
        np.testing.assert_array_equal(some, shut | (straight.prim >= 0))
