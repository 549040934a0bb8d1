"""Which numbers a sampler of Mitsuba hands out: one function for each kind of record."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from renderer.kernels.jit import record_class
from renderer.replay.numbers.dimensions import begin_dimensions
from renderer.replay.samplers.independent import (
    Independent,
    begin_independent,
    make_independent,
    next_independent_1d,
    next_independent_2d,
)
from renderer.replay.samplers.low_discrepancy import (
    LowDiscrepancy,
    make_low_discrepancy,
    next_low_discrepancy_1d,
    next_low_discrepancy_2d,
)
from renderer.replay.samplers.multijitter import (
    Multijitter,
    make_multijitter,
    next_multijitter_1d,
    next_multijitter_2d,
)
from renderer.replay.samplers.orthogonal import (
    Orthogonal,
    make_orthogonal,
    next_orthogonal_1d,
    next_orthogonal_2d,
)
from renderer.replay.samplers.stratified import (
    Stratified,
    make_stratified,
    next_stratified_1d,
    next_stratified_2d,
)
from renderer.scene_file.description import Sampler

Sequence = Independent | Stratified | Multijitter | Orthogonal | LowDiscrepancy

MAKERS: dict[str, Callable[[NDArray[np.uint32], Sampler], Sequence]] = {
    "independent": make_independent,
    "stratified": make_stratified,
    "multijitter": make_multijitter,
    "orthogonal": make_orthogonal,
    "ldsampler": make_low_discrepancy,
}

_BEGIN = {
    Independent: begin_independent,
    Stratified: begin_dimensions,
    Multijitter: begin_dimensions,
    Orthogonal: begin_dimensions,
    LowDiscrepancy: begin_dimensions,
}
_NEXT_1D = {
    Independent: next_independent_1d,
    Stratified: next_stratified_1d,
    Multijitter: next_multijitter_1d,
    Orthogonal: next_orthogonal_1d,
    LowDiscrepancy: next_low_discrepancy_1d,
}
_NEXT_2D = {
    Independent: next_independent_2d,
    Stratified: next_stratified_2d,
    Multijitter: next_multijitter_2d,
    Orthogonal: next_orthogonal_2d,
    LowDiscrepancy: next_low_discrepancy_2d,
}


def make_sequence(seeds: NDArray[np.uint32], sampler: Sampler) -> Sequence:
    """Return the record of the sampler with this name.

    Parameters
    ----------
    seeds : ndarray of shape (pixels,)
        What Mitsuba calls `Sampler::seed` with, at each pixel.
    sampler : Sampler
        Its own seed is added or mixed in; its sample count is rounded as Mitsuba does.

    Raises
    ------
    NotReplayable
        If an orthogonal array of this strength has too many rows.
    """
    return MAKERS[sampler.name](seeds, sampler)


def begin_sample(sequence: Any, pixel: int) -> None:
    """Tell the sequence that a new sample of a pixel begins."""
    raise TypeError("inside kernels only")


def next_1d(sequence: Any, pixel: int, sample: int) -> Any:
    """Return the next number of a sample, 0 the first of its pixel; float32 in [0, 1)."""
    raise TypeError("inside kernels only")


def next_2d(sequence: Any, pixel: int, sample: int) -> Any:
    """Return the next pair of numbers of a sample, float32 in [0, 1).

    Except for `independent` the pair differs from two results of `next_1d`. The y
    of `ldsampler` can be 1, as in Mitsuba.
    """
    raise TypeError("inside kernels only")


@overload(begin_sample)
def _begin_sample(sequence, pixel):
    begin = _BEGIN.get(record_class(sequence))
    if begin is None:
        return None
    return lambda sequence, pixel: begin(sequence, pixel)


@overload(next_1d)
def _next_1d(sequence, pixel, sample):
    draw = _NEXT_1D.get(record_class(sequence))
    if draw is None:
        return None
    return lambda sequence, pixel, sample: draw(sequence, pixel, sample)


@overload(next_2d)
def _next_2d(sequence, pixel, sample):
    draw = _NEXT_2D.get(record_class(sequence))
    if draw is None:
        return None
    return lambda sequence, pixel, sample: draw(sequence, pixel, sample)
