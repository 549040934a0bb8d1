"""What a trace says about where two paths part, and a pixel known to diverge at an edge.

Hand-made paths stand for both renderers in the first tests; the last two ask both.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from test_path_comparison import PATH, with_bounce, with_light

from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.replay.paths.path_comparison import compare_paths, first_difference
from mitsuba_ref.replay.paths.path_from_reference_rays import LedPath, cause_of
from mitsuba_ref.replay.paths.traced_pair import TracedPair

SCENES = Path(__file__).parents[3] / "scenes"
UP, TILTED = (0.0, 0.0, 1.0), (0.0, 0.6, 0.8)


def said_of(ours, moved=None) -> str:
    """Return the cause of the first difference of ours; moved far enough it is `moved`."""

    def trace_led(moves):
        yield from (ours if move is None else moved or ours for move in moves)

    quantities = compare_paths(ours, PATH)
    found = LedPath(PATH, trace_led, lambda *ray: None).examine()
    return cause_of(found, quantities[first_difference(quantities)])


def test_a_shadow_decision_that_a_tiny_move_flips_is_rounding():
    said = said_of(with_light(1, blocked=False), PATH)
    assert said.startswith(
        "Within rounding: from the same rays as Mitsuba's, light blocked"
    )


@pytest.mark.parametrize(
    "ours", [with_light(1, blocked=False), with_bounce(1, throughput=(0.5, 0.4, 0.2))]
)
def test_what_no_move_explains_is_told_without_its_values(ours):
    """The sentence before it has both values already."""
    said = said_of(ours)
    assert said.startswith("Not within rounding: from the same ray as Mitsuba's no move")
    assert "Likely a" in said


def test_rounding_has_no_part_in_other_random_numbers():
    numbers = dict.fromkeys(PATH.bounces[0].numbers, 0.5)
    assert said_of(with_bounce(0, numbers=numbers)) == ""


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
def test_a_known_edge_is_named_and_explained(smooth_mesh):
    """smooth-mesh at 127,119, as in its replay: sample 5 hits faces 151 and 1111.

    One of the two divergent pixels of the scene at demo size.
    """
    cause = smooth_mesh.cause((127, 119))
    assert "face is 151 in lightproof and 1111 in Mitsuba" in cause
    assert "Amplified rounding: from the same rays as Mitsuba's" in cause
