"""What a kind of BSDF is: its parameters, its formulas, and how it is made known.

Formulas are written in the local frame of a surface point: z is the shading normal, wo and
wi point away from the surface. A reflecting kind is seen from the side of +z only (on a
two-sided surface the frame is turned); a transmitting one has wo.z < 0 inside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.vectors import dot, select3
from renderer.plugins.bsdfs.mirror import reflect, refract
from renderer.plugins.bsdfs.parameters import (
    ROWS,
    Table,
    hints_of,
    make_loader,
    parameters_from,
    rows_of,
)
from renderer.plugins.bsdfs.parameters import Color as Color
from renderer.plugins.bsdfs.parameters import Float as Float
from renderer.plugins.sampling.arithmetic import cosine_direction as cosine_direction
from renderer.plugins.sampling.arithmetic import to_world


class Numbers(NamedTuple):
    """Random numbers in [0, 1) for one scattering."""

    x: Any  # a pair, spread over the samples of a pixel together
    y: Any
    choice: Any  # for choosing between lobes
    arithmetic: Any  # see `renderer.plugins.sampling.arithmetic`


class BsdfSample(NamedTuple):
    """A direction in which a path goes on, for 16 surface points."""

    wi: Any  # unit, local
    weight: Any  # f cos / pdf, or of a delta lobe f / its probability; 0: the path ends
    pdf: Any  # [1/sr]; 0: a delta lobe; -1: one that goes straight on, as through a hole
    eta: Any  # relative index of refraction that was crossed; 1: reflected


class Branch(NamedTuple):
    """A delta lobe as Whitted's trees follow it."""

    weight: Any  # RGB
    share: Any  # of the radiance, by Fresnel
    cos_t: Any  # z of the new direction: wo.z if it is reflected, of other sign if not
    eta: Any


class BsdfMethods(NamedTuple):
    """The record that the kernels of one kind are given."""

    form: Any  # of the kind's class: None for what each point has, arrays for tables
    arithmetic: Any


@dataclass(frozen=True)
class BsdfKind:
    """One kind of BSDF.

    Parameters
    ----------
    name
        Of the plugin in scene files.
    parameters
        A NamedTuple class; its fields are annotated `Color`, `Float` or `Table` and are
        named as the properties of the description.
    read
        Makes the description from the properties of a file.
    about
        A few words for `--explain`.
    sample
        (parameters, wo, numbers) -> BsdfSample.
    eval_pdf
        (parameters, wo, wi) -> f |cos|, pdf; None: there are delta lobes only.
    reflection, transmission
        (parameters, wo) -> Branch; None: there is no such delta lobe.
    albedo
        parameters -> RGB that the AOV shows, or (parameters, wo) -> RGB; None: black.
    transmits
        Whether light goes through, so that the back of a surface shows the same BSDF.
    source
        Module and hash of the file that holds the kernels; empty for the renderer's own.
    oriented
        Whether x and y of the local frame matter: x is along dp/du then.
    delta_pdf
        (parameters, wo, sample) -> probability of the delta lobe that was chosen, which a
        blend weighs it by; None: as `reflection` and `transmission` say.
    straight
        Whether the transmitted lobe goes straight on.
    variants
        Kinds that `read` may choose in its place; they are no plugins themselves.
    reaches_all
        BSDF of the description -> whether `sample` goes wherever `eval_pdf` is not 0, and
        neglects no lobe; None: so it is for all of the kind.
    """

    name: str
    parameters: type
    read: Callable[[Any], Any]
    about: str
    sample: Any
    eval_pdf: Any = None
    reflection: Any = None
    transmission: Any = None
    albedo: Any = None
    transmits: bool = False
    source: str = ""
    oriented: bool = False
    delta_pdf: Any = None
    straight: bool = False
    variants: tuple[BsdfKind, ...] = ()
    reaches_all: Callable[[Any], bool] | None = None
    normal = None  # the AOV `sh_normal` shows that of the surface

    @property
    def seen_albedo(self) -> bool:
        """Whether the albedo depends on where it is seen from."""
        return self.albedo is not None and self.albedo.py_func.__code__.co_argcount == 2

    @property
    def smooth(self) -> bool:
        """Whether lights are sampled at its points."""
        return self.eval_pdf is not None

    @property
    def delta(self) -> bool:
        """Whether it has lobes of a single direction."""
        return self.reflection is not None or self.transmission is not None

    @property
    def chooses(self) -> bool:
        """Whether a delta lobe is chosen at random."""
        others = self.smooth or self.transmission is not None
        return self.reflection is not None and others

    def form(self, tables: dict[str, Any] | None = None) -> Any:
        """Return the kind's record: arrays of its tables, None for what points have."""
        given = tables or {}
        fields = self.parameters._fields  # type: ignore[attr-defined]
        return self.parameters(*(given.get(name) for name in fields))

    def layout(self) -> list[tuple[str, int, int]]:
        """Return (name, first row, rows) of the parameters that each point has."""
        rows, at = [], 0
        for name, kind in hints_of(self.parameters).items():
            count = ROWS[kind]
            if count:
                rows.append((name, at, count))
            at += count
        return rows

    @property
    def tables(self) -> list[str]:
        """The names of the parameters that are tables."""
        hints = hints_of(self.parameters)
        return [name for name, kind in hints.items() if kind is Table]

    @property
    def row_count(self) -> int:
        """Rows of all parameters."""
        return sum(count for _, _, count in self.layout())


# ------------------------------------------- what the stages ask of every kind of BSDF


@interface
def sample_bsdf(parameters: Any, wo: Any, numbers: Numbers) -> BsdfSample:
    """Choose the direction in which paths go on."""


@interface
def eval_pdf_bsdf(parameters: Any, wo: Any, wi: Any) -> Any:
    """Return f |cos| and the density [1/sr] of `sample_bsdf` for smooth lobes."""


@interface
def reflection_of(parameters: Any, wo: Any) -> Branch:
    """Return the mirrored branch."""


@interface
def transmission_of(parameters: Any, wo: Any) -> Branch:
    """Return the refracted branch."""


@interface
def albedo_of(parameters: Any) -> Any:
    """Return the colour that the AOV `albedo` shows."""


@interface
def seen_albedo_of(parameters: Any, wo: Any) -> Any:
    """Return it for a BSDF whose albedo depends on the direction."""


@interface
def normal_of(parameters: Any, wo: Any) -> Any:
    """Return the local normal that the AOV `sh_normal` shows, where it is not z."""


@interface
def visible_side(form: Any, front: Any, normal: Any) -> Any:
    """Return the z axis of the local frame: turned to where a reflecting BSDF is seen."""


@interface
def outgoing(form: Any, arithmetic: Any, frame: Any, wo: Any, sample: BsdfSample) -> Any:
    """Return a sample's direction in the world; wo is in the world too."""


@interface
def is_possible(form: Any, sample: BsdfSample) -> Any:
    """Return which samples are no failures, as far as the density tells."""


@kernel
def _turned(form, front, normal):
    return select3(front, normal, -normal)


@kernel
def _as_it_is(form, front, normal):
    return normal


@kernel
def _smooth(form, arithmetic, frame, wo, sample):
    return to_world(arithmetic, frame, sample.wi)


@kernel
def _mirrored(form, arithmetic, frame, wo, sample):
    """Go by the normal alone: the way through the local frame would add its rounding."""
    return reflect(wo, frame.n)


@kernel
def _mirrored_or_bent(form, arithmetic, frame, wo, sample):
    same_side = (sample.wi.z > 0.0) ^ ~(dot(wo, frame.n) > 0.0)
    bent = refract(wo, frame.n, sample.wi.z, sample.eta)
    return select3(same_side, reflect(wo, frame.n), bent)


@kernel
def _mirrored_or_straight(form, arithmetic, frame, wo, sample):
    same_side = (sample.wi.z > 0.0) ^ ~(dot(wo, frame.n) > 0.0)
    return select3(same_side, reflect(wo, frame.n), -wo)


@kernel
def _smooth_or_mirrored(form, arithmetic, frame, wo, sample):
    smooth = to_world(arithmetic, frame, sample.wi)
    return select3(sample.pdf > 0.0, smooth, reflect(wo, frame.n))


@kernel
def _any_of_three(form, arithmetic, frame, wo, sample):
    smooth = to_world(arithmetic, frame, sample.wi)
    delta = _mirrored_or_bent(form, arithmetic, frame, wo, sample)
    return select3(sample.pdf > 0.0, smooth, delta)


# (smooth lobes, delta lobes, transmits) -> how a direction is turned into the world
_OUTGOING = {
    (True, False, False): _smooth,
    (True, False, True): _smooth,
    (False, True, False): _mirrored,
    (False, True, True): _mirrored_or_bent,
    (True, True, False): _smooth_or_mirrored,
    (True, True, True): _any_of_three,
}


@kernel
def _by_density(form, sample):
    return sample.pdf > 0.0


@kernel
def _by_weight_alone(form, sample):
    return sample.pdf == sample.pdf


def make_known(kind: BsdfKind) -> None:
    """Let the stages find the kernels of a kind."""
    cls = kind.parameters
    load, count = make_loader(cls)
    parameters_from.by(cls)(load)
    rows_of.by(cls)(count)
    sample_bsdf.by(cls)(kind.sample)
    for function, chosen in (
        (eval_pdf_bsdf, kind.eval_pdf),
        (reflection_of, kind.reflection),
        (transmission_of, kind.transmission),
        (seen_albedo_of if kind.seen_albedo else albedo_of, kind.albedo),
    ):
        if chosen is not None:
            function.by(cls)(chosen)
    visible_side.by(cls)(_as_it_is if kind.transmits else _turned)
    outgoing.by(cls)(
        _mirrored_or_straight
        if kind.straight
        else _OUTGOING[kind.smooth, kind.delta, kind.transmits]
    )
    is_possible.by(cls)(_by_weight_alone if kind.delta else _by_density)
