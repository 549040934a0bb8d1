"""Known faults that scenes at random meet, and which differences each may explain.

Headings and reasons are in docs/mitsuba-faults.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple
from xml.etree.ElementTree import Element

from mitsuba_ref.generate import undo

NOT_FINITE = "not finite"
MITSUBA_NOT_FINITE = "not finite in Mitsuba"
"""Quantities of a picture with NaN or infinite values: of ours, and of Mitsuba's alone."""


class KnownFault(NamedTuple):
    """A fault, and how it is undone."""

    name: str
    undo: Callable[[Element], bool]
    quantities: tuple[str, ...] = ()  # that may differ first; empty: any of a path
    most: float = math.inf  # relative: what that quantity may differ by
    gives_nan: bool = False  # to Mitsuba's picture

    def explains(self, quantity: str, error: float) -> bool:
        """Tell whether a difference that begins so may come from it."""
        if quantity == MITSUBA_NOT_FINITE:
            return self.gives_nan
        if self.most < math.inf and not 0.0 < error <= self.most:
            return False
        if self.quantities:
            return quantity in self.quantities
        return not quantity.startswith("Mitsuba") and quantity != NOT_FINITE


_VALUES = (
    *("throughput after", "unblocked light", "light adds", "emitted", "BSDF pdf"),
    "picture",  # of an integrator without a trace
)
"""What a surface's formula says."""

_IN_MEDIA = ("light passes", "random: bsdf x", "random: phase function x")
"""What a shadow ray meets on its way, and the numbers that come after those it took."""

KNOWN_FAULTS = (
    KnownFault("a hidden lamp moves the ray that passes it", undo.show_emitters),
    KnownFault(
        "path ends where it hides lamps and meets an instance",
        undo.show_emitters_to_instances,
        ("MitsubaCrashed",),
    ),
    KnownFault("ours: a bump map inside of a normal map", undo.take_bumps_off_normal_maps),
    KnownFault(
        "ours: a B-spline curve that is thicker than its bend is round",
        undo.leave_out_strands,
        ("hits", "light blocked", "face", "t", "position", "normal", "picture"),
    ),
    KnownFault(
        "a shadow ray to a light at infinity is turned by the ray offset",
        undo.widen_the_scene,
        ("light blocked", "picture", *_IN_MEDIA),
    ),
    KnownFault(
        "a sphere that shines lights itself from inside", undo.coat_lamps, gives_nan=True
    ),
    KnownFault("a texel that ends at the joint of a curve", undo.move_textures_of_curves),
    KnownFault("a picture on a turned sphere is sampled elsewhere", undo.turn_lamps_back),
    KnownFault(
        "numbers of ldsampler never end a path",
        undo.end_paths,
        ("MitsubaTimeout", "picture"),
    ),
    KnownFault("sh_normal of a bump map", undo.show_no_normals_of_bumps, ("picture",)),
    KnownFault("a point on a curve lies off its ray", undo.leave_out_curves),
    KnownFault(
        "points of small cylinders are off the surface", undo.leave_out_small_cylinders
    ),
    KnownFault("numbers without jitter on the edge of a choice", undo.jitter),
    KnownFault(
        "bumps on a shape without u and v",
        undo.take_bumps_off_shapes_without_uv,
        gives_nan=True,
    ),
    KnownFault("bumps on a mirrored rectangle", undo.take_bumps_off_mirrored_rectangles),
    KnownFault(
        "flat bumps where u runs along z",
        undo.turn_bumpy_shapes,
        ("goes on", "BSDF direction", *_VALUES),
        gives_nan=True,
    ),
    KnownFault(
        "geo_normal of a mirrored rectangle", undo.mirror_no_rectangles, ("picture",)
    ),
    KnownFault(
        "ours: a lamp that lets light through, met by paths that a medium has scattered",
        undo.coat_lamps_in_media,
        ("picture",),
    ),
    KnownFault("light behind holes is dropped, which no trace shows", undo.close_the_room),
    KnownFault(
        "principled in a blend, seen from behind",
        undo.unblend_principled,
        ("throughput after", "BSDF pdf", "picture"),
    ),
    KnownFault(
        "a sun by place and time, to 2e-5",
        undo.point_to_the_sun,
        ("light direction", "emitted", "unblocked light", "light adds", "picture"),
    ),
    KnownFault("the rim of a complex sun, in roundings of a cosine", undo.even_the_sun),
    KnownFault(
        "a texel halfway between two half floats",
        undo.keep_all_digits_of_texels,
        _VALUES,
        most=1e-3,
    ),
    KnownFault(
        "a rough plastic's tables, added up in single precision",
        undo.blacken_rough_plastics,
        _VALUES,
        most=3e-5,
    ),
    KnownFault(
        "hits of a grid of distances, to 1e-5",
        undo.make_distances_cubes,
        ("t", "position", "normal", "unblocked light"),
        most=1.9e-3,
    ),
    KnownFault(
        "a direction between texels of nearly equal light",
        undo.even_the_sky,
        ("light direction",),
        most=1.9e-3,
    ),
    KnownFault(
        "a null collision of a share of 1e-7, or of none",
        undo.take_nearest_cells,
        (*_IN_MEDIA, "light blocked"),
    ),
    KnownFault(
        "a transmittance of about 2^-126, by the thread",
        undo.thin_the_media,
        ("throughput", "light passes"),
    ),
)
