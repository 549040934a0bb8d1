"""All kinds of emitter that stand alone: one line makes a kind known."""

from __future__ import annotations

from renderer.lights.constant import CONSTANT
from renderer.lights.directional import DIRECTIONAL
from renderer.lights.kind import LightPlugin
from renderer.lights.point import POINT
from renderer.lights.spot import SPOT

LIGHTS: dict[str, LightPlugin] = {
    kind.name: kind for kind in (POINT, SPOT, DIRECTIONAL, CONSTANT)
}


def plugin_of(emitter: object) -> LightPlugin:
    """Return the kind of an emitter of the description."""
    return next(kind for kind in LIGHTS.values() if isinstance(emitter, kind.description))
