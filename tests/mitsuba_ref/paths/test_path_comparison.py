"""Two paths side by side: hand-made records, and the first difference between them.

The path of all tests: the camera sees shape 3, which samples the light on shape 1 and sends
the path on to shape 2, from where it leaves the scene. Each test changes one thing and
expects its name, bounce and kind.
"""

from __future__ import annotations

import io
import math
from dataclasses import asdict, replace

import msgspec
import pytest
from rich.console import Console

from mitsuba_ref.our_renderer.traced_path import (
    Bounce,
    SampledLight,
    Scattered,
    TracedPath,
)
from mitsuba_ref.replay.paths.path_comparison import (
    CAMERA,
    TOLERANCE,
    WHOLE,
    compare_paths,
    difference_sentence,
    first_difference,
    largest_error,
)
from mitsuba_ref.replay.paths.path_table import MARK, print_paths

NAMES = ("ours", "theirs")

LIGHT = SampledLight(
    light="shape 1",
    direction=(0.0, 0.6, 0.8),
    distance=2.0,
    pdf=5.0,
    weight=(2.0, 1.5, 1.0),
    carried=(0.2, 0.15, 0.1),
    blocked=False,
)
SCATTERED = Scattered(
    direction=(0.0, 0.0, 1.0), pdf=0.3, throughput=(0.5, 0.4, 0.3), survived=True
)
FIRST = Bounce(
    shape=3,
    face=None,
    t=4.0,
    position=(1.0, 2.0, 0.5),
    throughput=(1.0, 1.0, 1.0),
    emitted=(0.0, 0.0, 0.0),
    numbers={"light x": 0.1, "light y": 0.2, "bsdf": 0.3},
    lights=(LIGHT,),
    scattered=SCATTERED,
    radiance=(0.2, 0.15, 0.1),
)
SECOND = replace(
    FIRST,
    shape=2,
    face=7,
    t=1.0,
    position=(1.0, 2.0, 1.5),
    throughput=SCATTERED.throughput,
    lights=(replace(LIGHT, blocked=True),),
)
LAST = replace(
    FIRST,
    shape=0,
    face=None,
    t=math.inf,
    position=None,
    numbers={},
    lights=(),
    scattered=None,
)
PATH = TracedPath(
    renderer="theirs",
    numbers={"film x": 0.5, "film y": 0.25},
    origin=(0.0, 0.0, 5.0),
    direction=(0.0, 0.0, -1.0),
    bounces=(FIRST, SECOND, LAST),
)


def with_bounce(number: int, **changes) -> TracedPath:
    """Return the path with one bounce changed."""
    bounces = list(PATH.bounces)
    bounces[number] = replace(bounces[number], **changes)
    return replace(PATH, bounces=tuple(bounces))


def with_light(number: int, **changes) -> TracedPath:
    (light,) = PATH.bounces[number].lights
    return with_bounce(number, lights=(replace(light, **changes),))


def with_scattered(number: int, **changes) -> TracedPath:
    scattered = PATH.bounces[number].scattered
    return with_bounce(number, scattered=replace(scattered, **changes))


def first_of(ours: TracedPath, reference: TracedPath = PATH):
    quantities = compare_paths(ours, reference)
    index = first_difference(quantities)
    return None if index is None else quantities[index]


def test_a_path_agrees_with_itself():
    """Nothing differs, and all errors are 0."""
    quantities = compare_paths(PATH, PATH)
    assert first_difference(quantities) is None
    assert largest_error(quantities) == 0.0
    assert "agree" in difference_sentence(quantities, NAMES)


@pytest.mark.parametrize(
    ("ours", "bounce", "name", "kind"),
    [
        (
            replace(PATH, numbers={"film x": 0.5, "film y": 0.26}),
            CAMERA,
            "random: film y",
            "random numbers",
        ),
        (replace(PATH, direction=(0.0, 0.01, -1.0)), CAMERA, "direction", "value"),
        (with_bounce(1, shape=4), 1, "hits", "hit"),
        (with_bounce(1, face=8, position=(1.0, 2.0, 1.6)), 1, "face", "hit"),
        (with_bounce(1, position=(1.0, 2.01, 1.5)), 1, "position", "value"),
        (with_bounce(2, emitted=(0.1, 0.0, 0.0)), 2, "emitted", "value"),
        (
            with_bounce(1, numbers={**FIRST.numbers, "bsdf": 0.31}),
            1,
            "random: bsdf",
            "random numbers",
        ),
        (with_light(0, light="shape 2"), 0, "light", "light choice"),
        (with_light(0, direction=(0.0, 0.8, 0.6)), 0, "light direction", "value"),
        (with_light(0, carried=(0.1, 0.15, 0.1)), 0, "unblocked light", "value"),
        (with_light(1, blocked=False), 1, "light blocked", "shadow"),
        (with_bounce(0, lights=()), 0, "light", "light choice"),
        (with_scattered(1, direction=(0.0, 1.0, 0.0)), 1, "BSDF direction", "value"),
        (with_scattered(1, pdf=0.31), 1, "BSDF pdf", "value"),
        (with_scattered(0, throughput=(0.5, 0.4, 0.2)), 0, "throughput after", "value"),
        (with_scattered(1, survived=False), 1, "survives", "roulette"),
        (with_bounce(1, scattered=None), 1, "goes on", "end"),
        (with_bounce(1, radiance=(0.3, 0.2, 0.1)), 1, "radiance so far", "value"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_the_first_difference_has_its_place_and_kind(ours, bounce, name, kind):
    """One change in the middle of a path: its bounce, name and kind."""
    found = first_of(ours)
    assert (found.bounce, found.name, found.kind) == (bounce, name, kind)


def test_what_follows_from_a_difference_is_not_the_first():
    """Another light direction carries other light: the direction is the cause."""
    ours = with_light(0, direction=(0.0, 0.8, 0.6), carried=(0.1, 0.1, 0.1))
    assert first_of(ours).name == "light direction"


def test_a_pdf_counts_only_as_far_as_the_light_it_carries():
    """Near a light's edge pdf and weight are all rounding; what they carry counts."""
    assert first_of(with_light(0, pdf=6.0)) is None
    assert first_of(with_light(0, pdf=6.0, carried=(0.1, 0.15, 0.1))).name == "light pdf"


def test_a_path_that_ends_early_is_seen():
    """Our path has one bounce less although nothing said so: it hits nothing there."""
    found = first_of(replace(PATH, bounces=PATH.bounces[:2]))
    assert (found.bounce, found.name, found.kind) == (2, "hits", "hit")


def test_differences_below_the_tolerance_pass():
    """2e-4 of a position is fine at the default tolerance and not at 1e-4."""
    quantities = compare_paths(with_bounce(1, position=(1.0, 2.0004, 1.5)), PATH)
    assert first_difference(quantities, TOLERANCE) is None
    assert first_difference(quantities, 1e-4) is not None


def test_what_rounding_makes_of_tiny_values_passes():
    """Light of a thousandth of the pixel's, and a density at a grazing angle, off by 0.5 %.

    The same 0.5 % of a bright light or of a usual density is a difference.
    """
    reference = with_light(1, carried=(2e-4, 2e-4, 2e-4))
    assert first_of(with_light(1, carried=(2.01e-4,) * 3), reference) is None
    reference = with_scattered(0, pdf=1e-3)
    assert first_of(with_scattered(0, pdf=1.005e-3), reference) is None
    assert first_of(with_light(0, carried=(0.201, 0.15, 0.1))).name == "unblocked light"
    assert first_of(with_scattered(0, pdf=0.3015)).name == "BSDF pdf"


@pytest.mark.parametrize(("share", "rounding"), [(1.01, True), (1.1, False)])
def test_a_small_difference_may_be_rounding_that_grew(share, rounding):
    """1 % more throughput may come of curved mirrors; 10 % more is called a value."""
    ours = with_scattered(0, throughput=tuple(share * c for c in SCATTERED.throughput))
    sentence = difference_sentence(compare_paths(ours, PATH), NAMES)
    assert ("Likely rounding that has grown" in sentence) == rounding
    assert "the formula of this quantity" in sentence


def test_a_light_on_the_black_side_need_not_be_asked():
    """Where it would carry nothing, one side may leave it out or give up early."""
    dark = {"carried": (0.0, 0.0, 0.0), "blocked": None}
    reference = with_light(0, **dark)
    assert first_of(with_bounce(0, lights=()), reference) is None
    assert first_of(with_light(0, pdf=0.0, weight=(0.0,) * 3, **dark), reference) is None


def test_a_face_on_a_shared_edge_does_not_matter():
    """The same point on the neighbouring triangle; and rectangles have no faces in ours."""
    assert first_of(with_bounce(1, face=8)) is None
    assert first_of(with_bounce(1, face=None)) is None


def test_what_is_known_to_be_dark_may_be_left_out():
    """Our `direct` sends no rays where no light can be hit; light from there is seen."""
    ours = with_bounce(0, scattered=None, left_out=True)
    ours = replace(ours, bounces=ours.bounces[:1])
    assert first_of(ours) is None
    reference = with_bounce(2, radiance=(0.5, 0.5, 0.5))
    found = first_of(ours, reference)
    assert (found.bounce, found.name) == (WHOLE, "radiance")


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_values_that_are_not_finite_on_one_side_differ(bad):
    """NaN is never a pass; on both sides it is the same."""
    assert first_of(with_bounce(1, throughput=(bad, 0.4, 0.3))).name == "throughput"
    same = with_bounce(1, throughput=(bad, 0.4, 0.3))
    assert first_of(same, same) is None


def test_records_survive_json():
    """Tuples that became lists included."""
    import json

    assert msgspec.convert(json.loads(json.dumps(asdict(PATH))), TracedPath) == PATH


def test_the_table_marks_one_row():
    """The mark stands in the row of the quantity, under the title of its bounce."""
    quantities = compare_paths(with_light(1, blocked=False), PATH)
    output = io.StringIO()
    print_paths(quantities, NAMES, TOLERANCE, Console(file=output, width=128))
    lines = [line.rstrip() for line in output.getvalue().splitlines()]
    (marked,) = (i for i, line in enumerate(lines) if line.endswith(MARK))
    assert lines[marked].split()[:4] == ["light", "blocked", "no", "yes"]
    titles = [line.strip() for line in lines[:marked] if line.strip().startswith("bounce")]
    assert titles[-1] == "bounce 1"
    assert "First difference at bounce 1: light blocked is no in ours" in lines[-1]
    assert all("…" not in line for line in lines)
