"""The numbers of a replay, drawn ahead: a sampler like the others for all stages.

Mitsuba draws from one stream for each pixel, one sample after the other, and how many
numbers a bounce takes depends on what is hit. So they are drawn at the start of the bounce
(`begin_bounce`) and lie ready by pixel; the stages ask for them as they ask any sampler.

Order within a sample (Mitsuba 3.9.1, src/render/integrator.cpp, src/integrators/path.cpp):
the place on the film, and that on the lens if there is one; then at each hit from which the
path may go on: two numbers for a light sample if the surface has a smooth part (whichever
side is seen), one and two for the BSDF, one for the roulette. All are drawn even where
nobody uses them. `direct` plays no roulette and draws the BSDF's two before its one: they
are arguments of one call, which the wheel's compiler evaluates from the right.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel, method_kernel
from renderer.kinds.sampling.numbers_and_warps import choose_one
from renderer.lanes.functions import as_i32, splat_f32, splat_i32
from renderer.lanes.memory import gather_row, load_row, store_row
from renderer.records.batch import CAPACITY
from renderer.records.tile import pixel_key, slot_pixel
from renderer.replay.numbers.sequences import begin_sample, next_1d, next_2d

# rows of `Replay.numbers`
FILM = 0  # x, y in the pixel
BSDF_CHOICE = 2
BSDF = 3  # x, y
ROULETTE = 5
LIGHT = 6  # x, y
APERTURE = 8  # x, y on the lens
ROWS = 10


class Replay(NamedTuple):
    """Numbers drawn ahead from a sampler of Mitsuba's, by pixel of the full film."""

    sequence: Any  # a record of renderer.replay.numbers.sequences
    numbers: NDArray[np.float32]  # (ROWS, pixels)
    smooth: NDArray[np.int32]  # (shapes,) 1: light samples are drawn at this shape
    bsdf: int  # 0: the integrator draws nothing for BSDFs
    direct: int  # 1: in the order of `direct`, 0: in that of `path`


@method_kernel
def draw_film(sampler, tile, sample, film):
    """Begin a sample of each pixel of a tile: draw its place on the film."""
    sequence, numbers = sampler.sequence, sampler.numbers
    for slot in range(CAPACITY):
        x, y = slot_pixel(slot)
        if x >= tile.width or y >= tile.height:
            continue
        pixel = (y + tile.y) * tile.film_width + (x + tile.x)
        begin_sample(sequence, pixel)
        dx, dy = next_2d(sequence, pixel, sample)
        numbers[FILM, pixel], numbers[FILM + 1, pixel] = dx, dy
        film[0, slot], film[1, slot] = dx, dy


@method_kernel
def draw_aperture(sampler, tile, sample, film):
    """Draw where on the lens the sample of each pixel of a tile lies."""
    sequence, numbers = sampler.sequence, sampler.numbers
    for slot in range(CAPACITY):
        x, y = slot_pixel(slot)
        if x >= tile.width or y >= tile.height:
            continue
        pixel = (y + tile.y) * tile.film_width + (x + tile.x)
        u, v = next_2d(sequence, pixel, sample)
        numbers[APERTURE, pixel], numbers[APERTURE + 1, pixel] = u, v
        film[2, slot], film[3, slot] = u, v


@kernel
def _draw_bsdf(direct, sequence, numbers, pixel, sample):
    if direct == 0:
        numbers[BSDF_CHOICE, pixel] = next_1d(sequence, pixel, sample)
        numbers[BSDF, pixel], numbers[BSDF + 1, pixel] = next_2d(sequence, pixel, sample)
        numbers[ROULETTE, pixel] = next_1d(sequence, pixel, sample)
        return
    numbers[BSDF, pixel], numbers[BSDF + 1, pixel] = next_2d(sequence, pixel, sample)
    numbers[BSDF_CHOICE, pixel] = next_1d(sequence, pixel, sample)


@method_kernel
def begin_bounce(sampler, shape, tile, sample, rays, hits, count):
    """Draw what the first paths need at the surfaces that they have just hit.

    `shape` is the scene's, by primitive id.
    """
    sequence, numbers = sampler.sequence, sampler.numbers
    for i in range(count):
        prim = hits.prim[i]
        if prim < 0:
            continue
        x, y = slot_pixel(rays.slot[i])
        pixel = (y + tile.y) * tile.film_width + x + tile.x
        if sampler.smooth[shape[prim]] == 1:
            numbers[LIGHT, pixel], numbers[LIGHT + 1, pixel] = next_2d(
                sequence, pixel, sample
            )
        if sampler.bsdf != 0:
            _draw_bsdf(sampler.direct, sequence, numbers, pixel, sample)


@kernel
def _pixels(numbers, tile, slots, i):
    """Return the pixels of slots i to i + 15, and which are on the film."""
    pixel = pixel_key(tile, load_row(slots, 0, i))
    return as_i32(pixel), pixel < np.uint32(numbers.shape[1])


@method_kernel
def draw(sampler, tile, sample, block, slots, count, numbers):
    """Hand out x, y, choice and roulette of the BSDF."""
    drawn = sampler.numbers
    for i in range(0, count, 16):
        pixel, inside = _pixels(drawn, tile, slots, i)
        store_row(numbers, 0, i, gather_row(drawn, BSDF, pixel, inside))
        store_row(numbers, 1, i, gather_row(drawn, BSDF + 1, pixel, inside))
        store_row(numbers, 2, i, gather_row(drawn, BSDF_CHOICE, pixel, inside))
        store_row(numbers, 3, i, gather_row(drawn, ROULETTE, pixel, inside))


@method_kernel
def choose_light(sampler, tile, sample, block, turn, lights, slots, count, numbers, light):
    """Hand out x and y of the light; x chooses it, and the rest of x is its sample's."""
    drawn = sampler.numbers
    for i in range(0, count, 16):
        pixel, inside = _pixels(drawn, tile, slots, i)
        x = gather_row(drawn, LIGHT, pixel, inside)
        chosen = splat_i32(turn)
        if turn < 0:
            chosen, x = choose_one(x, lights)
        store_row(light, 0, i, chosen)
        store_row(numbers, 0, i, x)
        store_row(numbers, 1, i, gather_row(drawn, LIGHT + 1, pixel, inside))
        store_row(numbers, 2, i, splat_f32(0.0))
