"""Every row of the atlas: before its boundary the method holds, behind it fails."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from reports.limits.atlas import ATLAS, CHAPTERS
from reports.limits.measure import measure_row
from reports.limits.record import AGREES, AS_SAID, BROKEN, EARLY
from reports.limits.row import Row, measure_sides

EACH = [
    pytest.param(row, id=row.name, marks=[pytest.mark.slow] if row.slow else [])
    for row in ATLAS
]
PICTURED = [row for row in ATLAS if row.picture is not None]

ROW = Row(
    name="square",
    method="A method",
    stress="strength",
    measure=lambda strength: strength**2,
    quantity="error",
    unit="of it",
    strengths=(0.1, 1.0, 10.0),
    tolerance=4.0,
    holds_at=1.0,
    fails_at=10.0,
    why="So it is.",
    instead="Another.",
    source="measured here",
)


@pytest.mark.parametrize("row", EACH)
def test_both_sides_of_the_boundary(row):
    """A method that no longer fails is an alarm: the row has gone blind, or it was mended.

    Nothing is random: seeds are fixed, so the rate of false alarms is that of another
    machine's rounding, which the distance between the two strengths covers.
    """
    sides = measure_sides(row)
    assert sides.holds_before, f"{sides.before} at {row.holds_at}"
    assert sides.fails_behind, f"{sides.behind} at {row.fails_at}"


@pytest.mark.parametrize("row", PICTURED, ids=lambda row: row.name)
def test_pictures_show_something_and_say_what(row):
    picture = row.picture()
    assert picture.dtype == np.uint8 and picture.ndim == 3 and picture.shape[2] == 3
    assert np.std(picture) > 10.0 and row.caption.endswith(".")


def test_names_are_anchors_and_no_two_alike():
    assert not [name for name, n in Counter(r.name for r in ATLAS).items() if n > 1]
    assert all(re.fullmatch(r"[A-Za-z0-9]+(-[A-Za-z0-9]+)*", row.name) for row in ATLAS)


def test_chapters_have_their_rows():
    least = {"numbers": 40, "structures": 30, "light": 25, "comparing": 20}
    rows = {chapter.name: len(chapter.rows) for chapter in CHAPTERS}
    assert rows.keys() == least.keys()
    assert all(rows[name] >= count for name, count in least.items())


def test_what_is_measured_twice_is_measured_once():
    """Both sides stand on the curve too, and the halving begins between them."""
    asked = []

    def measure(strength):
        asked.append(strength)
        return strength**2

    assert measure_row(replace(ROW, measure=measure)).verdict == AS_SAID
    assert len(asked) == len(set(asked)) == 3 + 5


def test_each_row_says_why_and_what_instead():
    """Whole sentences, and strengths that grow through the boundary."""
    for row in ATLAS:
        for sentence in (row.why, row.instead):
            assert len(sentence) > 5 and sentence.endswith("."), row.name
        for phrase in (row.method, row.stress, row.unit, row.source):
            assert phrase.strip() == phrase != "", row.name
        assert list(row.strengths) == sorted(set(row.strengths)), row.name
        if row.fails_at is None:
            # no limit is claimed for all of the curve, so its far end is what is asserted
            assert row.holds_at >= row.strengths[-1], row.name
        else:
            assert row.strengths[0] <= row.holds_at < row.fails_at, row.name
            # within a factor of 1000 it is measured; farther apart it is a guess
            assert row.fails_at <= 1000.0 * max(row.holds_at, 1.0), row.name


# ------------------------------------------------------------------------------ alarms


def test_a_row_that_stops_failing_is_an_alarm():
    assert measure_row(ROW).verdict == AS_SAID
    mended = measure_row(replace(ROW, measure=lambda strength: 0.0))
    assert mended.verdict == AGREES and mended.alarm


@pytest.mark.parametrize("value", [5.0, float("nan"), float("inf")])
def test_a_row_that_fails_too_early_is_an_alarm(value):
    """What is no number is a failure on either side."""
    assert measure_row(replace(ROW, measure=lambda strength: value)).verdict == EARLY


@pytest.mark.parametrize(
    "strengths, fails_at, found",
    [
        ((0.1, 1.0, 3.0), None, EARLY),  # no limit is claimed, and 9 is over 4
        ((0.1, 1.0, 1.9), None, AS_SAID),
        ((-3.0, 1.0, 10.0), 10.0, EARLY),  # before the side that holds
        ((0.1, 3.0, 10.0), 3.0, AS_SAID),
    ],
)
def test_the_curve_is_judged_too(strengths, fails_at, found):
    """Both sides alone say as said of each: x^2 is 1 at 1, and 9 at 3."""
    row = replace(ROW, strengths=strengths, fails_at=fails_at)
    assert measure_row(row).verdict == found


def test_a_method_that_fails_here_and_there_is_an_alarm():
    """Beyond its boundary it is to fail everywhere: from here on is what the page says."""
    row = replace(ROW, measure=lambda x: 9.0 * (x == 10.0), strengths=(1.0, 10.0, 11.0))
    assert measure_row(row).verdict == AGREES


def test_what_cannot_be_measured_is_an_alarm_that_says_why():
    def broken(strength):
        raise ZeroDivisionError(f"at {strength}")

    row = measure_row(replace(ROW, measure=broken))
    assert row.verdict == BROKEN and row.alarm
    assert row.error == "ZeroDivisionError: at 10.0"


def test_the_boundary_is_found_by_halving():
    """x^2 leaves 4 at 2: five halvings of a decade leave a factor of 10^(1/32)."""
    row = measure_row(ROW)
    assert row.holds_to <= 2.0 < row.fails_from
    assert row.fails_from / row.holds_to == pytest.approx(10.0 ** (1 / 32))


def test_a_method_without_a_limit_has_one_side():
    row = measure_row(replace(ROW, fails_at=None, strengths=(0.1, 1.0)))
    assert (row.verdict, row.behind, row.holds_to, row.fails_from) == (
        AS_SAID,
        None,
        1,
        None,
    )
