"""The scene of the simple path tracer: a list of surfaces, a list of lights."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene.light_order import light_order
from renderer.scene_file.description import (
    Bsdf,
    Conductor,
    ConstantLight,
    Dielectric,
    Diffuse,
    SceneDescription,
    TwoSided,
)
from renderer.simple.light_choice import LightChoice
from renderer.simple.lights import EMITTERS, Light
from renderer.simple.surfaces.surfaces import Hit, Surface
from renderer.simple.surfaces.unit_shapes import UNIT_SHAPES
from renderer.simple.vectors import Vector

# A ray does not meet the surface that it leaves: t > epsilon, which is far above the
# rounding of double precision in scenes of up to 100,000 units. A shadow ray ends by this
# fraction before its light.
EPSILON = 1e-9


class Scene:
    """What the description says, as the path tracer asks for it.

    Raises
    ------
    SceneError
        For what this renderer leaves to the kernels.
    """

    def __init__(self, description: SceneDescription) -> None:
        integrator = description.integrator
        _check(description)
        self.max_depth, self.rr_depth = integrator.max_depth, integrator.rr_depth
        self.surfaces = [Surface(shape) for shape in description.shapes]
        order = light_order(description)
        numbered: dict[int, Light] = dict(
            zip(order.of_emitters, description.emitters, strict=True)
        )
        numbered |= dict(zip(order.of_shapes, self.surfaces, strict=True))
        skies = [e for e in description.emitters if isinstance(e, ConstantLight)]
        self.environment = skies[0] if skies else None
        # Those that are sampled. The sky shines alike from everywhere: directions that the
        # BSDF chooses find it best.
        lights = [numbered[i] for i in sorted(numbered) if i >= 0]
        self.lights = [light for light in lights if light is not self.environment]
        self.choice = LightChoice(self.lights)


def _check(description: SceneDescription) -> None:
    integrator, rfilter = description.integrator, description.camera.film.rfilter
    covered = {
        f"integrator {integrator.name!r}; possible is 'path'": integrator.name == "path",
        "hide_emitters; possible is false": not integrator.hide_emitters,
        f"rfilter {rfilter.name!r}; possible is 'box'": rfilter.name == "box",
        "instances; possible are shapes alone": not description.instances,
    }
    for shape in description.shapes:
        covered[f"shape {type(shape).__name__.lower()!r}"] = type(shape) in UNIT_SHAPES
    for bsdf in (side for shape in description.shapes for side in _sides(shape.bsdf)):
        covered[f"bsdf {getattr(bsdf, 'plugin', '')!r}"] = isinstance(
            bsdf, Diffuse | Conductor | Dielectric
        )
    covered["textures on lights; possible is one colour"] = not any(
        shape.radiance is not None and not isinstance(shape.radiance, tuple)
        for shape in description.shapes
    ) and all(getattr(e, "texture", None) is None for e in description.emitters)
    for emitter in description.emitters:
        possible = isinstance(emitter, EMITTERS)
        covered[f"emitter {getattr(emitter, 'plugin', '')!r}"] = possible
    for what, possible in covered.items():
        if not possible:
            raise SceneError(f"{description.source}: the simple path tracer has no {what}")


def _sides(bsdf: Bsdf) -> tuple[Bsdf, ...]:
    return (bsdf.front, bsdf.back) if isinstance(bsdf, TwoSided) else (bsdf,)


def closest_hit(scene: Scene, p: Vector, d: Vector, near: float, far: float) -> Hit | None:
    """Return the hit of smallest t > epsilon, by asking every surface (brute force)."""
    closest = None
    for surface in scene.surfaces:
        hit = surface.hit(p, d, near + EPSILON, far if closest is None else closest.t)
        closest = hit or closest
    return closest


def visible(scene: Scene, p: Vector, d: Vector, distance: float) -> bool:
    """Return V: whether nothing is met on the way of a shadow ray."""
    far = distance * (1.0 - EPSILON)
    return all(surface.hit(p, d, EPSILON, far) is None for surface in scene.surfaces)
