"""Mitsuba's `multijitter`: correlated multi-jittered samples [Kensler2013]."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.replay.numbers.dimensions import (
    generator_states,
    next_key,
    no_dimensions,
    pattern_keys,
    place_in_stratum,
)
from renderer.replay.numbers.permutations import LOW_32, permute_any_size
from renderer.replay.rounding.arithmetic.fused import fused_multiply_add
from renderer.scene_file.description import Sampler
from renderer.scene_file.objects.view.samplers import round_sample_count

_ONE = np.float32(1.0)
# each permutation of a dimension has its own key, the dimension's times one of these
_ORDER_1D = np.uint64(0x45FBE943)
_ORDER_2D = np.uint64(0x51633E2D)
_WITHIN_ROW = np.uint64(0x68BC21EB)
_WITHIN_COLUMN = np.uint64(0x02E5BE93)


class Multijitter(NamedTuple):
    """Pairs: one in each of columns x rows cells, one in each thin row and column."""

    state: NDArray[np.uint64]  # (pixels,) generators of the jitter
    key: NDArray[np.uint32]  # (pixels,)
    dimension: NDArray[np.uint32]  # (pixels,) how many the current sample has used
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
    """Return a number in the stratum that is this sample's in the next dimension."""
    key = next_key(sequence, pixel)
    count = sequence.columns * sequence.rows
    stratum = _permute(np.uint64(sample), count, key, _ORDER_1D)
    place = place_in_stratum(sequence, pixel)
    return (np.float32(stratum) + place) * (_ONE / np.float32(count))


@kernel
def next_multijitter_2d(sequence, pixel, sample):
    """Return a pair: in its cell, the thin column and row are again its own alone."""
    key = next_key(sequence, pixel)
    columns, rows = sequence.columns, sequence.rows
    cell = _permute(np.uint64(sample), columns * rows, key, _ORDER_2D)
    column, row = cell % columns, cell // columns
    thin_row = np.float32(_permute(column, columns, key, _WITHIN_ROW))
    thin_column = np.float32(_permute(row, rows, key, _WITHIN_COLUMN))
    width, height = _ONE / np.float32(columns), _ONE / np.float32(rows)
    thin_column += place_in_stratum(sequence, pixel)
    thin_row += place_in_stratum(sequence, pixel)
    # fused in Mitsuba's wheel: one number in twenty would be off by an ulp or two
    x = fused_multiply_add(thin_column, height, np.float32(column))
    y = fused_multiply_add(thin_row, width, np.float32(row))
    return x * width, y * height
