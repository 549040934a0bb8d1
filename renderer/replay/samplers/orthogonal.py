"""Mitsuba's `orthogonal`: samples from orthogonal arrays [Jarosz2019].

Every pair of dimensions is stratified, not only those that are drawn together.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import NotReplayable
from renderer.kernels.jit import kernel
from renderer.replay.numbers.dimensions import (
    generator_states,
    next_dimension,
    no_dimensions,
    pattern_keys,
    place_in_stratum,
)
from renderer.replay.numbers.permutations import LOW_32, permute_any_size
from renderer.scene_file.description import Sampler
from renderer.scene_file.objects.view.samplers import round_sample_count

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_STRATUM = np.uint64(0x51633E2D)
_SUBSTRATUM = np.uint64(0x68BC21EB)


class Orthogonal(NamedTuple):
    """An array of `rows` = side^strength rows; a sample takes one, a dimension a column."""

    state: NDArray[np.uint64]  # (pixels,) generators of the jitter
    key: NDArray[np.uint32]  # (pixels,)
    dimension: NDArray[np.uint32]  # (pixels,) how many the current sample has used
    side: np.uint64  # a prime, its square is the number of samples
    rows: np.uint64
    strength: int  # any so many dimensions together are stratified, each in `side` parts
    jitter: bool


def make_orthogonal(seeds: NDArray[np.uint32], sampler: Sampler) -> Orthogonal:
    """Return the record for pixels with the given seeds.

    Raises
    ------
    NotReplayable
        If the array has 2^32 rows or more: their number overflows in Mitsuba, which then
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
    # unsigned: the partner of dimension 2 is 3, that of 3 is 2
    partner = dimension - _ONE if dimension % _TWO == _ONE else dimension + _ONE
    stratum = (high + (dimension - _ONE) * low) & LOW_32
    substratum = (high + (partner - _ONE) * low) & LOW_32
    return stratum % side, substratum % side


@kernel
def _bush(row, dimension, side, strength):
    """Return the stratum of a row of an array of any strength: a polynomial's value.

    Its coefficients are digits of the row to the base `side`, its argument the dimension.
    Mitsuba's first coefficient is not a digit but row - row * side (modulo 2^32), and the
    others are one digit late; so is this.
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
    """Return a number in the stratum that the array gives in the next dimension."""
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
    key = key * (dimension + _ONE)
    stratum = permute_any_size(stratum, side, (key * _STRATUM) & LOW_32)
    substratum = permute_any_size(substratum, parts, (key * _SUBSTRATUM) & LOW_32)
    place = np.float32(substratum) + place_in_stratum(sequence, pixel)
    return (np.float32(stratum) + place / np.float32(parts)) / np.float32(side)


@kernel
def next_orthogonal_2d(sequence, pixel, sample):
    """Return a pair from two dimensions, x first."""
    x = next_orthogonal_1d(sequence, pixel, sample)
    return x, next_orthogonal_1d(sequence, pixel, sample)
