"""Reflection at a mirror, and at the facets of a rough surface."""

from __future__ import annotations

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import dot


@kernel
def reflect(wo, normal):
    """Return wo mirrored at the normal: the angle of incidence is that of exit."""
    return normal * (2.0 * dot(wo, normal)) - wo
