"""The two ways to find a lamp, each alone, and both weighed [Veach1997, chapter 9]."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from reports.limits.light_transport.one_point import (
    by_one_strategy,
    scene_at,
    spread_of_a_sample,
)
from reports.limits.row import Row
from reports.limits.screen import on_screen

SPP = 64
_PLATE = """<shape type="rectangle"><bsdf type="roughconductor">
    <string name="material" value="none"/><string name="distribution" value="ggx"/>
    <float name="alpha" value="{alpha}"/></bsdf></shape>"""
_LAMP = """<shape type="sphere"><point name="center" value="-4,0,4"/>
    <float name="radius" value="{radius}"/><emitter type="area"/></shape>"""
_LOOKAT = 'origin="3,0,3" target="0,0,0" up="0,0,1"'
_DISTANCE = 32**0.5


def over_roughness(smoothness: float, *, strategy: str) -> float:
    """Return the spread of a sample at a plate of alpha 1 / smoothness, the lamp large."""
    return _spread(1.0 / smoothness, _DISTANCE / 4.0, strategy)


def over_roughness_grown(alpha: float, *, strategy: str) -> float:
    """Return the same, from a mirror to a rough plate."""
    return over_roughness(1.0 / alpha, strategy=strategy)


def over_lamp_size(distance_over_radius: float, *, strategy: str) -> float:
    """Return the spread of a sample at a plate of alpha 0.3."""
    return _spread(0.3, _DISTANCE / distance_over_radius, strategy)


def _spread(alpha: float, radius: float, strategy: str) -> float:
    body = _PLATE.format(alpha=alpha) + _LAMP.format(radius=radius)
    values = by_one_strategy(scene_at(body, _LOOKAT), SPP, strategy)
    return spread_of_a_sample(values, SPP)


def large_lamp_near(half_width: float, *, strategy: str) -> float:
    """Return the spread of a sample below a square lamp, 1 above a diffuse floor."""
    body = f"""<shape type="rectangle"><bsdf type="diffuse"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="{half_width!r}"/>
        <rotate x="1" angle="180"/><translate z="1"/></transform>
        <emitter type="area"/></shape>"""
    scene = scene_at(body, 'origin="0.6,0,0.5" target="0,0,0" up="0,0,1"')
    return spread_of_a_sample(by_one_strategy(scene, SPP, strategy), SPP)


def strategies_seen() -> NDArray[np.uint8]:
    """Show a smooth plate's reflection of a lamp by lamps alone, the BSDF alone, both."""
    body = _PLATE.format(alpha=0.03).replace(
        "<bsdf", '<transform name="to_world"><scale value="3"/></transform><bsdf', 1
    )
    body += _LAMP.format(radius=1.0)
    scene = scene_at(body, 'origin="3,0,3" target="-0.3,0,0" up="0,0,1"', size=96, fov=45.0)
    pictures = [
        by_one_strategy(scene, 4, name).reshape(96, 96)
        for name in ("lights", "bsdf", "both")
    ]
    return on_screen(pictures)


_UNIT = "standard deviation of a sample over the mean"
_ROUGHNESS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
_SIZES = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
_WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
_VEACH = "[Veach1997, section 9.2]; measured here"

ROWS = (
    Row(
        name="glossy-lights-alone",
        method="Sampling lamps alone",
        stress="1 / roughness, under a large lamp",
        measure=partial(over_roughness, strategy="lights"),
        quantity="error",
        unit=_UNIT,
        strengths=_ROUGHNESS,
        tolerance=3.0,
        holds_at=8.0,
        fails_at=64.0,
        why="Few points of the lamp lie in the narrow lobe, and these count for all.",
        instead="Both ways weighed: the path tracer's own.",
        source=_VEACH,
        picture=strategies_seen,
        caption="A lamp in a plate of roughness 0.03 by lamps alone, by the BSDF alone, "
        "and by both, at 4 samples a pixel.",
    ),
    Row(
        name="glossy-bsdf-alone-roughness",
        method="Sampling the BSDF alone",
        stress="roughness, under the same lamp",
        measure=partial(over_roughness_grown, strategy="bsdf"),
        quantity="error",
        unit=_UNIT,
        strengths=tuple(1.0 / x for x in reversed(_ROUGHNESS)),
        tolerance=3.0,
        holds_at=0.125,
        fails_at=1.0,
        why="The wider the lobe, the fewer of its directions meet the lamp.",
        instead="Both ways weighed: the path tracer's own.",
        source=_VEACH,
    ),
    Row(
        name="glossy-both-roughness",
        method="Both ways, weighed by the power heuristic",
        stress="1 / roughness, under a large lamp",
        measure=partial(over_roughness, strategy="both"),
        quantity="error",
        unit=_UNIT,
        strengths=_ROUGHNESS,
        tolerance=1.5,
        holds_at=128.0,
        fails_at=None,
        why="Each way counts where its density is the larger one.",
        instead="This is the method to use.",
        source=_VEACH,
    ),
    Row(
        name="glossy-bsdf-alone",
        method="Sampling the BSDF alone",
        stress="lamp's distance over its radius, roughness 0.3",
        measure=partial(over_lamp_size, strategy="bsdf"),
        quantity="error",
        unit=_UNIT,
        strengths=_SIZES,
        tolerance=3.0,
        holds_at=4.0,
        fails_at=32.0,
        why="The smaller the lamp, the fewer directions of the lobe meet it.",
        instead="Both ways weighed: the path tracer's own.",
        source=_VEACH,
    ),
    Row(
        name="glossy-lights-alone-size",
        method="Sampling lamps alone",
        stress="lamp's distance over its radius, roughness 0.3",
        measure=partial(over_lamp_size, strategy="lights"),
        quantity="error",
        unit=_UNIT,
        strengths=_SIZES,
        tolerance=3.0,
        holds_at=128.0,
        fails_at=None,
        why="Over a small lamp the lobe is all but constant.",
        instead="Both ways weighed: this one alone fails at smooth surfaces.",
        source=_VEACH,
    ),
    Row(
        name="glossy-both-size",
        method="Both ways, weighed by the power heuristic",
        stress="lamp's distance over its radius, roughness 0.3",
        measure=partial(over_lamp_size, strategy="both"),
        quantity="error",
        unit=_UNIT,
        strengths=_SIZES,
        tolerance=1.5,
        holds_at=128.0,
        fails_at=None,
        why="Each way counts where its density is the larger one.",
        instead="This is the method to use.",
        source=_VEACH,
    ),
    Row(
        name="lamp-near-lights-alone",
        method="Sampling a lamp by its area alone",
        stress="half width of a square lamp over its distance",
        measure=partial(large_lamp_near, strategy="lights"),
        quantity="error",
        unit=_UNIT,
        strengths=_WIDTHS,
        tolerance=3.0,
        holds_at=2.0,
        fails_at=16.0,
        why="Nearly all the light comes from the small part right above, and 1 / r^2 and "
        "two cosines leave little of the rest.",
        instead="Both ways weighed, or sampling the solid angle, as spheres do.",
        source="[Shirley1996]; measured here",
    ),
    Row(
        name="lamp-near-both",
        method="Both ways, weighed by the power heuristic",
        stress="half width of a square lamp over its distance",
        measure=partial(large_lamp_near, strategy="both"),
        quantity="error",
        unit=_UNIT,
        strengths=_WIDTHS,
        tolerance=1.0,
        holds_at=32.0,
        fails_at=None,
        why="Near a large lamp the BSDF's directions meet it almost surely, and they carry "
        "the weight.",
        instead="This is the method to use.",
        source=_VEACH,
    ),
)
