"""Which numbers a sampler of Mitsuba hands out: one function for each kind of record."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from renderer.jit import kernel, record_class
from renderer.replay.pcg32 import next_float, pcg32_seed
from renderer.scene_file.description import Sampler


class Independent(NamedTuple):
    """A generator for each pixel, all of whose samples take numbers one by one."""

    state: NDArray[np.uint64]  # (pixels,)


def make_independent(seeds: NDArray[np.uint32], sampler: Sampler) -> Independent:
    """Return the record for pixels with the given seeds."""
    return Independent(pcg32_seed(seeds.astype(np.uint64) + sampler.seed))


MAKERS = {"independent": make_independent}


def begin_sample(sequence: Any, pixel: int) -> None:
    """Tell the sequence that a new sample of a pixel begins."""
    raise TypeError("inside kernels only")


def next_1d(sequence: Any, pixel: int, sample: int) -> Any:
    """Return the next number of a sample."""
    raise TypeError("inside kernels only")


def next_2d(sequence: Any, pixel: int, sample: int) -> Any:
    """Return the next pair of numbers of a sample."""
    raise TypeError("inside kernels only")


@kernel
def _begin_independent(sequence, pixel):
    return None


@kernel
def _next_independent_1d(sequence, pixel, sample):
    return next_float(sequence.state, pixel)


@kernel
def _next_independent_2d(sequence, pixel, sample):
    x = next_float(sequence.state, pixel)
    return x, next_float(sequence.state, pixel)


_DRAW = {Independent: (_begin_independent, _next_independent_1d, _next_independent_2d)}


@overload(begin_sample)
def _begin_sample(sequence, pixel):
    begin = _DRAW[record_class(sequence)][0]
    return lambda sequence, pixel: begin(sequence, pixel)


@overload(next_1d)
def _next_1d(sequence, pixel, sample):
    draw = _DRAW[record_class(sequence)][1]
    return lambda sequence, pixel, sample: draw(sequence, pixel, sample)


@overload(next_2d)
def _next_2d(sequence, pixel, sample):
    draw = _DRAW[record_class(sequence)][2]
    return lambda sequence, pixel, sample: draw(sequence, pixel, sample)
