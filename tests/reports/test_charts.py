"""Charts: each value is handed to the library as it was measured, on the axis it needs.

Where a value lies on the screen, and what the mouse finds there, is checked in a browser
(`test_report_browser`).
"""

from __future__ import annotations

import math

import pytest
from drawn_charts import curves, figure, figures, guides, points
from hypothesis import given
from hypothesis import strategies as st

from reports.charts.columns import Bin, histogram_chart
from reports.charts.curves import log_log_chart
from reports.charts.figure import COLOURS, Point, Series
from reports.charts.rows import dots_chart

positive = st.floats(1e-8, 1e8, allow_nan=False)


def drawn(*series: Series) -> dict:
    return figure(
        log_log_chart(series, x_label="seconds", y_label="RMSE", description="A chart")
    )


@given(st.lists(st.tuples(positive, positive), min_size=1, max_size=6))
def test_points_are_where_they_were_measured(values: list[tuple[float, float]]) -> None:
    chart = drawn(Series("ours", tuple(Point(x, y) for x, y in values)))
    (curve,) = curves(chart)
    assert points(curve) == values
    assert chart["layout"]["xaxis"]["type"] == chart["layout"]["yaxis"]["type"] == "log"


def test_independent_samples_run_parallel_to_the_guide() -> None:
    """Points with error = c / sqrt(time) have the slope of the guide, and lie on it."""
    own = tuple(Point(spp / 100, 0.3 / math.sqrt(spp)) for spp in (4, 16, 64, 256))
    (guide,) = guides(drawn(Series("ours", own)))
    for x, y in points(guide):
        assert y == pytest.approx(0.03 / math.sqrt(x))
    assert guide["x"] == [own[0].x, own[-1].x]


def test_labels_and_tooltips_stay_with_their_points() -> None:
    chart = drawn(
        Series("ours", (Point(1, 2, "4 spp", "first"), Point(2, 1, "8"))),
        Series("empty", ()),
        Series("theirs", (Point(3, 3, tooltip="second"),)),
    )
    ours, theirs = curves(chart)
    assert ours["text"] == ["4 spp", "8"]
    assert ours["hovertext"] == ["first", "ours"]
    assert theirs["hovertext"] == ["second"]
    assert ours["textposition"] != theirs["textposition"]  # labels do not meet


def test_series_differ_by_more_than_colour() -> None:
    """Six series: each pair differs in colour, in marker and in dash."""
    chart = drawn(*(Series(str(n), (Point(1, n + 1),)) for n in range(6)))
    looks = [
        (one["line"]["color"], one["marker"]["symbol"], one["line"]["dash"])
        for one in curves(chart)
    ]
    assert [len(set(kind)) for kind in zip(*looks, strict=True)] == [6, 6, 6]


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2 of a colour such as #0a8a7b."""
    parts = [int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in parts
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("background", ["#ffffff", "#1d2024"])
def test_colours_are_seen_on_light_and_dark_pages(background: str) -> None:
    """WCAG 2.1, 1.4.11: graphics have a contrast of at least 3 with what they touch."""
    for colour in COLOURS:
        one, other = sorted((luminance(colour), luminance(background)))
        assert (other + 0.05) / (one + 0.05) >= 3.0, colour


def test_tooltip_label_and_names_are_escaped() -> None:
    """Names come from a file: neither HTML nor plotly, which knows some, may read them."""
    bad = '"><script>&<b>'
    chart = log_log_chart(
        [Series(bad, (Point(1, 1, label=bad, tooltip=bad),))],
        x_label=bad,
        y_label=bad,
        description=bad,
    )
    assert "<script" not in chart
    (found,) = figures(chart)
    (curve,) = curves(found)
    shown = '"&gt;&lt;script&gt;&amp;&lt;b&gt;'
    assert curve["name"] == curve["text"][0] == curve["hovertext"][0] == shown
    assert found["layout"]["xaxis"]["title"]["text"] == shown


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_values_without_a_logarithm_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match="no place on logarithmic axes"):
        drawn(Series("ours", (Point(1.0, value),)))
    with pytest.raises(ValueError, match="above 0"):
        dots_chart([("tree", {"a": value})], ["a"], x_label="x", description="d")


def test_no_points_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one point"):
        drawn(Series("ours", ()))


def test_dots_have_a_row_for_each_name_in_their_order() -> None:
    """An absent value gives no dot; the first row is on top."""
    rows = [("tree", {"a": 1.0, "b": 10.0, "c": 100.0}), ("grid", {"a": 2.0})]
    chart = figure(dots_chart(rows, ["a", "b", "c"], x_label="x", description="d"))
    assert [points(one) for one in chart["data"]] == [
        [(1.0, "tree"), (2.0, "grid")],
        [(10.0, "tree")],
        [(100.0, "tree")],
    ]
    names = chart["layout"]["yaxis"]
    assert names["categoryarray"] == ["tree", "grid"]
    assert names["range"][0] > names["range"][1]
    assert chart["layout"]["xaxis"]["type"] == "log"


def test_bars_and_the_expected_line_share_an_axis() -> None:
    """10, 20 and 40 counted, 25 expected everywhere, up to both ends."""
    bins = [Bin(k, k + 1.0, count, 25.0) for k, count in enumerate((10, 20, 40))]
    chart = figure(histogram_chart(bins, x_ticks=(0.0, 3.0), x_label="x", description="d"))
    counted, expected = chart["data"]
    assert points(counted) == [(0.5, 10), (1.5, 20), (2.5, 40)]
    assert max(counted["width"]) < 1.0
    assert counted["hovertext"][2] == "2 to 3: 40, expected 25.0"
    assert expected["x"] == [0.0, 0.5, 1.5, 2.5, 3.0]
    assert set(expected["y"]) == {25.0}
    assert chart["layout"]["yaxis"]["rangemode"] == "tozero"
