"""How much of a replay rounding decides, where no path is traced.

Both pictures are rendered again, the random numbers being the same: with a camera that is
turned a little, and with all numbers of the scene changed a little. A pixel in which a path
goes another way then, or in which both go the same way, is one that rounding decides. A
wrong formula stays wrong.
"""

from __future__ import annotations

import copy
import random
import re
from collections.abc import Iterator
from math import cos, degrees, pi, sin
from xml.etree.ElementTree import Element

from mitsuba_ref.generate.drawing import numbers_text

TURN = 2e-5
"""Angle: rounding of a direction that a rough surface chooses (`CHOSEN` of a traced path),
a tenth of it on the way to a hit."""

CHANGE = 1e-5
"""Of a number, relative: rounding of what smooth BSDFs and media make of their parameters,
which turns of the camera do not touch."""

AXES = 12
"""Turns of the camera, and as many changes of all numbers."""

_NUMBER = re.compile(r"-?\d+\.\d+(e-?\d+)?")
_HELD = ("float", "point", "vector", "rgb", "scale", "translate", "rotate")


def changed_scenes(root: Element) -> Iterator[Element]:
    """Yield copies of a scene, each changed by about a rounding."""
    for k in range(AXES):
        yield _with_camera_turned(root, 2.0 * pi * k / AXES)
        yield _with_numbers_changed(root, random.Random(k))


def _with_camera_turned(root: Element, angle: float) -> Element:
    """Return a copy whose camera is turned about an axis across its view."""
    moved = copy.deepcopy(root)
    transform = moved.find("sensor/transform[@name='to_world']")
    assert transform is not None
    axis = numbers_text((cos(angle), sin(angle), 0.0))
    transform.insert(0, Element("rotate", value=axis, angle=f"{degrees(TURN):.9g}"))
    return moved


def _with_numbers_changed(root: Element, rng: random.Random) -> Element:
    """Return a copy in which each number with decimals is changed."""

    def other(found: re.Match[str]) -> str:
        return f"{float(found.group()) * (1.0 + rng.choice((-CHANGE, CHANGE))):.9g}"

    moved = copy.deepcopy(root)
    for element in moved.iter():
        if element.tag in _HELD:
            for name in set(element.keys()) & {"value", "x", "y", "z", "angle"}:
                element.set(name, _NUMBER.sub(other, element.get(name, "")))
    return moved
