"""Bump map: the nested BSDF is evaluated in the frame of a displaced surface [Blinn1978].

To first order in h, the surface p + h(u, v) n has the derivatives dp/du + n dh/du and
dp/dv + n dh/dv; its normal is their cross product.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.errors import SceneError
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import splat_f32
from renderer.kernels.lanes.vectors import (
    cross,
    dot,
    normalize,
    orthonormal_basis,
    select3,
    vec3,
)
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    Float,
)
from renderer.plugins.bsdfs.normalmap import (
    albedo,
    eval_pdf,
    facing,
    frame_along,
    normal,
    sample,
    turned_frame,
)
from renderer.plugins.bsdfs.parameters import (
    Derivatives,
    GeometricNormal,
    Gradient,
    Nested,
    ShadingNormal,
)
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import BitmapTexture, ConstantTexture
from renderer.scene_file.description import BumpMap as Description
from renderer.scene_file.objects.objects import read_nested, read_texture

_ALONG = np.float32(1e-12)
"""Squared sine of an angle below which rounding determines the perpendicular part."""


class Bumped(NamedTuple):
    """Its parameters."""

    height: Gradient  # of h by u and v, without `scale`
    scale: Float
    flip_invalid_normals: Float  # as in a normal map
    use_shadowing_function: Float
    derivatives: Derivatives
    shading_normal: ShadingNormal
    normal: GeometricNormal
    nested: Nested


def read(properties: Any) -> Description:
    """Read the properties of a file; the texture may have any name."""
    textures = properties.children("texture")
    if len(textures) != 1:
        raise SceneError(
            f"{properties.location}: {properties.element} holds {len(textures)} textures; "
            "expected one, of the heights"
        )
    name = textures[0][0]
    height = read_texture(properties, name, 0.0, Use.NUMBER)
    if isinstance(height, ConstantTexture):
        height = ConstantTexture((0.0, 0.0, 0.0))  # the slope of a constant texture
    elif not isinstance(height, BitmapTexture):
        properties.fail(name, "a texture without a slope", "a bitmap")
    scale = properties.number("scale", 1.0, at_least=-1e9, at_most=1e9)
    flip = properties.boolean("flip_invalid_normals", True)
    shadow = properties.boolean("use_shadowing_function", True)
    (nested,) = read_nested(properties, 1, 1, "one")
    return Description(height, scale, flip, shadow, nested)


@turned_frame.by(Bumped)
@kernel
def _turned_frame(bumped, wo):
    """Return the local frame around the normal of the displaced surface.

    As in Mitsuba, its x axis is computed from dp/du in world space and this normal in local
    space. Only anisotropic BSDFs depend on that.
    """
    n, (dp_du, dp_dv) = bumped.shading_normal, bumped.derivatives
    by_u, by_v = bumped.height[0] * bumped.scale, bumped.height[1] * bumped.scale
    du = dp_du + n * (by_u - dot(n, dp_du))
    dv = dp_dv + n * (by_v - dot(n, dp_dv))
    displaced = cross(du, dv)
    displaced = select3(dot(bumped.normal, displaced) < 0.0, -displaced, displaced)
    # into the local frame, whose x axis is along dp/du
    across = dp_du - n * dot(n, dp_du)
    there = dot(across, across) > 0.0
    s, _ = orthonormal_basis(n)
    s = normalize(select3(there, across, s))
    local = vec3(dot(displaced, s), dot(displaced, cross(n, s)), dot(displaced, n))
    none, one = splat_f32(0.0), splat_f32(1.0)
    # without u and v there is no displacement; the products leave only rounding errors
    some = there & (dot(local, local) > 0.0)
    local = facing(bumped, wo, select3(some, normalize(local), vec3(none, none, one)))
    # dp/du in world space may be parallel to that normal: flat bumps, u along z
    x = normalize(select3(there, dp_du, s))
    rest = x - local * dot(local, x)
    other, _ = orthonormal_basis(local)
    frame, valid = frame_along(local, select3(dot(rest, rest) > _ALONG, x, other))
    return frame, valid, valid


BUMP_MAP = BsdfKind(
    "bumpmap",
    Bumped,
    read,
    "with bumps of an image",
    sample,
    eval_pdf,
    albedo=albedo,
    normal=normal,
    oriented=True,
)
