"""Phase function samples from the same random numbers as in Mitsuba.

Each plugin has its own formula for the cosine and its own azimuth; `isotropic` samples in
world space.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    mask_bits,
    maximum,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.vectors import orthonormal_basis, select3, vec3
from renderer.kernels.records.media import (
    HENYEY_GREENSTEIN,
    ISOTROPIC,
    TABULATED,
)
from renderer.plugins.media.phase_functions import sample_leaf, share_at
from renderer.plugins.sampling.numbers_and_warps import TWO_PI
from renderer.replay.directions import sincos_as_mitsuba

_ONE = np.float32(1.0)
_TWO = np.float32(2.0)
_EPSILON = np.float32(2.0**-24)


class _Turn(NamedTuple):
    """A direction in the frame of wi, or in the world for `isotropic`."""

    x: Any
    y: Any
    z: Any


@kernel
def _cosine_of_hg(g, x):
    """Return the cosine between wi and the sampled direction, negated."""
    if abs(g) < _EPSILON:
        return _ONE - _TWO * x
    term = (_ONE - g * g) / ((_ONE - g) + (_TWO * g) * x)
    return ((_ONE + g * g) - term * term) / (_TWO * g)


@kernel
def _turn(media, leaf, x, y):
    kind = media.phase_kind[leaf]
    around = (x if kind == ISOTROPIC else y) * TWO_PI
    sin_phi, cos_phi = sincos_as_mitsuba(around)
    if kind == ISOTROPIC:
        z = _ONE - _TWO * y
    elif kind == HENYEY_GREENSTEIN:
        z = -_cosine_of_hg(media.phase_g[leaf], x)
    else:
        z = sample_leaf(media, leaf, x)
    sine = sqrt(maximum(_ONE - z * z, splat_f32(0.0)))
    if kind == TABULATED:
        return _Turn(-(sine * cos_phi), -(sine * sin_phi), -z)
    return _Turn(sine * cos_phi, sine * sin_phi, z)


@kernel
def sample_phase_in_order(media, medium, position, wo, x, y, choice, mask):
    """Return the sampled directions of paths at collisions.

    Parameters
    ----------
    medium
        Medium ids, in lanes; only those in `mask` count.
    position
        Positions of the collisions, in the world.
    wo
        Unit vectors, back along the rays.
    x, y, choice
        The pair of random numbers, and the one that chooses a phase function of a mixture.
    """
    s, t = orthonormal_basis(wo)
    direction = wo
    for k in range(media.count):
        mine = mask & (medium == np.int32(k))
        if mask_bits(mine) == 0:
            continue
        # The smallest numbers choose the last phase function of a mixture.
        first, end = media.phase_begin[k], media.phase_begin[k + 1]
        left, up_to = mine, splat_f32(0.0)
        for back in range(end - first):
            leaf = end - 1 - back
            up_to = up_to + share_at(media, leaf, position, mine)
            taken = left if leaf == first else left & (choice <= up_to)
            left = left & ~taken
            if mask_bits(taken) == 0:
                continue
            turn = _turn(media, leaf, x, y)
            if media.phase_kind[leaf] == ISOTROPIC:
                chosen = vec3(turn.x, turn.y, turn.z)
            else:
                chosen = s * turn.x + t * turn.y + wo * turn.z
            direction = select3(taken, chosen, direction)
    return direction
