"""What can be said about a divergent pixel of an integrator that has no trace.

Only `path`, `direct` and `volpath` are written down bounce by bounce. For the others our
AOVs show whether the camera rays of the pixel pass an edge: one ray through each pixel's
centre, and the shapes and primitives that the neighbouring pixels see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer.picture import RenderOurs
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import DivergentPixel

SEEN = (("shape_index", "shape"), ("prim_index", "triangle"))
"""AOVs that change at an edge, and what is another there."""


def first_hit_causes(
    pixels: Sequence[DivergentPixel],
    request: RenderRequest,
    integrator: str,
    render_ours: RenderOurs,
) -> tuple[DivergentPixel, ...]:
    """Return the divergent pixels of a replay, each with a sentence on where it lies."""
    wanted = replace(request, kind="aovs", spp=None, replay=False, camera=None)
    arrays = render_ours(wanted).arrays
    no_trace = f"No trace of {integrator}; possible are path, direct and volpath."
    return tuple(
        replace(p, cause=f"{no_trace} {place_sentence(arrays, p.x, p.y)}") for p in pixels
    )


def place_sentence(arrays: dict[str, NDArray[np.float32]], x: int, y: int) -> str:
    """Return whether pixel (x, y) is next to an edge, by the AOVs `SEEN`, (H, W, 1)."""
    around = slice(max(0, y - 1), y + 2), slice(max(0, x - 1), x + 2)
    for kind, noun in SEEN:
        if np.ptp(arrays[kind][around]) > 0.0:
            return (
                f"It lies next to an edge: a neighbouring pixel sees another {noun}, so "
                "rounding may send a camera ray to the other side."
            )
    return (
        "Its neighbours see the same primitive: the camera ray passes no edge there, and "
        "the difference comes later (a shadow, a mirror or glass), or from the shading."
    )
