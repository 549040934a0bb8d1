"""Smooth dielectric: reflection and refraction, weighted by the Fresnel reflectance."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, splat_f32, splat_i32
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import DELTA, BsdfKind, BsdfSample, Color, Float
from renderer.plugins.bsdfs.mirror import refracted
from renderer.scene_file.colors.named_materials import INDICES
from renderer.scene_file.description import Dielectric as Description
from renderer.scene_file.description import Texture
from renderer.scene_file.numbers import quoted
from renderer.scene_file.objects.objects import read_texture


class Dielectric(NamedTuple):
    """Its parameters."""

    eta: Float  # index of refraction, inside over outside
    specular_reflectance: Color
    specular_transmittance: Color


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    return Description(*read_glass(properties))


# For a larger index squares overflow float32, and pictures are NaN, as in Mitsuba.
LARGEST_INDEX = 1e9


def read_glass(properties: Any) -> tuple[float, Texture, Texture]:
    """Return the index of refraction, inside over outside, and two colours."""
    return (
        read_relative_index(properties, "bk7"),
        read_texture(properties, "specular_reflectance", 1.0),
        read_texture(properties, "specular_transmittance", 1.0),
    )


def read_relative_index(properties: Any, interior: str, *, rough: bool = False) -> float:
    """Return the index of refraction, inside over outside.

    A rough interface between equal indices is refused: it has no effect, and the half
    vector of two opposite directions does not exist.
    """
    inside = _index(properties, "int_ior", interior)
    outside = _index(properties, "ext_ior", "air")
    if rough and inside == outside:
        name = "int_ior" if properties.has("int_ior") else "ext_ior"
        properties.fail(name, f"{inside:g} on both sides", "two different indices")
    if not 1.0 / LARGEST_INDEX <= inside / outside <= LARGEST_INDEX:
        name = "int_ior" if properties.has("int_ior") else "ext_ior"
        properties.fail(
            name,
            f"{inside:g} inside of {outside:g}",
            f"a quotient from {1.0 / LARGEST_INDEX:g} to {LARGEST_INDEX:g}",
        )
    return inside / outside


def _index(properties: Any, name: str, default: str) -> float:
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


@kernel
def sample(glass, wo, numbers):
    """Sample reflection or refraction by the Fresnel reflectance."""
    fresnel, cos_t, crossing = fresnel_dielectric(wo.z, glass.eta)
    reflected = numbers.choice < fresnel
    # radiance scales by 1 / eta^2 of the crossing from wo's side to wi's
    squeeze = 1.0 / (crossing * crossing)
    weight = select3(
        reflected, glass.specular_reflectance, glass.specular_transmittance * squeeze
    )
    bent = refracted(numbers.arithmetic, wo, glass.eta, cos_t)
    wi = select3(reflected, vec3(-wo.x, -wo.y, wo.z), bent)
    eta = select(reflected, splat_f32(1.0), crossing)
    probability = select(reflected, fresnel, 1.0 - fresnel)
    return BsdfSample(wi, weight, probability, eta, splat_i32(DELTA))


DIELECTRIC = BsdfKind(
    "dielectric",
    Dielectric,
    read,
    "smooth glass",
    sample,
    delta=True,
    transmits=True,
)
