"""Free flight through a medium, and the transmittance of a way through it.

In a homogeneous medium both are closed formulas. In a heterogeneous one tentative
collisions come as often as the densest place of a cell would have them, the majorant; each
is real with the probability sigma_t / majorant [Woodcock1965]. The transmittance is that
of the thinnest place of each cell, exactly, times what is left at tentative collisions with
the rest [Novak2014].

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
from renderer.plugins.media.majorants import cross, enter_cells, way_out
from renderer.plugins.media.volumes import look_up_grid
from renderer.plugins.sampling.numbers_and_warps import hash4, unit_float

_THIRD = np.float32(1.0 / 3.0)
_INFINITE = np.float32(np.inf)
_BITS = np.float32(2.0**24)
# Cells and tentative collisions of one flight, as at an optical depth of 10^6; a path that
# has more ends there.
MOST_STEPS = 1 << 20
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
def _two_more(noise, turn):
    """Return two numbers in [0, 1) for tentative collisions by number."""
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
        flight = _through_grid(media, medium, origin, direction, end, noise, varies, flight)
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
def attenuated_sigma_t(media, medium, distance, mask):
    """Return sigma_t T(distance) of homogeneous media, RGB: densities of each colour."""
    sigma = gather3(media.sigma_t, medium, mask)
    return sigma * _transmittance(sigma, distance)


@kernel
def _enter_box(media, medium, origin, direction, end, mask):
    """Return where rays enter their boxes, 0, how far they go on, and what is before.

    Distances in the box do not drown in that to a far camera.
    """
    near, last = box_of(media, medium, origin, direction, end, mask)
    inside = mask & (near < last)
    start = select3(inside, origin + direction * near, origin)
    return start, splat_f32(0.0), select(inside, last - near, splat_f32(0.0)), near


@kernel
def _step(media, cells, sigma, inverse, t, last, depth, on):
    """Go on to a tentative collision or into the next cell.

    Parameters
    ----------
    sigma, inverse
        How often collisions are tried in the cell [1/length], and one over it.
    t, last
        Where rays are, and where their box or their way ends.
    depth
        The optical depth left to the tentative collision.

    Returns
    -------
    Which rays collide tentatively, and the new t, depth and cells.
    """
    stop = minimum(way_out(cells), last)
    reached = select(sigma > 0.0, t + depth * inverse, splat_f32(_INFINITE))
    tried = on & (reached < stop)
    crossing = on & ~tried
    there = select(tried, reached, select(crossing, maximum(stop, t), t))
    depth = select(crossing, depth - sigma * (there - t), depth)
    return tried, there, depth, cross(cells, media, crossing)


@kernel
def _through_grid(media, medium, origin, direction, end, noise, mask, flight):
    start, t, last, near = _enter_box(media, medium, origin, direction, end, mask)
    weight, collided, steps = _one(), splat_mask(False), 0
    on, turn = mask & (t < last), splat_u32(np.uint32(0))
    u, v = _two_more(noise, turn)
    depth = -log(1.0 - u)  # optical, to the next tentative collision
    cells = enter_cells(media, medium, start, direction, on)
    while mask_bits(on) != 0 and steps < MOST_STEPS:
        steps += 1
        sigma = gather_row(media.cells, 0, cells.cell, on)
        inverse = 1.0 / select(sigma > 0.0, sigma, splat_f32(1.0))
        tried, t, depth, cells = _step(media, cells, sigma, inverse, t, last, depth, on)
        on = on & (t < last)
        if mask_bits(tried) == 0:
            continue
        at = start + direction * t
        real = sigma_t_at(media, medium, at, tried) * inverse  # shares of collisions
        share = mean(real)
        hit = tried & (v < share)
        null = tried & ~hit
        left = 1.0 / select(null, 1.0 - share, splat_f32(1.0))
        weight = select3(null, weight * (_one() - real) * left, weight)
        if mask_bits(hit) != 0:
            scattered = real * albedo_at(media, medium, at, hit)
            weight = select3(
                hit, weight * scattered * (1.0 / select(hit, share, splat_f32(1.0))), weight
            )
        collided = collided | hit
        on = on & ~hit
        turn = select(null, turn + np.uint32(1), turn)
        u, v = _two_more(noise, turn)
        depth = select(null, -log(1.0 - u), depth)
    weight = select3(on, _one() * 0.0, weight)
    return Flight(
        flight.collided | collided,
        select(collided, near + t, flight.distance),
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
    start, t, last, _ = _enter_box(media, medium, origin, direction, end, varies)
    on, turn, steps = varies & (t < last), splat_u32(np.uint32(0)), 0
    u, _ = _two_more(noise, turn)
    depth, surely = -log(1.0 - u), splat_f32(0.0)
    cells = enter_cells(media, medium, start, direction, on)
    while mask_bits(on) != 0 and steps < MOST_STEPS:
        steps += 1
        least = gather_row(media.cells, 1, cells.cell, on)
        sigma = gather_row(media.cells, 0, cells.cell, on) - least
        inverse, before = 1.0 / select(sigma > 0.0, sigma, splat_f32(1.0)), t
        tried, t, depth, cells = _step(media, cells, sigma, inverse, t, last, depth, on)
        surely = surely + select(on, least * (t - before), 0.0)
        on = on & (t < last)
        if mask_bits(tried) == 0:
            continue
        at = start + direction * t
        rest = sigma_t_at(media, medium, at, tried) - vec3(least, least, least)
        passed = select3(tried, passed * (_one() - rest * inverse), passed)
        on = on & (maximum(maximum(passed.x, passed.y), passed.z) > _DARK)
        turn = select(tried, turn + np.uint32(1), turn)
        u, _ = _two_more(noise, turn)
        depth = select(tried, -log(1.0 - u), depth)
    return select3(on, _one() * 0.0, passed * exp(-surely))
