"""Defects of implicit surfaces, which Mitsuba has not: tests by closed forms see them.

Their scene is one that shows nothing of them, as there is no reference of one that does.
"""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

NO_TWIN = "Mitsuba has no such shape"


def _mutation(name: str, does: str, test: str, *edits: Edit) -> Mutation:
    tests = (f"test_implicit_surfaces.py::{test}",)
    return Mutation(name, does, edits, scene="grey-furnace", tests=tests, remark=NO_TWIN)


DEFECTS = (
    _mutation(
        "roots-by-the-middle-alone",
        "an interval is left out if a function is not 0 within half of it",
        "test_no_first_root_is_missed_and_none_invented",
        Edit(
            "plugins/shapes/implicit/roots.py",
            "_has_zero(_around_middle(here, slope, half))",
            "_has_zero(_around_middle(here, slope, 0.5 * half))",
        ),
    ),
    _mutation(
        "touching-is-no-root",
        "what no interval decides is no root",
        "test_a_double_root_counts",
        Edit(
            "plugins/shapes/implicit/roots.py",
            "if value.high - value.low < np.inf:",
            "if value.high - value.low < 0.0:",
        ),
    ),
    _mutation(
        "waves-without-their-peak",
        "the range of a sine is that between its ends, whatever lies between",
        "test_the_range_of_a_wave_is_that_of_its_ends_and_peaks",
        Edit(
            "plugins/shapes/implicit/intervals.py",
            "1.0 if top <= a.high + slack else",
            "1.0 if top > np.inf else",
        ),
    ),
    _mutation(
        "implicit-normals-by-the-matrix",
        "normals are stretched as the surface is",
        "test_normals_go_by_the_inverse_transpose",
        Edit(
            "plugins/shapes/implicit/implicit.py",
            "n = unit_normal(surfaces.to_object, k, g, vec3(0.0, 0.0, 1.0))",
            "n = unit_normal(surfaces.to_world, k, g, vec3(0.0, 0.0, 1.0))",
        ),
    ),
)
