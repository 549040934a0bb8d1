"""Where a new ray starts: acne if too near, gaps jumped over if too far."""

from __future__ import annotations

import functools
from typing import Any

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
from reports.limits.row import Row
from reports.limits.screen import on_screen

Rule = tuple[float, float]
MIDDLE = np.array([2.0, -1.0, 2.0])  # of the square, in half widths

_SQUARE = """<scene version="3.0.0">
<integrator type="direct"/>
<sensor type="perspective"><float name="fov" value="30"/>
    <float name="far_clip" value="1e9"/>
    <transform name="to_world">
        <lookat origin="{eye}" target="{middle}" up="0,0,1"/></transform>
    <film type="hdrfilm"><integer name="width" value="{side}"/>
        <integer name="height" value="{side}"/><rfilter type="box"/></film>
    <sampler type="stratified"><integer name="sample_count" value="1"/>
        <boolean name="jitter" value="false"/></sampler></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="{size}"/>
    <rotate x="1" angle="50"/><translate value="{middle}"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
<emitter type="directional"><vector name="direction" value="0.3,0.8,-0.6"/></emitter>
</scene>"""


def _square(rule: Rule, size: float, side: int = 32) -> NDArray[np.float32]:
    """Render a lit square of half width `size`, its middle 3 sizes from the origin."""
    middle = MIDDLE * size
    eye = middle + np.array([0.2, -0.8, 0.6]) * size
    places = {
        name: ",".join(f"{x:.9g}" for x in place)
        for name, place in (("middle", middle), ("eye", eye))
    }
    scene = renderer.load_string(_SQUARE.format(size=size, side=side, **places))
    return render_with_offset(scene, rule)


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


def _not_seen_into(half: float) -> float:
    return 0.0 if lamp_seen(TIGHT, 1e-3, half) else 1.0


def acne_picture() -> NDArray[np.uint8]:
    """Return the square at three sizes, starting 10^-3 off; and, last, by our rule."""
    side, largest = 144, 1e5
    shown = [_square(_fixed(size), size, side) for size in (1e3, 1e4, largest)]
    shown.append(_square(TIGHT, largest, side))
    return on_screen(shown)


_GAPS = (1e1, 1e2, 3e2, 1e3, 3e3, 1e4, 3e4, 1e5, 1e6, 1e7)
_SIZES = (1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
_LOST = "of lamps behind a pane not seen"
_DARK = "of pixels dark"


def _gap_row(name: str, method: str, rule: Rule, **given: Any) -> Row:
    return Row(
        name=name,
        method=method,
        stress="half width of a pane / gap behind it",
        measure=functools.partial(_jumped_over, rule=rule),
        quantity="error",
        unit=_LOST,
        strengths=_GAPS,
        tolerance=0.0,
        **given,
    )


def _small_row(name: str, method: str, rule: Rule, **given: Any) -> Row:
    return Row(
        name=name,
        method=method,
        stress="1 / size of a pane, the lamp behind it in proportion",
        measure=functools.partial(_small, rule=rule),
        quantity="error",
        unit=_LOST,
        strengths=_SIZES,
        tolerance=0.0,
        source="measured here",
        **given,
    )


def _acne_row(name: str, method: str, rule: Rule | None, **given: Any) -> Row:
    return Row(
        name=name,
        method=method,
        stress="half width of a lit square, 3 of it from the origin",
        measure=functools.partial(_acne, rule=rule),
        quantity="error",
        unit=_DARK,
        strengths=_SIZES,
        tolerance=1e-3,
        **given,
    )


ROWS = (
    _gap_row(
        "offset-fixed-gap",
        "New rays start 10^-3 off",
        FIXED,
        holds_at=9e2,
        fails_at=1.1e3,
        why="The ray starts behind whatever is nearer than the distance.",
        instead="A distance that follows the rounding of the point: two rows on.",
        source="register of expected failures, fixed epsilon; [Waechter2019]",
    ),
    _gap_row(
        "offset-mitsuba-gap",
        "New rays start by Mitsuba's rule",
        MITSUBA,
        holds_at=1e4,
        fails_at=1.25e4,
        why="1500 rounding units of 1 + max|p|, and never less.",
        instead="--ray-offset tight, the default; Mitsuba's is for comparing with it.",
        source="register of expected failures, Mitsuba's epsilon",
    ),
    _gap_row(
        "offset-tight-gap",
        "New rays start by this renderer's rule",
        TIGHT,
        holds_at=3e4,
        fails_at=1e5,
        why="It follows the size of the primitive, by some rounding units.",
        instead="Smaller primitives: the distance goes with their size.",
        source="measured here",
    ),
    Row(
        name="offset-tight-large-pane",
        method="New rays start by this renderer's rule",
        stress="half width of a pane over a gap of 10^-3",
        measure=_not_seen_into,
        quantity="error",
        unit=_LOST,
        strengths=(1e0, 1e1, 3e1, 1e2, 3e2, 1e3),
        tolerance=0.0,
        holds_at=3e1,
        fails_at=1e2,
        why="The rule looks at the whole primitive, not at where on it the point is.",
        instead="Cut large panes up, or take --ray-offset mitsuba.",
        source="register of expected failures, tight offset on a large square",
    ),
    _small_row(
        "offset-fixed-small",
        "New rays start 10^-3 off",
        FIXED,
        holds_at=5e1,
        fails_at=2e2,
        why="A length that suits one size of scene is a gap of another.",
        instead="A distance that shrinks with the scene: two rows on.",
    ),
    _small_row(
        "offset-mitsuba-small",
        "New rays start by Mitsuba's rule",
        MITSUBA,
        holds_at=5e2,
        fails_at=2e3,
        why="1 + max|p| never is less than 1, however small the scene.",
        instead="Another unit of length, or this renderer's own rule.",
    ),
    _small_row(
        "offset-tight-small",
        "New rays start by this renderer's rule",
        TIGHT,
        holds_at=1e6,
        fails_at=None,
        why="It shrinks with the primitive.",
        instead="Nothing.",
    ),
    Row(
        name="offset-few-roundings",
        method="New rays start by this renderer's rule, but nearer",
        stress="1 / distance in rounding units of the primitive's size",
        measure=lambda strength: _acne(1.0, (1.0 / strength, 0.0)),
        quantity="error",
        unit=_DARK,
        strengths=tuple(2.0**k for k in range(-6, 5)),
        tolerance=0.0,
        holds_at=1.0 / TIGHT[0],
        fails_at=4.0,
        why="Rounding puts points up to a unit behind their own surface.",
        instead="The rule's own number, with its margin.",
        source="measured here",
    ),
    _acne_row(
        "offset-fixed-acne",
        "New rays start 10^-3 off",
        None,
        holds_at=1e2,
        fails_at=1e5,
        why="Float32 numbers are 10^-3 apart at 10^4: the distance is less than rounding.",
        instead="A distance that grows with the coordinates: the next two rows.",
        source="[Waechter2019]; measured here",
        picture=acne_picture,
        caption="A lit square of half width 10^3, 10^4 and 10^5, starting 10^-3 off; last, "
        "10^5 by this renderer's rule.",
    ),
    _acne_row(
        "offset-mitsuba-acne",
        "New rays start by Mitsuba's rule",
        MITSUBA,
        holds_at=1e6,
        fails_at=None,
        why="It grows with the coordinates.",
        instead="Nothing.",
        source="measured here",
    ),
    _acne_row(
        "offset-tight-acne",
        "New rays start by this renderer's rule",
        TIGHT,
        holds_at=1e6,
        fails_at=None,
        why="It grows with the primitive's coordinates.",
        instead="Nothing.",
        source="measured here",
    ),
)
