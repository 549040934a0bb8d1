"""Many lamps, one of them asked at each point: uniformly, or by what it can give there."""

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


def _spread(body: str, integrator: str, light_choice: str) -> float:
    scene = scene_at(_FLOOR + body, _LOOKAT)
    values = estimates(scene, SPP, integrator=integrator, light_choice=light_choice)
    return spread_of_a_sample(values, SPP)


def one_lamp_that_counts(
    others: float, *, integrator: str = "path", light_choice: str = "importance"
) -> float:
    """Return the spread of a sample below one lamp near by and others a thousand times off.

    With a uniform choice on paper the root of the number of the others: all the light comes
    with a probability of one over n + 1, and then n + 1 times.
    """
    far = _LAMP.format(x=0, z=1000) * round(others)
    return _spread(_LAMP.format(x=0, z=1) + far, integrator, light_choice)


def street_of_lamps(lamps: float, *, light_choice: str = "importance") -> float:
    """Return the spread of a sample at the middle of a street of equal lamps."""
    count = round(lamps)
    street = (_LAMP.format(x=k - count // 2, z=1) for k in range(count))
    return _spread("".join(street), "path", light_choice)


def hidden_lamp(times: float, *, light_choice: str = "importance") -> float:
    """Return the spread beside a lamp, and another that would give more but for a screen.

    Both are as far away; the screen is a small disk before the other.
    """
    strong = f"""<emitter type="point"><point name="position" value="-0.5,0,2"/>
        <spectrum name="intensity" value="{times!r}"/></emitter>
        <shape type="disk"><transform name="to_world"><scale value="0.01"/>
        <translate x="-0.475" z="1.9"/></transform></shape>"""
    return _spread(_LAMP.format(x=0.5, z=2) + strong, "path", light_choice)


def street_seen() -> NDArray[np.uint8]:
    """Show a street of 81 lamps: chosen uniformly, by importance, and every one."""
    street = "".join(_LAMP.format(x=k / 10 - 4, z=0.2) for k in range(81))
    floor = """<shape type="rectangle"><transform name="to_world"><scale value="5"/>
        </transform><bsdf type="diffuse"/></shape>"""
    view = 'origin="0,-6,5" target="0,0,0" up="0,0,1"'
    scene = scene_at(floor + street, view, size=96, fov=60.0)
    pictures = [
        estimates(scene, SPP, integrator=name, light_choice=choice).reshape(96, 96)
        for name, choice in (
            ("path", "uniform"),
            ("path", "importance"),
            ("direct", "uniform"),
        )
    ]
    return on_screen(pictures, exposure=0.01)


_UNIT = "standard deviation of a sample over the mean"

ROWS = (
    Row(
        name="lamps-starved",
        method="Path tracing, a lamp chosen uniformly",
        stress="lamps far away beside the one that counts",
        measure=partial(one_lamp_that_counts, light_choice="uniform"),
        quantity="error",
        unit=_UNIT,
        strengths=(0.0, 1.0, 3.0, 7.0, 15.0, 31.0, 63.0, 127.0),
        tolerance=3.0,
        holds_at=7.0,
        fails_at=15.0,
        why="The one lamp that counts is asked as rarely as each that gives nothing: the "
        "error goes with the root of their number.",
        instead="The choice by importance, the default: uniform choices are those of a "
        "replay of Mitsuba, and of `--light-choice uniform`.",
        source="[Shirley1996] (choice of lamps); measured here",
        picture=street_seen,
        caption="A street of 81 lamps: one asked at each point, uniformly and by what it "
        "can give there, and every one.",
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
        measure=partial(street_of_lamps, light_choice="uniform"),
        quantity="error",
        unit=_UNIT,
        strengths=(1.0, 3.0, 9.0, 27.0, 81.0, 243.0),
        tolerance=3.0,
        holds_at=9.0,
        fails_at=81.0,
        why="What a lamp gives falls with the third power of its distance along the "
        "street, so that only a few of them matter at any one place.",
        instead="The choice by importance, the default.",
        source="measured here",
    ),
    Row(
        name="lamps-by-importance",
        method="Path tracing, a lamp chosen by what it can give",
        stress="equal lamps in a street",
        measure=street_of_lamps,
        quantity="error",
        unit=_UNIT,
        strengths=(1.0, 3.0, 9.0, 27.0, 81.0, 243.0),
        tolerance=1.0,
        holds_at=243.0,
        fails_at=None,
        why="Power, distance and both cosines are in the bound; from 64 lamps on they are "
        "in trees, whose nodes are known less well.",
        instead="This is the method to use, where there are many lamps.",
        source="[Estevez2018]; measured here",
    ),
    Row(
        name="lamps-hidden",
        method="Path tracing, a lamp chosen by what it can give",
        stress="strength of a hidden lamp beside the one that counts",
        measure=hidden_lamp,
        quantity="error",
        unit=_UNIT,
        strengths=(0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0),
        tolerance=3.0,
        holds_at=4.0,
        fails_at=64.0,
        why="The choice knows nothing of shadows: a hidden lamp takes the samples of the "
        "others. The uniform sixteenth bounds the spread by the root of 16 n.",
        instead="`--light-choice uniform`, or `direct`, which asks every lamp.",
        source="measured here",
    ),
)
