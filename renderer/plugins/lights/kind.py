"""The interfaces of a kind of light, and how the lights of a batch are sampled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, method_kernel
from renderer.kernels.lanes.functions import first_lanes, mask_bits
from renderer.kernels.lanes.memory import gather_row, load_row, store_where
from renderer.kernels.lanes.vectors import load3, store3_where
from renderer.plugins.lights.choice.bounds import LightBounds


class LightSample(NamedTuple):
    """One direction to a light for each of 16 points."""

    wi: Any  # unit, towards the light
    distance: Any  # to the light
    radiance: Any  # arriving, over the density: I / r^2 for a point, L / pdf for an area
    pdf: Any  # [1/sr] of wi given the light; 0: the light is a point or a direction


class LightKind(NamedTuple):
    """What the kernels of one kind of light are given."""

    lights: Any  # its table
    index: int  # its row of `Lights.methods`
    kind: NDArray[np.int32]  # that of every light
    arithmetic: Any
    sampled: float  # 1; 0: only found, as an even sky


@dataclass(frozen=True)
class LightPlugin:
    """One kind of emitter.

    Parameters
    ----------
    name
        Of the plugin in scene files.
    description
        The class that `read` returns.
    read
        Makes the description from the properties of a file.
    table
        (lights in all, {light id: description}, a distance beyond the scene) -> the record
        of the kind, columns by light id.
    at_infinity
        Whether it is infinitely far away.
        With textures a further argument are the `LightTextures`, or None.
    bounds
        description -> `LightBounds`: place, directions and power. Lights are chosen by
        them, and they tell which walls can never block the light.
    texture
        The attribute of the description that may be a texture, "" for none. Lights whose
        textures are of different kinds, or without, are in tables of their own.
    on_shapes
        Whether it lies on a shape, in whose element it stands.
    environment
        Whether rays that hit nothing find it: `environment_light` is implemented for it.
        A scene has one at most.
    even
        Whether it is an environment of one radiance from everywhere: BSDF samples alone,
        which go where the BSDF reflects most, then mostly find it with less noise than
        light samples, or both together (`Plan.finds_sky`).
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

    `lights` are the kind's table, `kind` is the whole `LightKind`.
    """


@method_kernel
def sample_lights_of(kind, points, numbers, samples, count):
    """Sample those of the chosen lights that are of one kind, for the first points."""
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
