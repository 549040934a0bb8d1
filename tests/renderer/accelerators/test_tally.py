"""What accelerators count: known numbers on paper, and no change by the counting."""

from __future__ import annotations

import numpy as np
import pytest
from agreement import assert_same, every_name, extents_for, proved, ways_of
from kernel_probes import (
    accelerator,
    blocked,
    closest,
    directions,
    soup,
    triangles,
)
from numba.core.errors import TypingError
from soups import awkward_rays

from renderer.kernels.jit import entry_kernel
from renderer.kernels.records import batch as counting
from renderer.kernels.records.batch import (
    BOXES,
    NODES,
    PRIMITIVES,
    SAVED,
    STACK,
    make_tally,
)

RAYS = 300


def rays(n, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (n, 3)), directions(n, rng)


def counts_of(accel, origin, direction, ask=closest, **settings):
    """Counters of each ray, (ROWS, n), and what was found."""
    tally = make_tally(len(origin))
    found = ask(accel, origin, direction, tally=tally, **settings)
    assert (tally >= 0).all()
    assert not tally[:, len(origin) :].any(), "counted beyond the last ray"
    return tally[:, : len(origin)], found


# ---------------------------------------------------------------------- known on paper


@pytest.mark.parametrize("n", [1, 17, 100])
def test_brute_force_tests_every_primitive_of_every_ray(n):
    """n tests a ray and nothing else; a shadow ray that is not blocked takes n as well."""
    accel = accelerator(
        "triangles", soup("triangles", n, np.random.default_rng(0)), "brute"
    )
    counts, _ = counts_of(accel, *rays(RAYS))
    np.testing.assert_array_equal(counts[PRIMITIVES], n)
    assert not np.delete(counts, PRIMITIVES, axis=0).any()
    away = np.full((RAYS, 3), 9.0), np.tile([0.0, 0.0, 1.0], (RAYS, 1))
    counts, shut = counts_of(accel, *away, ask=blocked)
    assert not shut.any()
    np.testing.assert_array_equal(counts[PRIMITIVES], n)


def two_clusters():
    """Eight copies of one triangle at x = 0 and eight at x = 100, each in plane x = const.

    Eight primitives are one block of work, so each cluster becomes a leaf below the root.
    """
    one = np.array([[0.0, -1, -1], [0, 1, -1], [0, 0, 1]])
    return triangles(np.repeat([one, one + np.array([100, 0, 0])], 8, axis=0))


@pytest.mark.parametrize(
    ("start", "end", "expected"),
    [
        # past both: the root's box is tested, and no more
        ([-5.0, 50, 0], [1.0, 0, 0], {BOXES: 1, NODES: 0, PRIMITIVES: 0, STACK: 0}),
        # through the first alone: the root and one leaf
        ([0.5, 0.1, -0.5], [-1.0, 0, 0], {BOXES: 3, NODES: 2, PRIMITIVES: 8, STACK: 1}),
        # through both: the second waits, and is behind the first's hit
        ([-5.0, 0.1, -0.5], [1.0, 0, 0], {BOXES: 3, NODES: 2, PRIMITIVES: 8, STACK: 2}),
        # through both boxes, past all triangles in them
        ([-5.0, 0.9, 0.9], [1.0, 0, 0], {BOXES: 3, NODES: 3, PRIMITIVES: 16, STACK: 2}),
    ],
)
def test_the_bvh_of_two_clusters(start, end, expected):
    """Three nodes: how many boxes, nodes and primitives a ray meets is seen by eye."""
    accel = proved("bvh", "triangles", two_clusters())
    assert accel.count.tolist() == [0, 8, 8]
    counts, _ = counts_of(accel, np.array([start]), np.array([end]))
    assert {row: int(counts[row, 0]) for row in expected} == expected


# ----------------------------------------------------------------------- the counting twin


@every_name
def test_counting_changes_no_hit(name):
    """The same hits with a tally as without, bit for bit, and the same counts again."""
    surfaces = soup("triangles", 300, np.random.default_rng(2), size=0.4)
    accel = proved(name, "triangles", surfaces, reach=5.0)
    extents = extents_for("triangles", surfaces)
    for origin, direction in (
        rays(RAYS + 5),
        awkward_rays(extents, 40, np.random.default_rng(3)),
    ):
        for coherent in ways_of(accel):
            plain = closest(accel, origin, direction, coherent=coherent)
            counts, found = counts_of(accel, origin, direction, coherent=coherent)
            assert_same(found, plain, f"{name} counting, packets: {coherent}")
            hit = plain.prim >= 0
            assert hit.any() and (counts[PRIMITIVES, hit] > 0).all()
            again, _ = counts_of(accel, origin, direction, coherent=coherent)
            np.testing.assert_array_equal(again, counts)
            any_counts, shut = counts_of(
                accel, origin, direction, ask=blocked, coherent=coherent
            )
            np.testing.assert_array_equal(shut, hit)
            assert (any_counts[PRIMITIVES, hit] > 0).all()


@every_name
def test_a_structure_spares_work(name):
    """Far fewer tests than brute force; what it visits instead is counted too.

    2000 small triangles: brute force takes 2000 tests a ray, each structure less than a
    tenth. A traversal that takes the slow way through everything fails here. Boxes around
    runs of a soup are all as large as the soup: they are for objects.
    """
    n = 2000
    surfaces = soup("triangles", n, np.random.default_rng(4), size=0.05)
    accel = proved(name, "triangles", surfaces, reach=5.0)
    counts, _ = counts_of(accel, *rays(RAYS))
    if name == "brute":
        assert (counts[PRIMITIVES] == n).all()
        return
    if name == "boxes":
        assert (counts[BOXES] == counts[BOXES, 0]).all(), "every ray tests every box"
    else:
        assert counts[PRIMITIVES].mean() < n / 10
    assert counts[NODES].mean() >= 1
    assert counts[NODES].max() < n


def test_mailboxes_save_tests_and_no_hit():
    """A triangle in many cells is tested once a ray; without mailboxes, in each cell.

    One huge triangle across all cells of a crowd of small ones (row 11).
    """
    rng = np.random.default_rng(5)
    c = rng.uniform(-1, 1, (2000, 1, 3))
    small = c + 0.02 * rng.uniform(-1, 1, (2000, 3, 3))
    huge = [[[-1.5, -1.5, 0.01], [1.5, -1.5, 0.02], [0, 2.5, -0.01]]]
    surfaces = triangles(np.concatenate((huge, small)))
    found = {}
    for name in ("grid", "grid-without-mailboxes"):
        accel = proved(name, "triangles", surfaces, reach=5.0)
        found[name] = counts_of(accel, *rays(RAYS))
    (with_, hits), (without, same) = found.values()
    assert_same(hits, same, "mailboxes")
    assert not without[SAVED].any() and with_[SAVED].sum() > 0
    np.testing.assert_array_equal(
        with_[PRIMITIVES] + with_[SAVED], without[PRIMITIVES], "saved + done = all"
    )


# --------------------------------------------------------------------- without any count


@entry_kernel
def count_nonsense(tally):
    """Would not compile where counting is compiled: a pair is no amount."""
    counting.add_to(tally, PRIMITIVES, 0, (1, 2))
    counting.add_to_packet(tally, PRIMITIVES, 0, 16, (1, 2))
    counting.note_stack(tally, 0, (1, 2))
    counting.note_packet_stack(tally, 0, 16, (1, 2))


def test_without_a_tally_no_counting_is_compiled():
    """Counting a pair of numbers is a type error, unless the counting is left out."""
    count_nonsense(None)
    with pytest.raises(TypingError):
        count_nonsense(make_tally(1))
