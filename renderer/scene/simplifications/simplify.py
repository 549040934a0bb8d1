"""`simplified`: a scene with less in it, each step with a name and a sentence.

`--simplify NAME=VALUE` names the same steps; `python -m reports.needs` measures what each
of them loses and saves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

from renderer.errors import SceneError
from renderer.scene.simplifications import materials
from renderer.scene.simplifications.lights import lights_by_name, without_light
from renderer.scene.simplifications.textures import mean_radiance, mean_texture
from renderer.scene_file.description import (
    Film,
    Integrator,
    Mesh,
    ReconstructionFilter,
    SceneDescription,
    SdfGrid,
    SpotLight,
)

BOX = ReconstructionFilter("box", radius=0.5)
MOST_DEPTH = 2**31 - 1

Step = Callable[[SceneDescription], SceneDescription]


class Simplification(NamedTuple):
    """A step that can be asked for."""

    value: str  # the only one there is
    sentence: str
    step: Step


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


def _on_bsdfs(change: materials.Change) -> Step:
    def step(description: SceneDescription) -> SceneDescription:
        changed = materials.everywhere(change)

        def of(shape: Any) -> Any:
            bsdf = changed(shape.bsdf)
            return shape if bsdf is shape.bsdf else dataclasses.replace(shape, bsdf=bsdf)

        return _on_shapes(of)(description)

    return step


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


def _on_integrator(change: Callable[[Integrator], Integrator]) -> Step:
    """Return the step that changes the integrator which makes the colours."""

    def within(integrator: Integrator) -> Integrator:
        if integrator.nested is None:
            return change(integrator)
        return dataclasses.replace(integrator, nested=within(integrator.nested))

    return lambda description: dataclasses.replace(
        description, integrator=within(description.integrator)
    )


def _without_roulette(integrator: Integrator) -> Integrator:
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


def _to_depth(depth: int) -> Step:
    def limited(integrator: Integrator) -> Integrator:
        deep = integrator.max_depth < 0 or integrator.max_depth > depth
        if integrator.name not in ("path", "whitted", "direct") or not deep:
            return integrator
        return dataclasses.replace(integrator, max_depth=depth)

    return _on_integrator(limited)


SIMPLIFICATIONS = {
    "roulette": Simplification(
        "off",
        "paths go on to max_depth, none is ended by chance",
        _on_integrator(_without_roulette),
    ),
    "textures": Simplification(
        "mean", "one colour, the mean, for each image and pattern", _mean_textures
    ),
    "normals": Simplification(
        "flat", "no interpolated normals, normal maps or bump maps", _flat
    ),
    "glass": Simplification(
        "straight",
        "light goes straight through glass, nothing is reflected",
        _on_bsdfs(materials.glass_as_nothing),
    ),
    "specular": Simplification(
        "off",
        "plastic and principled surfaces are their diffuse base alone",
        _on_bsdfs(materials.without_specular),
    ),
    "diffuse": Simplification(
        "off", "plastic is its coat alone", _on_bsdfs(materials.without_diffuse)
    ),
    "metal": Simplification(
        "diffuse",
        "metals scatter what they reflect at normal incidence",
        _on_bsdfs(materials.metal_as_diffuse),
    ),
    "filter": Simplification("box", "every pixel is the mean of itself", _box_filter),
}
NAMES = ("depth", *SIMPLIFICATIONS, "no-light")


def words_of(description: SceneDescription) -> list[str]:
    """Return every `NAME=VALUE` there is, but `depth=K`, of which there is no end."""
    named = [f"{name}={one.value}" for name, one in SIMPLIFICATIONS.items()]
    return named + [f"no-light={light}" for light in lights_by_name(description)]


def is_endless(description: SceneDescription) -> bool:
    """Return whether only roulette ends the paths, so that it cannot be left out."""
    asked = description.integrator
    while asked.nested is not None:
        asked = asked.nested
    return asked.name == "path" and asked.max_depth < 0


def offered(description: SceneDescription) -> tuple[list[str], list[str]]:
    """Return the words (`depth=K` apart) that change the scene, and those that do not."""
    words = words_of(description)
    if is_endless(description):
        words.remove("roulette=off")
    changing = [w for w in words if differs(description, simplified(description, w))]
    return changing, [w for w in words if w not in changing]


def simplified(description: SceneDescription, word: str) -> SceneDescription:
    """Return a description with one simplification; `simplified` of it says what that was.

    A scene that has nothing of the kind is the same scene, and says that.

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
    """Return whether a simplification changed anything, but what it said."""
    return not (
        all(a is b for a, b in zip(one.every_shape, other.every_shape, strict=True))
        and len(one.emitters) == len(other.emitters)
        and all(a is b for a, b in zip(one.emitters, other.emitters, strict=True))
        and one.camera is other.camera
        and one.integrator == other.integrator
    )


def _found(description: SceneDescription, word: str) -> tuple[str, Step]:
    """Return the sentence and the step that a word names."""
    name, equals, value = word.partition("=")
    if not equals or name not in NAMES:
        raise SceneError(
            f"{description.source}: simplification {word!r} is unknown; there are: "
            f"depth=K, {', '.join(words_of(description))}"
        )
    if name == "depth":
        if not (value.isascii() and value.isdigit() and 1 <= int(value) <= MOST_DEPTH):
            possible = f"1 to {MOST_DEPTH}"
            raise _refused(description, name, value, possible)
        return f"paths of at most {value} segments", _to_depth(int(value))
    if name == "no-light":
        lights = lights_by_name(description)
        if value not in lights:
            raise _refused(description, name, value, ", ".join(lights) or "none")
        return f"{value} does not shine", lambda d: without_light(d, lights[value])
    one = SIMPLIFICATIONS[name]
    if value != one.value:
        raise _refused(description, name, value, one.value)
    return one.sentence, one.step


def _refused(
    description: SceneDescription, name: str, value: str, possible: str
) -> SceneError:
    return SceneError(
        f"{description.source}: simplification {name}: {value!r} is not possible; "
        f"possible: {possible}"
    )
