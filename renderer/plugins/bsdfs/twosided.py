"""Two-sided BSDF: one BSDF for both sides of a surface, or one for each.

Around a BSDF without nested ones, at the top level, it needs no record: a shape has a BSDF
id for each side. The records here are for all other nestings.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, select
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    albedo_of,
    black,
    eval_pdf_nested,
    sample_nested,
)
from renderer.plugins.bsdfs.parameters import Nested
from renderer.scene_file.description import TwoSided as Description
from renderer.scene_file.objects.objects import read_nested


class OneForBoth(NamedTuple):
    """The BSDF of both sides."""

    front: Nested


class OneForEach(NamedTuple):
    """The BSDFs of the front and the back."""

    front: Nested
    back: Nested


def read(properties: Any) -> Description:
    """Read the properties of a file."""
    sides = read_nested(properties, 1, 2, "one for both sides, or one for each")
    return Description(front=sides[0], back=sides[-1])


@kernel
def _from_above(wo, chosen):
    """Flip a sample of the upper hemisphere to the side of wo."""
    above = wo.z > 0.0
    wi = vec3(chosen.wi.x, chosen.wi.y, select(above, chosen.wi.z, -chosen.wi.z))
    weight = select3(wo.z != 0.0, chosen.weight, black())
    return BsdfSample(wi, weight, chosen.pdf, chosen.eta, chosen.lobe)


@kernel
def _sample_both(two, wo, numbers):
    above = vec3(wo.x, wo.y, fabs(wo.z))
    return _from_above(wo, sample_nested(two.front, above, numbers))


@kernel
def _eval_pdf_both(two, wo, wi):
    turned = vec3(wi.x, wi.y, select(wo.z > 0.0, wi.z, -wi.z))
    return eval_pdf_nested(two.front, vec3(wo.x, wo.y, fabs(wo.z)), turned)


@kernel
def _sample_each(two, wo, numbers):
    above, front = vec3(wo.x, wo.y, fabs(wo.z)), wo.z > 0.0
    a = sample_nested(two.front, above, numbers)
    b = sample_nested(two.back, above, numbers)
    chosen = BsdfSample(
        select3(front, a.wi, b.wi),
        select3(front, a.weight, b.weight),
        select(front, a.pdf, b.pdf),
        select(front, a.eta, b.eta),
        select(front, a.lobe, b.lobe),
    )
    return _from_above(wo, chosen)


@kernel
def _eval_pdf_each(two, wo, wi):
    above, front = vec3(wo.x, wo.y, fabs(wo.z)), wo.z > 0.0
    turned = vec3(wi.x, wi.y, select(front, wi.z, -wi.z))
    f_a, pdf_a = eval_pdf_nested(two.front, above, turned)
    f_b, pdf_b = eval_pdf_nested(two.back, above, turned)
    return select3(front, f_a, f_b), select(front, pdf_a, pdf_b)


@kernel
def _albedo_of_both(two, wo):
    return albedo_of(two.front, vec3(wo.x, wo.y, fabs(wo.z)))


@kernel
def _albedo_of_each(two, wo):
    above = vec3(wo.x, wo.y, fabs(wo.z))
    front, back = albedo_of(two.front, above), albedo_of(two.back, above)
    return select3(wo.z > 0.0, front, back)


ONE_FOR_BOTH = BsdfKind(
    "twosided",
    OneForBoth,
    read,
    "on both sides",
    _sample_both,
    _eval_pdf_both,
    albedo=_albedo_of_both,
    opaque=True,
)
ONE_FOR_EACH = BsdfKind(
    "twosided",
    OneForEach,
    read,
    "two sides",
    _sample_each,
    _eval_pdf_each,
    albedo=_albedo_of_each,
    opaque=True,
)
