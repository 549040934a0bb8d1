"""Whether rounding explains where two paths part, and in which words.

Hand-made paths stand for both renderers and for what the kernels make of a moved ray; the
last two ask both renderers, for a pixel that is known to diverge at an edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from test_path_comparison import PATH, with_bounce, with_light

from mitsuba_ref.our_renderer.ray_perturbation import Moved
from mitsuba_ref.our_renderer.traced_path import TracedPath
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.replay.paths.path_comparison import compare_paths, first_difference
from mitsuba_ref.replay.paths.traced_pair import TracedPair
from mitsuba_ref.replay.paths.within_rounding import (
    Move,
    rounding_sentence,
    smallest_move,
)

SCENES = Path(__file__).parents[3] / "scenes"
UP, TILTED = (0.0, 0.0, 1.0), (0.0, 0.6, 0.8)


def verdict(ours: TracedPath, moved_far: TracedPath, size: float, segment: int = 1):
    """Explain ours beside PATH; moves of one ray by `size` make `moved_far` of it."""
    quantities = compare_paths(ours, PATH)
    index = first_difference(quantities)
    quantity = quantities[index]

    def trace(moves: Sequence[Moved]):
        for move in moves:
            far = sum(c * c for c in move.by) ** 0.5 > 0.99 * size
            yield moved_far if far and move.segment == segment else ours

    move = smallest_move(ours, PATH, index, quantity, trace)
    return move, rounding_sentence(ours, PATH, quantity, move)


def test_a_shadow_decision_that_a_tiny_move_flips():
    """It flips at 1e-6 of the ray's length and not below."""
    move, said = verdict(with_light(1, blocked=False), PATH, 1e-6)
    assert move == Move(1, 1e-6)
    assert "Within rounding: moving our ray of bounce 1 by 1e-06 of its length" in said


def test_a_decision_that_only_a_large_move_flips_is_not_within_rounding():
    """1e-3 of a ray's length is ten thousand roundings: a wrong ray is likely."""
    move, said = verdict(with_bounce(1, shape=4), PATH, 1e-3)
    assert move is None
    assert said.startswith("Not within rounding") and "a wrong shape" in said


@pytest.mark.parametrize(
    "ours", [with_light(1, blocked=False), with_bounce(1, throughput=(0.5, 0.4, 0.2))]
)
def test_what_no_move_explains_is_not_within_rounding(ours):
    """No moved path does what the reference does: the old sentence on what is likely."""
    move, said = verdict(ours, ours, 0.0)
    assert move is None
    assert said.startswith("Not within rounding") and "Likely a" in said


def test_a_value_whose_error_has_grown_on_the_way_is_amplified_rounding():
    """Rays 1e-6 apart at bounce 0 and 1e-3 at bounce 1: a thousand times more."""
    ours = with_bounce(0, position=(1.0, 2.001, 0.5))
    ours = replace(ours, direction=(1e-6, 0.0, -1.0))
    bounces = list(ours.bounces)
    bounces[1] = replace(bounces[1], position=(1.0, 2.004, 1.5))
    ours = replace(ours, bounces=tuple(bounces))
    bounces[1] = replace(bounces[1], position=(1.0, 2.009, 1.5))
    moved = replace(ours, bounces=tuple(bounces))
    move, said = verdict(ours, moved, 1e-6, segment=0)
    assert move == Move(0, 1e-6)
    assert said.startswith("Amplified rounding: moving our ray of bounce 0 by 1e-06")
    assert "1.0e-06 of their length apart at bounce 0 and 1.0e-03 at bounce 1" in said


@pytest.mark.parametrize(("before", "amplified"), [(1e-5, True), (1e-7, False)])
def test_what_grew_step_by_step_may_be_moved_as_far_as_it_is_apart(before, amplified):
    """From 1e-5 to 1e-3 in one bounce is growth; from 1e-7 it is a wrong formula."""
    ours = with_bounce(0, position=(1.0, 2.001, 0.5))
    bounces = list(ours.bounces)
    bounces[1] = replace(bounces[1], position=(1.0, 2.004, 1.5))
    ours = replace(ours, direction=(before, 0.0, -1.0), bounces=tuple(bounces))
    bounces[1] = replace(bounces[1], position=(1.0, 2.009, 1.5))
    move, said = verdict(ours, replace(ours, bounces=tuple(bounces)), 2e-3)
    assert said.startswith("Amplified" if amplified else "Not within")
    assert (move is not None) == amplified


def test_another_face_of_the_same_point_is_the_cause_of_what_follows():
    """Normals part and with them the light: an edge, not the light's formula."""
    ours = with_light(1, carried=(0.1, 0.15, 0.1))
    bounces = list(ours.bounces)
    bounces[1] = replace(bounces[1], face=8, normal=TILTED)
    ours = replace(ours, bounces=tuple(bounces))
    reference = with_bounce(1, normal=UP)
    quantities = compare_paths(ours, reference)
    first = quantities[first_difference(quantities)]
    assert (first.bounce, first.name, first.kind) == (1, "face", "hit")
    said = rounding_sentence(ours, reference, first, Move(1, 1e-7))
    assert "Both hit one point" in said and "37 degrees apart: an edge" in said


def test_a_normal_of_another_sign_is_the_same_and_a_wrong_one_comes_first():
    """Before the light that it changes; alone it is no difference."""
    reference = with_bounce(1, normal=UP)
    ours = with_bounce(1, normal=(0.0, 0.0, -1.0))
    assert first_difference(compare_paths(ours, reference)) is None
    (light,) = ours.bounces[1].lights
    light = replace(light, carried=(0.1, 0.15, 0.1))
    bounces = list(ours.bounces)
    bounces[1] = replace(bounces[1], normal=TILTED, lights=(light,))
    quantities = compare_paths(replace(ours, bounces=tuple(bounces)), reference)
    assert quantities[first_difference(quantities)].name == "normal"


@pytest.fixture(scope="module")
def smooth_mesh():
    size = {"width": "224", "height": "144", "spp": "16"}
    scene = SCENES / "smooth-mesh" / "scene.xml"
    with TracedPair(RenderRequest(str(scene), size, spp=16)) as pair:
        yield pair


@pytest.mark.slow
def test_a_trace_without_a_replay_asks_mitsuba_for_its_camera(smooth_mesh):
    """With the measured entries the camera rays agree in all bits; without, to 4e-8."""
    for sample in range(4):
        ours, reference = smooth_mesh.trace((127, 119), sample)
        assert (ours.origin, ours.direction) == (reference.origin, reference.direction)


@pytest.mark.slow
def test_a_known_edge_is_named_and_measured(smooth_mesh):
    """smooth-mesh at 127,119, as in its replay: sample 5 hits faces 151 and 1111.

    One of the two divergent pixels of the scene at demo size.
    """
    cause = smooth_mesh.cause((127, 119))
    assert "face is 151 in lightproof and 1111 in Mitsuba" in cause
    assert "rounding: moving our ray" in cause and "apart: an edge" in cause
