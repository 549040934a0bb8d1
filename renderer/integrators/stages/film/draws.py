"""The random numbers of a batch, from a sampler that hashes pixel, sample and dimension.

A sampler's methods: the place of each sample on the film, four numbers for each
surface point, and the light that each point samples.
"""

from __future__ import annotations

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import lane_index, mask_bits, splat_i32
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.records.batch import CAPACITY
from renderer.kernels.records.tile import sample_key, slot_pixel
from renderer.plugins.sampling.numbers_and_warps import (
    APERTURE_BLOCK,
    FILM_BLOCK,
    choose_from_draw,
    draw4_twice,
)


@kernel
def _store(numbers, row, i, drawn, count):
    """Store the first `count` of the numbers drawn for 16 pixels."""
    for k in range(count):
        store_row(numbers, row + k, i, drawn[k])


@kernel
def _write_pair(sampler, tile, sample, block, film, row):
    """Write two numbers in [0, 1) for each sample of a tile's square, by slot."""
    for first in range(tile.square * CAPACITY, (tile.square + 1) * CAPACITY, 32):
        slot = lane_index() + first
        x, y = slot_pixel(slot, tile.level)  # the next 16 are to the right of these
        if mask_bits((x < tile.width) & (y < tile.height)) == 0:
            continue
        here, beside = sample_key(tile, slot), sample_key(tile, slot + 16)
        a, b = draw4_twice(sampler, here, beside, sample, block)
        _store(film, row, first, a, 2)
        _store(film, row, first + 16, b, 2)


@method_kernel
def draw_film(sampler, tile, sample, film):
    """Write where in their pixel the samples of a tile's square lie."""
    _write_pair(sampler, tile, sample, FILM_BLOCK, film, 0)


@method_kernel
def draw_aperture(sampler, tile, sample, film):
    """Write where on the lens the samples of a tile's square lie."""
    _write_pair(sampler, tile, sample, APERTURE_BLOCK, film, 2)


@method_kernel
def draw(sampler, tile, sample, block, slots, count, numbers):
    """Draw four numbers for each of `count` points, in rows of `numbers`."""
    for i in range(0, count, 32):
        here = sample_key(tile, load_row(slots, 0, i))
        next_ones = sample_key(tile, load_row(slots, 0, i + 16))
        a, b = draw4_twice(sampler, here, next_ones, sample, block)
        _store(numbers, 0, i, a, 4)
        _store(numbers, 0, i + 16, b, 4)


@method_kernel
def choose_light(sampler, tile, sample, block, turn, lights, slots, count, numbers, light):
    """Choose the light that each point samples, and draw three numbers for its sample.

    That is light number `turn`; if it is negative, one of all `lights`, at random.
    """
    draw(sampler, tile, sample, block, slots, count, numbers)
    for i in range(0, count, 16):
        if turn >= 0:
            store_row(light, 0, i, splat_i32(turn))
        else:
            x, w = load_row(numbers, 0, i), load_row(numbers, 3, i)
            chosen, x = choose_from_draw(sampler, x, w, lights)
            store_row(light, 0, i, chosen)
            store_row(numbers, 0, i, x)
