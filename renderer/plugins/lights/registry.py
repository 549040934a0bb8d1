"""Registers all kinds of emitter."""

from __future__ import annotations

from renderer.plugins.lights.area import AREA
from renderer.plugins.lights.constant import CONSTANT
from renderer.plugins.lights.directional import DIRECTIONAL
from renderer.plugins.lights.envmap import ENVMAP
from renderer.plugins.lights.kind import LightPlugin
from renderer.plugins.lights.point import POINT
from renderer.plugins.lights.projector import PROJECTOR
from renderer.plugins.lights.spot import SPOT
from renderer.plugins.lights.sunsky import SUNSKY

LIGHTS: dict[str, LightPlugin] = {
    kind.name: kind
    for kind in (POINT, SPOT, DIRECTIONAL, CONSTANT, ENVMAP, SUNSKY, PROJECTOR, AREA)
}


def plugin_of(emitter: object) -> LightPlugin:
    """Return the plugin of an emitter of the scene description."""
    return next(kind for kind in LIGHTS.values() if isinstance(emitter, kind.description))
