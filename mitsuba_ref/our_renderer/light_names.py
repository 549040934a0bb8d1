"""Names of a scene's lights in a trace, the same for both renderers."""

from __future__ import annotations

from renderer.plugins.lights.registry import plugin_of
from renderer.rendering.job import RenderJob
from renderer.scene.light_order import light_order


def light_names(job: RenderJob) -> list[str]:
    """Name lights by id, as `SampledLight.light` says; "far" ones are at infinity."""
    description, shapes = job.scene.description, job.kernel_scene.shapes
    order = light_order(description)
    names = {
        light: f"shape {shapes.number[shape]}"
        for shape, light in enumerate(order.of_shapes)
        if light >= 0
    }
    numbered = zip(order.of_emitters, description.emitters, strict=True)
    for number, (light, emitter) in enumerate(numbered, start=1):
        far = plugin_of(emitter).at_infinity
        names[light] = f"{'far ' if far else ''}emitter {number}"
    return [names[light] for light in sorted(names)]
