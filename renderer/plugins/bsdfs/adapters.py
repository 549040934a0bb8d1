"""BSDFs around BSDFs: masks, blends, bumps, two sides, in any nesting.

The parameters of a wrapper are a record whose last fields are the records of what is
inside. Numba tells such records apart by all that is in them, so the functions below, which
call one another from the outside in, are compiled for each *structure* that a scene has, as
"mask(blendbsdf(diffuse, conductor))": a row of the method tables, like any kind
(docs/decisions/nested-bsdfs.md).

Other than a kind by itself, a BSDF inside of another one may be seen from any side, and it
says with what probability it chose a delta lobe, and whether that is a hole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    albedo_of,
    eval_pdf_bsdf,
    is_possible,
    normal_of,
    outgoing,
    reflection_of,
    sample_bsdf,
    seen_albedo_of,
    visible_side,
)
from renderer.plugins.bsdfs.parameters import (
    make_loader,
    parameters_from,
    rows_of,
)
from renderer.plugins.sampling.arithmetic import to_world


class Lobe(NamedTuple):
    """A direction that a nested BSDF has chosen, for 16 surface points."""

    wi: Any  # unit, local
    weight: Any  # f cos / pdf; 0: the path ends
    pdf: Any  # [1/sr], or of a delta lobe its probability
    eta: Any
    delta: Any  # 0: smooth, 1: of one direction, 2: straight on, as through a hole


@interface
def sample_lobe(parameters: Any, wo: Any, numbers: Any) -> Lobe:
    """Choose a direction, whatever side wo is on."""


@interface
def eval_pdf_lobes(parameters: Any, wo: Any, wi: Any) -> Any:
    """Return f |cos| and the density of smooth lobes, whatever sides wo and wi are on."""


@interface
def nested_albedo(parameters: Any, wo: Any) -> Any:
    """Return the colour that the AOV `albedo` shows; black where there is none."""


@interface
def _lobe_of(parameters: Any, wo: Any, numbers: Any) -> Lobe:
    """Choose a direction from a side that the BSDF is seen from."""


@interface
def _delta_pdf(parameters: Any, wo: Any, sample: BsdfSample) -> Any:
    """Return the probability of a delta lobe that was chosen."""


@kernel
def black():
    """Return no light."""
    none = splat_f32(0.0)
    return vec3(none, none, none)


# ------------------------------------------------------- kinds that nothing is inside of


@kernel
def _is_certain(parameters, wo, sample):
    return splat_f32(1.0)


@kernel
def _by_share(parameters, wo, sample):
    reflected = reflection_of(parameters, wo).share
    same_side = (sample.wi.z > 0.0) ^ ~(wo.z > 0.0)
    return select(same_side, reflected, 1.0 - reflected)


@kernel
def _delta_direction(wo, sample):
    """Return the mirrored or refracted direction; of a sample's own only z counts."""
    same_side = (sample.wi.z > 0.0) ^ ~(wo.z > 0.0)
    across = select(same_side, splat_f32(-1.0), -1.0 / sample.eta)
    return vec3(wo.x * across, wo.y * across, select(same_side, wo.z, sample.wi.z))


@kernel
def _one_or_hole(sample):
    return select(sample.pdf < 0.0, splat_f32(2.0), 1.0)


@kernel
def _smooth_lobe(parameters, wo, numbers):
    s = sample_bsdf(parameters, wo, numbers)
    weight = select3(s.pdf > 0.0, s.weight, black())
    return Lobe(s.wi, weight, s.pdf, s.eta, splat_f32(0.0))


@kernel
def _delta_lobe(parameters, wo, numbers):
    s = sample_bsdf(parameters, wo, numbers)
    wi, pdf = _delta_direction(wo, s), _delta_pdf(parameters, wo, s)
    return Lobe(wi, s.weight, pdf, s.eta, _one_or_hole(s))


@kernel
def _smooth_or_delta_lobe(parameters, wo, numbers):
    s = sample_bsdf(parameters, wo, numbers)
    smooth = s.pdf > 0.0
    wi = select3(smooth, s.wi, _delta_direction(wo, s))
    pdf = select(smooth, s.pdf, _delta_pdf(parameters, wo, s))
    return Lobe(wi, s.weight, pdf, s.eta, select(smooth, 0.0, _one_or_hole(s)))


@kernel
def _lobe_in_front(parameters, wo, numbers):
    """Ask a BSDF that does not transmit; from behind it is black."""
    lobe, front = _lobe_of(parameters, wo, numbers), wo.z > 0.0
    return Lobe(
        select3(front, lobe.wi, black()),
        select3(front, lobe.weight, black()),
        select(front, lobe.pdf, 0.0),
        lobe.eta,
        lobe.delta,
    )


@kernel
def _lobes_in_front(parameters, wo, wi):
    f_cos, pdf = eval_pdf_bsdf(parameters, wo, wi)
    front = wo.z > 0.0
    return select3(front, f_cos, black()), select(front, pdf, 0.0)


@kernel
def _lobes(parameters, wo, wi):
    return eval_pdf_bsdf(parameters, wo, wi)


@kernel
def _no_smooth_lobes(parameters, wo, wi):
    return black(), splat_f32(0.0)


_LOBE_OF = {
    (True, False): _smooth_lobe,
    (False, True): _delta_lobe,
    (True, True): _smooth_or_delta_lobe,
}


@kernel
def _no_albedo(parameters, wo):
    return black()


@kernel
def _albedo(parameters, wo):
    return albedo_of(parameters)


@kernel
def _seen_albedo(parameters, wo):
    return seen_albedo_of(parameters, wo)


def make_nestable(kind: BsdfKind) -> None:
    """Let wrappers find the kernels of a kind."""
    cls = kind.parameters
    lobe = _LOBE_OF[kind.smooth, kind.delta]
    _lobe_of.by(cls)(lobe)
    sample_lobe.by(cls)(lobe if kind.transmits else _lobe_in_front)
    by_share = _by_share if kind.reflection is not None else _is_certain
    _delta_pdf.by(cls)(kind.delta_pdf or by_share)
    if not kind.smooth:
        eval_pdf_lobes.by(cls)(_no_smooth_lobes)
    else:
        eval_pdf_lobes.by(cls)(_lobes if kind.transmits else _lobes_in_front)
    albedo = _seen_albedo if kind.seen_albedo else _albedo
    nested_albedo.by(cls)(_no_albedo if kind.albedo is None else albedo)


# ------------------------------------------------------------------------------ wrappers


@dataclass(frozen=True)
class Wrapper:
    """A kind of BSDF that others are inside of.

    Parameters
    ----------
    name, read, about
        As of a `BsdfKind`.
    parameters
        A NamedTuple class; those fields that are annotated `Nested` come last.
    sample
        (parameters, wo, numbers) -> Lobe.
    eval_pdf
        (parameters, wo, wi) -> f |cos|, pdf of the smooth lobes.
    albedo
        (parameters, wo) -> RGB that the AOV shows.
    passes
        Whether some of the light goes straight through, whatever is inside.
    oriented
        Whether the x axis of the local frame must be along dp/du.
    normal
        (parameters, wo) -> local normal that the AOV `sh_normal` shows; None: z.
    opaque
        Whether what is inside must let no light through.
    """

    name: str
    parameters: type
    read: Callable[[Any], Any]
    about: str
    sample: Any
    eval_pdf: Any
    albedo: Any
    passes: bool = False
    oriented: bool = False
    normal: Any = None
    opaque: bool = False


@kernel
def _seen_as_it_is(form, front, normal):
    return normal


@kernel
def _from_the_frame(form, arithmetic, frame, wo, sample):
    return to_world(arithmetic, frame, sample.wi)


@kernel
def _always(form, sample):
    return sample.pdf == sample.pdf


@kernel
def _sample(parameters, wo, numbers):
    """Sample as the stages expect it: without the probability of a delta lobe."""
    lobe = sample_lobe(parameters, wo, numbers)
    pdf = select(lobe.delta > 0.0, 1.0 - lobe.delta, lobe.pdf)  # -1 of a hole
    return BsdfSample(lobe.wi, lobe.weight, pdf, lobe.eta)


def make_wrapper_known(wrapper: Wrapper) -> None:
    """Let stages and other wrappers find the kernels of a wrapper."""
    cls = wrapper.parameters
    load, count = make_loader(cls)
    parameters_from.by(cls)(load)
    rows_of.by(cls)(count)
    sample_lobe.by(cls)(wrapper.sample)
    eval_pdf_lobes.by(cls)(wrapper.eval_pdf)
    sample_bsdf.by(cls)(_sample)
    eval_pdf_bsdf.by(cls)(wrapper.eval_pdf)
    nested_albedo.by(cls)(wrapper.albedo)
    seen_albedo_of.by(cls)(wrapper.albedo)
    if wrapper.normal is not None:
        normal_of.by(cls)(wrapper.normal)
    visible_side.by(cls)(_seen_as_it_is)
    outgoing.by(cls)(_from_the_frame)
    is_possible.by(cls)(_always)
