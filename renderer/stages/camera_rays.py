"""Stage 1, ray generation: one camera ray for each pixel of a tile, x(t) = p + t d."""

from __future__ import annotations

import numpy as np

from renderer.batch import CAPACITY
from renderer.jit import kernel
from renderer.lanes.functions import (
    lane,
    lane_index,
    lowest_bit,
    mask_bits,
    popcount,
    splat_f32,
    splat_i32,
    to_f32,
)
from renderer.lanes.memory import append_row
from renderer.replay.camera import round_camera_ray
from renderer.replay.draws import draw_film_places
from renderer.sampling import FILM_BLOCK, draw4
from renderer.stages.tile import pixel_key, slot_pixel
from renderer.vectors import append3, column, dot, normalize, vec3


@kernel
def film_position(sampler, tile, slot, sample):
    """Return where on the full film, in pixels, a sample of the slots' pixels lies."""
    x, y = slot_pixel(slot)
    dx, dy, _, _ = draw4(sampler, pixel_key(tile, slot), sample, FILM_BLOCK)
    return to_f32(x + tile.x) + dx, to_f32(y + tile.y) + dy


@kernel
def _round(replayed, rays, count, inside, px, py):
    """Round the rays just appended as Mitsuba does, if this is a replay."""
    if replayed is None:
        return
    bits = mask_bits(inside)
    while bits != 0:
        j = lowest_bit(bits)
        bits &= bits - 1
        round_camera_ray(replayed.camera, rays, count, lane(px, j), lane(py, j))
        count += 1


@kernel
def camera_rays(camera, sampler, replayed, tile, sample, rays, hits):
    """Fill `rays` with one ray for each pixel of the tile; return how many.

    It is given what it looks at and not the whole scene: so it is not compiled anew for
    each kind of scene.
    """
    draw_film_places(sampler, tile, sample)
    one = vec3(splat_f32(1.0), splat_f32(1.0), splat_f32(1.0))
    count = 0
    for first in range(0, CAPACITY, 16):
        slot = lane_index() + first
        x, y = slot_pixel(slot)
        inside = (x < tile.width) & (y < tile.height)
        if mask_bits(inside) == 0:
            continue
        px, py = film_position(sampler, tile, slot, sample)
        direction = normalize(
            column(camera.corner, 0)
            + px * column(camera.right, 0)
            + py * column(camera.down, 0)
        )
        # the near plane cuts the ray's start, the far plane its end
        along = 1.0 / dot(direction, column(camera.forward, 0))
        near = np.float32(camera.near) * along
        append3(rays.origin, count, column(camera.origin, 0) + direction * near, inside)
        append3(rays.direction, count, direction, inside)
        append3(rays.throughput, count, one, inside)
        append_row(rays.pdf, 0, count, splat_f32(0.0), inside)
        append_row(rays.eta, 0, count, splat_f32(1.0), inside)
        append_row(rays.slot, 0, count, slot, inside)
        append_row(hits.t, 0, count, np.float32(camera.far) * along - near, inside)
        append_row(hits.prim, 0, count, splat_i32(-1), inside)
        _round(replayed, rays, count, inside, px, py)
        count += popcount(mask_bits(inside))
    return count
