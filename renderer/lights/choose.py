"""Asking the lights: one of all, chosen at random, or each in turn."""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.lanes.functions import minimum, splat_f32, splat_i32, to_f32, to_i32
from renderer.lanes.memory import gather_row
from renderer.lights.area import sample_area_lights
from renderer.lights.constant import sample_constant_lights
from renderer.lights.directional import sample_directional_lights
from renderer.lights.light_sample import LightSample
from renderer.lights.point import sample_point_lights
from renderer.lights.spot import sample_spot_lights
from renderer.vectors import vec3


@kernel
def lights_asked(lights, every_light):
    """Return how many lights are asked at each surface point."""
    return 1 if every_light is None else lights.count


@kernel
def light_probability(lights, every_light):
    """Return the probability that a given light is asked, the same for all of them."""
    return np.float32(1.0 / lights.count) if every_light is None else np.float32(1.0)


@kernel
def _place(replay, scaled, light, x):
    """Return the first number for the light's own sample."""
    if replay is None:
        return x
    return scaled - to_f32(light)


@kernel
def choose_light(lights, every_light, replay, turn, x, number):
    """Return the light to ask in a turn, and the first number of its own sample.

    Where one of all is asked, `number` in [0, 1) chooses it. The sample's number is x; in
    a replay of Mitsuba it is what the choice has left over of `number`.
    """
    if every_light is not None:
        return splat_i32(turn), x
    last = np.float32(lights.count - 1)
    scaled = number * np.float32(lights.count)
    light = to_i32(minimum(scaled, splat_f32(last)))
    return light, _place(replay, scaled, light, x)


@kernel
def sample_light(lights, surfaces, light, position, x, y, z):
    """Sample a direction from each of 16 points to its light; return a `LightSample`."""
    zero = splat_f32(0.0)
    none = vec3(zero, zero, zero)
    kind = gather_row(lights.kind, 0, light, light >= 0)
    sample = LightSample(none, zero, none, zero)
    sample = sample_point_lights(lights.points, light, kind, position, sample)
    sample = sample_spot_lights(lights.spots, light, kind, position, sample)
    sample = sample_directional_lights(lights.directionals, light, kind, sample)
    sample = sample_constant_lights(lights.constants, light, kind, x, y, sample)
    return sample_area_lights(
        lights.areas, surfaces, light, kind, position, x, y, z, sample
    )
