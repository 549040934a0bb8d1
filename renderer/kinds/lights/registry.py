"""All kinds of emitter: one line makes a kind known."""

from __future__ import annotations

from renderer.kinds.lights.areas.area import AREA
from renderer.kinds.lights.environments.constant import CONSTANT
from renderer.kinds.lights.environments.envmap import ENVMAP
from renderer.kinds.lights.kind import LightPlugin
from renderer.kinds.lights.points.directional import DIRECTIONAL
from renderer.kinds.lights.points.point import POINT
from renderer.kinds.lights.points.projector import PROJECTOR
from renderer.kinds.lights.points.spot import SPOT

LIGHTS: dict[str, LightPlugin] = {
    kind.name: kind
    for kind in (POINT, SPOT, DIRECTIONAL, CONSTANT, ENVMAP, PROJECTOR, AREA)
}


def plugin_of(emitter: object) -> LightPlugin:
    """Return the kind of an emitter of the description."""
    return next(kind for kind in LIGHTS.values() if isinstance(emitter, kind.description))
