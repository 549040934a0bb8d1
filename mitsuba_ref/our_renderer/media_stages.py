"""The stages of a replay of `volpath` one by one, callable from Python."""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import entry_kernel
from renderer.replay.media.carried import add_found_light
from renderer.replay.media.flight import fly_in_order
from renderer.replay.media.trace import (
    begin_paths,
    draw_directions,
    draw_lights,
    light_collisions,
    light_surfaces,
    next_hits,
    scatter_in_order,
)
from renderer.replay.sequences import begin_sample, next_1d, next_2d, skip_1d

ONE, TWO, SKIPPED = 1, 2, 0
"""Kinds of draws: of one number, of a pair, and of none."""


@entry_kernel
def redraw_step(order, pixel, sample, kinds):
    """Begin a sample of a pixel, and draw as many numbers of these kinds."""
    sequence = order.replay.sequence
    begin_sample(sequence, pixel)
    for kind in kinds:
        if kind == ONE:
            next_1d(sequence, pixel, sample)
        elif kind == TWO:
            next_2d(sequence, pixel, sample)
        else:
            skip_1d(sequence, pixel)


@entry_kernel
def begin_step(order, tile, sample, work, count):
    """Begin the paths of `count` camera rays, whose hits are known."""
    begin_paths(order, tile, sample, work, count)


@entry_kernel
def fly_step(order, tile, sample, work):
    """Let one ray fly; return 1 if it reaches its surface, 2 if it collides, else 0."""
    reached, collisions = fly_in_order(order, tile, sample, work, np.int64(1))
    return reached + 2 * collisions


@entry_kernel
def arrive_step(order, tile, work, count):
    """Add the light of what `count` rays have hit to `work.radiance`."""
    add_found_light(order.carry, order.scene, tile, work, count)


@entry_kernel
def draw_lights_step(order, tile, sample, work, count, collisions):
    """Group hits by BSDF; draw the numbers of their lights, and of collisions."""
    draw_lights(order, tile, sample, work, count, collisions)


@entry_kernel
def light_step(order, tile, sample, work, collisions):
    """Add what light samples carry to `work.radiance`."""
    light_surfaces(order, tile, sample, work)
    light_collisions(order, tile, sample, work, collisions)


@entry_kernel
def draw_directions_step(order, tile, sample, work, count, collisions):
    """Draw the numbers of BSDFs and phase functions."""
    draw_directions(order, tile, sample, work, count, collisions)


@entry_kernel
def scatter_step(order, tile, sample, work, collisions):
    """Put the next rays into `work.rays`; return how many there are."""
    return scatter_in_order(order, tile, sample, work, collisions)


@entry_kernel
def next_hits_step(order, work, count):
    """Intersect the first `count` rays as those of any later bounce."""
    next_hits(order.scene, work, count)
