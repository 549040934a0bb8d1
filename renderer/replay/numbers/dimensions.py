"""The keys of Mitsuba's patterns: one for each pixel, and from it one for each dimension.

A pattern says where the samples of a pixel lie in one dimension (or a pair). Dimensions are
numbered in the order in which a sample draws them; a draw takes one or two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.replay.numbers.pcg32 import next_float, pcg32_seed
from renderer.replay.numbers.permutations import LOW_32, encrypt
from renderer.scene_file.description import Sampler

_HALF = np.float32(0.5)


def generator_states(seeds: NDArray[np.uint32], sampler: Sampler) -> NDArray[np.uint64]:
    """Return the generator of each pixel; its seed plus the sampler's is modulo 2^32."""
    return pcg32_seed((seeds.astype(np.uint64) + np.uint64(sampler.seed)) & LOW_32)


def pattern_keys(seeds: NDArray[np.uint32], sampler: Sampler) -> NDArray[np.uint32]:
    """Return the key of each pixel: its seed, encrypted with the sampler's seed."""
    own = np.full(seeds.shape, sampler.seed, np.uint64)
    return encrypt(own, seeds.astype(np.uint64), 4)[0].astype(np.uint32)


def no_dimensions(seeds: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return how many dimensions each pixel has used at the start of a sample: none."""
    return np.zeros(seeds.shape, np.uint32)


@kernel
def begin_dimensions(sequence, pixel):
    """Start a sample: its first draw is dimension 0."""
    sequence.dimension[pixel] = np.uint32(0)


@kernel
def next_dimension(sequence, pixel):
    """Return the number of the next dimension of the sample of a pixel, and count it."""
    dimension = sequence.dimension[pixel]
    sequence.dimension[pixel] = dimension + np.uint32(1)
    return np.uint64(dimension)


@kernel
def next_key(sequence, pixel):
    """Return the key of the pattern in the next dimension, and count the dimension."""
    dimension = next_dimension(sequence, pixel)
    return (np.uint64(sequence.key[pixel]) + dimension) & LOW_32


@kernel
def place_in_stratum(sequence, pixel):
    """Return where in its stratum a number lies, in [0, 1); the middle without jitter."""
    if sequence.jitter:
        return next_float(sequence.state, pixel)
    return _HALF
