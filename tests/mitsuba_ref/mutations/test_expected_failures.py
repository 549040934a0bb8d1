"""The register of known disagreements: every entry still disagrees, by its own number.

Each measurement is run on a right method as well, where there is one: it must then say so,
or the entry would prove nothing.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from mitsuba_ref.expected_failures import REGISTER, ExpectedFailure, check
from mitsuba_ref.expected_failures.cost import stadium_tests_per_ray
from mitsuba_ref.expected_failures.light import inside, terminator_pictures
from mitsuba_ref.expected_failures.offsets import MITSUBA, TIGHT, smallest_gap
from mitsuba_ref.expected_failures.reference import (
    edge_rays_lost,
    lamp_with_vertex_normals,
    point_light_sampled_often,
)
from mitsuba_ref.expected_failures.rounding import far_spheres_wrong, small_triangles_lost
from mitsuba_ref.expected_failures.volpathmis import (
    blue_in_coloured_mist,
    floor_behind_a_tinted_pane,
    floor_in_a_clear_lamp,
    red_floor_by_one_density,
    white_mist_with_roulette,
)

BY_NAME = {entry.name: entry for entry in REGISTER}
entries = [
    pytest.param(entry, id=entry.name, marks=[pytest.mark.slow] if entry.slow else [])
    for entry in REGISTER
]


@pytest.mark.parametrize("entry", entries)
def test_still_disagrees(entry):
    """Within the band around the number that was measured when the entry was written."""
    outcome = check(entry)
    assert not outcome.alarm, f"{outcome.verdict}: {outcome.measured}, not {entry.band}"


RIGHT = {
    "small triangles": functools.partial(small_triangles_lost, edge=1e-2),
    "far spheres": functools.partial(far_spheres_wrong, distance=1e1),
    "single precision film": lambda: math.fsum([float(np.float32(0.1))] * 10**6) / 1e5,
    "fixed epsilon": functools.partial(smallest_gap, TIGHT),
    "Mitsuba's epsilon": functools.partial(smallest_gap, TIGHT),
    "tight offset on a large square": functools.partial(smallest_gap, MITSUBA, 1000.0),
    "Embree's default mode": functools.partial(edge_rays_lost, robust=True),
    "Mitsuba's point light, sampled four times": functools.partial(
        point_light_sampled_often, 1
    ),
    "Mitsuba's lamp with vertex normals": functools.partial(lamp_with_vertex_normals, 0.0),
    "roulette of Mitsuba's volpathmis": functools.partial(white_mist_with_roulette, 1000),
    "tinted panes of Mitsuba's volpathmis": functools.partial(
        floor_behind_a_tinted_pane, 1.0
    ),
    "clear lamps of Mitsuba's volpathmis": functools.partial(
        floor_in_a_clear_lamp, shines=False
    ),
    "single density of Mitsuba's volpathmis": functools.partial(
        red_floor_by_one_density, green=0.5
    ),
    "Mitsuba's coloured mist without spectral extinction": functools.partial(
        blue_in_coloured_mist, spectral=True
    ),
    "teapot in a stadium": functools.partial(stadium_tests_per_ray, "bvh"),
}


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_method_would_be_an_alarm(name):
    """The same measurement of a method that is right lies where the entry says it would."""
    entry = BY_NAME[name]
    low, high = entry.agreement
    measured = RIGHT[name]()
    assert low <= measured <= high
    assert not entry.band[0] <= measured <= entry.band[1]


@pytest.mark.parametrize("entry", REGISTER, ids=lambda entry: entry.name)
def test_entries_make_sense(entry):
    """The number is in its band, the bands are apart, and every word is there."""
    assert entry.band[0] <= entry.measured <= entry.band[1]
    assert entry.band[1] < entry.agreement[0] or entry.agreement[1] < entry.band[0]
    assert entry.name and entry.what and entry.reason
    assert len(BY_NAME) == len(REGISTER)


@pytest.mark.parametrize(
    ("value", "verdict"),
    [
        (0.5, "still disagrees"),
        (0.05, "ALARM: agrees now"),
        (0.3, "ALARM: another number"),
        (math.nan, "ALARM: another number"),
    ],
)
def test_what_is_an_alarm(value, verdict):
    entry = ExpectedFailure(
        "one", "a share", lambda: value, 0.5, (0.4, 0.6), (0.0, 0.1), "for this test"
    )
    outcome = check(entry)
    assert outcome.verdict == verdict
    assert outcome.alarm == verdict.startswith("ALARM")


def test_the_terminator_s_error_is_in_its_band():
    """Row 29: 16 segments are wrong where the light grazes, and only there.

    A quarter of the pixels with cosines up to 0.2 are black on the mesh. Where the sphere
    is lit by more, the error is that of the facets' depth: 0.01. Where it is dark, so is
    the mesh.
    """
    smooth, mesh = terminator_pictures()
    seen = inside(0.95)
    band = seen & (smooth > 0) & (smooth < 0.2)
    lit = seen & (smooth > 0.25)
    assert 0.15 < np.mean(mesh[band] == 0) < 0.35
    assert (mesh[lit] > smooth[lit] - 0.02).all()
    assert np.sqrt(np.mean((mesh - smooth)[lit] ** 2)) < 0.012
    assert (mesh[seen & (smooth == 0)] == 0).all()
