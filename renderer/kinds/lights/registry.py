"""All kinds of emitter: one line makes a kind known."""

from __future__ import annotations

import renderer.kinds.lights.finite.spheres  # noqa: F401  (how spheres are sampled)
from renderer.kinds.lights.finite.area import AREA
from renderer.kinds.lights.finite.point import POINT
from renderer.kinds.lights.finite.projector import PROJECTOR
from renderer.kinds.lights.finite.spot import SPOT
from renderer.kinds.lights.infinite.constant import CONSTANT
from renderer.kinds.lights.infinite.directional import DIRECTIONAL
from renderer.kinds.lights.infinite.envmap import ENVMAP
from renderer.kinds.lights.kind import LightPlugin

LIGHTS: dict[str, LightPlugin] = {
    kind.name: kind
    for kind in (POINT, SPOT, DIRECTIONAL, CONSTANT, ENVMAP, PROJECTOR, AREA)
}


def plugin_of(emitter: object) -> LightPlugin:
    """Return the kind of an emitter of the description."""
    return next(kind for kind in LIGHTS.values() if isinstance(emitter, kind.description))
