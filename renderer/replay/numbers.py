"""Mitsuba's random numbers: PCG32, permutations, dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.kernels.jit import kernel
from renderer.scene_file.description import Sampler

# -------------------------------------------------------------------------------- pcg32
# PCG32, the generator of Mitsuba's samplers: 64 bits of state, 32 out [ONeill2014].

DEFAULT_STREAM = 0xDA3E39CB94B95BDB
_MULTIPLIER = np.uint64(0x5851F42D4C957F2D)
_INCREMENT = np.uint64((DEFAULT_STREAM << 1 | 1) & 0xFFFFFFFFFFFFFFFF)
_BELOW_ONE = np.float32(2.0**-23)


def pcg32_seed(initstate: ArrayLike) -> NDArray[np.uint64]:
    """Return the states of generators seeded with `initstate` on the default stream."""
    seeds = np.asarray(initstate).astype(np.uint64)
    with np.errstate(over="ignore"):
        return (seeds + _INCREMENT) * _MULTIPLIER + _INCREMENT


@kernel
def next_u32(state, pixel):
    """Return 32 random bits from the generator of a pixel, and advance it."""
    old = state[pixel]
    state[pixel] = old * _MULTIPLIER + _INCREMENT
    shifted = np.uint32(((old >> np.uint64(18)) ^ old) >> np.uint64(27))
    turn = np.uint32(old >> np.uint64(59))
    back = np.uint32((np.uint32(32) - turn) & np.uint32(31))
    return np.uint32((shifted >> turn) | (shifted << back))


@kernel
def next_float(state, pixel):
    """Return a number in [0, 1) of 23 bits, as Mitsuba computes it."""
    return np.float32(next_u32(state, pixel) >> np.uint32(9)) * _BELOW_ONE


# ------------------------------------------------------------------------- permutations
# Pseudo-random permutations, and the cipher for their keys, bit for bit as in Mitsuba.
#
# All is 32-bit arithmetic, done in 64 bits since Numba widens anyway. Overflow is masked
# where a right shift or a remainder would see it.

LOW_32 = np.uint64(0xFFFFFFFF)
_ONE = np.uint64(1)
_TWO = np.uint64(2)
_FOUR = np.uint64(4)
_FIVE = np.uint64(5)


def encrypt(v0: Any, v1: Any, rounds: int) -> Any:
    """Return the two 32-bit halves of a block after rounds of TEA [Zafar2010].

    In Python, for arrays of uint64 below 2^32; `tea` is the same as a kernel.
    """
    total = np.uint64(0)
    for _ in range(rounds):
        total = (total + np.uint64(0x9E3779B9)) & LOW_32
        left = ((v1 << _FOUR) + np.uint64(0xA341316C)) ^ (v1 + total)
        v0 = (v0 + (left ^ ((v1 >> _FIVE) + np.uint64(0xC8013EA4)))) & LOW_32
        right = ((v0 << _FOUR) + np.uint64(0xAD90777D)) ^ (v0 + total)
        v1 = (v1 + (right ^ ((v0 >> _FIVE) + np.uint64(0x7E95761E)))) & LOW_32
    return v0, v1


tea = kernel(encrypt)


@kernel
def _mix(x, mask, key):
    """Apply one step of Kensler's hash, a bijection on 0 .. `mask`."""
    x = (x ^ key) * np.uint64(0xE170893D)
    x ^= key >> np.uint64(16)
    x ^= (x & mask) >> _FOUR
    x = (x ^ (key >> np.uint64(8))) * np.uint64(0x0929EB3F)
    x ^= key >> np.uint64(23)
    x ^= (x & mask) >> _ONE
    x *= (_ONE | (key >> np.uint64(27))) * np.uint64(0x6935FA69)
    x ^= (x & mask) >> np.uint64(11)
    x *= np.uint64(0x74DCB303)
    x ^= (x & mask) >> _TWO
    x *= np.uint64(0x9E501CC3)
    x ^= (x & mask) >> _TWO
    x = (x * np.uint64(0xC860A3DF)) & mask
    return x ^ (x >> _FIVE)


@kernel
def permute_any_size(index, size, key):
    """Return the image of `index` under a permutation of 0 .. size - 1 [Kensler2013].

    Values outside are hashed again until they are inside. An index beyond the size may
    never get there, and Mitsuba then hangs; here the walk ends after `size` steps. With a
    key less than `size` below 2^32 the last sum overflows, and two indices share an image:
    one key in 2^32 / size, in Mitsuba too.
    """
    if size == _ONE:
        return np.uint64(0)
    mask = size - _ONE
    for shift in (1, 2, 4, 8, 16):
        mask |= mask >> np.uint64(shift)
    for _ in range(np.int64(mask) + 1):
        index = _mix(index, mask, key)
        if index < size:
            break
    return ((index + key) & LOW_32) % size


@kernel
def permute_power_of_two(index, size, key):
    """Return the image of `index` under a permutation of 0 .. size - 1; size is 2^n.

    A shuffling network [Kollig2002]: each bit is flipped by a hash of the bits above it and
    of the shuffled bits below it.
    """
    bit = _ONE
    while bit < size:
        index ^= tea(index | bit, key, 2)[0] & bit
        bit <<= _ONE
    return index


# --------------------------------------------------------------------------- dimensions
# The keys of Mitsuba's patterns: one per pixel, and derived from it one per dimension.
#
# A pattern arranges the samples of a pixel in one dimension, or in a pair. Dimensions are
# numbered in the order in which a sample draws them; a draw takes one or two.

_HALF = np.float32(0.5)


def generator_states(seeds: NDArray[np.uint32], sampler: Sampler) -> NDArray[np.uint64]:
    """Return each pixel's generator, seeded by its seed plus the sampler's modulo 2^32."""
    return pcg32_seed((seeds.astype(np.uint64) + np.uint64(sampler.seed)) & LOW_32)


def pattern_keys(seeds: NDArray[np.uint32], sampler: Sampler) -> NDArray[np.uint32]:
    """Return the key of each pixel: its seed, encrypted with the sampler's seed."""
    own = np.full(seeds.shape, sampler.seed, np.uint64)
    return encrypt(own, seeds.astype(np.uint64), 4)[0].astype(np.uint32)


def no_dimensions(seeds: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the number of dimensions used at the start of a sample: 0 for each pixel."""
    return np.zeros(seeds.shape, np.uint32)


@kernel
def begin_dimensions(sequence, pixel):
    """Start a sample: its first draw is dimension 0."""
    sequence.dimension[pixel] = np.uint32(0)


@kernel
def next_dimension(sequence, pixel):
    """Return the index of the next dimension of a pixel's sample, and advance it."""
    dimension = sequence.dimension[pixel]
    sequence.dimension[pixel] = dimension + np.uint32(1)
    return np.uint64(dimension)


@kernel
def next_key(sequence, pixel):
    """Return the key of the pattern in the next dimension, and advance the dimension."""
    dimension = next_dimension(sequence, pixel)
    return (np.uint64(sequence.key[pixel]) + dimension) & LOW_32


@kernel
def place_in_stratum(sequence, pixel):
    """Return the position of a number in its stratum, in [0, 1); 1/2 without jitter."""
    if sequence.jitter:
        return next_float(sequence.state, pixel)
    return _HALF
