"""Camera rays of a batch of samples, and the samples' random numbers."""

from __future__ import annotations

from renderer.kernels.jit import call, count_of, entry_kernel, kernel, method_kernel
from renderer.kernels.lanes.functions import (
    lane_index,
    mask_bits,
    popcount,
    splat_f32,
    splat_i32,
    to_f32,
)
from renderer.kernels.lanes.memory import append_row, load_row, store_row
from renderer.kernels.lanes.vectors import append3, vec3
from renderer.kernels.records.batch import CAPACITY, sample_key, slot_pixel
from renderer.kernels.records.kernel_scene import (
    AFTER_CAMERA_RAYS,
    DRAW_APERTURE,
    DRAW_FILM,
    FILL_RAYS,
    RECORD,
)
from renderer.plugins.sampling.numbers_and_warps import (
    APERTURE_BLOCK,
    FILM_BLOCK,
    choose_from_draw,
    draw4_twice,
)
from renderer.plugins.sensors.kind import camera_ray

# -------------------------------------------------------------------------------- draws
# The random numbers of a batch, from a sampler that hashes pixel, sample and dimension.
#
# A sampler has methods for the film position of each sample, for four numbers per surface
# point, and for the light that each point samples.


@kernel
def _store(numbers, row, i, drawn, count):
    """Store the first `count` of the numbers drawn for 16 pixels."""
    for k in range(count):
        store_row(numbers, row + k, i, drawn[k])


@kernel
def _write_pair(sampler, tile, sample, block, film, row):
    """Write two numbers in [0, 1) for each sample of a tile's square, indexed by slot."""
    for first in range(tile.square * CAPACITY, (tile.square + 1) * CAPACITY, 32):
        slot = lane_index() + first
        x, y = slot_pixel(slot, tile.level)  # the next 16 slots are to the right
        if mask_bits((x < tile.width) & (y < tile.height)) == 0:
            continue
        here, after = sample_key(tile, slot), sample_key(tile, slot + 16)
        a, b = draw4_twice(sampler, here, after, sample, block)
        _store(film, row, first, a, 2)
        _store(film, row, first + 16, b, 2)


@method_kernel
def draw_film(sampler, tile, sample, film):
    """Write the position in its pixel of each sample of a tile's square."""
    _write_pair(sampler, tile, sample, FILM_BLOCK, film, 0)


@method_kernel
def draw_aperture(sampler, tile, sample, film):
    """Write the position on the lens of each sample of a tile's square."""
    _write_pair(sampler, tile, sample, APERTURE_BLOCK, film, 2)


@method_kernel
def draw(sampler, tile, sample, block, slots, count, numbers):
    """Draw four numbers for each of `count` points, into the rows of `numbers`."""
    for i in range(0, count, 32):
        here = sample_key(tile, load_row(slots, 0, i))
        next_ones = sample_key(tile, load_row(slots, 0, i + 16))
        a, b = draw4_twice(sampler, here, next_ones, sample, block)
        _store(numbers, 0, i, a, 4)
        _store(numbers, 0, i + 16, b, 4)


@method_kernel
def choose_light(sampler, tile, sample, block, turn, lights, slots, count, numbers, light):
    """Choose the light that each point samples, and draw three numbers for its sample.

    The light is number `turn`; if `turn` is negative, it is one of all `lights` at random.
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


# -------------------------------------------------------------------------- camera rays
# Stage 1, ray generation: one camera ray x(t) = p + t d per sample of a batch.


@kernel
def camera_rays(scene, tile, sample, work, first):
    """Append one camera ray per sample of a tile's square after the first `first` rays.

    Writes the samples' positions on the full film [pixels] to `work.film`. Returns the new
    number of rays.
    """
    rays, film, sampler, sensor = work.rays, work.film, scene.sampler, scene.sensor
    call(sampler[0, DRAW_FILM], sampler[0, RECORD], (tile, sample, film))
    if sampler[0, DRAW_APERTURE] != 0:
        call(sampler[0, DRAW_APERTURE], sampler[0, RECORD], (tile, sample, film))
    count = count_of(
        sensor[0, FILL_RAYS], sensor[0, RECORD], (tile, rays, work.hits, film, first)
    )
    after = scene.hooks
    if after[AFTER_CAMERA_RAYS, 1] != 0:
        call(
            after[AFTER_CAMERA_RAYS, 1],
            after[AFTER_CAMERA_RAYS, RECORD],
            (rays, count, film),
        )
    return count


@method_kernel
def fill_rays(sensor, tile, rays, hits, film, count):
    """Append rays for the samples whose positions in their pixels are in `film`.

    `count` rays exist already. Replaces the positions in `film` by those on the full film
    [pixels]. Returns the new number of rays.
    """
    one = vec3(splat_f32(1.0), splat_f32(1.0), splat_f32(1.0))
    for first in range(tile.square * CAPACITY, (tile.square + 1) * CAPACITY, 16):
        slot = lane_index() + first
        x, y = slot_pixel(slot, tile.level)
        inside = (x < tile.width) & (y < tile.height)
        if mask_bits(inside) == 0:
            continue
        px = to_f32(x + tile.x) + load_row(film, 0, first)
        py = to_f32(y + tile.y) + load_row(film, 1, first)
        store_row(film, 0, first, px)
        store_row(film, 1, first, py)
        ray = camera_ray(sensor, px, py, load_row(film, 2, first), load_row(film, 3, first))
        append3(rays.origin, count, ray.origin, inside)
        append3(rays.direction, count, ray.direction, inside)
        append3(rays.throughput, count, one, inside)
        append_row(rays.pdf, 0, count, splat_f32(0.0), inside)
        append_row(rays.eta, 0, count, splat_f32(1.0), inside)
        append_row(rays.slot, 0, count, slot, inside)
        append_row(hits.t, 0, count, ray.length, inside)
        append_row(hits.prim, 0, count, splat_i32(-1), inside)
        count += popcount(mask_bits(inside))
    return count


@entry_kernel
def camera_rays_through(sensor, tile, work, count):
    """Append the rays of a tile's square to `count` others; return the new number.

    `sensor` is the sensor's table of methods. Rows 0 and 1 of `work.film` hold the
    positions on the full film [pixels], whatever the tile; rows 2 and 3 those on the lens.
    """
    film = work.film
    for first in range(tile.square * CAPACITY, (tile.square + 1) * CAPACITY, 16):
        x, y = slot_pixel(lane_index() + first, tile.level)
        store_row(film, 0, first, load_row(film, 0, first) - to_f32(x + tile.x))
        store_row(film, 1, first, load_row(film, 1, first) - to_f32(y + tile.y))
    return count_of(
        sensor[0, FILL_RAYS],
        sensor[0, RECORD],
        (tile, work.rays, work.hits, film, count),
    )
