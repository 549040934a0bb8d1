"""Random numbers of a sample, and warps of the unit square."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import Packed, interface, kernel
from renderer.kernels.lanes.functions import (
    as_i32,
    as_u32,
    fabs,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_mask,
    splat_u32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.mathematics import sincos
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import (
    cross,
    dot,
    length,
    load3,
    normalize,
    orthonormal_basis,
    select3,
    vec3,
)

# ------------------------------------------------------------------------------- source
# The interface of a source of random numbers to the stages.


@dataclass(frozen=True)
class Sampling:
    """A source of random numbers, as methods of a record."""

    record: Packed
    film: Any  # kernel of `stages.camera_rays`, or another one with the same parameters
    draw: Any
    choose_light: Any
    aperture: Any
    by_pair: bool = False  # the first number of a draw is better stratified than the fourth
    begin_bounce: Any = None  # None: numbers may be drawn in any order


# --------------------------------------------------------------------------- arithmetic
# Interfaces of operations on directions and pdfs whose rounding can be replaced.
#
# A normal render uses the formulas of `Plain`. A replay, which must agree with Mitsuba to
# the last bit, passes another record to the kernels and implements the interfaces for it.


class Plain(NamedTuple):
    """The normal formulas."""


class AlongU(NamedTuple):
    """`Plain`, but with the x axis of the local frame along dp/du, for anisotropy."""


class FromLastEvent(NamedTuple):
    """`Plain`, but pdfs of lights are relative to the last scattering event.

    Used if rays may pass surfaces straight through before they hit a light.
    """


def along_u(arithmetic: Any) -> Any:
    """Return the arithmetic for anisotropic BSDFs."""
    return AlongU() if isinstance(arithmetic, Plain) else arithmetic


class Frame(NamedTuple):
    """Local frame of a surface point: unit vectors; n is the normal."""

    s: Any
    t: Any
    n: Any


@interface
def cosine_direction(arithmetic: Any, x: Any, y: Any) -> Any:
    """Map [0, 1)^2 to unit vectors around +z with pdf cos / pi."""


@interface
def to_world(arithmetic: Any, frame: Frame, local: Any) -> Any:
    """Return the world space direction with local coordinates `local` in a frame."""


@interface
def tangents_of(arithmetic: Any, points: Any, i: int, normal: Any) -> Any:
    """Return two unit tangents for the shading normals of points i to i + 15.

    They do not depend on the side that is seen.
    """


@interface
def density_normal(arithmetic: Any, flat: Any, smooth: Any) -> Any:
    """Return the normal for converting a pdf by area to one by solid angle.

    Selected from the geometric normal and the interpolated vertex normal.
    """


@interface
def seen_from(arithmetic: Any, points: Any, i: int) -> Any:
    """Return the previous path vertex, the distance to it, and the |cosine| here.

    In a replay the cosine is infinite if the previous vertex is behind the surface.
    """


@kernel
def to_local(frame, direction):
    """Return the local coordinates of a direction in a frame."""
    return vec3(dot(direction, frame.s), dot(direction, frame.t), dot(direction, frame.n))


@cosine_direction.by(Plain, AlongU)
@kernel
def _cosine_direction(arithmetic, x, y):
    return square_to_cosine_hemisphere(x, y)


@to_world.by(Plain, AlongU)
@kernel
def _to_world(arithmetic, frame, local):
    return frame.s * local.x + frame.t * local.y + frame.n * local.z


@tangents_of.by(Plain)
@kernel
def _tangents_of(arithmetic, points, i, normal):
    return orthonormal_basis(normal)


@tangents_of.by(AlongU)
@kernel
def _tangents_along_u(arithmetic, points, i, normal):
    along_u = load3(points.tangent, i)
    across = along_u - normal * dot(normal, along_u)
    nowhere = ~(dot(across, across) > 0.0)  # at a pole, or where dp/du is 0
    s, t = orthonormal_basis(normal)
    across = normalize(select3(nowhere, s, across))
    return across, select3(nowhere, t, cross(normal, across))


@density_normal.by(Plain, FromLastEvent)
@kernel
def _density_normal(arithmetic, flat, smooth):
    """Return the normal of the surface whose area counts."""
    return flat


@seen_from.by(Plain)
@kernel
def _seen_from(arithmetic, points, i):
    """Return the origin of the ray: exact except for the offset."""
    wo, t = load3(points.wo, i), load_row(points.t, 0, i)
    here = load3(points.position, i)
    return here + wo * t, t, fabs(dot(wo, load3(points.normal, i)))


@seen_from.by(FromLastEvent)
@kernel
def _seen_from_event(arithmetic, points, i):
    previous = load3(points.previous, i)
    distance = length(previous - load3(points.position, i))
    return previous, distance, fabs(dot(load3(points.wo, i), load3(points.normal, i)))


# -------------------------------------------------------------------- numbers and warps
# Random numbers, and the warps from the unit square to directions and surfaces.
#
# A random number is a hash of pixel, sample, dimension and seed [Jarzynski2020, pcg4d].
# It needs no state, so an image does not depend on threads, tiles or batches.

TWO_PI = np.float32(2.0 * np.pi)
INV_PI = np.float32(1.0 / np.pi)
_QUARTER_PI = np.float32(np.pi / 4.0)
_HALF_PI = np.float32(np.pi / 2.0)
_TO_UNIT = np.float32(2.0**-24)
_BELOW_ONE = np.float32(1.0 - 2.0**-24)

# Numbers are drawn in blocks of four. Block 0 is the film; then each bounce has a stride of
# blocks. In a bounce, block 0 is for the BSDF, the following ones for the lights (4 per
# point in fog near lights), and those from `ON_THE_WAY` on for events along the ray: media,
# panes. The lens uses the block before the first one of the second bounce.
FILM_BLOCK = 0
BLOCKS_PER_BOUNCE = 1 << 20
ON_THE_WAY = BLOCKS_PER_BOUNCE // 2
APERTURE_BLOCK = BLOCKS_PER_BOUNCE
# A selection by the first number of a pair uses log2(count) of its 24 bits. For 4096 items
# 4096 values remain for each, with mean 0.4999. Larger selections use a separate number.
MOST_BY_PAIR = 4096


class Independent(NamedTuple):
    """Independent random numbers."""

    seed: int


class Stratified(NamedTuple):
    """Stratified sampling: each pair is once in each cell of a grid, in shuffled order."""

    seed: int
    columns: int  # cells in x
    rows: int  # cells in y
    jitter: float  # 1: uniform in the cell, 0: its centre
    multi: int | None  # not None: also once in each of columns * rows parts of either axis


@kernel
def hash4(a, b, c, d):
    """Hash four u32 lanes to four that look independent [Jarzynski2020, pcg4d]."""
    a = a * 1664525 + 1013904223
    b = b * 1664525 + 1013904223
    c = c * 1664525 + 1013904223
    d = d * 1664525 + 1013904223
    a += b * d
    b += c * a
    c += a * b
    d += b * c
    a ^= a >> 16
    b ^= b >> 16
    c ^= c >> 16
    d ^= d >> 16
    a += b * d
    b += c * a
    c += a * b
    d += b * c
    return a, b, c, d


@kernel
def unit_float(bits):
    """Return lanes in [0, 1) from the upper 24 of 32 random bits."""
    return to_f32(bits >> 8) * _TO_UNIT


@kernel
def _block_bits(block):
    """Return 32 bits for a block, which also differ for bounces 4096 apart.

    The hash is weak if only the highest bit differs (bounces 2048 apart, for strata 1024):
    the first numbers of two such blocks have a correlation of 0.04.
    """
    return splat_u32(np.uint32(block + (block >> 32) * 0x9E3779B1))


@kernel
def hash_floats(seed, key, sample, block):
    """Return four lanes of independent numbers in [0, 1)."""
    a, b, c, d = hash4(
        key.pixel,
        key.later + np.uint32(sample),
        _block_bits(block),
        splat_u32(np.uint32(seed)),
    )
    return unit_float(a), unit_float(b), unit_float(c), unit_float(d)


@kernel
def _in_unit(x):
    """Return x, or the largest number below 1 where a sum was rounded to 1."""
    return minimum(x, splat_f32(_BELOW_ONE))


@interface
def draw4(sampler: Any, key: Any, sample: int, block: int) -> Any:
    """Draw four numbers in [0, 1) for each of the 16 samples of a `SampleKey`.

    `sample` is the number of the first of the samples that are traced together.

    The first two numbers are a pair, stratified jointly over the samples of a pixel. The
    third and the fourth are stratified separately.
    """


@interface
def draw4_twice(
    sampler: Any, key: Any, other: Any, sample: int, block: int
) -> tuple[Any, Any]:
    """Draw as `draw4` does, for 16 samples and for 16 other ones."""


@draw4.by(Independent)
@kernel
def _draw_independent(sampler, key, sample, block):
    return hash_floats(sampler.seed, key, sample, block)


@kernel
def permute(index, size, key):
    """Return the image of `index` under random permutations of 0 .. size - 1, per lane.

    Xor, odd multiplication and shifts are invertible modulo a power of two. A result that
    is out of range is permuted again (cycle walking), so it remains a permutation. Alone
    this favours some places, which would bias an estimate. A random rotation at the end
    makes every place equally likely for every index.
    """
    bits = 1
    while (1 << bits) < size:
        bits += 1
    mask = np.uint32((1 << bits) - 1)
    half = np.uint32((bits + 1) // 2)
    x = index
    inside = splat_mask(False)
    while mask_bits(inside) != 0xFFFF:
        y = (x ^ key) & mask
        y = (y * ((key >> 8) | 1)) & mask
        y ^= y >> half
        y = (y + (key >> 15)) & mask
        y = (y * 0x2C1B3C6D) & mask
        y ^= y >> half
        y = (y ^ (key >> 4)) & mask
        y = (y * 0x297A2D39) & mask
        y ^= y >> half
        x = select(inside, x, y)
        inside = x < np.uint32(size)
    turn = key * 0x9E3779B1
    turn = (turn ^ (turn >> 15)) * 0x85EBCA77
    turn = as_u32(to_i32(unit_float(turn ^ (turn >> 13)) * np.float32(size)))
    turned = x + turn
    return select(turned < np.uint32(size), turned, turned - np.uint32(size))


@kernel
def _inside_cell(multi, column, row, columns, rows, keys, jx, jy):
    """Return the position inside a cell, in [0, 1) along each axis.

    Plain strata use the jitter. Correlated multi-jittering [Kensler2013] divides the cell
    again, with one part for each other cell of its column or row. The order is the same in
    all columns (rows), so neighbouring cells form a lattice. With a separate order for
    each, the variance at edges is 1.2 to 1.5 times as large.
    """
    if multi is None:
        return jx, jy
    k0, k1, k2, k3 = keys
    kx, ky, _, _ = hash4(k0, k1, k2, k3)
    part_x = to_f32(permute(as_u32(row), rows, kx))
    part_y = to_f32(permute(as_u32(column), columns, ky))
    return (
        (part_x + jx) * np.float32(1.0 / rows),
        (part_y + jy) * np.float32(1.0 / columns),
    )


@draw4.by(Stratified)
@kernel
def _draw_stratified(sampler, key, sample, block):
    columns, rows = sampler.columns, sampler.rows
    count = columns * rows
    # samples that are traced together are in one grid: their number divides its cells
    index = key.later + np.uint32(sample % count)
    # for the jitter and the shuffles; samples beyond one grid start a new, independent one
    grid = sample // count
    jx, jy, jz, jw = hash_floats(sampler.seed, key, sample, 2 * block)
    amount = np.float32(sampler.jitter)
    jx = (jx - 0.5) * amount + 0.5
    jy = (jy - 0.5) * amount + 0.5
    if count == 1:  # nothing to shuffle
        return _in_unit(jx), _in_unit(jy), jz, jw
    keys = hash4(
        key.pixel,
        splat_u32(np.uint32(grid)),
        _block_bits(2 * block + 1),
        splat_u32(np.uint32(sampler.seed)),
    )
    cell = as_i32(permute(index, count, keys[0]))
    row = to_i32((to_f32(cell) + 0.5) * np.float32(1.0 / columns))
    # the quotient has a rounding error of one for cells beyond 2^22 in float32
    column = cell - row * columns
    row = select(column < 0, row - 1, select(column >= columns, row + 1, row))
    column = cell - row * columns
    x, y = _inside_cell(sampler.multi, column, row, columns, rows, keys, jx, jy)
    one = np.float32(1.0 / count)
    return (
        _in_unit((to_f32(column) + x) * np.float32(1.0 / columns)),
        _in_unit((to_f32(row) + y) * np.float32(1.0 / rows)),
        _in_unit((to_f32(permute(index, count, keys[1])) + jz) * one),
        _in_unit((to_f32(permute(index, count, keys[2])) + jw) * one),
    )


@draw4_twice.by(Independent, Stratified)
@kernel
def _draw_after_another(sampler, key, other, sample, block):
    return draw4(sampler, key, sample, block), draw4(sampler, other, sample, block)


@interface
def choose_from_draw(sampler: Any, x: Any, w: Any, count: int) -> Any:
    """Select one of `count` items by the first or fourth number of a draw.

    Returns
    -------
    chosen, x
        `x` is the rescaled first number. With stratified pairs the first number selects,
        unless there are too many items: the samples of each item are then stratified like
        all samples, and are no random subset.
    """


@kernel
def choose_one(number, count):
    """Return one of `count` items, uniformly, and the rescaled number."""
    scaled = number * np.float32(count)
    chosen = to_i32(minimum(scaled, splat_f32(np.float32(count - 1))))
    return chosen, scaled - to_f32(chosen)


@choose_from_draw.by(Independent)
@kernel
def _choose_by_last(sampler, x, w, count):
    chosen, _ = choose_one(w, count)
    return chosen, x


@kernel
def choose_by_pair(sampler, x, w, count):
    """Select by the first number of a pair, if enough of its bits remain."""
    if count > MOST_BY_PAIR:
        return _choose_by_last(sampler, x, w, count)
    chosen, rest = choose_one(x, count)
    return chosen, _in_unit(rest)


@kernel
def _choose_if(multi, sampler, x, w, count):
    if multi is None:
        return _choose_by_last(sampler, x, w, count)
    return choose_by_pair(sampler, x, w, count)


@choose_from_draw.by(Stratified)
@kernel
def _choose_stratified(sampler, x, w, count):
    return _choose_if(sampler.multi, sampler, x, w, count)


@kernel
def square_to_disk(x, y):
    """Map [0, 1)^2 to the unit disk; area-preserving and continuous [Shirley1997]."""
    a = 2.0 * x - 1.0
    b = 2.0 * y - 1.0
    steep = fabs(a) < fabs(b)
    radius = select(steep, b, a)
    ratio = select(steep, a, b) / select(radius == 0.0, splat_f32(1.0), radius)
    angle = select(steep, _HALF_PI - _QUARTER_PI * ratio, _QUARTER_PI * ratio)
    sine, cosine = sincos(angle)
    return radius * cosine, radius * sine


@kernel
def square_to_cosine_hemisphere(x, y):
    """Map [0, 1)^2 to unit vectors around +z with pdf cos / pi."""
    p, q = square_to_disk(x, y)
    z2 = 1.0 - (p * p + q * q)  # Mitsuba's order of operations, visible near the rim
    return vec3(p, q, sqrt(maximum(z2, splat_f32(0.0))))


@kernel
def square_to_sphere(x, y):
    """Map [0, 1)^2 to unit vectors with pdf 1 / (4 pi)."""
    z = 1.0 - 2.0 * y
    r = sqrt((1.0 - z) * (1.0 + z))  # 1 - z^2 would cancel at the poles
    sine, cosine = sincos(TWO_PI * x)
    return vec3(r * cosine, r * sine, z)


@kernel
def square_to_triangle(x, y):
    """Map [0, 1)^2 to barycentric coordinates of a triangle, uniformly by area."""
    root = sqrt(maximum(1.0 - x, splat_f32(0.0)))
    return 1.0 - root, root * y


@kernel
def power_heuristic(pdf, other_pdf):
    """Return the power heuristic p^2 / (p^2 + q^2) for two pdfs [Veach1997]."""
    ratio = other_pdf / pdf  # the square of a pdf above 1.8e19 would overflow
    return 1.0 / (1.0 + ratio * ratio)
