"""Directions of specular reflection and refraction."""

from __future__ import annotations

from typing import Any

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import select
from renderer.kernels.lanes.vectors import dot, vec3
from renderer.plugins.sampling.numbers_and_warps import AlongU, Plain


@kernel
def reflect(wo, normal):
    """Return wo reflected about the normal."""
    return normal * (2.0 * dot(wo, normal)) - wo


@interface
def refracted(arithmetic: Any, wo: Any, eta: Any, cos_t: Any) -> Any:
    """Return the local wo, refracted by Snell's law at the plane z = 0.

    eta is the index of refraction inside (z < 0) over outside; cos_t is z of the result.
    """


@refracted.by(Plain, AlongU)
@kernel
def _refracted(arithmetic, wo, eta, cos_t):
    ratio = select(wo.z >= 0.0, 1.0 / eta, eta)
    return vec3(-(wo.x * ratio), -(wo.y * ratio), cos_t)
