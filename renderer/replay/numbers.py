"""The numbers of a replay, drawn ahead: a sampler like the others for all stages.

Mitsuba draws from one stream for each pixel, one sample after the other, and how many
numbers a bounce takes depends on what is hit. So they are drawn at the start of the bounce
(`draws.py`) and lie ready by pixel; the stages ask for them by `sampling.draw4`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from renderer.jit import kernel, record_class
from renderer.lanes.functions import as_i32, splat_f32
from renderer.lanes.memory import gather_row
from renderer.sampling import BLOCKS_PER_BOUNCE, FILM_BLOCK, draw4

# rows of `Replay.numbers`
FILM = 0  # x, y in the pixel
BSDF_CHOICE = 2
BSDF = 3  # x, y
ROULETTE = 5
LIGHT = 6  # x, y
ROWS = 8


class Replay(NamedTuple):
    """Numbers drawn ahead from a sampler of Mitsuba's, by pixel of the full film."""

    sequence: Any  # a record of renderer.replay.sequences
    numbers: NDArray[np.float32]  # (ROWS, pixels)
    smooth: NDArray[np.int32]  # (shapes,) 1: light samples are drawn at this shape
    bsdf: int | None  # None: the integrator draws nothing for BSDFs
    direct: int | None  # None: in the order of `path`


@kernel
def _draw_replayed(sampler, pixel, sample, block):
    """Return four lanes: x, y, choice, roulette of the BSDF; x, y, -, x of a light."""
    numbers = sampler.numbers
    index = as_i32(pixel)
    inside = pixel < np.uint32(numbers.shape[1])  # slots beyond the film's edge ask too
    none = splat_f32(0.0)
    if block == FILM_BLOCK:
        x = gather_row(numbers, FILM, index, inside)
        return x, gather_row(numbers, FILM + 1, index, inside), none, none
    place = (block - 1) % BLOCKS_PER_BOUNCE
    if place == 0:
        return (
            gather_row(numbers, BSDF, index, inside),
            gather_row(numbers, BSDF + 1, index, inside),
            gather_row(numbers, BSDF_CHOICE, index, inside),
            gather_row(numbers, ROULETTE, index, inside),
        )
    x = gather_row(numbers, LIGHT, index, inside)
    # x also chooses the light, and is then stretched over what is left of it
    return x, gather_row(numbers, LIGHT + 1, index, inside), none, x


@overload(draw4)
def _draw4(sampler, pixel, sample, block):
    if record_class(sampler) is not Replay:
        return None
    return lambda sampler, pixel, sample, block: _draw_replayed(
        sampler, pixel, sample, block
    )
