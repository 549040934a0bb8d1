"""Smooth conductor: specular reflection with the complex Fresnel reflectance."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import splat_f32, splat_i32
from renderer.kernels.lanes.vectors import vec3
from renderer.plugins.bsdfs.fresnel import fresnel_conductor
from renderer.plugins.bsdfs.kind import DELTA, BsdfKind, BsdfSample, Color
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.colors.named_materials import MATERIALS
from renderer.scene_file.description import Conductor as Description
from renderer.scene_file.description import ConstantTexture, Texture
from renderer.scene_file.numbers import quoted
from renderer.scene_file.objects.objects import read_texture


class Conductor(NamedTuple):
    """Its parameters."""

    eta: Color  # real part of the index of refraction, per colour
    k: Color  # its imaginary part: absorption
    specular_reflectance: Color


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    eta, k = read_complex_index(properties)
    return Description(eta, k, read_texture(properties, "specular_reflectance", 1.0))


def read_complex_index(properties: Any) -> tuple[Texture, Texture]:
    """Return eta and k, for a named material or as given in the file."""
    name = properties.string("material", "none")
    if name != "none" and (properties.has("eta") or properties.has("k")):
        other = "eta" if properties.has("eta") else "k"
        properties.fail(other, 'a value together with "material"', "one of the two")
    if name == "none":
        return (
            read_texture(properties, "eta", 0.0, Use.REFRACTION),
            read_texture(properties, "k", 1.0, Use.REFRACTION),
        )
    if name not in MATERIALS:
        properties.fail("material", quoted(name), "one of none, " + ", ".join(MATERIALS))
    eta, k = MATERIALS[name]
    return ConstantTexture(eta), ConstantTexture(k)


@kernel
def reflectance(metal, cos_i):
    """Return the Fresnel reflectance for each colour."""
    fresnel = vec3(
        fresnel_conductor(cos_i, metal.eta.x, metal.k.x),
        fresnel_conductor(cos_i, metal.eta.y, metal.k.y),
        fresnel_conductor(cos_i, metal.eta.z, metal.k.z),
    )
    return metal.specular_reflectance * fresnel


@kernel
def sample(metal, wo, numbers):
    """Mirror wo at the normal."""
    one = splat_f32(1.0)
    wi = vec3(-wo.x, -wo.y, wo.z)
    return BsdfSample(wi, reflectance(metal, wo.z), one, one, splat_i32(DELTA))


CONDUCTOR = BsdfKind("conductor", Conductor, read, "smooth metal", sample, delta=True)
