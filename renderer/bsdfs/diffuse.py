"""Diffuse reflection (Lambert): f = k_d / pi, the same in all directions."""

from __future__ import annotations

from renderer.jit import kernel
from renderer.lanes.functions import select
from renderer.replay.directions import (
    cosine_hemisphere_as_mitsuba,
    to_world_as_mitsuba,
)
from renderer.sampling import INV_PI, square_to_cosine_hemisphere
from renderer.textures import eval_texture
from renderer.vectors import gather3


@kernel
def diffuse_albedo(diffuse, bsdf, u, v, mask):
    """Return k_d of 16 surface points."""
    constant = gather3(diffuse.reflectance, bsdf, mask)
    return eval_texture(diffuse.textures, diffuse.texture, bsdf, u, v, constant, mask)


@kernel
def eval_diffuse(albedo, cos_i):
    """Return f times the cosine of the incident direction."""
    return albedo * (INV_PI * select(cos_i > 0.0, cos_i, 0.0))


@kernel
def pdf_diffuse(cos_i):
    """Return the density [1/sr] with which `sample_diffuse` chooses a direction."""
    return INV_PI * select(cos_i > 0.0, cos_i, 0.0)


@kernel
def sample_diffuse(replay, s, t, normal, x, y):
    """Choose a direction around the normal by its cosine; return it and its cosine.

    s and t are unit vectors across the normal. f cos / pdf is the albedo exactly. A replay
    rounds as Mitsuba does.
    """
    if replay is not None:
        local = cosine_hemisphere_as_mitsuba(x, y)
        return to_world_as_mitsuba(s, t, normal, local), local.z
    local = square_to_cosine_hemisphere(x, y)
    return s * local.x + t * local.y + normal * local.z, local.z
