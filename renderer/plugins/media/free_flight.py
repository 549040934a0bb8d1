"""Free flight through a medium, and the transmittance of a way through it.

In a homogeneous medium both are closed formulas. In a heterogeneous one tentative
collisions come as often as its densest place would have them, the majorant; each is real
with the probability sigma_t / majorant [Woodcock1965], and the product of what is left at
each estimates the transmittance [Novak2014].

Where the three colours of sigma_t differ, one of them chooses the distance, and the weight
is that of the balance heuristic over all three [Wilkie2014]: in a homogeneous medium no
colour's weight exceeds 3. In a grid of colours each tentative collision has a weight of its
own, and their product is without bound.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_u32,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_mask,
    splat_u32,
    to_i32,
)
from renderer.kernels.lanes.mathematics import exp, log
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import gather3, gather_rows3, select3, vec3
from renderer.plugins.media.volumes import look_up_grid
from renderer.plugins.sampling.numbers_and_warps import hash4, unit_float

_THIRD = np.float32(1.0 / 3.0)
_INFINITE = np.float32(np.inf)
_BITS = np.float32(2.0**24)
# Tentative collisions of one flight, in the densest place an optical depth of 10^6; a path
# that has more ends there.
_MOST_STEPS = 1 << 20
_DARK = np.float32(1e-12)  # transmittances below it are 0


class Flight(NamedTuple):
    """Where 16 rays go."""

    collided: Any  # mask
    distance: Any  # to the collision
    weight: Any  # RGB that the throughput is multiplied by


class Noise(NamedTuple):
    """What the random numbers of tentative collisions are made of."""

    a: Any
    b: Any


@kernel
def noise_of(x, y):
    """Return the source of more numbers from two in [0, 1)."""
    return Noise(as_u32(to_i32(x * _BITS)), as_u32(to_i32(y * _BITS)))


@kernel
def _two_more(noise, step):
    """Return two numbers in [0, 1) for tentative collision number `step`."""
    turn = splat_u32(np.uint32(step))
    x, y, _, _ = hash4(noise.a, noise.b, turn, splat_u32(np.uint32(0x9E3779B9)))
    return unit_float(x), unit_float(y)


@kernel
def mean(color):
    """Return the mean of three colours."""
    return (color.x + color.y + color.z) * _THIRD


@kernel
def _one():
    one = splat_f32(1.0)
    return vec3(one, one, one)


@kernel
def _color_at(media, constants, grids, medium, position, mask):
    """Return a volume's colours at positions: its constants times its grid's."""
    color = gather3(constants, medium, mask)
    grid = gather_row(grids, 0, medium, mask)
    varying = mask & (grid >= 0)
    if mask_bits(varying) == 0:
        return color
    found = look_up_grid(media.grids, grid, position, varying)
    return select3(varying, color * found, color)


@kernel
def albedo_at(media, medium, position, mask):
    """Return the share of scattering in what collides at positions."""
    return _color_at(media, media.albedo, media.albedo_grid, medium, position, mask)


@kernel
def sigma_t_at(media, medium, position, mask):
    """Return extinction coefficients [1/length] at positions inside of their boxes."""
    return _color_at(media, media.sigma_t, media.sigma_grid, medium, position, mask)


@kernel
def _attenuation(sigma, distance):
    """Return exp(-sigma distance); 1 for sigma 0 at any distance."""
    return select(sigma > 0.0, exp(-sigma * distance), 1.0)


@kernel
def _transmittance(sigma, distance):
    return vec3(
        _attenuation(sigma.x, distance),
        _attenuation(sigma.y, distance),
        _attenuation(sigma.z, distance),
    )


@kernel
def box_of(media, medium, origin, direction, end, mask):
    """Return where rays enter and leave the boxes of their media, cut at `end`."""
    low = gather_rows3(media.box, 0, medium, mask)
    high = gather_rows3(media.box, 3, medium, mask)
    first, last = splat_f32(0.0), end
    first, last = _slab(first, last, origin.x, direction.x, low.x, high.x)
    first, last = _slab(first, last, origin.y, direction.y, low.y, high.y)
    return _slab(first, last, origin.z, direction.z, low.z, high.z)


@kernel
def _slab(first, last, o, d, low, high):
    parallel = d == 0.0
    inverse = 1.0 / select(parallel, splat_f32(1.0), d)
    a, b = (low - o) * inverse, (high - o) * inverse
    outside = parallel & ((o < low) | (o > high))
    near = select(parallel, splat_f32(0.0), minimum(a, b))
    far = select(parallel, select(outside, splat_f32(-1.0), last), maximum(a, b))
    return maximum(first, near), minimum(last, far)


# ----------------------------------------------------------------------------- distance


@kernel
def free_flight(media, medium, origin, direction, end, x, y, noise, mask):
    """Sample where rays collide first before `end`, from x, y in [0, 1) and more noise.

    Parameters
    ----------
    medium
        Ids, in lanes; `mask` says where there is one.
    origin, direction, end
        Rays in the world, unit directions.
    """
    majorant = gather_row(media.majorant, 0, medium, mask)
    even = mask & ~(majorant > 0.0)
    varies = mask & (majorant > 0.0)
    flight = Flight(splat_mask(False), end, _one())
    if mask_bits(even) != 0:
        flight = _through_homogeneous(
            media, medium, origin, direction, end, x, y, even, flight
        )
    if mask_bits(varies) != 0:
        flight = _through_grid(
            media, medium, majorant, origin, direction, end, noise, varies, flight
        )
    return flight


@kernel
def _through_homogeneous(media, medium, origin, direction, end, x, y, mask, flight):
    sigma = gather3(media.sigma_t, medium, mask)
    channel = to_i32(y * 3.0)
    chosen = select(channel == 0, sigma.x, select(channel == 1, sigma.y, sigma.z))
    depth = -log(1.0 - x)  # optical
    t = select(chosen > 0.0, depth / chosen, splat_f32(_INFINITE))
    collided = mask & (t < end)
    distance = select(collided, t, end)
    passed = _transmittance(sigma, distance)
    density = select(collided, mean(sigma * passed), mean(passed))
    inverse = select(density > 0.0, 1.0 / density, 0.0)
    weight = passed * inverse
    if mask_bits(collided) != 0:
        at = origin + direction * distance
        scattered = sigma * albedo_at(media, medium, at, collided)
        weight = select3(collided, weight * scattered, weight)
    return Flight(collided, distance, select3(mask, weight, flight.weight))


@kernel
def _through_grid(media, medium, majorant, origin, direction, end, noise, mask, flight):
    t, last = box_of(media, medium, origin, direction, end, mask)
    inverse = 1.0 / select(mask, majorant, splat_f32(1.0))
    weight, collided, step = _one(), splat_mask(False), 0
    on = mask & (t < last)
    while mask_bits(on) != 0 and step < _MOST_STEPS:
        u, v = _two_more(noise, step)
        step += 1
        t = select(on, t - log(1.0 - u) * inverse, t)
        on = on & (t < last)
        if mask_bits(on) == 0:
            break
        at = origin + direction * t
        real = sigma_t_at(media, medium, at, on) * inverse  # shares of collisions
        share = mean(real)
        hit = on & (v < share)
        null = on & ~hit
        left = 1.0 / select(null, 1.0 - share, splat_f32(1.0))
        weight = select3(null, weight * (_one() - real) * left, weight)
        if mask_bits(hit) != 0:
            scattered = real * albedo_at(media, medium, at, hit)
            weight = select3(
                hit, weight * scattered * (1.0 / select(hit, share, splat_f32(1.0))), weight
            )
        collided = collided | hit
        on = null
    weight = select3(on, _one() * 0.0, weight)
    return Flight(
        flight.collided | collided,
        select(collided, t, flight.distance),
        select3(mask, weight, flight.weight),
    )


# ------------------------------------------------------------------------ transmittance


@kernel
def transmittance(media, medium, origin, direction, end, noise, mask):
    """Return estimates of what gets through from rays' origins to `end`, RGB."""
    majorant = gather_row(media.majorant, 0, medium, mask)
    varies = mask & (majorant > 0.0)
    even = mask & ~(majorant > 0.0)
    passed = _transmittance(gather3(media.sigma_t, medium, even), end)
    passed = select3(even, passed, _one())
    if mask_bits(varies) == 0:
        return passed
    t, last = box_of(media, medium, origin, direction, end, varies)
    inverse = 1.0 / select(varies, majorant, splat_f32(1.0))
    on, step = varies & (t < last), 0
    while mask_bits(on) != 0 and step < _MOST_STEPS:
        u, _ = _two_more(noise, step)
        step += 1
        t = select(on, t - log(1.0 - u) * inverse, t)
        on = on & (t < last)
        at = origin + direction * t
        left = _one() - sigma_t_at(media, medium, at, on) * inverse
        passed = select3(on, passed * left, passed)
        on = on & (maximum(maximum(passed.x, passed.y), passed.z) > _DARK)
    return select3(on, _one() * 0.0, passed)
