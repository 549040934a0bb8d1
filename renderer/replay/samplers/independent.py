"""Mitsuba's `independent`: a generator for each pixel, and no pattern."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.replay.numbers.dimensions import generator_states
from renderer.replay.numbers.pcg32 import next_float
from renderer.scene_file.description import Sampler


class Independent(NamedTuple):
    """A generator for each pixel, all of whose samples take numbers one by one."""

    state: NDArray[np.uint64]  # (pixels,)


def make_independent(seeds: NDArray[np.uint32], sampler: Sampler) -> Independent:
    """Return the record for pixels with the given seeds."""
    return Independent(generator_states(seeds, sampler))


@kernel
def begin_independent(sequence, pixel):
    """Do nothing: a sample goes on where the one before it stopped."""
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
