"""Blend of two BSDFs: f = (1 - w) f_1 + w f_2; one of the two is sampled.

The pdf is that of the mixture. As in Mitsuba, a delta lobe enters it with its probability
in place of a pdf: blended with a smooth BSDF, its direction has the weight
w p_2 f / (w p_2 + (1 - w) pdf_1). This adds a probability to a pdf, so delta lobes lose
energy. The exact mixture is brighter.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select
from renderer.kernels.lanes.vectors import select3
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    Float,
    Numbers,
    albedo_of,
    black,
    eval_pdf_nested,
    sample_nested,
    straight_through,
)
from renderer.plugins.bsdfs.mask import in_unit_interval
from renderer.plugins.bsdfs.parameters import Nested
from renderer.scene_file.description import Blend as Description
from renderer.scene_file.objects.objects import read_nested, read_scalar_texture


class Blended(NamedTuple):
    """Its parameters."""

    weight: Float  # of the second, clamped to [0, 1]
    first: Nested
    second: Nested


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    if not properties.has("weight"):
        properties.fail("weight", "nothing", "the share of the second bsdf")
    weight = read_scalar_texture(properties, "weight", 0.5)
    first, second = read_nested(properties, 2, 2, "two")
    return Description(weight, first, second)


@kernel
def sample(blend, wo, numbers):
    """Sample one of the two BSDFs; the weight includes f and pdf of the other."""
    w, choice = in_unit_interval(blend.weight), numbers.choice
    other = 1.0 - w
    second = (choice <= w) & (w > 0.0)
    rest = select(second, choice / w, (choice - w) / other)
    inner = Numbers(numbers.x, numbers.y, rest, numbers.arithmetic)
    a, b = sample_nested(blend.first, wo, inner), sample_nested(blend.second, wo, inner)
    wi = select3(second, b.wi, a.wi)
    f_a, pdf_a = eval_pdf_nested(blend.first, wo, wi)
    f_b, pdf_b = eval_pdf_nested(blend.second, wo, wi)
    f_a = select3(second, f_a, a.weight * a.pdf) * other
    f_b = select3(second, b.weight * b.pdf, f_b) * w
    pdf = select(second, pdf_a, a.pdf) * other + select(second, b.pdf, pdf_b) * w
    return BsdfSample(
        wi,
        select3(pdf > 0.0, (f_a + f_b) * (1.0 / pdf), black()),
        pdf,
        select(second, b.eta, a.eta),
        select(second, b.lobe, a.lobe),
    )


@kernel
def eval_pdf(blend, wo, wi):
    """Return f |cos| and density of the mixture."""
    w = in_unit_interval(blend.weight)
    f_a, pdf_a = eval_pdf_nested(blend.first, wo, wi)
    f_b, pdf_b = eval_pdf_nested(blend.second, wo, wi)
    return f_a * (1.0 - w) + f_b * w, pdf_a * (1.0 - w) + pdf_b * w


@kernel
def albedo(blend, wo):
    """Return the albedo of the mixture."""
    w = in_unit_interval(blend.weight)
    first, second = albedo_of(blend.first, wo), albedo_of(blend.second, wo)
    return first * (1.0 - w) + second * w


@kernel
def eval_straight(blend, wo):
    """Return the straight transmittance of the mixture."""
    w = in_unit_interval(blend.weight)
    first, second = straight_through(blend.first, wo), straight_through(blend.second, wo)
    return first * (1.0 - w) + second * w


BLEND = BsdfKind(
    "blendbsdf",
    Blended,
    read,
    "two in one",
    sample,
    eval_pdf,
    albedo=albedo,
    eval_straight=eval_straight,
)
