"""Divergent pixels of integrators without a trace: is there an edge next to the pixel?"""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_ref.our_renderer.picture import OurPicture
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import DivergentPixel
from mitsuba_ref.replay.edge_causes import first_hit_causes, place_sentence


def aovs(kind: str) -> dict[str, np.ndarray]:
    """Return a picture of 6 x 4 pixels where `kind` changes between columns 2 and 3."""
    arrays = {
        name: np.zeros((4, 6, 1), np.float32) for name in ("shape_index", "prim_index")
    }
    arrays[kind][:, 3:] = 1.0
    return arrays


@pytest.mark.parametrize(
    ("kind", "noun"), [("shape_index", "another shape"), ("prim_index", "another triangle")]
)
def test_pixels_beside_an_edge(kind, noun):
    """Columns 2 and 3 touch it; 0 and 5 lie in the corners of the picture, away from it."""
    for x in (2, 3):
        assert noun in place_sentence(aovs(kind), x, 1)
    for x, y in ((0, 0), (1, 2), (4, 0), (5, 3)):
        assert "passes no edge" in place_sentence(aovs(kind), x, y)


def test_each_pixel_gets_a_sentence_that_says_why_there_is_no_trace():
    """Our renderer is called once, for AOVs and without a replay."""
    asked = []

    def ours(request: RenderRequest) -> OurPicture:
        asked.append(request)
        return OurPicture(arrays=aovs("shape_index"), spp=1)

    black = (0.0, 0.0, 0.0)
    pixels = [DivergentPixel(x, 1, black, black, 1.0) for x in (0, 3)]
    request = RenderRequest("scene.xml", spp=16, replay=True, camera=(1.0,) * 6)
    told = first_hit_causes(pixels, request, "whitted", ours)
    assert [(one.kind, one.replay, one.spp) for one in asked] == [("aovs", False, None)]
    assert all("No trace of whitted" in one.cause for one in told)
    assert "passes no edge" in told[0].cause and "next to an edge" in told[1].cause
