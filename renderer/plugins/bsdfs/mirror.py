"""The two directions of smooth interfaces: reflection and refraction."""

from __future__ import annotations

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import dot, normalize


@kernel
def reflect(wo, normal):
    """Return wo mirrored at the normal: the angle of incidence is that of exit."""
    return normal * (2.0 * dot(wo, normal)) - wo


@kernel
def refract(wo, normal, cos_t, crossing):
    """Return wo bent by Snell's law; cos_t and crossing as from `fresnel_dielectric`."""
    scale = -1.0 / crossing
    return normalize(wo * scale + normal * (cos_t - scale * dot(wo, normal)))
