"""Null surface: light passes straight through; the path gets one segment longer.

Shadow rays treat it as opaque, as in Mitsuba's `path`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import splat_f32, splat_i32
from renderer.kernels.lanes.vectors import vec3
from renderer.plugins.bsdfs.kind import STRAIGHT, BsdfKind, BsdfSample
from renderer.scene_file.description import Null as Description


class Null(NamedTuple):
    """It has no parameters."""


def read(properties: Any) -> Description:
    """Read the properties of a file: there are none."""
    return Description()


@kernel
def sample(null, wo, numbers):
    """Sample the direction -wo."""
    one = splat_f32(1.0)
    return BsdfSample(-wo, vec3(one, one, one), one, one, splat_i32(STRAIGHT))


@kernel
def eval_straight(null, wo):
    """Return the transmittance 1."""
    one = splat_f32(1.0)
    return vec3(one, one, one)


NULL = BsdfKind(
    "null",
    Null,
    read,
    "not there: light goes straight on",
    sample,
    delta=True,
    transmits=True,
    straight=True,
    eval_straight=eval_straight,
)
