"""What sampling a light towards a surface point returns."""

from __future__ import annotations

from typing import Any, NamedTuple


class LightSample(NamedTuple):
    """One direction to a light for each of 16 points."""

    wi: Any  # unit, towards the light
    distance: Any  # to the light
    radiance: Any  # arriving, over the density: I / r^2 for a point, L / pdf for an area
    pdf: Any  # [1/sr] of wi given the light; 0: the light is a point or a direction
