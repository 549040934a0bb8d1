"""PCG32, the generator of Mitsuba's samplers: 64 bits of state, 32 out [ONeill2014]."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.kernels.jit import kernel

DEFAULT_STREAM = 0xDA3E39CB94B95BDB
_MULTIPLIER = np.uint64(0x5851F42D4C957F2D)
_INCREMENT = np.uint64((DEFAULT_STREAM << 1 | 1) & 0xFFFFFFFFFFFFFFFF)
_BELOW_ONE = np.float32(2.0**-23)


def pcg32_seed(initstate: ArrayLike) -> NDArray[np.uint64]:
    """Return the states of generators seeded with `initstate` on the default stream."""
    seeds = np.asarray(initstate).astype(np.uint64)
    with np.errstate(over="ignore"):
        return (seeds + _INCREMENT) * _MULTIPLIER + _INCREMENT


@kernel
def next_u32(state, pixel):
    """Return 32 random bits from the generator of a pixel, and move it on."""
    old = state[pixel]
    state[pixel] = old * _MULTIPLIER + _INCREMENT
    shifted = np.uint32(((old >> np.uint64(18)) ^ old) >> np.uint64(27))
    turn = np.uint32(old >> np.uint64(59))
    back = np.uint32((np.uint32(32) - turn) & np.uint32(31))
    return np.uint32((shifted >> turn) | (shifted << back))


@kernel
def next_float(state, pixel):
    """Return a number in [0, 1) of 23 bits, as Mitsuba makes it."""
    return np.float32(next_u32(state, pixel) >> np.uint32(9)) * _BELOW_ONE
