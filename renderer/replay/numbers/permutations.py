"""Pseudo-random permutations, and the cipher behind their keys, bit for bit as in Mitsuba.

All are 32-bit arithmetic, done here in 64 bits: numba widens anyway, and what overflows
is cut off where a shift to the right or a remainder would see it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.kernels.jit import kernel

LOW_32 = np.uint64(0xFFFFFFFF)
_ONE = np.uint64(1)
_TWO = np.uint64(2)
_FOUR = np.uint64(4)
_FIVE = np.uint64(5)


def encrypt(v0: Any, v1: Any, rounds: int) -> Any:
    """Return the two 32-bit halves of a block after rounds of TEA [Zafar2010].

    Python, for arrays of uint64 below 2^32; `tea` is the same as a kernel.
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
    """Apply one step of Kensler's hash: one to one on the numbers up to `mask`."""
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
    """Return where a permutation of 0 .. size - 1 puts `index` [Kensler2013].

    What falls outside is hashed again until it is inside. An index beyond the size may
    never get there (Mitsuba then hangs); the walk stops after as many steps as there are
    numbers, so that a kernel always ends. With a key less than `size` below 2^32 the last
    sum overflows, and two indices share a place: one key in 2^32 / size, in Mitsuba too.
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
    """Return where a permutation of 0 .. size - 1 puts `index`; the size is 2^n.

    A shuffling network: each bit is flipped or not, as a hash of the bits above it and
    those already shuffled below it says [Kollig2002].
    """
    bit = _ONE
    while bit < size:
        index ^= tea(index | bit, key, 2)[0] & bit
        bit <<= _ONE
    return index
