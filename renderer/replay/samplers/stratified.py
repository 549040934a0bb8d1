"""Mitsuba's `stratified`: in each dimension, one sample of a pixel in each stratum."""

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
from renderer.replay.numbers.permutations import permute_any_size
from renderer.scene_file.description import Sampler
from renderer.scene_file.objects.view.samplers import round_sample_count

_ONE = np.float32(1.0)


class Stratified(NamedTuple):
    """One number lies in one of `count` strata, a pair in one of side x side cells."""

    state: NDArray[np.uint64]  # (pixels,) generators of the jitter
    key: NDArray[np.uint32]  # (pixels,)
    dimension: NDArray[np.uint32]  # (pixels,) how many the current sample has used
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
    """Return a number in the stratum that is this sample's in the next dimension."""
    key = next_key(sequence, pixel)
    stratum = permute_any_size(np.uint64(sample), sequence.count, key)
    place = place_in_stratum(sequence, pixel)
    return (np.float32(stratum) + place) * (_ONE / np.float32(sequence.count))


@kernel
def next_stratified_2d(sequence, pixel, sample):
    """Return a pair in the cell that is this sample's in the next dimension."""
    key = next_key(sequence, pixel)
    cell = permute_any_size(np.uint64(sample), sequence.count, key)
    column, row = cell % sequence.side, cell // sequence.side
    x = np.float32(column) + place_in_stratum(sequence, pixel)
    y = np.float32(row) + place_in_stratum(sequence, pixel)
    # times the rounded reciprocal, as Mitsuba does it: a division rounds differently
    width = _ONE / np.float32(sequence.side)
    return x * width, y * width
