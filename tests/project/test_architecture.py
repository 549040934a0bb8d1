"""docs/architecture.svg is what the imports are, and shows every package."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from docs.draw_architecture import PICTURE, arrows, draw, imports, reachable, rows

ROOT = PICTURE.parent.parent


def test_the_picture_is_up_to_date():
    assert PICTURE.read_text(encoding="utf-8") == draw(), "run `make docs`"


def test_the_picture_names_every_package_and_file():
    """Read as a picture, not as text: what is drawn is drawn where it can be seen."""
    picture = ET.fromstring(draw())
    _, _, width, height = map(float, picture.attrib["viewBox"].split())
    named = set()
    for text in picture.iter("{http://www.w3.org/2000/svg}text"):
        assert 0 < float(text.attrib["x"]) < width
        assert 0 < float(text.attrib["y"]) < height
        named |= {name.strip() for name in text.text.split(",")}
    folders = {path.parent.name for path in (ROOT / "renderer").glob("*/__init__.py")}
    files = {path.stem for path in (ROOT / "renderer").glob("*.py")} - {"__init__"}
    assert named == folders | files | {"mitsuba_ref", "reports"}


def test_what_imports_stands_above():
    graph, packages = imports()
    reach = reachable(graph)
    layers = rows(reach, packages)
    row = {name: number for number, names in enumerate(layers) for name in names}
    for name, imported in graph.items():
        for other in imported & packages:
            if name in packages:
                assert row[name] < row[other]


def test_an_arrow_that_others_imply_is_left_out():
    reach = reachable({"a": {"b", "c"}, "b": {"file"}, "file": {"c"}, "c": set()})
    assert arrows(reach, {"a", "b", "c"}) == [("a", "b"), ("b", "c")]
