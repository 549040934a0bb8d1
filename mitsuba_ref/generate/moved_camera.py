"""How much of a replay rounding decides, where no path is traced.

Both pictures are rendered again with a camera that is turned a little, the random numbers
being the same. A pixel in which a path goes another way then, or in which both go the same
way, is one that rounding decides. A wrong formula stays wrong.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from math import cos, degrees, pi, sin
from xml.etree.ElementTree import Element

from mitsuba_ref.generate.drawing import numbers_text

TURN = 2e-5
"""Angle: rounding of a direction that a rough surface chooses (`CHOSEN` of a traced path),
a tenth of it on the way to a hit."""

AXES = 6


def with_camera_turned(root: Element) -> Iterator[Element]:
    """Yield copies of a scene whose camera is turned about axes across its view."""
    for angle in (2.0 * pi * k / AXES for k in range(AXES)):
        moved = copy.deepcopy(root)
        transform = moved.find("sensor/transform[@name='to_world']")
        assert transform is not None
        axis = numbers_text((cos(angle), sin(angle), 0.0))
        first = Element("rotate", value=axis, angle=f"{degrees(TURN):.9g}")
        transform.insert(0, first)
        yield moved
