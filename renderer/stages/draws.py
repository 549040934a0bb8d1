"""The random numbers of a batch, from a sampler that hashes pixel, sample and dimension.

A sampler's methods: the place of each pixel's sample on the film, four numbers for each
surface point, and the light that each point samples.
"""

from __future__ import annotations

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import lane_index, mask_bits, splat_i32
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.records.batch import CAPACITY
from renderer.kernels.records.tile import pixel_key, slot_pixel
from renderer.kinds.sampling.numbers_and_warps import (
    APERTURE_BLOCK,
    FILM_BLOCK,
    choose_from_draw,
    draw4,
)


@kernel
def _write_pair(sampler, tile, sample, block, film, row):
    """Write two numbers in [0, 1) for the sample of each pixel of a tile, by slot."""
    for first in range(0, CAPACITY, 16):
        slot = lane_index() + first
        x, y = slot_pixel(slot)
        if mask_bits((x < tile.width) & (y < tile.height)) == 0:
            continue
        u, v, _, _ = draw4(sampler, pixel_key(tile, slot), sample, block)
        store_row(film, row, first, u)
        store_row(film, row + 1, first, v)


@method_kernel
def draw_film(sampler, tile, sample, film):
    """Write where in their pixel the samples of a tile lie."""
    _write_pair(sampler, tile, sample, FILM_BLOCK, film, 0)


@method_kernel
def draw_aperture(sampler, tile, sample, film):
    """Write where on the lens the samples of a tile lie."""
    _write_pair(sampler, tile, sample, APERTURE_BLOCK, film, 2)


@method_kernel
def draw(sampler, tile, sample, block, slots, count, numbers):
    """Draw four numbers for each of `count` points, in rows of `numbers`."""
    for i in range(0, count, 16):
        key = pixel_key(tile, load_row(slots, 0, i))
        x, y, z, w = draw4(sampler, key, sample, block)
        store_row(numbers, 0, i, x)
        store_row(numbers, 1, i, y)
        store_row(numbers, 2, i, z)
        store_row(numbers, 3, i, w)


@method_kernel
def choose_light(sampler, tile, sample, block, turn, lights, slots, count, numbers, light):
    """Choose the light that each point samples, and draw three numbers for its sample.

    That is light number `turn`; if it is negative, one of all `lights`, at random.
    """
    for i in range(0, count, 16):
        key = pixel_key(tile, load_row(slots, 0, i))
        x, y, z, w = draw4(sampler, key, sample, block)
        if turn >= 0:
            store_row(light, 0, i, splat_i32(turn))
        else:
            chosen, x = choose_from_draw(sampler, x, w, lights)
            store_row(light, 0, i, chosen)
        store_row(numbers, 0, i, x)
        store_row(numbers, 1, i, y)
        store_row(numbers, 2, i, z)
