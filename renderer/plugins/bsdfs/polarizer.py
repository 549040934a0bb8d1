"""Filters for polarized light, without polarization: light goes straight on, tinted.

As in Mitsuba's unpolarized variants, `polarizer` and `circular` let half of the light
through, and `retarder` all of it; angles make no difference.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import splat_f32, splat_i32
from renderer.plugins.bsdfs.kind import STRAIGHT, BsdfKind, BsdfSample, Color, Float
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.objects import read_scalar_texture, read_texture


class Filter(NamedTuple):
    """Parameters."""

    share: Float  # of the light that passes, before the tint
    transmittance: Color


class Circular(NamedTuple):
    """Parameters of `circular`: its kernels, by this class, have an albedo in addition."""

    share: Float
    transmittance: Color


@kernel
def eval_straight(filters, wo):
    """Return what passes."""
    return filters.transmittance * filters.share


@kernel
def sample(filters, wo, numbers):
    """Go straight on."""
    one = splat_f32(1.0)
    passes = eval_straight(filters, wo)
    return BsdfSample(-wo, passes, one, one, splat_i32(STRAIGHT))


@kernel
def _tint(filters):
    """Return the transmittance; of the three only `circular` has an albedo in Mitsuba."""
    return filters.transmittance


def _filter(
    name: str,
    share: float,
    about: str,
    *,
    ignored: dict[str, float | bool],
    albedo: Any = None,
) -> BsdfKind:
    """Return the kind of one plugin.

    `ignored` has defaults of properties that only polarized light depends on.
    """

    def read(properties: Any) -> OtherBsdf:
        for unused, default in ignored.items():
            if isinstance(default, bool):
                properties.boolean(unused, default)
            else:
                read_scalar_texture(properties, unused, default)
        tint = read_texture(properties, "transmittance", 1.0)
        return OtherBsdf(name, {"share": share, "transmittance": tint})

    return BsdfKind(
        name,
        Circular if albedo else Filter,
        read,
        about,
        sample,
        albedo=albedo,
        delta=True,
        transmits=True,
        straight=True,
        eval_straight=eval_straight,
    )


POLARIZER = _filter(
    "polarizer",
    0.5,
    "a polarizer: half of the light goes straight on",
    ignored={"theta": 0.0, "polarizing": True},
)
CIRCULAR = _filter(
    "circular",
    0.5,
    "a circular polarizer: half of the light goes straight on",
    ignored={"left_handed": False},
    albedo=_tint,
)
RETARDER = _filter(
    "retarder",
    1.0,
    "a wave plate: light goes straight on",
    ignored={"theta": 0.0, "delta": 90.0},
)
FILTERS = POLARIZER.name, CIRCULAR.name, RETARDER.name
