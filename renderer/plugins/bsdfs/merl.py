"""Measured isotropic BSDF: a table of the MERL database by half and difference angles.

Two sampling strategies are combined: by the cosine, and by a half vector whose angle to the
normal follows the table. The table is interpolated linearly in its own coordinates.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    floor,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
    to_i32,
)
from renderer.kernels.lanes.mathematics import arccos, arctan2, sincos
from renderer.kernels.lanes.vectors import dot, normalize, select3, vec3
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    Float,
    albedo_at_normal_incidence,
)
from renderer.plugins.bsdfs.merl_file import read_merl
from renderer.plugins.bsdfs.mirror import reflect
from renderer.plugins.bsdfs.parameters import Table, entry_of
from renderer.plugins.sampling.numbers_and_warps import INV_PI, cosine_direction
from renderer.scene_file.description import OtherBsdf

_HALF_PI = np.float32(np.pi / 2)
_PI = np.float32(np.pi)
_TWO_PI = np.float32(2 * np.pi)
_QUARTER_PI_INVERSE = np.float32(0.25 / np.pi)
_BISECTIONS = 12  # enough to find one of 4096 cells


class Merl(NamedTuple):
    """Its parameters."""

    theta_h: Float  # number of cells; likewise the next two
    theta_d: Float
    phi_d: Float
    share_of_cosine: Float
    f: Table  # [1/sr], all cells for red, then green, then blue
    cumulated: Table  # theta_h + 1 numbers: cumulative probability of theta_h cells


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file: a `filename` with the measurements."""
    expected = "the path of a .binary file (MERL)"
    table = properties.file("the measurements", expected, read_merl)
    counts = [float(n) for n in table.f.shape[1:]]
    shares = np.concatenate(([0.0], np.cumsum(table.share_of_half_vectors)))
    return OtherBsdf(
        "merl",
        {
            **dict(zip(("theta_h", "theta_d", "phi_d"), counts, strict=True)),
            "share_of_cosine": table.share_of_cosine,
            "f": table.f.ravel(),
            "cumulated": shares.astype(np.float32),
        },
    )


@kernel
def _cell(table, half, difference, turn):
    """Return f of cells by their indices."""
    cells = table.theta_h * table.theta_d * table.phi_d
    cell = (half * table.theta_d + difference) * table.phi_d + turn  # exact below 2^24
    return vec3(
        entry_of(table.f, to_i32(cell)),
        entry_of(table.f, to_i32(cell + cells)),
        entry_of(table.f, to_i32(cell + 2.0 * cells)),
    )


@kernel
def _between(position, count):
    """Return the cell whose centre precedes a position, and the offset behind it."""
    before = maximum(minimum(floor(position), count - 2.0), 0.0)
    return before, maximum(minimum(position - before, 1.0), 0.0)


@kernel
def _over_turns(table, half, difference, before, after, t):
    """Interpolate along phi_d."""
    a = _cell(table, half, difference, before)
    return a + (_cell(table, half, difference, after) - a) * t


@kernel
def _over_differences(table, half, difference, t, before, after, t_turn):
    """Interpolate along theta_d."""
    a = _over_turns(table, half, difference, before, after, t_turn)
    b = _over_turns(table, half, difference + 1.0, before, after, t_turn)
    return a + (b - a) * t


@kernel
def _half_angle(h):
    """Return theta_h in the table's spacing: 0 at the normal, 1 at the horizon."""
    theta = arctan2(sqrt(h.x * h.x + h.y * h.y), h.z)  # acos is inaccurate at the highlight
    return sqrt(theta / _HALF_PI)


@kernel
def _look_up(table, h, wi):
    """Return f, interpolated between the centres of cells."""
    spaced = _half_angle(h)
    half, t_half = _between(spaced * table.theta_h - 0.5, table.theta_h)

    # wi relative to the half vector: rotated by -phi_h about z, by -theta_h about y
    sine = sqrt(h.x * h.x + h.y * h.y)
    at_pole = sine == 0.0
    c = select(at_pole, 1.0, h.x / sine)
    s = select(at_pole, 0.0, h.y / sine)
    turned_x = wi.x * c + wi.y * s
    x = turned_x * h.z - wi.z * sine
    y = wi.y * c - wi.x * s
    theta = arccos(dot(wi, h))
    difference, t_difference = _between(
        theta / _HALF_PI * table.theta_d - 0.5, table.theta_d
    )

    # by reciprocity phi_d is periodic in pi
    turned = arctan2(y, x) * INV_PI
    position = select(turned < 0.0, turned + 1.0, turned) * table.phi_d - 0.5
    turn = floor(position)
    t_turn = position - turn
    before = select(turn < 0.0, turn + table.phi_d, turn)
    after = select(turn + 1.0 >= table.phi_d, 0.0, turn + 1.0)

    a = _over_differences(table, half, difference, t_difference, before, after, t_turn)
    b = _over_differences(
        table, half + 1.0, difference, t_difference, before, after, t_turn
    )
    return a + (b - a) * t_half


@kernel
def _squared_sine_of_half(table, cell):
    """Return sin^2(theta_h / 2) where a cell begins: uniform in solid angle."""
    edge = cell / table.theta_h
    sine, _ = sincos(edge * edge * (0.5 * _HALF_PI))
    return sine * sine


@kernel
def _cumulated(table, cell):
    """Return the cumulative probability of all theta_h cells below one."""
    return entry_of(table.cumulated, to_i32(cell))


@kernel
def _half_vector_pdf(table, h):
    """Return the pdf of half vectors per solid angle."""
    cell = floor(minimum(_half_angle(h) * table.theta_h, table.theta_h - 1.0))
    share = _cumulated(table, cell + 1.0) - _cumulated(table, cell)
    begin = _squared_sine_of_half(table, cell)
    end = _squared_sine_of_half(table, cell + 1.0)
    return share * _QUARTER_PI_INVERSE / (end - begin)


@kernel
def _sample_half_vector(table, x, y):
    """Sample a half vector: a cell of theta_h by bisection, uniform within the cell."""
    low, high = x * 0.0, table.theta_h
    for _ in range(_BISECTIONS):
        middle = floor(0.5 * (low + high))
        below = _cumulated(table, middle) <= x
        low, high = select(below, middle, low), select(below, high, middle)
    begin = _cumulated(table, low)
    rest = (x - begin) / (_cumulated(table, low + 1.0) - begin)
    near = _squared_sine_of_half(table, low)
    far = _squared_sine_of_half(table, low + 1.0)
    square = near + (far - near) * minimum(rest, 1.0)
    sine = 2.0 * sqrt(square * (1.0 - square))
    sin_phi, cos_phi = sincos(_TWO_PI * y)
    return vec3(sine * cos_phi, sine * sin_phi, 1.0 - 2.0 * square)


@kernel
def eval_pdf(table, wo, wi):
    """Return f cos and the pdf [1/sr]."""
    h = normalize(wo + wi)
    possible = (wi.z > 0.0) & (wo.z > 0.0)
    cos_i = select(possible, wi.z, 0.0)
    by_half = _half_vector_pdf(table, h) / (4.0 * dot(wo, h))
    by_cosine = INV_PI * cos_i
    pdf = by_half + (by_cosine - by_half) * table.share_of_cosine
    f_cos = _look_up(table, h, wi) * cos_i
    none = splat_f32(0.0)  # f_cos is NaN where wi is -wo, as behind a hole
    return select3(possible, f_cos, vec3(none, none, none)), select(possible, pdf, 0.0)


@kernel
def sample(table, wo, numbers):
    """Sample a direction by its cosine or by a half vector."""
    h = _sample_half_vector(table, numbers.x, numbers.y)
    diffuse = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)
    wi = select3(numbers.choice < table.share_of_cosine, diffuse, reflect(wo, h))
    f_cos, pdf = eval_pdf(table, wo, wi)
    some = pdf > 0.0
    return BsdfSample(wi, f_cos / select(some, pdf, 1.0), pdf, splat_f32(1.0))


MERL = BsdfKind(
    "merl",
    Merl,
    read,
    "measured (MERL)",
    sample,
    eval_pdf,
    albedo=albedo_at_normal_incidence,
)
