"""Scrambled points of digital nets, in groups of eight dimensions that belong together.

Of each pair of numbers that a path draws together (place in the pixel, direction, point on
a light), one of 2^m samples lies in each of the 2^m boxes of any shape 2^-i by 2^-(m - i):
they are (0, m, 2)-nets (`sobol_digits`). Every number is then scrambled: each binary digit
is flipped or not, by chance or by a hash of those before it, which keeps that and makes all
places equally likely [Owen1995], [Laine2011], with the hash of [Vegdahl2021].

One group has what one edge of a path is made of: the direction that leads to a surface
point (to the first: the place in the pixel and on the lens), and the light that is sampled
there. Groups are shuffled against one another, by scrambling the index [Burley2020].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    bit_reverse,
    joined,
    lower_half,
    select,
    upper_half,
)
from renderer.kernels.lanes.memory import load_one
from renderer.kernels.records.tile import SampleKey
from renderer.plugins.sampling.numbers_and_warps import (
    APERTURE_BLOCK,
    BLOCKS_PER_BOUNCE,
    choose_by_pair,
    choose_from_draw,
    draw4,
    draw4_twice,
    hash4,
    unit_float,
)
from renderer.plugins.sampling.sobol_digits import net_digits, sequence_digits

# the dimensions of a group: the first of each pair
_DIRECTION = 0  # or the place in the pixel
_LIGHT = 2
_LIGHT_PART = 4  # which triangle of the light
_LOBE = 6  # which part of the BSDF, and roulette; or the place on the lens
# Digits of a net that are flipped by a hash. If all are, edges have 1.2 times the variance
# with 64 samples, 1.35 times with 256: neighbours are as close to each other as may be.
_HASHED = 2


class Sobol(NamedTuple):
    """Points number 0 to 2^bits - 1, of which the samples are the first."""

    seed: int
    bits: int
    plain: int  # mask of the digits, from the lowest, that are flipped alike in all points
    # Mask of the bits of the index that are shuffled from the lowest up, too. Downwards
    # alone, one coordinate of all groups of a net has the same order of points but for the
    # last digits: 1.25 times the error in the Cornell box, with 64 samples.
    shuffled: int
    digits: NDArray[np.uint32]  # (8, 32) those that each bit of the index flips


def make_sobol(seed: int, spp: int) -> Sobol:
    """Return the sampler of `spp` numbers a pixel: a net, or a part of a sequence."""
    bits = (spp - 1).bit_length()
    net = net_digits(bits) if spp == 1 << bits else None
    if net is None:
        return Sobol(seed, bits, 0, 0, sequence_digits())
    return Sobol(seed, bits, (1 << max(bits - _HASHED, 0)) - 1, spp - 1, net)


@kernel
def scramble(digits, key):
    """Flip digits, lowest bit first, each by a hash of those below it [Vegdahl2021].

    The lowest bits of `hash4` are not good enough to flip the first digits of two blocks
    independently of each other (a product of two numbers was 21 standard errors off).
    """
    key ^= key >> 16
    digits ^= digits * 0x3D20ADEA
    digits += key
    digits *= (key >> 16) | 1
    digits ^= digits * 0x05526C56
    return digits ^ (digits * 0x53A22864)


@kernel
def _unit(digits, key, plain):
    mixed = scramble(digits, key)
    mixed ^= (mixed ^ digits ^ (key >> 16)) & plain
    return unit_float(bit_reverse(mixed))


@kernel
def _group_of(block):
    """Return the group of a block's numbers, and the dimensions of its two pairs."""
    bounce, turn = block // BLOCKS_PER_BOUNCE, block % BLOCKS_PER_BOUNCE - 2
    if block == APERTURE_BLOCK:
        return np.int64(0), _LOBE, _LIGHT_PART
    if turn >= 0:  # of several lights at one point, one shares the group of the point
        # A group has 32 bits: from light 4096 on, the upper bits of its number would be
        # lost (and light 4096 have the points of light 0). They go below the lower ones.
        turn = (turn << 20) + (turn >> 12 << 12)
        return bounce + turn, _LIGHT, _LIGHT_PART
    return bounce + turn + 2, _DIRECTION, _LOBE


@draw4.by(Sobol)
@kernel
def _draw_sobol(sampler, key, sample, block):
    """Draw for any number of samples at once."""
    pixel = key.pixel
    group, first, second = _group_of(block)
    zero = pixel ^ pixel
    seed, group = zero + np.uint32(sampler.seed), zero + np.uint32(group)
    order, _, _, _ = hash4(pixel, group, zero, seed)
    index = key.later + np.uint32(sample)
    index ^= (index ^ scramble(index, order >> 3)) & np.uint32(sampler.shuffled)
    index = bit_reverse(scramble(bit_reverse(index), order))
    a, b, c, d = zero, zero, zero, zero  # the digits of four numbers
    for bit in range(sampler.bits):
        flips = (index & np.uint32(1 << bit)) != 0
        a = select(flips, a ^ load_one(sampler.digits, first, bit), a)
        b = select(flips, b ^ load_one(sampler.digits, first + 1, bit), b)
        c = select(flips, c ^ load_one(sampler.digits, second, bit), c)
        d = select(flips, d ^ load_one(sampler.digits, second + 1, bit), d)
    x, y, z, w = hash4(pixel, group, zero + np.uint32(first + 1), seed)
    plain = zero + np.uint32(sampler.plain)
    return _unit(a, x, plain), _unit(b, y, plain), _unit(c, z, plain), _unit(d, w, plain)


@draw4_twice.by(Sobol)
@kernel
def _draw_sobol_twice(sampler, key, other, sample, block):
    """Draw for both together: a number is a chain of 20 multiplications of 10 cycles."""
    both = SampleKey(joined(key.pixel, other.pixel), joined(key.later, other.later))
    x, y, z, w = _draw_sobol(sampler, both, sample, block)
    return (
        (lower_half(x), lower_half(y), lower_half(z), lower_half(w)),
        (upper_half(x), upper_half(y), upper_half(z), upper_half(w)),
    )


choose_from_draw.by(Sobol)(choose_by_pair)
