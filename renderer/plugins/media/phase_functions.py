"""Phase functions: how likely light goes on in each direction, by its turn's cosine.

A medium has a mixture of them. The cosine is that between the direction before and the
direction after; 1 is straight on. Densities are per steradian, and integrate to 1.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    splat_mask,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.mathematics import power
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.records.media import (
    HENYEY_GREENSTEIN,
    RAYLEIGH,
    TABULATED,
)
from renderer.plugins.media.volumes import look_up_grid

_INV_4_PI = np.float32(0.25 / np.pi)
_INV_2_PI = np.float32(0.5 / np.pi)
_RAYLEIGH = np.float32(3.0 / (16.0 * np.pi))
_LEAST = np.float32(1e-20)
_THIRD = np.float32(1.0 / 3.0)


@kernel
def _of_table(media, leaf, cosine):
    """Interpolate linearly between the values of a table."""
    first = media.table_begin[leaf]
    last = media.table_begin[leaf + 1] - first - 1
    place = (cosine + 1.0) * np.float32(0.5 * last)
    bin_ = to_i32(minimum(maximum(place, splat_f32(0.0)), splat_f32(np.float32(last - 1))))
    every = splat_mask(True)
    a = gather_row(media.table, 0, bin_ + first, every)
    b = gather_row(media.table, 0, bin_ + first + 1, every)
    return (a + (b - a) * (place - to_f32(bin_))) * _INV_2_PI


@kernel
def _eval_leaf(media, leaf, cosine):
    kind = media.phase_kind[leaf]
    if kind == HENYEY_GREENSTEIN:
        g = media.phase_g[leaf]
        # 1 + g^2 - 2 g cos as a sum of squares, which does not cancel at the peak
        size, peak = np.float32(abs(g)), np.float32(1.0 if g > 0.0 else -1.0)
        least = np.float32((1.0 - size) * (1.0 - size))
        root = sqrt((1.0 - cosine * peak) * np.float32(2.0 * size) + least)
        return splat_f32(_INV_4_PI * np.float32(1.0 - g * g)) / (root * root * root)
    if kind == RAYLEIGH:
        return (cosine * cosine + 1.0) * _RAYLEIGH
    if kind == TABULATED:
        return _of_table(media, leaf, cosine)
    return splat_f32(_INV_4_PI)


@kernel
def share_at(media, leaf, position, mask):
    """Return the shares, [0, 1], of one phase function of a mixture at 16 positions."""
    share = splat_f32(media.phase_share[leaf])
    for k in range(media.weight_begin[leaf], media.weight_begin[leaf + 1]):
        grid = splat_i32(media.weights[0, k])
        weight = look_up_grid(media.grids, grid, position, mask).x
        weight = minimum(maximum(weight, splat_f32(0.0)), splat_f32(1.0))
        share = share * (weight if media.weights[1, k] == 1 else 1.0 - weight)
    return share


@kernel
def eval_phase(media, medium, position, cosine, mask):
    """Return the densities [1/sr] of turns by 16 cosines at positions in media, by id."""
    density = splat_f32(0.0)
    for k in range(media.count):
        mine = mask & (medium == np.int32(k))
        if mask_bits(mine) == 0:
            continue
        total = splat_f32(0.0)
        for leaf in range(media.phase_begin[k], media.phase_begin[k + 1]):
            share = share_at(media, leaf, position, mine)
            total = total + _eval_leaf(media, leaf, cosine) * share
        density = select(mine, total, density)
    return density


@kernel
def _sample_hg(g, x):
    """Return the cosine, by a formula that does not divide by g [Henyey1941]."""
    s = 2.0 * x - 1.0
    square = s * s
    numerator = s + (square * 0.5 + 1.5) * g + s * np.float32(g * g)
    numerator = numerator + (square - 1.0) * np.float32(0.5 * g * g * g)
    q = s * g + 1.0
    return numerator / (q * q)


@kernel
def _sample_rayleigh(x):
    """Return the root of a cubic, by Cardano's formula [Frisvad2011]."""
    z = 4.0 * x - 2.0
    root = sqrt(z * z + 1.0)
    return power(root + z, splat_f32(_THIRD)) - power(root - z, splat_f32(_THIRD))


@kernel
def _sample_table(media, leaf, x):
    """Return the cosine up to which the integral of a table is x."""
    first = media.table_begin[leaf]
    last = media.table_begin[leaf + 1] - first - 1
    every = splat_mask(True)
    low, high = splat_i32(0), splat_i32(np.int32(last))
    while mask_bits(high - low > 1) != 0:
        middle = (low + high) >> 1
        below = gather_row(media.table, 1, middle + first, every) <= x
        open_ = high - low > 1
        low = select(open_ & below, middle, low)
        high = select(open_ & ~below, middle, high)
    a = gather_row(media.table, 0, low + first, every)
    b = gather_row(media.table, 0, low + first + 1, every)
    rest = (x - gather_row(media.table, 1, low + first, every)) * np.float32(0.5 * last)
    # the root of a y + (b - a) y^2 / 2 = rest in the form that does not cancel
    root = sqrt(maximum(a * a + 2.0 * (b - a) * rest, splat_f32(0.0)))
    y = 2.0 * rest / maximum(a + root, splat_f32(_LEAST))
    return (to_f32(low) + minimum(y, splat_f32(1.0))) * np.float32(2.0 / last) - 1.0


@kernel
def sample_leaf(media, leaf, x):
    """Return cosines of one phase function of a mixture, from numbers in [0, 1)."""
    kind = media.phase_kind[leaf]
    if kind == HENYEY_GREENSTEIN:
        return _sample_hg(media.phase_g[leaf], x)
    if kind == RAYLEIGH:
        return _sample_rayleigh(x)
    if kind == TABULATED:
        return _sample_table(media, leaf, x)
    return 2.0 * x - 1.0


@kernel
def sample_phase(media, medium, position, x, choice, mask):
    """Return 16 cosines with the densities of `eval_phase`, from two numbers in [0, 1)."""
    cosine = splat_f32(1.0)
    for k in range(media.count):
        mine = mask & (medium == np.int32(k))
        if mask_bits(mine) == 0:
            continue
        before = splat_f32(0.0)
        for leaf in range(media.phase_begin[k], media.phase_begin[k + 1]):
            # the last one takes what rounding leaves
            taken = mine & (choice >= before)
            if mask_bits(taken) != 0:
                cosine = select(taken, sample_leaf(media, leaf, x), cosine)
            before = before + share_at(media, leaf, position, mine)
    return minimum(maximum(cosine, splat_f32(-1.0)), splat_f32(1.0))
