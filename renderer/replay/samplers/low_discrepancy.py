"""Mitsuba's `ldsampler`: a (0, 2)-sequence, scrambled and shuffled [Kollig2002]."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.replay.numbers.dimensions import next_key, no_dimensions, pattern_keys
from renderer.replay.numbers.permutations import encrypt, permute_power_of_two
from renderer.scene_file.description import Sampler
from renderer.scene_file.objects.view.samplers import round_sample_count

_ONE = np.uint64(1)
_NINE = np.uint64(9)
_TOP_BIT = np.uint64(1 << 31)
_STEP_23 = np.float32(2.0**-23)
_STEP_32 = np.float32(2.0**-32)
# which number of the cipher scrambles single numbers, and which pairs
_SCRAMBLE_1D = 0x48BC48EB
_SCRAMBLE_2D = 0x98BC51AB


class LowDiscrepancy(NamedTuple):
    """The same points in all dimensions of a pixel, in another order in each."""

    key: NDArray[np.uint32]  # (pixels,)
    scramble: NDArray[np.uint32]  # (3, pixels) of single numbers, of x, of y
    dimension: NDArray[np.uint32]  # (pixels,) how many the current sample has used
    count: np.uint64  # a power of 4


def make_low_discrepancy(seeds: NDArray[np.uint32], sampler: Sampler) -> LowDiscrepancy:
    """Return the record for pixels with the given seeds."""
    keys = pattern_keys(seeds, sampler)
    single, _ = encrypt(
        keys.astype(np.uint64), np.full(keys.shape, _SCRAMBLE_1D, np.uint64), 4
    )
    x, y = encrypt(keys.astype(np.uint64), np.full(keys.shape, _SCRAMBLE_2D, np.uint64), 4)
    return LowDiscrepancy(
        keys,
        np.stack([single, x, y]).astype(np.uint32),
        no_dimensions(seeds),
        np.uint64(round_sample_count("ldsampler", sampler.sample_count)),
    )


@kernel
def van_der_corput(index, scramble):
    """Return the bits of a 32-bit index mirrored at the point, in [0, 1), 23 of them."""
    bits, bit = scramble, _TOP_BIT
    while index != np.uint64(0):
        bits ^= bit * (index & _ONE)
        index >>= _ONE
        bit >>= _ONE
    return np.float32(bits >> _NINE) * _STEP_23


@kernel
def sobol(index, scramble):
    """Return Sobol's second dimension at a 32-bit index [Kollig2002].

    All 32 bits are rounded to float32, so the largest give 1, in Mitsuba too.
    """
    bits, column = scramble, _TOP_BIT
    while index != np.uint64(0):
        bits ^= column * (index & _ONE)
        index >>= _ONE
        column ^= column >> _ONE
    return np.float32(bits) * _STEP_32


@kernel
def next_low_discrepancy_1d(sequence, pixel, sample):
    """Return van der Corput's number at this sample's place in the next dimension."""
    key = next_key(sequence, pixel)
    index = permute_power_of_two(np.uint64(sample), sequence.count, key)
    return van_der_corput(index, np.uint64(sequence.scramble[0, pixel]))


@kernel
def next_low_discrepancy_2d(sequence, pixel, sample):
    """Return the (0, 2)-sequence's point at this sample's place in the next dimension."""
    key = next_key(sequence, pixel)
    index = permute_power_of_two(np.uint64(sample), sequence.count, key)
    x = van_der_corput(index, np.uint64(sequence.scramble[1, pixel]))
    return x, sobol(index, np.uint64(sequence.scramble[2, pixel]))
