"""What a kind of BSDF consists of: parameters, kernels, and their interfaces.

Kernels work in the local frame of a surface point: z is the shading normal, wo and wi point
away from the surface. For a kind that only reflects, wo.z >= 0 (on a two-sided surface the
frame is flipped); for one that transmits, wo.z < 0 inside.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import select, splat_f32, splat_i32
from renderer.kernels.lanes.vectors import select3, vec3
from renderer.plugins.bsdfs.parameters import (
    ROWS,
    Derivatives,
    Nested,
    Table,
    hints_of,
)
from renderer.plugins.bsdfs.parameters import Color as Color
from renderer.plugins.bsdfs.parameters import Float as Float
from renderer.plugins.sampling.numbers_and_warps import cosine_direction as cosine_direction

_PI = np.float32(np.pi)

# kind of lobe that a direction was sampled from
SMOOTH = np.int32(0)  # diffuse and glossy
DELTA = np.int32(1)  # specular reflection or refraction: light samples never match it
STRAIGHT = np.int32(2)  # a delta lobe in the direction -wo, as through a hole


class Numbers(NamedTuple):
    """Random numbers in [0, 1) for one BSDF sample."""

    x: Any  # x and y are a pair, stratified jointly over the samples of a pixel
    y: Any
    choice: Any  # selects the lobe
    arithmetic: Any  # see `renderer.plugins.sampling.numbers_and_warps`


class BsdfSample(NamedTuple):
    """A BSDF sample for 16 surface points."""

    wi: Any  # unit, local
    weight: Any  # f cos / pdf; for a delta lobe f / its probability; 0: the path ends
    pdf: Any  # [1/sr]; for a delta lobe its probability; 0: the path ends
    eta: Any  # relative index of refraction of the crossing; 1: reflected
    lobe: Any = None  # `SMOOTH`, `DELTA` or `STRAIGHT`; None if all are smooth


class Branch(NamedTuple):
    """A delta lobe in the form of version 1 (`old_delta_lobes`)."""

    weight: Any  # RGB
    share: Any  # its fraction of the radiance, by Fresnel
    cos_t: Any  # z of the new direction: wo.z for reflection, of opposite sign otherwise
    eta: Any


class BsdfMethods(NamedTuple):
    """Record that is passed to the kernels of one kind."""

    form: Any  # of the kind's class: None for values per point, arrays for tables
    arithmetic: Any
    both_sides: Any = None  # None: the frame is flipped so that wo.z is never negative
    in_plane: Any = None  # not None: see `BsdfKind.in_plane`


@dataclass(frozen=True)
class BsdfKind:
    """One kind of BSDF, or one that contains nested BSDFs.

    Parameters
    ----------
    name
        Name of the plugin in scene files.
    parameters
        A NamedTuple class. Its fields are annotated with the classes of
        `renderer.plugins.bsdfs.parameters` and have the names of the description's
        properties.
    read
        Function of the properties of a file that returns the description.
    about
        A few words for `--explain`.
    sample
        (parameters, wo, numbers) -> BsdfSample.
    eval_pdf
        (parameters, wo, wi) -> f |cos|, pdf of the smooth lobes. None if it has none.
    albedo
        parameters, or (parameters, wo) -> RGB for the AOV `albedo`. None: black.
    normal
        (parameters, wo) -> local normal for the AOV `sh_normal`. None: z.
    delta
        Whether it has delta lobes.
    transmits
        Whether it transmits light; then the same BSDF is on the back of a surface.
    straight
        Whether it transmits light in the direction -wo (a delta lobe).
    eval_straight
        (parameters, wo) -> RGB transmittance of shadow rays in media. None: black, as
        `eval_null_transmission` of the same plugin in Mitsuba.
    oriented
        Whether it depends on x and y of the local frame: x is then along dp/du.
    opaque
        Whether nested BSDFs must not transmit light.
    source
        Module and hash of the file with the kernels; empty for the renderer's own
        kinds.
    variants
        Kinds that `read` may return in its place; they are not plugins themselves.
    reaches_all
        BSDF of the description -> whether `sample` covers all directions where
        `eval_pdf` is not 0, without neglecting a lobe. None: true for all of the kind.
    inside
        Kinds of the nested BSDFs: the parameters annotated `Nested`.
    users_kernels
        Kernels that a user has registered, by name; empty for the renderer's own kinds.
    """

    name: str
    parameters: type
    read: Callable[[Any], Any]
    about: str
    sample: Any
    eval_pdf: Any = None
    albedo: Any = None
    normal: Any = None
    delta: bool = False
    transmits: bool = False
    straight: bool = False
    oriented: bool = False
    opaque: bool = False
    source: str = ""
    variants: tuple[BsdfKind, ...] = ()
    reaches_all: Callable[[Any], bool] | None = None
    inside: tuple[BsdfKind, ...] = ()
    users_kernels: tuple[tuple[str, Any], ...] = ()
    eval_straight: Any = None

    @property
    def smooth(self) -> bool:
        """Whether it has smooth lobes: light samples are taken."""
        return self.eval_pdf is not None

    @property
    def seen_albedo(self) -> bool:
        """Whether the albedo depends on wo."""
        return self.albedo is not None and self.albedo.py_func.__code__.co_argcount == 2

    @property
    def chooses(self) -> bool:
        """Whether one of several delta lobes is selected at random."""
        return self.delta and (self.smooth or self.transmits or bool(self.inside))

    @property
    def in_plane(self) -> bool:
        """Whether all lobes are specular reflection, refraction or straight transmission.

        Such a direction is in the plane of wo and the normal; its x and y are those of wo
        times a factor. So no tangents are needed: computing them made pictures with mirrors
        or glass take 1.04 to 1.12 times as long.
        """
        return self.delta and not (self.smooth or self.inside or self.source)

    @property
    def both_sides(self) -> bool:
        """Whether the kernels handle both signs of wo.z."""
        return self.transmits or bool(self.inside)

    @property
    def leaves(self) -> tuple[BsdfKind, ...]:
        """The innermost kinds: those without nested BSDFs."""
        return tuple(k for one in self.inside for k in one.leaves) or (self,)

    @property
    def nested_fields(self) -> tuple[str, ...]:
        """The names of the parameters that are BSDFs."""
        hints = hints_of(self.parameters).items()
        return tuple(name for name, annotation in hints if annotation is Nested)

    def _fields(self) -> list[tuple[str, int, Any]]:
        """Return (name, first row, annotation) of all parameters; nested: "child.name"."""
        fields, at, inside = [], 0, iter(self.inside)
        for name, annotation in hints_of(self.parameters).items():
            if annotation is Nested:
                kind = next(inside)
                fields += [(f"{name}.{n}", at + row, a) for n, row, a in kind._fields()]
                at += kind.row_count
            else:
                fields.append((name, at, annotation))
                at += ROWS[annotation]
        return fields

    def layout(self) -> list[tuple[str, int, int]]:
        """Return (name, first row, rows) of the parameters with values per point."""
        return [
            (name, first, ROWS[annotation])
            for name, first, annotation in self._fields()
            if ROWS[annotation] and annotation is not Derivatives
        ]

    @property
    def tables(self) -> list[str]:
        """The names of the parameters that are tables."""
        return [name for name, _, annotation in self._fields() if annotation is Table]

    @property
    def derived(self) -> list[int]:
        """The first rows of parameters that come from the surface point."""
        return [first for _, first, what in self._fields() if what is Derivatives]

    @property
    def row_count(self) -> int:
        """Rows of all parameters."""
        own = hints_of(self.parameters).values()
        rows = sum(ROWS[annotation] for annotation in own if annotation is not Nested)
        return rows + sum(kind.row_count for kind in self.inside)

    def form(self, tables: dict[str, Any] | None = None, start: str = "") -> Any:
        """Return the kind's record: arrays for its tables, None for values per point.

        Parameters
        ----------
        tables
            By the names of `tables` that begin with `start`.
        """
        inside = iter(self.inside)
        return self.parameters(
            *(
                next(inside).form(tables, f"{start}{name}.")
                if annotation is Nested
                else (tables or {}).get(start + name)
                for name, annotation in hints_of(self.parameters).items()
            )
        )


@functools.cache
def around(kind: BsdfKind, inside: tuple[BsdfKind, ...]) -> BsdfKind:
    """Return a wrapper with its nested kinds as one kind, treated like any other."""
    return replace(
        kind,
        name=f"{kind.name}({', '.join(one.name for one in inside)})",
        eval_pdf=kind.eval_pdf if any(one.smooth for one in inside) else None,
        albedo=kind.albedo if any(one.albedo is not None for one in inside) else None,
        delta=kind.delta or any(one.delta for one in inside),
        transmits=kind.transmits or any(one.transmits for one in inside),
        straight=kind.straight or any(one.straight for one in inside),
        oriented=kind.oriented or any(one.oriented for one in inside),
        source=" ".join(sorted({k.source for one in inside for k in one.leaves} - {""})),
        inside=inside,
    )


# ------------------------------------------------ interfaces that stages call for BSDFs


@interface
def sample_bsdf(parameters: Any, wo: Any, numbers: Numbers) -> BsdfSample:
    """Sample the direction wi."""


@interface
def eval_pdf_bsdf(parameters: Any, wo: Any, wi: Any) -> Any:
    """Return f |cos| and the pdf [1/sr] of `sample_bsdf`, for smooth lobes."""


@interface
def albedo_of(parameters: Any, wo: Any) -> Any:
    """Return the colour for the AOV `albedo`; black if the kind has none."""


@interface
def straight_through(parameters: Any, wo: Any) -> Any:
    """Return the RGB transmittance of shadow rays in media."""


@interface
def normal_of(parameters: Any, wo: Any) -> Any:
    """Return the local normal for the AOV `sh_normal`, if it is not z."""


def lobe_of(sample: BsdfSample) -> Any:
    """Return the lobe of a sample; `SMOOTH` if it is None."""
    raise TypeError("lobe_of can be called inside kernels only")


@overload(lobe_of)
def _lobe_of(sample):
    if len(sample.types) == len(BsdfSample._fields):
        return lambda sample: sample.lobe
    return lambda sample: splat_i32(SMOOTH)


# ------------------------------------------- interfaces that BSDFs call for nested BSDFs


@interface
def sample_nested(parameters: Any, wo: Any, numbers: Any) -> BsdfSample:
    """Sample a direction, for any sign of wo.z; the sample has its lobe."""


@interface
def eval_pdf_nested(parameters: Any, wo: Any, wi: Any) -> Any:
    """Return f |cos| and the pdf of smooth lobes, for any signs of wo.z and wi.z."""


@kernel
def black():
    """Return black."""
    none = splat_f32(0.0)
    return vec3(none, none, none)


@kernel
def albedo_at_normal_incidence(parameters, wo):
    """Return pi f |cos| of light along the normal, Mitsuba's default for the albedo."""
    none = splat_f32(0.0)
    f_cos, _ = eval_pdf_bsdf(parameters, wo, vec3(none, none, none + 1.0))
    return _PI * f_cos


@kernel
def _sample(parameters, wo, numbers):
    s = sample_bsdf(parameters, wo, numbers)
    weight = select3(s.pdf > 0.0, s.weight, black())
    return BsdfSample(s.wi, weight, s.pdf, s.eta, lobe_of(s))


@kernel
def _sample_in_front(parameters, wo, numbers):
    """Sample a BSDF that does not transmit; it is black for wo.z <= 0."""
    s, front = sample_bsdf(parameters, wo, numbers), wo.z > 0.0
    return BsdfSample(
        select3(front, s.wi, black()),
        select3(front & (s.pdf > 0.0), s.weight, black()),
        select(front, s.pdf, 0.0),
        s.eta,
        lobe_of(s),
    )


@kernel
def _eval_pdf_in_front(parameters, wo, wi):
    f_cos, pdf = eval_pdf_bsdf(parameters, wo, wi)
    front = wo.z > 0.0
    return select3(front, f_cos, black()), select(front, pdf, 0.0)


@kernel
def _no_smooth_lobes(parameters, wo, wi):
    return black(), splat_f32(0.0)


@interface
def _albedo_from_anywhere(parameters: Any) -> Any:
    """Return the albedo of a kind whose albedo does not depend on wo."""


@kernel
def _albedo(parameters, wo):
    return _albedo_from_anywhere(parameters)


@kernel
def _no_albedo(parameters, wo):
    return black()


@kernel
def _nothing_straight(parameters, wo):
    return black()


def register_kernels(kind: BsdfKind) -> None:
    """Register the kernels of a kind with the interfaces."""
    cls, wrapper = kind.parameters, bool(kind.nested_fields)
    sample_bsdf.by(cls)(kind.sample)
    eval_pdf = kind.eval_pdf
    if eval_pdf is not None:
        eval_pdf_bsdf.by(cls)(eval_pdf)
    if wrapper or kind.transmits:
        sample_nested.by(cls)(kind.sample if wrapper else _sample)
        eval_pdf_nested.by(cls)(eval_pdf or _no_smooth_lobes)
    else:
        sample_nested.by(cls)(_sample_in_front)
        eval_pdf_nested.by(cls)(_eval_pdf_in_front if eval_pdf else _no_smooth_lobes)
    if kind.albedo is None or kind.seen_albedo:
        albedo_of.by(cls)(kind.albedo or _no_albedo)
    else:
        albedo_of.by(cls)(_albedo)
        _albedo_from_anywhere.by(cls)(kind.albedo)
    straight_through.by(cls)(kind.eval_straight or _nothing_straight)
    if kind.normal is not None:
        normal_of.by(cls)(kind.normal)
