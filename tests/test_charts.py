"""Charts: a mark is where its value belongs, measured on the SVG that is drawn."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reports.axes import LinearAxis, LogAxis, tick_text
from reports.charts import log_log_chart
from reports.svg import Point, Series
from reports.timings_chart import timings_chart

positive = st.floats(1e-8, 1e8, allow_nan=False)


def drawn(*series: Series) -> ET.Element:
    chart = log_log_chart(series, x_label="seconds", y_label="RMSE", description="A chart")
    return ET.fromstring(str(chart))


def markers(chart: ET.Element) -> list[tuple[float, float]]:
    """Places of all points; the ones of the legend carry no tooltip."""
    places = []
    for path in chart.iter("path"):
        if path.find("title") is not None:
            numbers = re.findall(r"-?[\d.]+", path.attrib["transform"])
            places.append((float(numbers[0]), float(numbers[1])))
    return places


def tick_places(chart: ET.Element, axis: str) -> dict[str, float]:
    """Label -> place of the labelled grid lines of one axis."""
    lines = [line.attrib for line in chart.iter("line") if line.attrib["class"] == "grid"]
    if axis == "x":
        places = [float(line["x1"]) for line in lines if line["x1"] == line["x2"]]
    else:
        places = [float(line["y1"]) for line in lines if line["y1"] == line["y2"]]
    texts = [text for text in chart.iter("text") if text.attrib["class"] == "tick"]
    anchor = "middle" if axis == "x" else "end"
    labels = [str(text.text) for text in texts if text.attrib["text-anchor"] == anchor]
    return dict(zip(labels, places, strict=True))


def test_point_lies_on_the_grid_lines_of_its_values() -> None:
    """(0.1, 0.01) and (10, 1) are on labelled grid lines, up to the printed digits."""
    chart = drawn(Series("ours", (Point(0.1, 0.01), Point(10.0, 1.0))))
    x, y = tick_places(chart, "x"), tick_places(chart, "y")
    expected = [(x["0.1"], y["0.01"]), (x["10"], y["1"])]
    for place, wanted in zip(markers(chart), expected, strict=True):
        assert place == pytest.approx(wanted, abs=0.02)


def test_larger_is_right_and_up() -> None:
    small, large = markers(drawn(Series("ours", (Point(1, 1), Point(100, 100)))))
    assert large[0] > small[0]
    assert large[1] < small[1]  # SVG counts y downwards


def test_decades_are_equally_wide() -> None:
    chart = drawn(Series("ours", (Point(0.01, 1.0), Point(100.0, 1e-4))))
    places = tick_places(chart, "x")
    decades = [places[label] for label in ("0.01", "0.1", "1", "10", "100")]
    gaps = [after - before for before, after in pairwise(decades)]
    assert gaps == pytest.approx([gaps[0]] * 4, abs=0.02)


def test_independent_samples_run_parallel_to_the_guide() -> None:
    """Points with error = c / sqrt(time) have the slope of the guide, in pixels."""
    points = tuple(Point(spp / 100, 0.3 / math.sqrt(spp)) for spp in (4, 16, 64, 256))
    chart = drawn(Series("ours", points), Series("theirs", (Point(3.0, 0.2),)))
    places = markers(chart)[:4]
    guide = next(
        line.attrib for line in chart.iter("line") if line.attrib["class"] == "guide"
    )
    rise = float(guide["y2"]) - float(guide["y1"])
    run = float(guide["x2"]) - float(guide["x1"])
    curve = (places[3][1] - places[0][1]) / (places[3][0] - places[0][0])
    assert curve == pytest.approx(rise / run, rel=1e-3)


@given(st.lists(st.tuples(positive, positive), min_size=1, max_size=6))
def test_everything_stays_inside_the_frame(values: list[tuple[float, float]]) -> None:
    chart = drawn(Series("ours", tuple(Point(x, y, label="1") for x, y in values)))
    width, height = map(float, chart.attrib["viewBox"].split()[2:])
    places = markers(chart)
    assert len(places) == len(values)
    for line in chart.iter("line"):
        ends = line.attrib
        places += [(float(ends[f"x{end}"]), float(ends[f"y{end}"])) for end in "12"]
    assert all(0 <= x <= width and 0 <= y <= height for x, y in places)


@given(positive, st.floats(1.0, 1e6))
def test_log_axis_has_a_readable_number_of_ticks(low: float, ratio: float) -> None:
    """Two labels at least tell the scale; more than a dozen would overlap."""
    axis = LogAxis.around([low, low * ratio], 0.0, 400.0)
    ticks = axis.ticks()
    assert 2 <= len(ticks) <= 12
    assert all(0.0 <= axis.position(tick) <= 400.0 for tick in ticks)
    assert not set(ticks) & set(axis.minor_ticks())


@given(st.floats(1e-4, 1e5))
def test_linear_axis_has_a_readable_number_of_ticks(high: float) -> None:
    ticks = LinearAxis(high, 0.0, 400.0).ticks()
    assert ticks[0] == 0.0
    assert 4 <= len(ticks) <= 9


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.02, "0.02"),
        (10.0, "10"),
        (3e-5, "3·10⁻⁵"),
        (1e-7, "10⁻⁷"),
        (1e6, "10⁶"),
        (0, "0"),
    ],
)
def test_tick_texts(value: float, text: str) -> None:
    assert tick_text(value) == text


def test_tooltip_label_and_names_are_escaped() -> None:
    """Names come from a file: `<` and quotes must not end an element or an attribute."""
    bad = '"><script>&'
    chart = log_log_chart(
        [Series(bad, (Point(1, 1, label=bad, tooltip=bad),))],
        x_label=bad,
        y_label=bad,
        description=bad,
    )
    assert "<script" not in chart
    parsed = ET.fromstring(str(chart))
    assert parsed.attrib["aria-label"] == bad
    assert [title.text for title in parsed.iter("title")] == [bad]


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_values_without_a_logarithm_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match="no place on logarithmic axes"):
        drawn(Series("ours", (Point(1.0, value),)))


def test_no_points_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one point"):
        drawn(Series("ours", ()))


def test_long_legends_wrap_instead_of_leaving_the_picture() -> None:
    chart = drawn(*(Series("n" * 40, (Point(1, 1),)) for _ in range(3)))
    rows = {
        text.attrib["y"] for text in chart.iter("text") if text.get("class") == "legend"
    }
    assert len(rows) == 3


def test_timings_lie_on_a_linear_axis_with_the_median_marked() -> None:
    """Times 1, 2 and 9 of one renderer: from zero, in proportion, median bar at 2."""
    chart = ET.fromstring(
        str(
            timings_chart(
                [
                    Series(
                        "ours", tuple(Point(t, 0, tooltip=str(t)) for t in (9.0, 1.0, 2.0))
                    )
                ],
                x_label="seconds",
                description="Times",
            )
        )
    )
    (nine, _), (one, _), (two, _) = markers(chart)
    assert (nine - one) / (two - one) == pytest.approx(8.0, rel=1e-3)
    zero = tick_places(chart, "x")["0"]
    assert (nine - zero) / (one - zero) == pytest.approx(9.0, rel=1e-3)
    median = next(line for line in chart.iter("line") if line.attrib["class"] == "median")
    assert float(median.attrib["x1"]) == pytest.approx(two, abs=0.02)
