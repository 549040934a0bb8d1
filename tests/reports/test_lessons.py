"""Figures of the lessons: each title over its picture, surfaces where they are."""

from __future__ import annotations

import numpy as np
import pytest

import renderer
from renderer.simple.scene import Scene
from reports.charts import lessons

SCENE = """<scene version="3.0.0">
  <sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/></film></sensor>
  <shape type="sphere">
    <point name="center" value="1, 2, 3"/> <float name="radius" value="0.5"/>
    <emitter type="area"/>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><scale value="2"/> <translate z="-1"/></transform>
  </shape>
</scene>"""


def test_each_title_stands_over_its_picture():
    """plotly numbers facets from the bottom row; six pictures make two rows."""
    greys = {f"grey {k}": np.full((3, 5), k / 10) for k in range(6)}
    chart = lessons.side_by_side(greys, columns=4)
    above = {(note.x, note.y): note.text for note in chart.layout.annotations}
    for trace in chart.data:
        number = trace.xaxis.removeprefix("x")
        left, right = chart.layout[f"xaxis{number}"].domain
        top = chart.layout[f"yaxis{number}"].domain[1]
        title = next(
            text
            for (x, y), text in above.items()
            if left < x < right and y == pytest.approx(top)
        )
        assert np.asarray(trace.z)[0, 0] == round(255 * greys[title][0, 0])


def test_surfaces_are_drawn_where_they_are():
    """Corners of triangles lie on the sphere and on the rectangle; the lamp is yellow."""
    scene = Scene(renderer.load_string(SCENE).description)
    sphere, rectangle = lessons.surfaces(scene)
    at = np.stack([sphere.x, sphere.y, sphere.z], axis=1)
    np.testing.assert_allclose(np.linalg.norm(at - (1, 2, 3), axis=1), 0.5)
    assert sphere.color == lessons.LAMP and rectangle.color != lessons.LAMP
    assert set(zip(rectangle.x, rectangle.y, rectangle.z, strict=True)) == {
        (x, y, -1) for x in (-2, 2) for y in (-2, 2)
    }
    assert len(rectangle.i) == 2


def test_a_box_has_twelve_edges():
    """Four along each axis, as long as the box."""
    drawn = lessons.boxes([[0, 0, 0]], [[1, 2, 3]])
    ends = np.stack([drawn.x, drawn.y, drawn.z], axis=1).reshape(-1, 3, 3)  # with gaps
    lengths = np.abs(ends[:, 1] - ends[:, 0])
    assert sorted(map(tuple, lengths)) == sorted([(1, 0, 0), (0, 2, 0), (0, 0, 3)] * 4)
