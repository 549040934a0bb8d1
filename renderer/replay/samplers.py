"""Mitsuba's samplers, bit for bit."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import NotReplayable
from renderer.kernels.jit import kernel
from renderer.replay.arithmetic import fused_multiply_add
from renderer.replay.numbers import (
    LOW_32,
    encrypt,
    generator_states,
    next_dimension,
    next_float,
    next_key,
    no_dimensions,
    pattern_keys,
    permute_any_size,
    permute_power_of_two,
    place_in_stratum,
)
from renderer.scene_file.description import Sampler
from renderer.scene_file.objects.films import round_sample_count

# -------------------------------------------------------------------------- independent
# Mitsuba's `independent`: one generator per pixel, without a pattern.


class Independent(NamedTuple):
    """One generator per pixel; the pixel's samples draw from it in sequence."""

    state: NDArray[np.uint64]  # (pixels,)


def make_independent(seeds: NDArray[np.uint32], sampler: Sampler) -> Independent:
    """Return the record for pixels with the given seeds."""
    return Independent(generator_states(seeds, sampler))


@kernel
def begin_independent(sequence, pixel):
    """Do nothing: a sample continues the generator of the one before it."""
    return


@kernel
def next_independent_1d(sequence, pixel, sample):
    """Return the next number of the pixel's generator."""
    return next_float(sequence.state, pixel)


@kernel
def next_independent_2d(sequence, pixel, sample):
    """Return the next two numbers, x first."""
    x = next_float(sequence.state, pixel)
    return x, next_float(sequence.state, pixel)


# --------------------------------------------------------------------------- stratified
# Mitsuba's `stratified`: in each dimension, each sample of a pixel has its own stratum.

_ONE = np.float32(1.0)


class Stratified(NamedTuple):
    """A single number lies in one of `count` strata, a pair in one of side x side cells."""

    state: NDArray[np.uint64]  # (pixels,) generators of the jitter
    key: NDArray[np.uint32]  # (pixels,)
    dimension: NDArray[np.uint32]  # (pixels,) dimensions used by the current sample
    count: np.uint64
    side: np.uint64
    jitter: bool


def make_stratified(seeds: NDArray[np.uint32], sampler: Sampler) -> Stratified:
    """Return the record for pixels with the given seeds."""
    count = round_sample_count("stratified", sampler.sample_count)
    return Stratified(
        generator_states(seeds, sampler),
        pattern_keys(seeds, sampler),
        no_dimensions(seeds),
        np.uint64(count),
        np.uint64(math.isqrt(count)),
        sampler.jitter,
    )


@kernel
def next_stratified_1d(sequence, pixel, sample):
    """Return a number in this sample's stratum of the next dimension."""
    key = next_key(sequence, pixel)
    stratum = permute_any_size(np.uint64(sample), sequence.count, key)
    place = place_in_stratum(sequence, pixel)
    return (np.float32(stratum) + place) * (_ONE / np.float32(sequence.count))


@kernel
def next_stratified_2d(sequence, pixel, sample):
    """Return a pair in this sample's cell of the next dimension."""
    key = next_key(sequence, pixel)
    cell = permute_any_size(np.uint64(sample), sequence.count, key)
    column, row = cell % sequence.side, cell // sequence.side
    x = np.float32(column) + place_in_stratum(sequence, pixel)
    y = np.float32(row) + place_in_stratum(sequence, pixel)
    # multiply by the rounded reciprocal as Mitsuba does; a division rounds differently
    width = _ONE / np.float32(sequence.side)
    return x * width, y * width


# -------------------------------------------------------------------------- multijitter
# Mitsuba's `multijitter`: correlated multi-jittered samples [Kensler2013].

# each permutation of a dimension has its own key: the dimension's times one of these
_ORDER_1D = np.uint64(0x45FBE943)
_ORDER_2D = np.uint64(0x51633E2D)
_WITHIN_ROW = np.uint64(0x68BC21EB)
_WITHIN_COLUMN = np.uint64(0x02E5BE93)


class Multijitter(NamedTuple):
    """Pairs: one in each of columns x rows cells, and one in each thin row and column."""

    state: NDArray[np.uint64]  # (pixels,) generators of the jitter
    key: NDArray[np.uint32]  # (pixels,)
    dimension: NDArray[np.uint32]  # (pixels,) dimensions used by the current sample
    columns: np.uint64
    rows: np.uint64
    jitter: bool


def make_multijitter(seeds: NDArray[np.uint32], sampler: Sampler) -> Multijitter:
    """Return the record for pixels with the given seeds."""
    count = round_sample_count("multijitter", sampler.sample_count)
    rows = math.isqrt(count)
    return Multijitter(
        generator_states(seeds, sampler),
        pattern_keys(seeds, sampler),
        no_dimensions(seeds),
        np.uint64(count // rows),
        np.uint64(rows),
        sampler.jitter,
    )


@kernel
def _permute(index, size, key, purpose):
    return permute_any_size(index, size, (key * purpose) & LOW_32)


@kernel
def next_multijitter_1d(sequence, pixel, sample):
    """Return a number in this sample's stratum of the next dimension."""
    key = next_key(sequence, pixel)
    count = sequence.columns * sequence.rows
    stratum = _permute(np.uint64(sample), count, key, _ORDER_1D)
    place = place_in_stratum(sequence, pixel)
    return (np.float32(stratum) + place) * (_ONE / np.float32(count))


@kernel
def next_multijitter_2d(sequence, pixel, sample):
    """Return a pair in this sample's cell, in a thin column and row of its own."""
    key = next_key(sequence, pixel)
    columns, rows = sequence.columns, sequence.rows
    cell = _permute(np.uint64(sample), columns * rows, key, _ORDER_2D)
    column, row = cell % columns, cell // columns
    thin_row = np.float32(_permute(column, columns, key, _WITHIN_ROW))
    thin_column = np.float32(_permute(row, rows, key, _WITHIN_COLUMN))
    width, height = (
        _ONE / np.float32(columns),
        _ONE / np.float32(rows),
    )
    thin_column += place_in_stratum(sequence, pixel)
    thin_row += place_in_stratum(sequence, pixel)
    # fused in Mitsuba's wheel: otherwise one number in twenty is off by an ulp or two
    x = fused_multiply_add(thin_column, height, np.float32(column))
    y = fused_multiply_add(thin_row, width, np.float32(row))
    return x * width, y * height


# --------------------------------------------------------------------------- orthogonal
# Mitsuba's `orthogonal`: samples from orthogonal arrays [Jarosz2019].
#
# Every pair of dimensions is stratified, not only pairs that are drawn together.

_ONE_BIT = np.uint64(1)
_TWO = np.uint64(2)
_STRATUM = np.uint64(0x51633E2D)
_SUBSTRATUM = np.uint64(0x68BC21EB)


class Orthogonal(NamedTuple):
    """An array of side^strength rows; a sample uses one row, a dimension one column."""

    state: NDArray[np.uint64]  # (pixels,) generators of the jitter
    key: NDArray[np.uint32]  # (pixels,)
    dimension: NDArray[np.uint32]  # (pixels,) dimensions used by the current sample
    side: np.uint64  # a prime whose square is the number of samples
    rows: np.uint64
    strength: int  # any `strength` dimensions are jointly stratified, each in `side` parts
    jitter: bool


def make_orthogonal(seeds: NDArray[np.uint32], sampler: Sampler) -> Orthogonal:
    """Return the record for pixels with the given seeds.

    Raises
    ------
    NotReplayable
        If the array has 2^32 rows or more: the number overflows in Mitsuba, which then
        crashes or hangs.
    """
    count = round_sample_count("orthogonal", sampler.sample_count)
    side = math.isqrt(count)
    if side**sampler.strength >= 2**32:
        raise NotReplayable(
            f"orthogonal sampler: strength {sampler.strength} with {count} samples is too "
            f"much: {side}^{sampler.strength} rows, the limit is 2^32"
        )
    return Orthogonal(
        generator_states(seeds, sampler),
        pattern_keys(seeds, sampler),
        no_dimensions(seeds),
        np.uint64(side),
        np.uint64(side**sampler.strength),
        sampler.strength,
        sampler.jitter,
    )


@kernel
def _bose(row, dimension, side):
    """Return the stratum and the substratum of a row of an array of strength 2."""
    high, low = row // side, row % side
    if dimension == 0:
        return high, low
    if dimension == 1:
        return low, high
    # unsigned arithmetic: the partner of dimension 2 is 3, that of 3 is 2
    partner = dimension - _ONE_BIT if dimension % _TWO == _ONE_BIT else dimension + _ONE_BIT
    stratum = (high + (dimension - _ONE_BIT) * low) & LOW_32
    substratum = (high + (partner - _ONE_BIT) * low) & LOW_32
    return stratum % side, substratum % side


@kernel
def _bush(row, dimension, side, strength):
    """Return the stratum of a row of an array of any strength: a polynomial's value.

    The coefficients are the digits of the row in base `side`, the argument is the
    dimension. In Mitsuba the first coefficient is not a digit but row - row * side (modulo
    2^32), and the others are late by one digit. This function copies that.
    """
    value = row - row * side
    power, rest = dimension, row
    for _ in range(strength - 1):
        value += power * (rest % side)
        power *= dimension
        rest //= side
    return (value & LOW_32) % side


@kernel
def next_orthogonal_1d(sequence, pixel, sample):
    """Return a number in the array's stratum of the next dimension."""
    dimension = next_dimension(sequence, pixel)
    key, side, rows = np.uint64(sequence.key[pixel]), sequence.side, sequence.rows
    index, parts = np.uint64(sample), rows // side
    if sequence.strength == 2:
        row = permute_any_size(index % rows, rows, key)
        stratum, substratum = _bose(row, dimension, side)
    else:
        row = permute_any_size(index, rows, key)
        stratum = _bush(row, dimension, side, sequence.strength)
        substratum = (row // side) % parts
    key = key * (dimension + _ONE_BIT)
    stratum = permute_any_size(stratum, side, (key * _STRATUM) & LOW_32)
    substratum = permute_any_size(substratum, parts, (key * _SUBSTRATUM) & LOW_32)
    place = np.float32(substratum) + place_in_stratum(sequence, pixel)
    return (np.float32(stratum) + place / np.float32(parts)) / np.float32(side)


@kernel
def next_orthogonal_2d(sequence, pixel, sample):
    """Return a pair from two dimensions, x first."""
    x = next_orthogonal_1d(sequence, pixel, sample)
    return x, next_orthogonal_1d(sequence, pixel, sample)


# ---------------------------------------------------------------------- low discrepancy
# Mitsuba's `ldsampler`: a (0, 2)-sequence, scrambled and shuffled [Kollig2002].

_NINE = np.uint64(9)
_TOP_BIT = np.uint64(1 << 31)
_STEP_23 = np.float32(2.0**-23)
_STEP_32 = np.float32(2.0**-32)
# arguments of the cipher for the scrambles of single numbers and of pairs
_SCRAMBLE_1D = 0x48BC48EB
_SCRAMBLE_2D = 0x98BC51AB


class LowDiscrepancy(NamedTuple):
    """The same points in all dimensions of a pixel, in a different order in each."""

    key: NDArray[np.uint32]  # (pixels,)
    scramble: NDArray[np.uint32]  # (3, pixels) of single numbers, of x, of y
    dimension: NDArray[np.uint32]  # (pixels,) dimensions used by the current sample
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
    """Return the radical inverse of a 32-bit index in base 2, in [0, 1), with 23 bits."""
    bits, bit = scramble, _TOP_BIT
    while index != np.uint64(0):
        bits ^= bit * (index & _ONE_BIT)
        index >>= _ONE_BIT
        bit >>= _ONE_BIT
    return np.float32(bits >> _NINE) * _STEP_23


@kernel
def sobol(index, scramble):
    """Return Sobol's second dimension at a 32-bit index [Kollig2002].

    All 32 bits are rounded to float32, so the largest indices give 1, in Mitsuba too.
    """
    bits, column = scramble, _TOP_BIT
    while index != np.uint64(0):
        bits ^= column * (index & _ONE_BIT)
        index >>= _ONE_BIT
        column ^= column >> _ONE_BIT
    return np.float32(bits) * _STEP_32


@kernel
def next_low_discrepancy_1d(sequence, pixel, sample):
    """Return van der Corput's number at this sample's index in the next dimension."""
    key = next_key(sequence, pixel)
    index = permute_power_of_two(np.uint64(sample), sequence.count, key)
    return van_der_corput(index, np.uint64(sequence.scramble[0, pixel]))


@kernel
def next_low_discrepancy_2d(sequence, pixel, sample):
    """Return the (0, 2)-sequence's point at this sample's index in the next dimension."""
    key = next_key(sequence, pixel)
    index = permute_power_of_two(np.uint64(sample), sequence.count, key)
    x = van_der_corput(index, np.uint64(sequence.scramble[1, pixel]))
    return x, sobol(index, np.uint64(sequence.scramble[2, pixel]))
