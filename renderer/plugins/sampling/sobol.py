"""The sampler `sobol`: scrambled digital nets, and their generator matrices.

A point has eight coordinates in four pairs. Each pair is a point of the same
two-dimensional net, at an index that the pair's matrix (modulo 2) computes from the
sample's index. So every pair is a (0, m, 2)-net. The matrices were found by a random search
with small steps. It optimised the first two pairs as a net of four dimensions, and some
sets of two and three coordinates as nets. The cost was the fraction of boxes of volume
2^-m, 2^-(m-1) and 2^-(m-2) that do not have equally many points.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
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
from renderer.kernels.records.batch import SampleKey
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

DIGITS = 32

# Columns of the matrices of the second to the fourth pair; the lowest row is the lowest
# bit. The search optimised the first twelve columns of the sequence; the others are random.
_SEQUENCE = (
    "1 3 4 d 1b 29 41 91 194 272 646 e08 1d9c 3461 60b6 a288 14ecd 214fa 44d0b 821d9 "
    "12cde5 3a064f 699007 f4d52c 180edb2 33698f6 7e20a69 dd6024a 1a1dc7fb 3165603c "
    "63d5affb f7b07403",
    "1 2 6 c 10 3a 46 85 1c6 3d1 565 d62 1792 3060 7054 f9a8 108ec 249cf 74ab1 f96d5 "
    "13fcd7 29fa85 779e1c b62f8f 145ee6d 3a7c8a2 50728eb b460a32 1a4d1fa2 31964580 "
    "457cc098 83870e99",
    "1 3 4 b 16 35 5f a2 110 376 5eb f72 1d66 285f 46fe a634 169ef 3a0e2 5ce19 8bc3e "
    "155bae 333406 740b4b dd4178 1fe2bfb 2603491 7855a7a 870f0b7 18ee7e46 28cc8c8f "
    "4ce2f272 d426c3d9",
)
_NETS = {
    1: (
        "1",
        "1",
        "1",
    ),
    2: (
        "2 1",
        "1 3",
        "3 1",
    ),
    3: (
        "6 2 5",
        "4 2 3",
        "5 2 6",
    ),
    4: (
        "e 3 7 c",
        "c f 6 8",
        "4 d a 2",
    ),
    5: (
        "13 f 18 1 11",
        "a 4 1b 1a 2",
        "15 e 1d b 17",
    ),
    6: (
        "31 5 27 d 3e 18",
        "32 b 25 5 a 3e",
        "1a 3d c 20 3 3b",
    ),
    7: (
        "40 65 37 56 4f 26 9",
        "60 5a 48 65 56 58 78",
        "4f 64 35 74 7 3a 52",
    ),
    8: (
        "8e c1 3e cc 5b fa da 21",
        "a7 4f ca 20 dd 38 6a d9",
        "ca 2c 85 5f d4 b2 2 2d",
    ),
    9: (
        "1a6 a4 77 155 11f e 18b 144 27",
        "121 124 18d 113 1f0 1bd 1ce 191 166",
        "66 18e ef 1d3 48 109 ac 19c 1f5",
    ),
    10: (
        "16c 201 388 111 27 37c 2f4 1b3 33d 168",
        "c6 210 104 125 11f 1f9 cc 8d 63 3cc",
        "3a2 1d7 91 365 24a 167 34c 28e 24 75",
    ),
    11: (
        "755 5c1 4c1 5a 1fc 69e 21f 48e 789 2b7 6a0",
        "392 4 4e4 7fd 38e 493 351 321 684 288 bd",
        "369 10c 681 14c 3c0 7b6 5c2 23f 382 48b 169",
    ),
    12: (
        "ca9 964 1e0 6f4 ed3 36b 8ea 11a 7ad 9d5 56c 740",
        "ffb 4b3 619 4fe 4f0 c8c a39 4f8 9ff 30b dd6 1aa",
        "4dc 889 30e ef5 677 9fa e70 10e 741 b1c 75a 34a",
    ),
}


@functools.cache
def net_digits(bits: int) -> NDArray[np.uint32] | None:
    """Return the digits that each bit of an index flips, for a net of 2^bits points.

    The first two coordinates are the net of [Larcher2003]: the reversed index, and its
    product with a triangle of ones. Its points have a large minimum distance.

    Returns
    -------
    ndarray of shape (8, DIGITS) or None
        By coordinate and bit; the first binary digit is the lowest bit. None if no
        matrices are known for `bits`.
    """
    if bits not in _NETS:
        return None

    def first(point: int) -> int:
        return int(f"{point:0{bits}b}"[::-1], 2)

    def second(point: int) -> int:
        return functools.reduce(int.__xor__, (point >> k for k in range(bits)))

    return _table([_powers(bits), *(_numbers(text) for text in _NETS[bits])], first, second)


@functools.cache
def sequence_digits() -> NDArray[np.uint32]:
    """Return the same for any number of points: the sequence of [Sobol1967].

    The first coordinate is the index with its bits reversed; the matrix of the second is
    Pascal's triangle. The matrices of the pairs are triangular, so the first 2^m points
    form a net for every m. Columns beyond the search are random.
    """

    def second(point: int) -> int:
        digits = 0
        for k in range(DIGITS):
            if point >> k & 1:  # C(k, r) is odd if all bits of r are set in k
                digits ^= sum(1 << r for r in range(k + 1) if r & ~k == 0)
        return digits

    pairs = [_powers(DIGITS), *(_numbers(text) for text in _SEQUENCE)]
    return _table(pairs, lambda point: point, second)


def _powers(count: int) -> list[int]:
    return [1 << k for k in range(count)]


def _numbers(text: str) -> list[int]:
    return [int(column, 16) for column in text.split()]


def _table(
    pairs: list[list[int]], first: Callable[[int], int], second: Callable[[int], int]
) -> NDArray[np.uint32]:
    table = np.zeros((8, DIGITS), np.uint32)
    for pair, columns in enumerate(pairs):
        for bit, point in enumerate(columns):
            table[2 * pair : 2 * pair + 2, bit] = first(point), second(point)
    return table


# -------------------------------------------------------------------------------- sobol
# Scrambled points of digital nets, in groups of eight dimensions.
#
# The pairs of numbers that a path draws together (position in the pixel, direction, point
# on a light) are (0, m, 2)-nets: of 2^m samples, one is in each of the 2^m boxes of size
# 2^-i by 2^-(m - i), for every i. Every number is then scrambled: each binary digit is
# flipped at random, or by a hash of the digits before it. This keeps the net and makes all
# positions equally likely [Owen1995], [Laine2011], with the hash of [Vegdahl2021].
#
# One group has the numbers of one path segment: the direction to a surface point (for the
# first one: the position in the pixel and on the lens), and the light sample there. The
# groups are decorrelated by scrambling the index [Burley2020].

# the dimensions of a group: the first of each pair
_DIRECTION = 0  # or the position in the pixel
_LIGHT = 2
_LIGHT_PART = 4  # triangle of the light
_LOBE = 6  # lobe of the BSDF, and roulette; or the position on the lens
# Digits of a net that are flipped by a hash. If all are, the variance at edges is 1.2 times
# as large for 64 samples, 1.35 times for 256: points may then be arbitrarily close.
_HASHED = 2


class Sobol(NamedTuple):
    """Points 0 to 2^bits - 1; the samples are the first of them."""

    seed: int
    bits: int
    plain: int  # mask of the digits, from the lowest, with equal flips in all points
    # Mask of the bits of the index that are also shuffled from the lowest up. If they are
    # shuffled only downwards, one coordinate of all groups of a net has the same order of
    # points except for the last digits: 1.25 times the error in the Cornell box for 64
    # samples.
    shuffled: int
    digits: NDArray[np.uint32]  # (8, 32) the digits that each bit of the index flips


def make_sobol(seed: int, spp: int) -> Sobol:
    """Return the sampler for `spp` samples per pixel: a net, or a part of a sequence."""
    bits = (spp - 1).bit_length()
    net = net_digits(bits) if spp == 1 << bits else None
    if net is None:
        return Sobol(seed, bits, 0, 0, sequence_digits())
    return Sobol(seed, bits, (1 << max(bits - _HASHED, 0)) - 1, spp - 1, net)


@kernel
def scramble(digits, key):
    """Flip each digit, lowest bit first, by a hash of the digits below it [Vegdahl2021].

    The lowest bits of `hash4` would not flip the first digits of two blocks independently
    (the mean product of two numbers was off by 21 standard errors).
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
    """Return the group of a block, and the dimensions of its two pairs."""
    bounce, turn = block // BLOCKS_PER_BOUNCE, block % BLOCKS_PER_BOUNCE - 2
    if block == APERTURE_BLOCK:
        return np.int64(0), _LOBE, _LIGHT_PART
    if turn >= 0:  # the first of several light samples shares the group of the point
        # A group has 32 bits. From light 4096 on the upper bits of its number would be lost
        # (light 4096 would get the points of light 0). They are stored below the lower
        # ones.
        turn = (turn << 20) + (turn >> 12 << 12)
        return bounce + turn, _LIGHT, _LIGHT_PART
    return bounce + turn + 2, _DIRECTION, _LOBE


@draw4.by(Sobol)
@kernel
def _draw_sobol(sampler, key, sample, block):
    """Draw four numbers for lanes of samples."""
    pixel = key.pixel
    group, first, second = _group_of(block)
    zero = pixel ^ pixel
    seed, group = zero + np.uint32(sampler.seed), zero + np.uint32(group)
    order, _, _, _ = hash4(pixel, group, zero, seed)
    index = key.later + np.uint32(sample)
    index ^= (index ^ scramble(index, order >> 3)) & np.uint32(sampler.shuffled)
    index = bit_reverse(scramble(bit_reverse(index), order))
    a, b, c, d = zero, zero, zero, zero  # digits of the four numbers
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
    """Draw both interleaved: each is a chain of 20 multiplications with latency 10."""
    both = SampleKey(joined(key.pixel, other.pixel), joined(key.later, other.later))
    x, y, z, w = _draw_sobol(sampler, both, sample, block)
    return (
        (lower_half(x), lower_half(y), lower_half(z), lower_half(w)),
        (upper_half(x), upper_half(y), upper_half(z), upper_half(w)),
    )


choose_from_draw.by(Sobol)(choose_by_pair)
