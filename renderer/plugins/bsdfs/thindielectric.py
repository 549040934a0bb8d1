"""Thin dielectric: both interfaces of a pane at once; transmission is straight.

With the Fresnel reflectance R of one interface and T = 1 - R, the internal reflections add
up to R + T R T + T R^3 T + ... = 2 R / (1 + R) [Stokes1862].
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, select, splat_f32, splat_i32
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.dielectric import read_glass
from renderer.plugins.bsdfs.fresnel import fresnel_dielectric
from renderer.plugins.bsdfs.kind import (
    DELTA,
    STRAIGHT,
    BsdfKind,
    BsdfSample,
    Color,
    Float,
)
from renderer.scene_file.description import ThinDielectric as Description


class ThinDielectric(NamedTuple):
    """Its parameters."""

    eta: Float  # index of refraction, inside over outside
    specular_reflectance: Color
    specular_transmittance: Color


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    return Description(*read_glass(properties))


@kernel
def _reflectance(pane, wo):
    """Return the reflectance of the pane, the same for both sides."""
    once, _, _ = fresnel_dielectric(fabs(wo.z), pane.eta)
    return select(once < 1.0, once * 2.0 / (1.0 + once), 1.0)


@kernel
def sample(pane, wo, numbers):
    """Sample reflection or straight transmission by the reflectance."""
    reflectance = _reflectance(pane, wo)
    reflected = numbers.choice <= reflectance
    weight = select3(reflected, pane.specular_reflectance, pane.specular_transmittance)
    wi = vec3(-wo.x, -wo.y, select(reflected, wo.z, -wo.z))
    probability = select(reflected, reflectance, 1.0 - reflectance)
    lobe = select(reflected, splat_i32(DELTA), STRAIGHT)
    return BsdfSample(wi, weight, probability, splat_f32(1.0), lobe)


@kernel
def eval_straight(pane, wo):
    """Return the transmittance, including its colour."""
    return pane.specular_transmittance * (1.0 - _reflectance(pane, wo))


THIN_DIELECTRIC = BsdfKind(
    "thindielectric",
    ThinDielectric,
    read,
    "a thin pane of glass",
    sample,
    delta=True,
    transmits=True,
    straight=True,
    eval_straight=eval_straight,
)
