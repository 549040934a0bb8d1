"""How much of a replay rounding decides, where no path is traced.

The picture is rendered again with a camera that is turned a little, the random numbers
being the same. A pixel that another side of an edge shows then, or in which a path goes
another way after some bounces, is one that rounding decides. A wrong formula makes a pixel
differ from Mitsuba's, and not from itself.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from math import cos, degrees, pi, sin
from xml.etree.ElementTree import Element

from mitsuba_ref.generate.drawing import numbers_text

TURNS = (2e-6, 2e-5)
"""Angles: of rounding on the way to a hit, and in a direction that a rough surface chooses
(`CHOSEN` of a traced path)."""

AXES = 6


def with_camera_turned(root: Element) -> Iterator[Element]:
    """Yield copies of a scene whose camera is turned about axes across its view."""
    for turn in TURNS:
        for k in range(AXES):
            moved = copy.deepcopy(root)
            transform = moved.find("sensor/transform[@name='to_world']")
            assert transform is not None
            around = numbers_text((cos(2.0 * pi * k / AXES), sin(2.0 * pi * k / AXES), 0.0))
            first = Element("rotate", value=around, angle=f"{degrees(turn):.9g}")
            transform.insert(0, first)
            yield moved
