"""What a kind of light consists of: its table, its sampling, and MIS weights.

Tables of lights have one column for each light id, zero for lights of other kinds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, interface, kernel, method_kernel
from renderer.kernels.lanes.functions import (
    first_lanes,
    lane,
    lowest_bit,
    mask_bits,
    maximum,
    select,
    splat_f32,
)
from renderer.kernels.lanes.memory import gather_row, load_row, store_where
from renderer.kernels.lanes.vectors import length, load3, store3_where, vec3
from renderer.plugins.lights.light_tree import LightBounds
from renderer.plugins.sampling.numbers_and_warps import power_heuristic


def vector_columns(count: int, rows: dict[int, Any]) -> NDArray[np.float32]:
    """Return (4, count), vectors for `gather_vectors`; zero for ids without a vector."""
    table = np.zeros((4, count), np.float32)
    for i, row in rows.items():
        table[:3, i] = row
    return by_columns(table)


def number_column(count: int, values: dict[int, float]) -> NDArray[np.float32]:
    """Return (count,) with the given numbers, zero elsewhere."""
    table = np.zeros(count, np.float32)
    for i, value in values.items():
        table[i] = value
    return table


# ------------------------------------------------------------------------------ weights
# Multiple importance sampling (MIS): weights of light samples and BSDF samples.


@kernel
def light_probability(lights, settings):
    """Return the probability that a light is selected, if all are equally likely.

    Returns 1 otherwise: the pdfs of light samples and of rays that hit a light then already
    contain it (`choice.choose_by_importance`).
    """
    if settings.every_light != 0 or lights.choice.shape[0] != 0:
        return np.float32(1.0)
    return np.float32(1.0 / max(1, lights.sampled.size))


@kernel
def light_sample_weight(settings, light_pdf, bsdf_pdf):
    """Return the MIS weight of a light sample; 1 for delta lights, whose pdf is 0."""
    if settings.weigh == 0:
        return splat_f32(1.0)
    weight = power_heuristic(light_pdf * np.float32(settings.light_share), bsdf_pdf)
    return select(light_pdf > 0.0, weight, 1.0)


@kernel
def bsdf_sample_weight(settings, pdf, light_pdf):
    """Return the MIS weight of a BSDF sample; 1 for delta lobes, whose pdf is 0."""
    if settings.weigh == 0:
        return splat_f32(1.0)
    weight = power_heuristic(pdf, light_pdf * np.float32(settings.light_share))
    return select(pdf > 0.0, weight, 1.0)


@kernel
def add_lanes(radiance, slot, value, mask):
    """Add the masked lanes of a colour to their paths' radiance, one lane after another."""
    bits = mask_bits(mask)
    while bits != 0:
        j = lowest_bit(bits)
        bits &= bits - 1
        s = lane(slot, j)
        radiance[0, s] += lane(value.x, j)
        radiance[1, s] += lane(value.y, j)
        radiance[2, s] += lane(value.z, j)


# ------------------------------------------------------------------------------ placing
# Reading of positions and orientations, for all emitters of scene files.

STRETCH = 1e-4  # axes whose lengths differ by less than this fraction count as equal


def one_of(properties: Any, name: str) -> None:
    """Refuse a property that is given together with `to_world`, which replaces it."""
    if properties.has(name) and properties.has("to_world"):
        properties.fail(name, 'a value together with "to_world"', "one of the two")


# --------------------------------------------------------------------------------- kind
# The interfaces of a kind of light, and light sampling for a batch of points.


class LightSample(NamedTuple):
    """One direction to a light for each of 16 points."""

    wi: Any  # unit vector to the light
    distance: Any  # to the light
    radiance: Any  # incident radiance / pdf; I / r^2 for a point light
    pdf: Any  # [1/sr] of wi given the light; 0 for a delta light


class SphereAround(NamedTuple):
    """A sphere around all surfaces; lights at infinity are beyond it."""

    center: NDArray[np.float32]  # (3,)
    radius: float


@kernel
def distance_beyond(around, position):
    """Return lengths at which rays from 16 points have left the sphere in any direction.

    In a replay the sphere is Mitsuba's: a shadow ray starts off the surface, and ends at
    this distance from the surface. So its direction depends on the distance.
    """
    center = vec3(around.center[0], around.center[1], around.center[2])
    radius = splat_f32(np.float32(around.radius))
    return 2.0 * maximum(length(position - center), radius)


class LightKind(NamedTuple):
    """Arguments of the kernels of one kind of light."""

    lights: Any  # the table of the kind
    index: int  # its row of `Lights.methods`
    kind: NDArray[np.int32]  # (lights,) index of the kind of each light
    arithmetic: Any
    sampled: float  # 1: has light samples; 0: found by BSDF samples alone


@dataclass(frozen=True)
class LightPlugin:
    """One kind of emitter.

    Parameters
    ----------
    name
        Name of the plugin in scene files.
    description
        Class of the scene description that `read` returns.
    read
        Function of the properties of a file that returns the description.
    table
        (number of all lights, {light id: description}, a sphere around the scene) ->
        the record of the kind, columns by light id. For a kind with textures, a further
        argument is the `LightTextures` or None.
    at_infinity
        Whether the light is infinitely far away.
    bounds
        description -> `LightBounds`: position, directions and power. They are used to
        select lights, and to find surfaces that can never block them.
    texture
        Attribute of the description that may be a texture; "" if none. Lights with
        textures of different kinds, and lights without, are in separate tables.
    on_shapes
        Whether the emitter is nested in a shape.
    environment
        Whether rays that hit nothing find it: it implements `environment_light`. A
        scene has at most one.
    even
        Whether it is an environment of constant radiance. BSDF sampling alone then
        mostly has less noise than light samples, or than MIS of both
        (`Plan.finds_sky`).
    """

    name: str
    description: type
    read: Callable[[Any], Any]
    table: Callable[..., Any] | None = None  # None: by `light_tables`, with its shapes
    # None: by `light_bounds`, with its shape
    bounds: Callable[[Any], LightBounds] | None = None
    texture: str = ""
    on_shapes: bool = False
    at_infinity: bool = False
    environment: bool = False
    even: bool = False


@interface
def sample_light(
    lights: Any, kind: Any, light: Any, mask: Any, position: Any, x: Any, y: Any, z: Any
) -> LightSample:
    """Sample a direction from each of 16 points to a light of this kind, given by id.

    `lights` is the table of the kind, `kind` the whole `LightKind`.
    """


@method_kernel
def sample_lights_of(kind, points, numbers, samples, count):
    """Sample the selected lights of one kind, for the first `count` points."""
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        light = load_row(samples.light, 0, i)
        mine = valid & (gather_row(kind.kind, 0, light, valid) == kind.index)
        if mask_bits(mine) == 0:
            continue
        s = sample_light(
            kind.lights,
            kind,
            light,
            mine,
            load3(points.position, i),
            load_row(numbers, 0, i),
            load_row(numbers, 1, i),
            load_row(numbers, 2, i),
        )
        store3_where(samples.wi, i, s.wi, mine)
        store_where(samples.distance, 0, i, s.distance, mine)
        store3_where(samples.radiance, i, s.radiance, mine)
        store_where(samples.pdf, 0, i, s.pdf, mine)
