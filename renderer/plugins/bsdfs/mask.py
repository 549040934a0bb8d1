"""A BSDF with holes: the share `opacity` of the light meets it, the rest goes straight on.

Shadow rays take it for a wall, holes and all, as they do in Mitsuba's `path`; but a mask
around glass alone is a pane (`renderer.scene.panes`).
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

    opacity: Float  # of an image or a number, clamped to [0, 1]
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
    """Meet what is masked with the probability `opacity`, or go straight on."""
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
    """Return f |cos| and density of what is masked, by its share."""
    opacity = in_unit_interval(mask.opacity)
    f_cos, pdf = eval_pdf_nested(mask.nested, wo, wi)
    return f_cos * opacity, pdf * opacity


@kernel
def albedo(mask, wo):
    """Return that of what is masked, as Mitsuba does."""
    return albedo_of(mask.nested, wo)


@kernel
def eval_straight(mask, wo):
    """Return the holes, and what goes straight through what is masked."""
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
