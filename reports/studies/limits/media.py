"""Participating media: dense smoke before a lamp, grids of colours, thick white clouds."""

from __future__ import annotations

from functools import partial

import numpy as np

import renderer
from reports.studies.limits.one_point import (
    SIZE,
    estimates,
    scene_at,
    spread_of_a_sample,
)
from reports.studies.limits.probes import Shown, on_screen

SPP = 64
# A slab from z = 1 to 2. A constant volume of a heterogeneous medium is a grid of one cell:
# its bounds are the largest and the smallest of the three numbers.
_SLAB = """<shape type="cube"><transform name="to_world"><scale value="0.5"/>
    <translate z="1.5"/></transform><bsdf type="null"/>
    <medium type="{kind}" name="interior"><float name="albedo" value="0"/>
        <float name="scale" value="{scale!r}"/>
        <volume type="constvolume" name="sigma_t"><rgb name="value" value="{sigma}"/>
            <transform name="to_world"><translate x="-0.5" y="-0.5" z="1"/></transform>
        </volume></medium></shape>"""
_FLOOR = '<shape type="rectangle"><bsdf type="diffuse"/></shape>'
_LAMP = '<emitter type="point"><point name="position" value="0,0,5"/></emitter>'
_SKY = '<emitter type="constant"/>'
_CLOUD = """<shape type="sphere"><bsdf type="null"/><medium type="homogeneous"
    name="interior"><float name="sigma_t" value="{sigma!r}"/>
    <float name="albedo" value="1"/></medium></shape>"""


def spread_behind_smoke(
    optical_depth: float, *, kind: str = "heterogeneous", share: float = 1.0
) -> float:
    """Return the spread of a sample of a lamp's light on a floor, behind a slab of smoke.

    On paper the root of exp(share depth) - 1 in a grid. With n tentative collisions,
    (1 - share)^n of the light is left, and n is a Poisson number of mean depth / share.
    Blue is clear, so that nothing of the transmittance is known for certain.

    Parameters
    ----------
    kind
        Of the medium; "homogeneous" has a closed formula.
    share
        Of the majorant that the extinction of red is, which is what is looked at.
    """
    slab = _SLAB.format(kind=kind, sigma=f"{share!r},1,0", scale=optical_depth / share)
    lookat = 'origin="6,0,0.5" target="0,0,0" up="0,0,1"'
    scene = scene_at(_FLOOR + slab + _LAMP, lookat, integrator="volpath")
    return spread_of_a_sample(estimates(scene, SPP), SPP)


def _behind_slab(
    optical_depth: float, kind: str, sigma: str, size: int = SIZE, fov: float = 0.001
) -> renderer.Scene:
    """Return a white sky behind a slab; the depth is that of the densest colour."""
    slab = _SLAB.format(kind=kind, sigma=sigma, scale=optical_depth)
    lookat = 'origin="0,0,0" target="0,0,1" up="0,1,0"'
    return scene_at(_SKY + slab, lookat, size=size, fov=fov, integrator="volpath")


def spread_through_colors(
    optical_depth: float, *, kind: str = "heterogeneous", sigma: str = "0.1,0.1,1"
) -> float:
    """Return the spread of a red sample that comes through a slab.

    On paper the root of exp(0.55 depth) - 1 in a grid of the usual colours: of the
    tentative collisions 0.4 are real, and each of the others makes the path's red 1.5
    times as large.
    """
    scene = _behind_slab(optical_depth, kind, sigma)
    return spread_of_a_sample(estimates(scene, SPP), SPP)


def _lost_in_cloud(optical_diameter: float, *, depth: int) -> float:
    """Return the share of the light of a white sky that a ball of white cloud loses."""
    body = _SKY + _CLOUD.format(sigma=0.5 * optical_diameter)
    lookat = 'origin="0,0,5" target="0,0,0" up="0,1,0"'
    scene = scene_at(body, lookat, depth=depth, integrator="volpath")
    return abs(1.0 - float(np.mean(estimates(scene, SPP))))


def colors() -> Shown:
    """Show a slab of depth 8: a homogeneous medium, and a grid."""
    pictures = []
    for kind in ("homogeneous", "heterogeneous"):
        scene = _behind_slab(8.0, kind, "0.1,0.1,1", size=96, fov=70.0)
        pictures.append(renderer.render(scene, spp=16).pixels)
    return on_screen(pictures)


MEASURES = {
    "smoke-densest": spread_behind_smoke,
    "smoke-half-as-dense": partial(spread_behind_smoke, share=0.5),
    "smoke-homogeneous": partial(spread_behind_smoke, kind="homogeneous"),
    "grid-of-colours": spread_through_colors,
    "grid-of-one-colour": partial(spread_through_colors, sigma="0.1,0.1,0.1"),
    "colours-homogeneous": partial(spread_through_colors, kind="homogeneous"),
    "cloud-fixed-depth": partial(_lost_in_cloud, depth=16),
    "cloud-any-depth": partial(_lost_in_cloud, depth=-1),
}
PICTURES = {"coloured-grid": colors}
