"""Boxes around objects: where runs are cut, when they are chosen, and their proof.

That hits are those of brute force is shown with those of all structures
(`test_accelerators_agree` and its neighbours).
"""

from __future__ import annotations

import numpy as np
import pytest
from agreement import assert_same_hits, extents_for, proved, some
from kernel_probes import directions, soup, triangles, unit

import renderer
from renderer.accelerators import choice
from renderer.accelerators.choice import Estimate, RayCounts, choose_structures
from renderer.accelerators.rays.boxes import MOST, divide, expected_cost
from renderer.accelerators.validate import validate


def objects(count, parts, rng, size=0.1):
    """Corners of the boxes of `count` objects of `parts` primitives each, far apart."""
    centre = np.repeat(np.arange(count) * 10.0, parts)
    low = rng.uniform(-1, 1, (3, count * parts))
    low[0] += centre
    return low.astype(np.float32), (low + size).astype(np.float32)


def test_cuts_lie_between_objects():
    """Three objects of 12, as the walls of three boxes: runs of 12."""
    lower, upper = objects(3, 12, np.random.default_rng(0))
    np.testing.assert_array_equal(divide(lower, upper), [0, 12, 24, 36])


def test_there_are_no_more_boxes_than_lists():
    lower, upper = objects(20, 12, np.random.default_rng(1))
    start = divide(lower, upper)
    assert len(start) == MOST + 1
    assert start[0] == 0 and start[-1] == 240 and (np.diff(start) > 0).all()


@pytest.mark.parametrize("n", [1, 2, 40])
def test_one_box_where_cutting_saves_nothing(n):
    """All primitives as large as the whole: every run has the box of all."""
    lower, upper = np.zeros((3, n), np.float32), np.ones((3, n), np.float32)
    np.testing.assert_array_equal(divide(lower, upper), [0, n])
    assert expected_cost(lower, upper) > n  # every ray enters: worse than brute force


def test_cost_counts_who_enters():
    """A small object in a large room is passed by: little but the box remains."""
    lower, upper = np.zeros((3, 20), np.float32), np.ones((3, 20), np.float32)
    room = np.array([[-100.0] * 3, [100.0] * 3])
    assert 2.0 < expected_cost(lower, upper, room) < 2.1


def test_points_in_one_place_have_a_cost():
    """No area at all, neither of the room nor of the boxes."""
    point = np.zeros((3, 4), np.float32)
    assert expected_cost(point, point) == 2.0


def test_auto_takes_boxes_where_rays_are_many():
    """The Cornell box: its two blocks of 12 triangles, but not its walls, have boxes."""
    scene = renderer.load_file("scenes/cornell-box/scene.xml")
    many = choose_structures(scene, "auto", RayCounts(1e7, 1e8))
    assert (many["triangles"].name, many["rectangles"].name) == ("boxes", "brute")
    few = choose_structures(scene, "auto", RayCounts(1e3, 1e4))
    assert few["triangles"].name == "brute"


def test_auto_takes_boxes_for_few_primitives_only(monkeypatch):
    """Where brute force is the best of the others: up to 1024, as quick to build."""
    rng = np.random.default_rng(5)
    costs = [Estimate("brute", 0.0, 1.0), Estimate("bvh", 0.5, 0.6)]
    monkeypatch.setattr(choice, "estimate_all", lambda *scene: costs)
    room = np.array([[-50.0] * 3, [50.0] * 3])
    for n, name in ((1024, "boxes"), (1025, "brute")):
        found = choice.choose_structure(
            "triangles", soup("triangles", n, rng), n, "auto", room=room
        )
        assert found.name == name


def test_more_rays_than_a_list_holds():
    """3000 rays go in three parts, and four objects have four lists of each."""
    rng = np.random.default_rng(3)
    corners = rng.uniform(-0.5, 0.5, (4, 10, 3, 3)) + np.arange(4)[:, None, None, None] * 2
    corners = corners.reshape(40, 3, 3)
    origin = rng.uniform(-1, 8, (3000, 3))
    aim = corners[rng.integers(40, size=3000)].mean(axis=1) + 0.2 * directions(3000, rng)
    surfaces = triangles(corners)
    some(assert_same_hits("boxes", "triangles", surfaces, origin, unit(aim - origin)), 0.2)


def broken(accel, extents, match):
    with pytest.raises(ValueError, match=match):
        validate(accel, extents)


def test_the_proof_fails_where_it_must():
    surfaces = soup("triangles", 30, np.random.default_rng(4))
    accel = proved("boxes", "triangles", surfaces)
    extents = extents_for("triangles", surfaces)
    smaller = accel.bounds.copy()
    smaller[0, 3] -= np.float32(0.01)
    broken(accel._replace(bounds=smaller), extents, "sticks out")
    broken(accel._replace(start=np.array([0, 29])), extents, "each primitive once")
    ids = accel.primitives.id.copy()
    ids[:2] = ids[1], ids[0]
    turned = accel._replace(primitives=accel.primitives._replace(id=ids))
    broken(turned, extents, "order of their ids")
