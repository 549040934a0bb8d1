"""Many lamps, one of them asked at each point: chosen uniformly, whatever it gives."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from reports.limits.light_transport.one_point import (
    estimates,
    scene_at,
    spread_of_a_sample,
)
from reports.limits.row import Row
from reports.limits.screen import on_screen

SPP = 16
_FLOOR = '<shape type="rectangle"><bsdf type="diffuse"/></shape>'
_LAMP = '<emitter type="point"><point name="position" value="{x},0,{z}"/></emitter>'
_LOOKAT = 'origin="6,0,1" target="0,0,0" up="0,0,1"'


def _spread(lamps: str, integrator: str) -> float:
    scene = scene_at(_FLOOR + lamps, _LOOKAT)
    return spread_of_a_sample(estimates(scene, SPP, integrator=integrator), SPP)


def one_lamp_that_counts(others: float, *, integrator: str) -> float:
    """Return the spread of a sample below one lamp near by and others a thousand times off.

    On paper the root of the number of the others: all the light comes with a probability
    of one over n + 1, and then n + 1 times.
    """
    far = _LAMP.format(x=0, z=1000) * round(others)
    return _spread(_LAMP.format(x=0, z=1) + far, integrator)


def street_of_lamps(lamps: float, *, integrator: str) -> float:
    """Return the spread of a sample at the middle of a street of equal lamps."""
    count = round(lamps)
    street = (_LAMP.format(x=k - count // 2, z=1) for k in range(count))
    return _spread("".join(street), integrator)


def street_seen() -> NDArray[np.uint8]:
    """Show a street of 81 lamps: one asked at each point, and every one."""
    street = "".join(_LAMP.format(x=k / 10 - 4, z=0.2) for k in range(81))
    floor = """<shape type="rectangle"><transform name="to_world"><scale value="5"/>
        </transform><bsdf type="diffuse"/></shape>"""
    view = 'origin="0,-6,5" target="0,0,0" up="0,0,1"'
    scene = scene_at(floor + street, view, size=96, fov=60.0)
    pictures = [
        estimates(scene, SPP, integrator=name).reshape(96, 96)
        for name in ("path", "direct")
    ]
    return on_screen(pictures, exposure=0.01)


_UNIT = "standard deviation of a sample over the mean"

ROWS = (
    Row(
        name="lamps-starved",
        method="Path tracing, a lamp chosen uniformly",
        stress="lamps far away beside the one that counts",
        measure=partial(one_lamp_that_counts, integrator="path"),
        quantity="error",
        unit=_UNIT,
        strengths=(0.0, 1.0, 3.0, 7.0, 15.0, 31.0, 63.0, 127.0),
        tolerance=3.0,
        holds_at=7.0,
        fails_at=15.0,
        why="The one lamp that counts is asked as rarely as each that gives nothing: the "
        "error goes with the root of their number.",
        instead="`direct`, which asks every lamp at each point, or no lamps that the "
        "picture does not need; choosing by power would starve near lamps instead.",
        source="[Shirley1996] (choice of lamps); measured here",
        picture=street_seen,
        caption="A street of 81 lamps: one asked at each point, and every one.",
    ),
    Row(
        name="lamps-every-one",
        method="Direct light of every lamp at each point",
        stress="lamps far away beside the one that counts",
        measure=partial(one_lamp_that_counts, integrator="direct"),
        quantity="error",
        unit=_UNIT,
        strengths=(0.0, 1.0, 3.0, 7.0, 15.0, 31.0, 63.0, 127.0),
        tolerance=1e-3,
        holds_at=127.0,
        fails_at=None,
        why="The sum over all lamps has no choice in it; it costs a shadow ray a lamp.",
        instead="This is the method to use, where there are few lamps.",
        source="measured here",
    ),
    Row(
        name="lamps-street",
        method="Path tracing, a lamp chosen uniformly",
        stress="equal lamps in a street",
        measure=partial(street_of_lamps, integrator="path"),
        quantity="error",
        unit=_UNIT,
        strengths=(1.0, 3.0, 9.0, 27.0, 81.0, 243.0),
        tolerance=3.0,
        holds_at=9.0,
        fails_at=81.0,
        why="What a lamp gives falls with the third power of its distance along the "
        "street, so that only a few of them matter at any one place.",
        instead="Light trees or resampling, which this renderer does not have; else more "
        "samples in proportion to the lamps.",
        source="measured here",
    ),
)
