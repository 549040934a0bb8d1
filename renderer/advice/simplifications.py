"""Simplifications of a scene: functions from a description to a simpler one."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from renderer.advice import simpler_materials as materials
from renderer.advice import simplifications as paths
from renderer.advice.simpler_materials import mean_radiance, mean_texture
from renderer.advice.simpler_shapes import (
    lights_by_name,
    shape_names,
    with_copies,
    without_light,
)
from renderer.errors import SceneError, did_you_mean
from renderer.scene.light_properties import has_extended_lights
from renderer.scene.materials import kind_of, sides
from renderer.scene_file.description import (
    Film,
    Integrator,
    Mesh,
    ReconstructionFilter,
    SceneDescription,
    SdfGrid,
    SpotLight,
)

# -------------------------------------------------------------------------------- paths
# Fewer paths: less depth, no roulette, one sampling strategy, no caustics.

Step = Callable[[SceneDescription], SceneDescription]


def on_integrator(change: Callable[[Integrator], Integrator]) -> Step:
    """Return a step that changes the integrator of the colours."""

    def within(integrator: Integrator) -> Integrator:
        if integrator.nested is None:
            return change(integrator)
        return dataclasses.replace(integrator, nested=within(integrator.nested))

    return lambda description: dataclasses.replace(
        description, integrator=within(description.integrator)
    )


def without_roulette(integrator: Integrator) -> Integrator:
    """Continue paths to max_depth, without Russian roulette.

    Raises
    ------
    SceneError
        If there is no max_depth: paths might never end.
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
    """Return a step that limits the number of path segments."""

    def limited(integrator: Integrator) -> Integrator:
        deep = integrator.max_depth < 0 or integrator.max_depth > depth
        if integrator.name not in ("path", "whitted", "direct") or not deep:
            return integrator
        return dataclasses.replace(integrator, max_depth=depth)

    return on_integrator(limited)


def by_lights(description: SceneDescription) -> SceneDescription:
    """Remove BSDF samples where light samples find the same light."""
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
    """Remove light samples, and so the light of point and directional lights."""
    smooth, _ = _lobes(description)
    shining = has_extended_lights(description) or description.emitters

    def alone(integrator: Integrator) -> Integrator:
        if integrator.name not in ("path", "direct") or integrator.max_depth in (0, 1):
            return integrator
        samples = max(1, integrator.bsdf_samples)
        return dataclasses.replace(integrator, strategy="bsdfs", bsdf_samples=samples)

    return on_integrator(alone)(description) if smooth and shining else description


def without_caustics(description: SceneDescription) -> SceneDescription:
    """Remove caustics: light on rough surfaces by way of delta lobes."""
    smooth, delta = _lobes(description)

    def dull(integrator: Integrator) -> Integrator:
        if integrator.name != "path" or 0 <= integrator.max_depth < 3:
            return integrator
        return dataclasses.replace(integrator, caustics=False)

    if not (smooth and delta and has_extended_lights(description)):
        return description
    return on_integrator(dull)(description)


def _lobes(description: SceneDescription) -> tuple[bool, bool]:
    """Return whether any BSDF has smooth lobes, and whether any has delta lobes."""
    shown = {id(shape.bsdf): shape.bsdf for shape in description.every_shape}
    both = [side for bsdf in shown.values() for side in sides(bsdf) if side is not None]
    kinds = [kind_of(side) for side in both]
    return any(kind.smooth for kind in kinds), any(kind.delta for kind in kinds)


# -------------------------------------------------------------------------------- steps
# The table of simplifications, each with a name, a value, a sentence and a step.
#
# A step maps a description to another one, and returns parts unchanged that it does not
# apply to.

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
    """Return a step that changes all shapes, including those of groups."""

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
    """Return a step that changes the BSDFs of all shapes, or `only` one of them."""

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
    """Return steps that change one BSDF each, named by its first shape."""
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


# ----------------------------------------------------------------------------- simplify
# `simplified`: applies a simplification by name.
#
# `--simplify NAME=VALUE` uses the same names. `python -m reports needs` measures the error
# and the speed of each.

MOST_DEPTH = 2**31 - 1


def words_of(description: SceneDescription) -> list[str]:
    """Return every `NAME=VALUE` except for `depth=K`, whose values are unlimited."""
    named = {name: one.steps(description) for name, one in OF_EACH.items()}
    of_each = [f"{name}={thing}" for name, steps in named.items() for thing in steps]
    return [*SIMPLIFICATIONS, *of_each]


def is_endless(description: SceneDescription) -> bool:
    """Return whether only roulette ends the paths, so that it cannot be left out."""
    requested = description.integrator
    while requested.nested is not None:
        requested = requested.nested
    return requested.name == "path" and requested.max_depth < 0


def offered(description: SceneDescription) -> tuple[list[str], list[str]]:
    """Return the words (`depth=K` apart) that change the scene, and those that do not.

    Left out are the parts of a single BSDF if no other BSDF has them, and words that would
    be refused: endless paths without roulette, more copies than fit into memory.
    """
    words = words_of(description)
    for name in ("no-specular", "no-diffuse"):
        if len(alone := [word for word in words if word.startswith(name + "=")]) == 1:
            words.remove(alone[0])
    changing: list[str] = []
    absent: list[str] = []
    for word in words:
        try:
            new = simplified(description, word)
        except SceneError:
            continue
        (changing if differs(description, new) else absent).append(word)
    return changing, absent


def simplified(description: SceneDescription, word: str) -> SceneDescription:
    """Return a description with one simplification; `simplified` of it says what that was.

    A scene without the feature stays the same, and its `simplified` says so.

    Raises
    ------
    SceneError
        For a name or a value that does not exist in this scene.
    """
    sentence, step = _found(description, word)
    new = step(description)
    if not differs(description, new):
        sentence += "; the scene has none, nothing changes"
    told = (*description.simplified, f"{word}: {sentence}")
    return dataclasses.replace(new, simplified=told)


def differs(one: SceneDescription, other: SceneDescription) -> bool:
    """Return whether a simplification changed anything except for `simplified`."""
    return not (
        len(one.every_shape) == len(other.every_shape)
        and all(a is b for a, b in zip(one.every_shape, other.every_shape, strict=True))
        and len(one.instances) == len(other.instances)
        and len(one.emitters) == len(other.emitters)
        and all(a is b for a, b in zip(one.emitters, other.emitters, strict=True))
        and one.camera is other.camera
        and one.integrator == other.integrator
    )


def _found(description: SceneDescription, word: str) -> tuple[str, Step]:
    """Return the sentence and the step that a word names."""
    if word in SIMPLIFICATIONS:
        return SIMPLIFICATIONS[word]
    name, equals, value = word.partition("=")
    if not equals:
        raise _unknown(description, word)
    if name == "depth":
        if not (value.isascii() and value.isdigit() and 1 <= int(value) <= MOST_DEPTH):
            raise _refused(description, name, value, [f"1 to {MOST_DEPTH}"])
        return f"paths of at most {value} segments", to_depth(int(value))
    if name in OF_EACH:
        steps = OF_EACH[name].steps(description)
        if value not in steps:
            raise _refused(description, name, value, list(steps) or ["none"])
        return OF_EACH[name].sentence.format(value), steps[value]
    possible = [
        known.removeprefix(f"{name}=")
        for known in SIMPLIFICATIONS
        if known.startswith(f"{name}=")
    ]
    if possible:
        raise _refused(description, name, value, possible)
    raise _unknown(description, word)


def _unknown(description: SceneDescription, word: str) -> SceneError:
    known = ["depth=K", *words_of(description)]
    return SceneError(
        f"{description.source}: simplification {word!r} is unknown; there are: "
        f"{', '.join(known)}{did_you_mean(word, known)}"
    )


def _refused(
    description: SceneDescription, name: str, value: str, possible: list[str]
) -> SceneError:
    return SceneError(
        f"{description.source}: simplification {name}: {value!r} is not possible; "
        f"possible: {', '.join(possible)}"
    )
