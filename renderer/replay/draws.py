"""The stage that draws Mitsuba's numbers, in its order; it is empty for our own samplers.

Order within a sample (Mitsuba 3.9.1, src/render/integrator.cpp, src/integrators/path.cpp):
the place on the film; then at each hit from which the path may go on: two numbers for a
light sample if the surface has a smooth part (whichever side is seen), one and two for the
BSDF, one for the roulette. All are drawn even where nobody uses them. `direct` plays no
roulette and draws the BSDF's two before its one: they are arguments of one call, which the
wheel's compiler evaluates from the right.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from renderer.jit import kernel, never_inline, record_class
from renderer.replay.numbers import BSDF, BSDF_CHOICE, FILM, LIGHT, ROULETTE, Replay
from renderer.replay.sequences import begin_sample, next_1d, next_2d
from renderer.stages.tile import slot_pixel


def draw_film_places(sampler: Any, tile: Any, sample: int) -> None:
    """Begin a sample of each pixel of a tile: draw its place on the film."""
    raise TypeError("inside kernels only")


def draw_bounce(
    sampler: Any, shape: Any, tile: Any, sample: int, rays: Any, hits: Any, n: int
) -> None:
    """Draw what the first n paths need at the surfaces that they have just hit.

    `shape` is the scene's, by primitive id.
    """
    raise TypeError("inside kernels only")


@kernel
def _nothing_for_film(sampler, tile, sample):
    return


@kernel
def _nothing_for_bounce(sampler, shape, tile, sample, rays, hits, n):
    return


@kernel
def _replay_film_places(sampler, tile, sample):
    never_inline()
    sequence, numbers = sampler.sequence, sampler.numbers
    for y in range(tile.y, tile.y + tile.height):
        for x in range(tile.x, tile.x + tile.width):
            pixel = y * tile.film_width + x
            begin_sample(sequence, pixel)
            numbers[FILM, pixel], numbers[FILM + 1, pixel] = next_2d(
                sequence, pixel, sample
            )


@kernel
def _draw_bsdf(direct, sequence, numbers, pixel, sample):
    if direct is None:
        numbers[BSDF_CHOICE, pixel] = next_1d(sequence, pixel, sample)
        numbers[BSDF, pixel], numbers[BSDF + 1, pixel] = next_2d(sequence, pixel, sample)
        numbers[ROULETTE, pixel] = next_1d(sequence, pixel, sample)
        return
    numbers[BSDF, pixel], numbers[BSDF + 1, pixel] = next_2d(sequence, pixel, sample)
    numbers[BSDF_CHOICE, pixel] = next_1d(sequence, pixel, sample)


@kernel
def _draw_for_scattering(bsdf, direct, sequence, numbers, pixel, sample):
    if bsdf is None:
        return
    _draw_bsdf(direct, sequence, numbers, pixel, sample)


@kernel
def _replay_bounce(sampler, shape, tile, sample, rays, hits, n):
    never_inline()
    sequence, numbers = sampler.sequence, sampler.numbers
    for i in range(n):
        prim = hits.prim[i]
        if prim < 0:
            continue
        x, y = slot_pixel(rays.slot[i])
        pixel = (y + tile.y) * tile.film_width + x + tile.x
        if sampler.smooth[shape[prim]] == 1:
            numbers[LIGHT, pixel], numbers[LIGHT + 1, pixel] = next_2d(
                sequence, pixel, sample
            )
        _draw_for_scattering(sampler.bsdf, sampler.direct, sequence, numbers, pixel, sample)


@overload(draw_film_places)
def _draw_film_places(sampler, tile, sample):
    replays = record_class(sampler) is Replay
    draw = _replay_film_places if replays else _nothing_for_film
    return lambda sampler, tile, sample: draw(sampler, tile, sample)


@overload(draw_bounce)
def _draw_bounce(sampler, shape, tile, sample, rays, hits, n):
    replays = record_class(sampler) is Replay
    draw = _replay_bounce if replays else _nothing_for_bounce
    return lambda sampler, shape, tile, sample, rays, hits, n: draw(
        sampler, shape, tile, sample, rays, hits, n
    )
