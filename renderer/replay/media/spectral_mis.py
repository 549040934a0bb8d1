"""The state of paths in Mitsuba's `volpathmis`: densities per colour [Miller2019].

Let p_j be the density of a path if colour j determines its distances, and f its value. As
j is chosen at random, the throughput is f / mean(p). Light sampling may find the same path,
with densities p'_j. The balance heuristic over both techniques makes the throughput
1 / (mean(p) / f + mean(p') / f).

Mitsuba stores all p_j / f_i as matrices, one for each technique. Up to rounding a matrix is
the throughput f_i / mean(p) and the densities p_j / mean(p), which are stored here. As in
Mitsuba, if the throughput of one technique is 0 only the other counts.

Two faults of Mitsuba are replayed, and bias its pictures. The two f differ behind surfaces
that light passes straight through, and behind null collisions without spectral extinction.
And roulette scales one technique only.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select, splat_f32, splat_mask
from renderer.kernels.lanes.vectors import gather_rows3, select3, vec3
from renderer.plugins.bsdfs.kind import STRAIGHT
from renderer.plugins.media.free_flight import mean
from renderer.replay.media.carried import (
    after_collision,
    after_flight,
    after_ratio,
    any_of,
    begin_path,
    begin_shadow_ray,
    channel_of,
    goes_on,
    grey,
    keep_path,
    keep_shadow_ray,
    load_path,
    load_shadow_ray,
    note_scattered,
    of_channel,
    own_throughput,
    passed_to_light,
    raised,
    rcp,
    rcp_or_zero,
    scatter3,
    throughput_to_light,
    worth,
)
from renderer.replay.media.record import PASSED, ROWS_IN_MEDIA, pixel_of

# Rows of `Replay.numbers`, for a path and for its shadow ray: the densities, then the
# throughput and densities of light sampling. Of a shadow ray the latter throughput is
# relative to that of the ray.
PATH = ROWS_IN_MEDIA
LIT, LIT_DENSITIES = 3, 6  # relative to these
SHADOW = PATH + 9
FOUND = SHADOW + 9  # RGB: PASSED for BSDF sampling
ROWS_OF_MIS = FOUND + 3


class Weights(NamedTuple):
    """The weights of a path in one of the two techniques."""

    throughput: Any  # RGB: f / mean(p)
    densities: Any  # RGB: p / mean(p)


class BothWays(NamedTuple):
    """The state of a path of `volpathmis`."""

    found: Weights  # by sampling directions from BSDFs and phase functions
    lit: Weights  # by a light sample at the last scattering event
    channel: Any  # colour channel that determines distances
    one: Any  # mask: only its density counts (use_spectral_mis is false)


class OfBothWays(NamedTuple):
    """The record of a replay of `volpathmis`."""

    numbers: NDArray[np.float32]  # those of the replay
    one: int  # 1: use_spectral_mis is false


# -------------------------------------------------------------------------------- weights


@kernel
def _weighed(carried, weights, p, f, mask):
    """Return a technique's weights after a step of densities p and values f, RGB."""
    p = select3(carried.one, grey(of_channel(p, carried.channel)), p)
    densities = weights.densities * p
    sum_of_them = mean(densities)
    inverse = rcp_or_zero(sum_of_them)
    throughput = weights.throughput * f * inverse
    return Weights(
        select3(mask, throughput, weights.throughput),
        select3(mask & (inverse > 0.0), densities * inverse, weights.densities),
    )


@kernel
def unless_void(color, one):
    """Return a colour; for a single density, black if one component is 0."""
    all_of_them = (color.x != 0.0) & (color.y != 0.0) & (color.z != 0.0)
    return select3(~one | all_of_them, color, grey(splat_f32(0.0)))


@kernel
def inverse_of(x):
    """Return 1 / x, but 0 for 0."""
    some = x != 0.0
    return select(some, rcp(x, some), splat_f32(0.0))


@kernel
def balanced(mine, other, ratio, one):
    """Return a throughput weighted by the balance heuristic.

    `ratio` is the other technique's density of the last step, divided by that of `mine`.
    """
    x = inverse_of(inverse_of(mine.x) + ratio * inverse_of(other.x))
    y = inverse_of(inverse_of(mine.y) + ratio * inverse_of(other.y))
    z = inverse_of(inverse_of(mine.z) + ratio * inverse_of(other.z))
    return unless_void(vec3(x, y, z), one)


@worth.by(BothWays)
@kernel
def _worth(carried):
    return unless_void(carried.found.throughput, carried.one)


@own_throughput.by(BothWays)
@kernel
def _own_throughput(carried):
    return carried.found.throughput


@goes_on.by(BothWays)
@kernel
def _goes_on(carried):
    lit = carried.one & any_of(carried.lit.throughput)
    return any_of(carried.found.throughput) | lit


@raised.by(BothWays)
@kernel
def _raised(carried, survival, mask):
    found = carried.found
    throughput = found.throughput * rcp(survival, mask)
    found = Weights(select3(mask, throughput, found.throughput), found.densities)
    return BothWays(found, carried.lit, carried.channel, carried.one)


@after_flight.by(BothWays)
@kernel
def _after_flight(carried, passed, density, mask):
    return BothWays(
        _weighed(carried, carried.found, density, passed, mask),
        _weighed(carried, carried.lit, density, passed, mask),
        carried.channel,
        carried.one,
    )


@after_collision.by(BothWays)
@kernel
def _after_collision(carried, collision, mask):
    null, spectral = collision.null, collision.spectral
    sigma_n, share = collision.sigma_n, grey(collision.share)
    of_null = select3(spectral, share, sigma_n)
    of_real = select3(spectral, grey(1.0 - collision.share), collision.sigma_t)
    p, f = select3(null, of_null, of_real), select3(null, sigma_n, collision.sigma_s)
    one, lit = grey(splat_f32(1.0)), select3(spectral, sigma_n, share)
    return BothWays(
        _weighed(carried, carried.found, p, f, mask),
        _weighed(carried, carried.lit, one, lit, mask & null),
        carried.channel,
        carried.one,
    )


@after_ratio.by(BothWays)
@kernel
def _after_ratio(carried, collision, mask):
    spectral, sigma_n = collision.spectral, collision.sigma_n
    p = select3(spectral, grey(collision.share), sigma_n)
    one, lit = grey(splat_f32(1.0)), sigma_n / collision.majorant
    return BothWays(
        _weighed(carried, carried.found, p, sigma_n, mask),
        _weighed(carried, carried.lit, one, select3(spectral, sigma_n, lit), mask),
        carried.channel,
        carried.one,
    )


# ----------------------------------------------------------------------- loads and stores


@kernel
def _load(carry, row, pixel, throughput, mask):
    numbers = carry.numbers
    lit = gather_rows3(numbers, row + LIT, pixel, mask)
    lit_densities = gather_rows3(numbers, row + LIT_DENSITIES, pixel, mask)
    return BothWays(
        Weights(throughput, gather_rows3(numbers, row, pixel, mask)),
        Weights(lit, lit_densities),
        channel_of(numbers, pixel, mask),
        splat_mask(carry.one != 0),
    )


@kernel
def _keep(carry, carried, lit, row, pixel, mask):
    numbers = carry.numbers
    scatter3(numbers, row, pixel, carried.found.densities, mask)
    scatter3(numbers, row + LIT, pixel, lit, mask)
    scatter3(numbers, row + LIT_DENSITIES, pixel, carried.lit.densities, mask)


@load_path.by(OfBothWays)
@kernel
def _load_path(carry, pixel, throughput, mask):
    return _load(carry, PATH, pixel, throughput, mask)


@keep_path.by(OfBothWays)
@kernel
def _keep_path(carry, carried, pixel, mask):
    _keep(carry, carried, carried.lit.throughput, PATH, pixel, mask)


@load_shadow_ray.by(OfBothWays)
@kernel
def _load_shadow_ray(carry, pixel, throughput, mask):
    c = _load(carry, SHADOW, pixel, throughput, mask)
    lit = Weights(c.lit.throughput * throughput, c.lit.densities)
    return BothWays(c.found, lit, c.channel, c.one)


@keep_shadow_ray.by(OfBothWays)
@kernel
def _keep_shadow_ray(carry, carried, pixel, mask, arrives):
    found, lit = carried.found.throughput, carried.lit.throughput
    inverse = vec3(inverse_of(found.x), inverse_of(found.y), inverse_of(found.z))
    _keep(carry, carried, lit * inverse, SHADOW, pixel, mask)
    scatter3(carry.numbers, PASSED, pixel, lit, arrives)
    scatter3(carry.numbers, FOUND, pixel, found, arrives)


@begin_path.by(OfBothWays)
@kernel
def _begin_path(carry, pixel):
    for row in range(PATH, SHADOW):
        carry.numbers[row, pixel] = np.float32(1.0)


@begin_shadow_ray.by(OfBothWays)
@kernel
def _begin_shadow_ray(carry, pixel):
    numbers = carry.numbers
    for c in range(3):
        numbers[SHADOW + c, pixel] = numbers[PATH + c, pixel]
        numbers[SHADOW + LIT + c, pixel] = np.float32(1.0)
        numbers[SHADOW + LIT_DENSITIES + c, pixel] = numbers[PATH + c, pixel]


@throughput_to_light.by(OfBothWays)
@kernel
def _throughput_to_light(carry, throughput):
    return throughput


@note_scattered.by(OfBothWays)
@kernel
def _note_scattered(carry, tile, rays, first, end):
    """Restart the light-sampling weights where rays have scattered, not where straight."""
    numbers = carry.numbers
    for k in range(first, end):
        if rays.lobe[k] == STRAIGHT:
            continue
        pixel = pixel_of(tile, rays.slot[k])
        for c in range(3):
            numbers[PATH + LIT + c, pixel] = rays.throughput[c, k] * rays.pdf[k]
            numbers[PATH + LIT_DENSITIES + c, pixel] = numbers[PATH + c, pixel]


@passed_to_light.by(OfBothWays)
@kernel
def _passed_to_light(carry, pixel, ratio, mask):
    lit = gather_rows3(carry.numbers, PASSED, pixel, mask)
    found = gather_rows3(carry.numbers, FOUND, pixel, mask & any_of(lit))
    return balanced(lit, found, ratio, splat_mask(carry.one != 0))
