"""Opacity mask: nested BSDF with probability `opacity`, else straight transmission.

Shadow rays treat it as opaque, as in Mitsuba's `path`, except a mask around glass, which
is a pane (`renderer.scene.panes`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import maximum, minimum, select, splat_f32, splat_i32
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.kind import (
    STRAIGHT,
    BsdfKind,
    BsdfSample,
    Float,
    Numbers,
    albedo_of,
    eval_pdf_nested,
    sample_nested,
    straight_through,
)
from renderer.plugins.bsdfs.parameters import Nested
from renderer.scene_file.description import Mask as Description
from renderer.scene_file.objects.objects import read_nested, read_scalar_texture


class Masked(NamedTuple):
    """Its parameters."""

    opacity: Float  # from an image or a number, clamped to [0, 1]
    nested: Nested


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    opacity = read_scalar_texture(properties, "opacity", 0.5)
    (nested,) = read_nested(properties, 1, 1, "one")
    return Description(opacity, nested)


@kernel
def in_unit_interval(x):
    """Return lanes clamped to [0, 1]."""
    return minimum(maximum(x, splat_f32(0.0)), splat_f32(1.0))


@kernel
def sample(mask, wo, numbers):
    """Sample the nested BSDF with probability `opacity`, else straight transmission."""
    opacity, choice = in_unit_interval(mask.opacity), numbers.choice
    met = choice < opacity
    rest = select(met, choice / opacity, choice)
    chosen = sample_nested(
        mask.nested, wo, Numbers(numbers.x, numbers.y, rest, numbers.arithmetic)
    )
    one = splat_f32(1.0)
    return BsdfSample(
        select3(met, chosen.wi, -wo),
        select3(met, chosen.weight, vec3(one, one, one)),
        select(met, chosen.pdf * opacity, 1.0 - opacity),
        select(met, chosen.eta, one),
        select(met, chosen.lobe, splat_i32(STRAIGHT)),
    )


@kernel
def eval_pdf(mask, wo, wi):
    """Return f |cos| and pdf of the nested BSDF, times `opacity`."""
    opacity = in_unit_interval(mask.opacity)
    f_cos, pdf = eval_pdf_nested(mask.nested, wo, wi)
    return f_cos * opacity, pdf * opacity


@kernel
def albedo(mask, wo):
    """Return the albedo of the nested BSDF, as in Mitsuba."""
    return albedo_of(mask.nested, wo)


@kernel
def eval_straight(mask, wo):
    """Return the transmittance of the holes and of the nested BSDF."""
    opacity, one = in_unit_interval(mask.opacity), splat_f32(1.0)
    holes = one - opacity
    return straight_through(mask.nested, wo) * opacity + vec3(holes, holes, holes)


MASK = BsdfKind(
    "mask",
    Masked,
    read,
    "with holes",
    sample,
    eval_pdf,
    albedo=albedo,
    delta=True,
    transmits=True,
    straight=True,
    eval_straight=eval_straight,
)
