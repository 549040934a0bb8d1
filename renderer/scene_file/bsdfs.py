"""BSDFs: diffuse, dielectric, conductor, twosided."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene_file.colors import Use, read_color
from renderer.scene_file.conductor_materials import MATERIALS
from renderer.scene_file.description import Bsdf, Conductor, Dielectric, Diffuse, TwoSided
from renderer.scene_file.numbers import quoted
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading
from renderer.scene_file.refractive_indices import INDICES
from renderer.scene_file.textures import read_texture
from renderer.scene_file.tree import Element


def read_bsdf(element: Element, reading: Reading) -> Bsdf:
    """Read a `<bsdf>`; the same element gives the same record each time.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    return reading.once(element, lambda: _read(Properties(element, reading)))


def _read(properties: Properties) -> Bsdf:
    bsdf: Bsdf
    match properties.element.plugin:
        case "diffuse":
            bsdf = Diffuse(read_texture(properties, "reflectance", 0.5))
        case "dielectric":
            bsdf = _dielectric(properties)
        case "conductor":
            bsdf = _conductor(properties)
        case _:
            bsdf = _two_sided(properties)
    properties.finish()
    return bsdf


def _dielectric(properties: Properties) -> Dielectric:
    interior = _index(properties, "int_ior", "bk7")
    exterior = _index(properties, "ext_ior", "air")
    return Dielectric(
        eta=interior / exterior,
        specular_reflectance=read_color(
            properties, "specular_reflectance", 1.0, Use.REFLECTANCE
        ),
        specular_transmittance=read_color(
            properties, "specular_transmittance", 1.0, Use.REFLECTANCE
        ),
    )


def _index(properties: Properties, name: str, default: str) -> float:
    """Return an index of refraction, given as a float or by the name of a material."""
    property_ = properties.take(name)
    value = default if property_ is None else property_.value
    if isinstance(value, str):
        index = INDICES.get(value.lower())
        if index is None:
            properties.fail(name, quoted(value), "a float or one of " + ", ".join(INDICES))
        return index
    if not isinstance(value, float):  # an integer is refused: Mitsuba wants a float here
        kind = property_.kind if property_ else ""
        properties.fail(
            name, f"a value of type {kind}", "a float or the name of a material"
        )
    if value <= 0.0:
        properties.fail(name, f"{value:g}", "an index of refraction above 0")
    return value


def _conductor(properties: Properties) -> Conductor:
    name = properties.string("material", "none")
    if properties.has("material") and (properties.has("eta") or properties.has("k")):
        other = "eta" if properties.has("eta") else "k"
        properties.fail(other, 'a value beside "material"', "one of the two")
    if name == "none":
        eta = read_color(properties, "eta", 0.0, Use.REFRACTION)
        k = read_color(properties, "k", 1.0, Use.REFRACTION)
    elif name in MATERIALS:
        eta, k = MATERIALS[name]
    else:
        properties.fail("material", quoted(name), "one of none, " + ", ".join(MATERIALS))
    return Conductor(
        eta, k, read_color(properties, "specular_reflectance", 1.0, Use.REFLECTANCE)
    )


def _two_sided(properties: Properties) -> TwoSided:
    nested = properties.children("bsdf")
    if not 1 <= len(nested) <= 2:
        raise SceneError(
            f"{properties.location}: {properties.element} holds {len(nested)} bsdfs; "
            "expected one for both sides, or one for each"
        )
    sides: list[Diffuse | Conductor] = []
    for _, element in nested:
        if element.plugin == "twosided":  # before reading it, which would recurse
            side: Bsdf | None = None
        else:
            side = read_bsdf(element, properties.reading)
        if not isinstance(side, Diffuse | Conductor):
            raise SceneError(
                f"{element.location}: {element} cannot be inside of twosided; supported: "
                "diffuse, conductor"
            )
        sides.append(side)
    return TwoSided(front=sides[0], back=sides[-1])
