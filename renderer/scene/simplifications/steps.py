"""The table of simplifications: each a name, a value, a sentence and a step.

A step maps a description to another one. Parts without anything to leave out are returned
unchanged.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from renderer.scene.simplifications import materials, paths
from renderer.scene.simplifications.instances import with_copies
from renderer.scene.simplifications.lights import (
    lights_by_name,
    shape_names,
    without_light,
)
from renderer.scene.simplifications.paths import Step, on_integrator
from renderer.scene.simplifications.textures import mean_radiance, mean_texture
from renderer.scene_file.description import (
    Film,
    Mesh,
    ReconstructionFilter,
    SceneDescription,
    SdfGrid,
    SpotLight,
)

BOX = ReconstructionFilter("box", radius=0.5)


class Simplification(NamedTuple):
    """A simplification that a user can choose."""

    sentence: str
    step: Step


class OfEach(NamedTuple):
    """Steps of one kind, one for each named object of the scene."""

    sentence: str  # with {} for the name
    steps: Callable[[SceneDescription], Mapping[str, Step]]


def _on_shapes(change: Callable[[Any], Any]) -> Step:
    """Return the step that changes all shapes, those of groups too."""

    def step(description: SceneDescription) -> SceneDescription:
        def of(shapes: tuple[Any, ...]) -> tuple[Any, ...]:
            return tuple(map(change, shapes))

        groups = tuple(
            dataclasses.replace(group, shapes=of(group.shapes))
            for group in description.groups
        )
        return dataclasses.replace(
            description, shapes=of(description.shapes), groups=groups
        )

    return step


def _on_bsdfs(change: materials.Change, only: Any = None) -> Step:
    """Return the step that changes BSDFs: those of all shapes, or `only` one of them."""

    def step(description: SceneDescription) -> SceneDescription:
        changed = materials.everywhere(change)

        def of(shape: Any) -> Any:
            if only is not None and shape.bsdf is not only:
                return shape
            bsdf = changed(shape.bsdf)
            return shape if bsdf is shape.bsdf else dataclasses.replace(shape, bsdf=bsdf)

        return _on_shapes(of)(description)

    return step


def _each_bsdf(change: materials.Change, description: SceneDescription) -> dict[str, Step]:
    """Return the steps that change one BSDF each, by the first shape that shows it."""
    changed = materials.everywhere(change)
    steps: dict[str, Step] = {}
    met: set[int] = set()
    shapes = zip(shape_names(description), description.every_shape, strict=True)
    for name, shape in shapes:
        if id(shape.bsdf) in met:
            continue
        met.add(id(shape.bsdf))
        if changed(shape.bsdf) is not shape.bsdf:
            steps[name] = _on_bsdfs(change, only=shape.bsdf)
    return steps


def _each_light(description: SceneDescription) -> dict[str, Step]:
    return {
        name: partial(without_light, light=light)
        for name, light in lights_by_name(description).items()
    }


def _flat(description: SceneDescription) -> SceneDescription:
    def flat(shape: Any) -> Any:
        if isinstance(shape, Mesh) and shape.normals is not None:
            return dataclasses.replace(shape, normals=None)
        if isinstance(shape, SdfGrid) and shape.smooth:
            return dataclasses.replace(shape, smooth=False)
        return shape

    return _on_shapes(flat)(_on_bsdfs(materials.without_relief)(description))


def _mean_textures(description: SceneDescription) -> SceneDescription:
    def dull(shape: Any) -> Any:
        radiance = mean_radiance(shape.radiance)
        if radiance is shape.radiance:
            return shape
        return dataclasses.replace(shape, radiance=radiance)

    def even(light: Any) -> Any:
        if not isinstance(light, SpotLight) or light.texture is None:
            return light
        texture = mean_texture(light.texture)
        same = texture is light.texture
        return light if same else dataclasses.replace(light, texture=texture)

    described = _on_shapes(dull)(_on_bsdfs(materials.without_texture)(description))
    return dataclasses.replace(described, emitters=tuple(map(even, described.emitters)))


def _box_filter(description: SceneDescription) -> SceneDescription:
    film: Film = description.camera.film
    if film.rfilter.name == "box":
        return description
    film = dataclasses.replace(film, rfilter=BOX)
    camera = dataclasses.replace(description.camera, film=film)
    return dataclasses.replace(description, camera=camera)


SIMPLIFICATIONS = {
    "roulette=off": Simplification(
        "paths go on to max_depth, none is ended by chance",
        on_integrator(paths.without_roulette),
    ),
    "sampling=lights": Simplification(
        "lights are found by sampling them, by BSDF samples only where that cannot be",
        paths.by_lights,
    ),
    "sampling=bsdfs": Simplification(
        "lights are found by BSDF samples that hit them; points and directions are not",
        paths.by_bsdfs,
    ),
    "caustics=off": Simplification(
        "no light that mirrors or glass throw on rough surfaces", paths.without_caustics
    ),
    "instances=flat": Simplification(
        "copies are shapes of their own, without a tree above those of the groups",
        with_copies,
    ),
    "textures=mean": Simplification(
        "one colour, the mean, for each image and pattern", _mean_textures
    ),
    "normals=flat": Simplification(
        "no interpolated normals, normal maps or bump maps", _flat
    ),
    "glass=straight": Simplification(
        "light goes straight through glass, nothing is reflected",
        _on_bsdfs(materials.glass_as_nothing),
    ),
    "specular=off": Simplification(
        "plastic and principled surfaces are their diffuse base alone",
        _on_bsdfs(materials.without_specular),
    ),
    "diffuse=off": Simplification(
        "plastic is its coat alone, principled without metal and tint its facets",
        _on_bsdfs(materials.without_diffuse),
    ),
    "metal=diffuse": Simplification(
        "metals scatter what they reflect at normal incidence",
        _on_bsdfs(materials.metal_as_diffuse),
    ),
    "filter=box": Simplification("every pixel is the mean of itself", _box_filter),
}
OF_EACH = {
    "no-light": OfEach("{} does not shine", _each_light),
    "no-specular": OfEach(
        "the BSDF of {} is its diffuse base alone",
        partial(_each_bsdf, materials.without_specular),
    ),
    "no-diffuse": OfEach(
        "the BSDF of {} is without its diffuse base",
        partial(_each_bsdf, materials.without_diffuse),
    ),
}
