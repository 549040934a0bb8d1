"""The random number sequences of Mitsuba's samplers, and the numbers of a bounce.

A sampler's numbers come from functions that are implemented for each kind of record.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, method_kernel, record_class
from renderer.kernels.lanes.functions import as_i32, splat_f32, splat_i32
from renderer.kernels.lanes.memory import gather_row, load_row, store_row
from renderer.kernels.records.batch import CAPACITY, sample_key, slot_pixel
from renderer.plugins.sampling.numbers_and_warps import BLOCKS_PER_BOUNCE, choose_one
from renderer.replay.numbers import begin_dimensions, next_dimension
from renderer.replay.samplers import (
    Independent,
    LowDiscrepancy,
    Multijitter,
    Orthogonal,
    Stratified,
    begin_independent,
    make_independent,
    make_low_discrepancy,
    make_multijitter,
    make_orthogonal,
    make_stratified,
    next_independent_1d,
    next_independent_2d,
    next_low_discrepancy_1d,
    next_low_discrepancy_2d,
    next_multijitter_1d,
    next_multijitter_2d,
    next_orthogonal_1d,
    next_orthogonal_2d,
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
        Mitsuba's argument of `Sampler::seed` for each pixel.
    sampler : Sampler
        Its own seed is added or mixed in; its sample count is rounded as in Mitsuba.

    Raises
    ------
    NotReplayable
        If an orthogonal array of this strength would have too many rows.
    """
    return MAKERS[sampler.name](seeds, sampler)


def begin_sample(sequence: Any, pixel: int) -> None:
    """Begin a new sample of a pixel."""
    raise TypeError("inside kernels only")


def next_1d(sequence: Any, pixel: int, sample: int) -> Any:
    """Return the next number of sample 0, 1, ... of its pixel; float32 in [0, 1)."""
    raise TypeError("inside kernels only")


def next_2d(sequence: Any, pixel: int, sample: int) -> Any:
    """Return the next pair of numbers of a sample, float32 in [0, 1).

    Except for `independent` the pair is not two results of `next_1d`. The y of `ldsampler`
    can be 1, as in Mitsuba.
    """
    raise TypeError("inside kernels only")


def skip_1d(sequence: Any, pixel: int) -> None:
    """Skip a number as Mitsuba's masked draw does: only the dimension advances."""
    raise TypeError("inside kernels only")


@overload(begin_sample)
def _begin_sample(sequence, pixel):
    begin = _BEGIN.get(record_class(sequence))
    if begin is None:
        return None
    return lambda sequence, pixel: begin(sequence, pixel)


@overload(skip_1d)
def _skip_1d(sequence, pixel):
    if record_class(sequence) is Independent:
        return lambda sequence, pixel: None

    def skip(sequence, pixel):
        next_dimension(sequence, pixel)

    return skip


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


# -------------------------------------------------------------------------- drawn ahead
# The numbers of a replay are drawn at the start of a bounce, by a sampler like the others.
#
# Mitsuba draws from one stream per pixel, one sample after the other, and the numbers of a
# bounce depend on the hit. So they are drawn at the start of the bounce (`begin_bounce`)
# and stored by pixel; the stages read them as from any other sampler. Samples of a pixel
# are never traced together (`Plan.level` is 0): each slot is a pixel.
#
# Order within a sample (Mitsuba, src/render/integrator.cpp, src/integrators/path.cpp): the
# film position, and the lens position if there is a lens; one number for the time if the
# shutter stays open. Then at each hit from which the path may continue: two numbers for a
# light sample if the surface has a smooth lobe (on either side), one and two for the BSDF,
# one for the roulette. All are drawn even if unused. `direct` plays no roulette and draws
# the BSDF's two before its one: they are arguments of one call, which the wheel's compiler
# evaluates from right to left. With several samples per point, the light samples come
# before the BSDF samples.

# rows of `Replay.numbers`
FILM = 0  # x, y in the pixel
APERTURE = 2  # x, y on the lens
BSDF_CHOICE = 4
BSDF = 5  # x, y
ROULETTE = 7
LIGHT = 8  # x, y
SET = 6  # number of rows from BSDF_CHOICE on, per further sample of `direct`


def rows_of(samples: int) -> int:
    """Return the number of rows of `Replay.numbers` for a number of samples per point."""
    return BSDF_CHOICE + SET * max(samples, 1)


class Replay(NamedTuple):
    """Numbers drawn in advance from a sampler of Mitsuba's, by pixel of the full film."""

    sequence: Any  # a record of renderer.replay.sequences
    numbers: NDArray[np.float32]  # (rows_of(samples), pixels)
    smooth: NDArray[np.int32]  # (shapes,) 1: light samples are drawn on this shape
    lights: int  # light samples per point
    bsdf: int  # BSDF samples per point; 0: the integrator draws no numbers for BSDFs
    direct: int  # 1: the order of `direct`, 0: the order of `path`
    # draw of a camera ray's time; 0: none, 1: after the film position, 2: after the lens
    shutter: int


@method_kernel
def draw_film(sampler, tile, sample, film):
    """Begin a sample of each pixel of a tile: draw its film position."""
    sequence, numbers = sampler.sequence, sampler.numbers
    for slot in range(CAPACITY):
        x, y = slot_pixel(slot, 0)
        if x >= tile.width or y >= tile.height:
            continue
        pixel = (y + tile.y) * tile.film_width + (x + tile.x)
        begin_sample(sequence, pixel)
        dx, dy = next_2d(sequence, pixel, sample)
        if sampler.shutter == 1:
            next_1d(sequence, pixel, sample)
        numbers[FILM, pixel], numbers[FILM + 1, pixel] = dx, dy
        film[0, slot], film[1, slot] = dx, dy


@method_kernel
def draw_aperture(sampler, tile, sample, film):
    """Draw the lens position of the sample of each pixel of a tile."""
    sequence, numbers = sampler.sequence, sampler.numbers
    for slot in range(CAPACITY):
        x, y = slot_pixel(slot, 0)
        if x >= tile.width or y >= tile.height:
            continue
        pixel = (y + tile.y) * tile.film_width + (x + tile.x)
        u, v = next_2d(sequence, pixel, sample)
        if sampler.shutter == 2:
            next_1d(sequence, pixel, sample)
        numbers[APERTURE, pixel], numbers[APERTURE + 1, pixel] = u, v
        film[2, slot], film[3, slot] = u, v


@kernel
def _draw_pair(sequence, numbers, row, pixel, sample):
    x, y = next_2d(sequence, pixel, sample)
    numbers[row, pixel], numbers[row + 1, pixel] = x, y


@kernel
def _draw_bsdf(sampler, pixel, sample):
    sequence, numbers = sampler.sequence, sampler.numbers
    if sampler.direct == 0:
        numbers[BSDF_CHOICE, pixel] = next_1d(sequence, pixel, sample)
        _draw_pair(sequence, numbers, BSDF, pixel, sample)
        numbers[ROULETTE, pixel] = next_1d(sequence, pixel, sample)
        return
    for k in range(sampler.bsdf):
        _draw_pair(sequence, numbers, BSDF + SET * k, pixel, sample)
        numbers[BSDF_CHOICE + SET * k, pixel] = next_1d(sequence, pixel, sample)


@method_kernel
def begin_bounce(sampler, shape, tile, sample, rays, hits, count):
    """Draw the numbers that the first `count` paths need at the surfaces just hit.

    `shape` is the shape id by primitive id.
    """
    sequence, numbers = sampler.sequence, sampler.numbers
    for i in range(count):
        prim = hits.prim[i]
        if prim < 0:
            continue
        x, y = slot_pixel(rays.slot[i], 0)
        pixel = (y + tile.y) * tile.film_width + x + tile.x
        if sampler.smooth[shape[prim]] == 1:
            for k in range(sampler.lights):
                _draw_pair(sequence, numbers, LIGHT + SET * k, pixel, sample)
        if sampler.bsdf != 0:
            _draw_bsdf(sampler, pixel, sample)


@kernel
def _pixels(numbers, tile, slots, i):
    """Return the pixels of slots i to i + 15, and the mask of those on the film."""
    pixel = sample_key(tile, load_row(slots, 0, i)).pixel
    return as_i32(pixel), pixel < np.uint32(numbers.shape[1])


@kernel
def _first_row(sampler, block):
    """Return the row offset of a block of numbers; `direct` has rows for each sample."""
    return np.int64(0) if sampler.direct == 0 else SET * (block // BLOCKS_PER_BOUNCE)


@method_kernel
def draw(sampler, tile, sample, block, slots, count, numbers):
    """Write x, y, choice and roulette numbers of the BSDF to `numbers`."""
    drawn, first = sampler.numbers, _first_row(sampler, block)
    for i in range(0, count, 16):
        pixel, inside = _pixels(drawn, tile, slots, i)
        store_row(numbers, 0, i, gather_row(drawn, BSDF + first, pixel, inside))
        store_row(numbers, 1, i, gather_row(drawn, BSDF + 1 + first, pixel, inside))
        store_row(numbers, 2, i, gather_row(drawn, BSDF_CHOICE + first, pixel, inside))
        store_row(numbers, 3, i, gather_row(drawn, ROULETTE + first, pixel, inside))


@method_kernel
def choose_light(sampler, tile, sample, block, turn, lights, slots, count, numbers, light):
    """Write the light, chosen by x, and its numbers: the remainder of x, and y."""
    drawn, first = sampler.numbers, _first_row(sampler, block)
    for i in range(0, count, 16):
        pixel, inside = _pixels(drawn, tile, slots, i)
        x = gather_row(drawn, LIGHT + first, pixel, inside)
        chosen = splat_i32(turn)
        if turn < 0:
            chosen, x = choose_one(x, lights)
        store_row(light, 0, i, chosen)
        store_row(numbers, 0, i, x)
        store_row(numbers, 1, i, gather_row(drawn, LIGHT + 1 + first, pixel, inside))
        store_row(numbers, 2, i, splat_f32(0.0))
