"""Where a new ray starts: acne if too near, gaps jumped over if too far."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.expected_failures.offsets import (
    FIXED,
    MITSUBA,
    TIGHT,
    lamp_seen,
    render_with_offset,
)
from reports.studies.limits.one_point import MIDDLES, load_scene
from reports.studies.limits.probes import Shown, on_screen

Rule = tuple[float, float]
MIDDLE = np.array([2.0, -1.0, 2.0])  # of the square, in half widths

_SQUARE = """<shape type="rectangle"><transform name="to_world"><scale value="{size}"/>
    <rotate x="1" angle="50"/><translate value="{middle}"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
<emitter type="directional"><vector name="direction" value="0.3,0.8,-0.6"/></emitter>"""
_WEDGE = """<shape type="rectangle"><bsdf type="dielectric"/></shape>
<shape type="rectangle"><transform name="to_world">
    <rotate x="1" angle="180"/><rotate y="1" angle="{angle!r}"/><translate z="{gap!r}"/>
    </transform><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>"""


def _square(rule: Rule, size: float, side: int = 32) -> NDArray[np.float32]:
    """Render a lit square of half width `size`, its middle 3 sizes from the origin."""
    middle = MIDDLE * size
    eye = middle + np.array([0.2, -0.8, 0.6]) * size
    place, seen_from = (",".join(f"{x:.9g}" for x in point) for point in (middle, eye))
    body = _SQUARE.format(size=size, middle=place)
    lookat = f'origin="{seen_from}" target="{place}" up="0,0,1"'
    return render_with_offset(_scene(body, lookat, "direct", side), rule)


def _scene(body: str, lookat: str, integrator: str, side: int) -> renderer.Scene:
    loop = f'<integrator type="{integrator}"/>'
    return load_scene(body, lookat, loop, size=side, fov=30.0, sampler=MIDDLES)


def _fixed(size: float) -> Rule:
    """Return the rule that is 10^-3 around the square's middle, whatever its size.

    The renderer has no such rule, only shares of 1 + max|p|.
    """
    return 0.0, FIXED[1] / (1.0 + MIDDLE.max() * size)


def _acne(size: float, rule: Rule | None) -> float:
    """Return the share of pixels in which the square is in its own shadow.

    By a rule, or, if it is None, 10^-3 off.
    """
    pixels = _square(_fixed(size) if rule is None else rule, size)
    return float(np.mean(pixels[..., 0] == 0.0))


def _jumped_over(strength: float, rule: Rule) -> float:
    return 0.0 if lamp_seen(rule, 1.0 / strength) else 1.0


def _small(strength: float, rule: Rule) -> float:
    """Return 1 if a lamp a tenth of the pane's half width behind it is not seen."""
    return 0.0 if lamp_seen(rule, 0.1 / strength, 1.0 / strength) else 1.0


def _large_pane(half: float, rule: Rule) -> float:
    return 0.0 if lamp_seen(rule, 1e-3, half) else 1.0


def acne() -> Shown:
    """Show the square at three sizes, starting 10^-3 off; and, last, by our rule."""
    side, largest = 144, 1e5
    shown = [_square(_fixed(size), size, side) for size in (1e3, 1e4, largest)]
    return on_screen([*shown, _square(TIGHT, largest, side)])


def missing_pane() -> Shown:
    """Show a lamp behind a pane, the gap from 0 to 0.003, by three rules."""
    # at a distance of 1 the picture of 30 degrees is half as wide as `edge`
    edge, gap = np.tan(np.radians(15.0)), 0.0015
    body = _WEDGE.format(angle=float(np.degrees(np.arctan(gap / edge))), gap=gap)
    lookat = 'origin="0,0,-1" target="0,0,0" up="0,1,0"'
    scene = _scene(body, lookat, "whitted", 96)
    shown = [render_with_offset(scene, rule) for rule in (TIGHT, FIXED, MITSUBA)]
    return on_screen(shown, exposure=0.15)


MEASURES = {
    "offset-fixed-acne": partial(_acne, rule=None),
    "offset-mitsuba-acne": partial(_acne, rule=MITSUBA),
    "offset-tight-acne": partial(_acne, rule=TIGHT),
    "offset-fixed-gap": partial(_jumped_over, rule=FIXED),
    "offset-mitsuba-gap": partial(_jumped_over, rule=MITSUBA),
    "offset-tight-gap": partial(_jumped_over, rule=TIGHT),
    "offset-tight-large-pane": partial(_large_pane, rule=TIGHT),
    "offset-mitsuba-large-pane": partial(_large_pane, rule=MITSUBA),
    "offset-fixed-small": partial(_small, rule=FIXED),
    "offset-mitsuba-small": partial(_small, rule=MITSUBA),
    "offset-tight-small": partial(_small, rule=TIGHT),
    "offset-few-roundings": lambda strength: _acne(1.0, (1.0 / strength, 0.0)),
}
PICTURES = {"offset-acne": acne, "offset-gap": missing_pane}
