"""Normal map: the nested BSDF is evaluated in the frame of a perturbed normal.

Light that is above one horizon and below the other is dropped. To avoid a hard terminator,
light fades out by the shadowing of a rough surface [Estevez2019].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import (
    maximum,
    minimum,
    select,
    splat_f32,
    splat_mask,
    sqrt,
)
from renderer.kernels.lanes.vectors import cross, dot, normalize, select3, vec3
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    Color,
    Float,
    albedo_of,
    black,
    eval_pdf_nested,
    sample_nested,
)
from renderer.plugins.bsdfs.parameters import Nested
from renderer.plugins.sampling.numbers_and_warps import Frame, to_local
from renderer.scene_file.description import BitmapTexture, ConstantTexture
from renderer.scene_file.description import NormalMap as Description
from renderer.scene_file.objects.objects import read_nested, read_texture

# squared length below which a vector counts as 0
_NOTHING = np.float32(1e-20)


class NormalMapped(NamedTuple):
    """Its parameters."""

    normalmap: Color  # (1 + n) / 2
    flip_invalid_normals: Float  # 1: n is mirrored at z if it points away from wo
    use_shadowing_function: Float
    nested: Nested


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    if not properties.has("normalmap"):
        properties.fail("normalmap", "nothing", "a texture of normals")
    normals = read_texture(properties, "normalmap", 0.5)
    bitmap = isinstance(normals, BitmapTexture) and normals.texels.shape[2] >= 3
    if not bitmap and not isinstance(normals, ConstantTexture):
        expected = "a bitmap of three channels, or a colour"
        properties.fail("normalmap", "a texture without normals", expected)
    flip = properties.boolean("flip_invalid_normals", True)
    shadow = properties.boolean("use_shadowing_function", True)
    (nested,) = read_nested(properties, 1, 1, "one")
    return Description(normals, flip, shadow, nested)


@interface
def turned_frame(parameters: Any, wo: Any) -> Any:
    """Return the frame of the nested BSDF in the local one, and two masks.

    The first is of valid frames. In the second a sampled direction keeps its density where
    it is on the wrong side of the surface, and black. (In Mitsuba, under bump maps alone.)
    """


@kernel
def facing(parameters, wo, normal):
    """Return the normal, mirrored at z if it points away from wo and may be flipped."""
    away = (wo.z * dot(wo, normal) <= 0.0) & (parameters.flip_invalid_normals != 0.0)
    return select3(away, vec3(-normal.x, -normal.y, normal.z), normal)


@kernel
def frame_along(normal, x):
    """Return the frame around a normal with s along x, and the mask of valid frames.

    An image may contain a normal of length 0, or one along x. There Mitsuba divides by 0,
    and nothing is reflected.
    """
    none, one = splat_f32(0.0), splat_f32(1.0)
    there = dot(normal, normal) > _NOTHING
    normal = normalize(select3(there, normal, vec3(none, none, one)))
    s = x - normal * dot(normal, x)
    across = dot(s, s) > _NOTHING
    s = normalize(select3(across, s, vec3(none, normal.z, -normal.y)))
    # normalise again: if x is nearly along the normal, s has large rounding errors
    s = normalize(s - normal * dot(normal, s))
    return Frame(s, cross(normal, s), normal), there & across


@turned_frame.by(NormalMapped)
@kernel
def _turned_frame(mapped, wo):
    one, none = splat_f32(1.0), splat_f32(0.0)
    rgb = mapped.normalmap
    n = facing(mapped, wo, vec3(rgb.x * 2.0 - 1.0, rgb.y * 2.0 - 1.0, rgb.z * 2.0 - 1.0))
    frame, there = frame_along(n, vec3(one, none, none))
    return frame, there, splat_mask(False)


@kernel
def _shadowing(parameters, n, wi):
    """Return the shadowing factor for the unperturbed wi [Estevez2019, eq. 3]."""
    alpha2 = minimum((1.0 / (n.z * n.z) - 1.0) * 0.125, splat_f32(1.0))
    tan2 = maximum(1.0 / (wi.z * wi.z) - 1.0, splat_f32(0.0))
    left = 2.0 / (1.0 + sqrt(1.0 + maximum(alpha2, splat_f32(0.0)) * tan2))
    return select(parameters.use_shadowing_function != 0.0, left, splat_f32(1.0))


@kernel
def sample(turned, wo, numbers):
    """Sample the nested BSDF in its own frame."""
    frame, there, below = turned_frame(turned, wo)
    chosen = sample_nested(turned.nested, to_local(frame, wo), numbers)
    wi = frame.s * chosen.wi.x + frame.t * chosen.wi.y + frame.n * chosen.wi.z
    possible = there & (wi.z * chosen.wi.z > 0.0)
    weight = chosen.weight * _shadowing(turned, frame.n, wi)
    return BsdfSample(
        wi,
        select3(possible, weight, black()),
        select(possible | below, chosen.pdf, 0.0),
        chosen.eta,
        chosen.lobe,
    )


@kernel
def eval_pdf(turned, wo, wi):
    """Return f |cos| and pdf of the nested BSDF in its own frame."""
    frame, there, _ = turned_frame(turned, wo)
    inner = to_local(frame, wi)
    f_cos, pdf = eval_pdf_nested(turned.nested, to_local(frame, wo), inner)
    possible = there & (wi.z * inner.z > 0.0)
    f_cos = f_cos * _shadowing(turned, frame.n, wi)
    return select3(possible, f_cos, black()), select(possible, pdf, 0.0)


@kernel
def normal(turned, wo):
    """Return the perturbed normal."""
    frame, _, _ = turned_frame(turned, wo)
    return frame.n


@kernel
def albedo(turned, wo):
    """Return the albedo of the nested BSDF; as in Mitsuba, in the unperturbed frame."""
    return albedo_of(turned.nested, wo)


NORMAL_MAP = BsdfKind(
    "normalmap",
    NormalMapped,
    read,
    "with normals of an image",
    sample,
    eval_pdf,
    albedo=albedo,
    normal=normal,
    oriented=True,
)
