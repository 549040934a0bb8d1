"""Users' BSDFs in the form of version 1, where a delta lobe is a sample with pdf 0.

Only z and eta of its direction were used, and `reflection` and `transmission` returned the
weights of the two lobes. The kernels here convert that to a whole `BsdfSample`. The form is
supported for one more version; `docs/adding-a-bsdf.md` describes the present one.
"""

from __future__ import annotations

from typing import Any

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import select, splat_f32, splat_i32
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.kind import DELTA, SMOOTH, Branch, BsdfSample, black


@interface
def _sample(parameters: Any, wo: Any, numbers: Any) -> BsdfSample:
    """Call the user's `sample`."""


@interface
def _reflection(parameters: Any, wo: Any) -> Branch:
    """Call the user's `reflection`."""


@interface
def _transmission(parameters: Any, wo: Any) -> Branch:
    """Call the user's `transmission`."""


@kernel
def _nothing(parameters, wo):
    none, one = splat_f32(0.0), splat_f32(1.0)
    return Branch(black(), none, -wo.z, one)


@kernel
def _sum(color):
    return color.x + color.y + color.z


@kernel
def whole_sample(parameters, wo, numbers):
    """Return the user's sample, with direction, probability and kind of a delta lobe."""
    s = _sample(parameters, wo, numbers)
    smooth = s.pdf > 0.0
    mirrored = (s.wi.z > 0.0) ^ ~(wo.z > 0.0)
    across = select(mirrored, splat_f32(-1.0), -1.0 / s.eta)
    wi = vec3(wo.x * across, wo.y * across, select(mirrored, wo.z, s.wi.z))
    # the weight is value / probability, so the probability follows from both
    there, beyond = _reflection(parameters, wo), _transmission(parameters, wo)
    value = select3(mirrored, there.weight * there.share, beyond.weight * beyond.share)
    weight = _sum(s.weight)
    probability = select(weight > 0.0, _sum(value) / weight, 1.0)
    return BsdfSample(
        select3(smooth, s.wi, wi),
        s.weight,
        select(smooth, s.pdf, probability),
        s.eta,
        select(smooth, splat_i32(SMOOTH), DELTA),
    )


def register_old_kernels(
    parameters: type, sample: Any, reflection: Any, transmission: Any
) -> None:
    """Register the kernels of a user's kind for `whole_sample`."""
    _sample.by(parameters)(sample)
    _reflection.by(parameters)(reflection)
    _transmission.by(parameters)(transmission or _nothing)
