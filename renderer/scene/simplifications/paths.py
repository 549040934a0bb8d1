"""Fewer paths: less depth, no roulette, one way to find light, no caustics."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from renderer.errors import SceneError
from renderer.scene.light_properties import has_extended_lights
from renderer.scene.materials import kind_of, sides
from renderer.scene_file.description import Integrator, SceneDescription

Step = Callable[[SceneDescription], SceneDescription]


def on_integrator(change: Callable[[Integrator], Integrator]) -> Step:
    """Return the step that changes the integrator which makes the colours."""

    def within(integrator: Integrator) -> Integrator:
        if integrator.nested is None:
            return change(integrator)
        return dataclasses.replace(integrator, nested=within(integrator.nested))

    return lambda description: dataclasses.replace(
        description, integrator=within(description.integrator)
    )


def without_roulette(integrator: Integrator) -> Integrator:
    """Let paths go on to max_depth.

    Raises
    ------
    SceneError
        If paths have no max_depth: they might never end.
    """
    if integrator.name != "path":
        return integrator
    if integrator.max_depth < 0:
        raise SceneError(
            "simplification roulette=off: the scene's paths have no max_depth, and might "
            "never end; possible: roulette=off after depth=K"
        )
    if integrator.rr_depth >= integrator.max_depth:
        return integrator
    return dataclasses.replace(integrator, rr_depth=integrator.max_depth)


def to_depth(depth: int) -> Step:
    """Return the step that leaves out what comes after so many segments."""

    def limited(integrator: Integrator) -> Integrator:
        deep = integrator.max_depth < 0 or integrator.max_depth > depth
        if integrator.name not in ("path", "whitted", "direct") or not deep:
            return integrator
        return dataclasses.replace(integrator, max_depth=depth)

    return on_integrator(limited)


def by_lights(description: SceneDescription) -> SceneDescription:
    """Leave out BSDF samples where light samples find the same light."""
    smooth, _ = _lobes(description)

    def alone(integrator: Integrator) -> Integrator:
        weighed = integrator.name == "path" or (
            integrator.name == "direct"
            and min(integrator.emitter_samples, integrator.bsdf_samples) > 0
        )
        if not weighed or integrator.max_depth in (0, 1):
            return integrator
        return dataclasses.replace(integrator, strategy="lights")

    if not (smooth and has_extended_lights(description)):
        return description
    return on_integrator(alone)(description)


def by_bsdfs(description: SceneDescription) -> SceneDescription:
    """Leave out light samples, and with them the light of points and directions."""
    smooth, _ = _lobes(description)
    shining = has_extended_lights(description) or description.emitters

    def alone(integrator: Integrator) -> Integrator:
        if integrator.name not in ("path", "direct") or integrator.max_depth in (0, 1):
            return integrator
        samples = max(1, integrator.bsdf_samples)
        return dataclasses.replace(integrator, strategy="bsdfs", bsdf_samples=samples)

    return on_integrator(alone)(description) if smooth and shining else description


def without_caustics(description: SceneDescription) -> SceneDescription:
    """Leave out light that mirrors or glass throw on rough surfaces."""
    smooth, delta = _lobes(description)

    def dull(integrator: Integrator) -> Integrator:
        if integrator.name != "path" or 0 <= integrator.max_depth < 3:
            return integrator
        return dataclasses.replace(integrator, caustics=False)

    if not (smooth and delta and has_extended_lights(description)):
        return description
    return on_integrator(dull)(description)


def _lobes(description: SceneDescription) -> tuple[bool, bool]:
    """Return whether any BSDF has smooth lobes, and whether any has mirrors or glass."""
    shown = {id(shape.bsdf): shape.bsdf for shape in description.every_shape}
    both = [side for bsdf in shown.values() for side in sides(bsdf) if side is not None]
    kinds = [kind_of(side) for side in both]
    return any(kind.smooth for kind in kinds), any(kind.delta for kind in kinds)
