"""Lamps that path tracing finds too seldom: small, many, hidden, behind glass, near."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.expected_failures.light import caustic_of_a_point_light
from reports.studies.limits.one_point import (
    SIZE,
    by_one_strategy,
    estimates,
    scene_at,
    spread_of_a_sample,
)
from reports.studies.limits.probes import Shown, on_screen

SPP = 64
WIDE = 96  # [pixels] of pictures, each way
_FLOOR = '<shape type="rectangle"><bsdf type="diffuse"/></shape>'
_WHITE = '<bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf>'
_WIDE_FLOOR = """<shape type="rectangle"><transform name="to_world"><scale value="{0}"/>
    </transform><bsdf type="diffuse"/></shape>"""
_POINT = '<emitter type="point"><point name="position" value="{0!r},0,{1!r}"/></emitter>'
_SPHERE = """<shape type="sphere"><point name="center" value="{0}"/>
    <float name="radius" value="{1}"/><emitter type="area"/></shape>"""
_FROM_THE_SIDE = 'origin="6,0,1" target="0,0,0" up="0,0,1"'


def _picture(
    body: str,
    lookat: str,
    spp: int,
    *,
    fov: float = 45.0,
    integrator: str | None = None,
    light_choice: str | None = None,
    depth: int = 8,
) -> NDArray[np.float64]:
    scene = scene_at(body, lookat, depth=depth, size=WIDE, fov=fov)
    values = estimates(scene, spp, integrator=integrator, light_choice=light_choice)
    return values.reshape(WIDE, WIDE)


# ------------------------------------------------------------------------ behind glass

DISTANCE = 5.0  # of the lamp from the floor
_BALL = """<shape type="sphere"><point name="center" value="0,0,1.5"/>
    <bsdf type="dielectric"/></shape>"""
_PANE = """<shape type="rectangle"><transform name="to_world"><scale value="9"/>
    <translate x="{x}" z="{z}"/></transform><bsdf type="thindielectric"/></shape>"""
_FROM_ABOVE = 'origin="6,0,5" target="0,0,0.6" up="0,0,1"'


def light_below_lamp(
    distance_over_radius: float, *, ball: bool, spp: int = SPP, size: int = SIZE
) -> NDArray[np.float64]:
    """Return estimates of the light below a spherical lamp, behind a glass ball or not."""
    lamp = _SPHERE.format("0,0,5", DISTANCE / distance_over_radius)
    body = _FLOOR + lamp + (_BALL if ball else "")
    return estimates(scene_at(body, _FROM_THE_SIDE, depth=8, size=size), spp)


def _spread_below_lamp(distance_over_radius: float, *, ball: bool) -> float:
    return spread_of_a_sample(light_below_lamp(distance_over_radius, ball=ball), SPP)


def _lost_behind_ball(radius_over_miss: float) -> float:
    """Return the share of a point light's light that path tracing loses on the floor."""
    return max(0.0, 1.0 - caustic_of_a_point_light(1.0 / radius_over_miss))


def _lost_behind_panes(panes: float, *, radius: float) -> float:
    """Return the share of a lamp's light that path tracing loses behind thin panes.

    On a floor below, a point light of intensity 1 at a distance d gives 1 / d^2, a ball of
    radiance 1 and radius r gives pi (r / d)^2. Of light from right above n panes pass
    (1 - R) / (1 + (2 n - 1) R), where R = 0.04 is what one surface of them reflects
    [Stokes1862]; from a whole ball of radius 2 four panes pass 0.1 % less.

    Parameters
    ----------
    radius
        Of the lamp; 0 is a point light.
    """
    count = round(panes)
    glass = "".join(_PANE.format(x=0, z=1 + 0.5 * k) for k in range(count))
    lamp, given = _POINT.format(0, DISTANCE), 1.0
    if radius:
        lamp, given = _SPHERE.format("0,0,5", radius), np.pi * radius**2
    scene = scene_at(_FLOOR + glass + lamp, _FROM_THE_SIDE, depth=16)
    reflected = (0.5043 / 2.5049) ** 2  # bk7 (1.5046) and air (1.000277)
    passed = (1 - reflected) / (1 + (2 * count - 1) * reflected) if count else 1.0
    seen = float(np.mean(estimates(scene, 256, integrator="path")))
    grey = 0.5 / np.pi  # radiance of the floor over what falls on it
    return abs(1.0 - seen / (grey * given / DISTANCE**2 * passed))


def caustics() -> Shown:
    """Show the ball's caustic of lamps of one power and radii of 1/2, 1/16 and 1/128."""
    pictures = []
    for radius in (0.5, 1 / 16, 1 / 128):
        body = _WIDE_FLOOR.format(3) + _BALL + _SPHERE.format("0,0,5", radius)
        pictures.append(_picture(body, _FROM_ABOVE, SPP) * (0.5 / radius) ** 2)
    return on_screen(pictures, exposure=15.0)


def _two_lamps(body: str, lookat: str, radius: float) -> Shown:
    """Show a scene under a spherical lamp, and under a point light of its power."""
    lamps = (
        (_SPHERE.format("0,0,5", radius), np.pi * radius**2),
        (_POINT.format(0, DISTANCE), 1.0),
    )
    return on_screen(
        [
            _picture(body + lamp, lookat, 256, integrator="path") / power
            for lamp, power in lamps
        ],
        exposure=20.0,
    )


def shadow_of_a_ball() -> Shown:
    """Show a glass ball under both lamps."""
    return _two_lamps(_WIDE_FLOOR.format(3) + _BALL, _FROM_ABOVE, 0.5)


def half_covered() -> Shown:
    """Show a floor under both lamps, its right half below a pane."""
    body = _WIDE_FLOOR.format(3) + _PANE.format(x=9, z=1)
    return _two_lamps(body, 'origin="0,-2.4,0.95" target="0,-0.5,0" up="0,0,1"', 2.0)


# -------------------------------------------------------------------------- many lamps


def _spread_at_floor(body: str, integrator: str, light_choice: str, spp: int = 16) -> float:
    scene = scene_at(_FLOOR + body, _FROM_THE_SIDE)
    values = estimates(scene, spp, integrator=integrator, light_choice=light_choice)
    return spread_of_a_sample(values, spp)


def one_lamp_that_counts(
    others: float, *, integrator: str = "path", light_choice: str = "importance"
) -> float:
    """Return the spread of a sample below one lamp near by and others a thousand times off.

    With a uniform choice on paper the root of the number of the others: all the light comes
    with a probability of one over n + 1, and then n + 1 times.
    """
    lamps = _POINT.format(0, 1) + _POINT.format(0, 1000) * round(others)
    return _spread_at_floor(lamps, integrator, light_choice)


def street_of_lamps(lamps: float, *, light_choice: str = "importance") -> float:
    """Return the spread of a sample at the middle of a street of equal lamps."""
    count = round(lamps)
    street = (_POINT.format(k - count // 2, 1) for k in range(count))
    return _spread_at_floor("".join(street), "path", light_choice)


def hidden_lamp(times: float, *, light_choice: str = "importance") -> float:
    """Return the spread next to a lamp, and another that would give more but for a screen.

    Both are as far away; the screen is a small disk before the other.
    """
    strong = f"""<emitter type="point"><point name="position" value="-0.5,0,2"/>
        <spectrum name="intensity" value="{times!r}"/></emitter>
        <shape type="disk"><transform name="to_world"><scale value="0.01"/>
        <translate x="-0.475" z="1.9"/></transform></shape>"""
    return _spread_at_floor(_POINT.format(0.5, 2) + strong, "path", light_choice)


def street() -> Shown:
    """Show a street of 81 lamps: chosen uniformly, by importance, and every one."""
    body = _WIDE_FLOOR.format(5)
    body += "".join(_POINT.format(k / 10 - 4, 0.2) for k in range(81))
    view = 'origin="0,-6,5" target="0,0,0" up="0,0,1"'
    ways = ("path", "uniform"), ("path", "importance"), ("direct", "uniform")
    pictures = [
        _picture(body, view, 16, fov=60.0, integrator=name, light_choice=choice, depth=2)
        for name, choice in ways
    ]
    return on_screen(pictures, exposure=0.04)


# ------------------------------------------- two ways to find a lamp [Veach1997, chapter 9]

_PLATE = """<shape type="rectangle"><transform name="to_world"><scale value="{0}"/>
    </transform><bsdf type="roughconductor"><string name="material" value="none"/>
    <string name="distribution" value="ggx"/><float name="alpha" value="{1}"/></bsdf>
    </shape>"""
_AWAY = 32**0.5  # of the lamp at (-4, 0, 4)


def _spread_at_plate(alpha: float, distance_over_radius: float, strategy: str) -> float:
    body = _PLATE.format(1, alpha) + _SPHERE.format("-4,0,4", _AWAY / distance_over_radius)
    scene = scene_at(body, 'origin="3,0,3" target="0,0,0" up="0,0,1"')
    return spread_of_a_sample(by_one_strategy(scene, SPP, strategy), SPP)


def _over_smoothness(smoothness: float, *, strategy: str) -> float:
    return _spread_at_plate(1.0 / smoothness, 4.0, strategy)


def _over_lamp_size(distance_over_radius: float, *, strategy: str) -> float:
    return _spread_at_plate(0.3, distance_over_radius, strategy)


def _large_lamp_near(half_width: float, *, strategy: str) -> float:
    """Return the spread of a sample below a square lamp, 1 above a diffuse floor."""
    body = f"""{_FLOOR}
    <shape type="rectangle"><transform name="to_world"><scale value="{half_width!r}"/>
        <rotate x="1" angle="180"/><translate z="1"/></transform>
        <emitter type="area"/></shape>"""
    scene = scene_at(body, 'origin="0.6,0,0.5" target="0,0,0" up="0,0,1"')
    return spread_of_a_sample(by_one_strategy(scene, SPP, strategy), SPP)


def strategies() -> Shown:
    """Show a smooth plate's reflection of a lamp by lamps alone, the BSDF alone, both."""
    body = _PLATE.format(3, 0.03) + _SPHERE.format("-4,0,4", 1.0)
    lookat = 'origin="3,0,3" target="-0.3,0,0" up="0,0,1"'
    scene = scene_at(body, lookat, size=WIDE, fov=45.0)
    names = "lights", "bsdf", "both"
    return on_screen([by_one_strategy(scene, 4, n).reshape(WIDE, WIDE) for n in names])


# ------------------------------------------------------------------- near a point light


def _error_below(one_over_height: float) -> float:
    """Return how far from I / (pi h^2) a white floor below a point light is, relatively."""
    height = 1.0 / one_over_height
    body = f'<shape type="rectangle">{_WHITE}</shape>' + _POINT.format(0, height)
    # straight from above: a point does not stand in its own light
    lookat = 'origin="0,0,0.06" target="0,0,0" up="0,1,0"'
    image = renderer.render(scene_at(body, lookat, size=1, fov=1e-5), spp=1)
    return abs(float(image.pixels[0, 0, 0]) * np.pi * height**2 - 1.0)


def _error_of_moved_point(one_over_height: float) -> float:
    """Return the same for a formula that takes the distance from a point moved by 1e-3."""
    height, start = np.float32(1.0 / one_over_height), np.float32(1e-3)
    with np.errstate(divide="ignore"):
        return float(abs((height / (height - start)) ** 2 - np.float32(1.0)))


def _room_with_a_spot(one_over_distance: float, half: float) -> str:
    """Return a floor and a wall, with a lamp at this distance from the wall."""
    return f"""<shape type="rectangle"><transform name="to_world"><scale value="9"/>
        <rotate y="1" angle="90"/><translate x="-1"/></transform>{_WHITE}</shape>
    <shape type="rectangle"><transform name="to_world"><scale value="{half}"/>
        </transform>{_WHITE}</shape>{_POINT.format(-1 + 1 / one_over_distance, 1)}"""


def _light_from_a_spot(one_over_distance: float) -> float:
    """Return the spread of a sample of light that comes by way of a lit spot of a wall.

    The floor is 1 away; its light is half that of the lamp however near that is.
    """
    body = _room_with_a_spot(one_over_distance, 1.0)
    lookat = 'origin="3,0,3" target="0,0,0" up="0,0,1"'
    return spread_of_a_sample(estimates(scene_at(body, lookat, depth=3), 256), 256)


def spots() -> Shown:
    """Show the floor and the wall with the lamp at 1, 1/8 and 1/64."""
    lookat = 'origin="2.6,-3.5,2.6" target="-0.3,0,0.4" up="0,0,1"'
    pictures = [
        _picture(_room_with_a_spot(1 / d, 4.0), lookat, 16, fov=50.0, depth=3)
        for d in (1.0, 1 / 8, 1 / 64)
    ]
    return on_screen(pictures, exposure=1.5)


MEASURES = {
    "caustic-lamp-radius": partial(_spread_below_lamp, ball=True),
    "lamp-radius-without-glass": partial(_spread_below_lamp, ball=False),
    "caustic-point-light": _lost_behind_ball,
    "point-light-behind-glass": partial(_lost_behind_panes, radius=0.0),
    "large-lamp-behind-glass": partial(_lost_behind_panes, radius=2.0),
    "lamps-starved": partial(one_lamp_that_counts, light_choice="uniform"),
    "lamps-starved-importance": one_lamp_that_counts,
    "lamps-every-one": partial(one_lamp_that_counts, integrator="direct"),
    "lamps-street": partial(street_of_lamps, light_choice="uniform"),
    "lamps-by-importance": street_of_lamps,
    "lamps-hidden": hidden_lamp,
    "lamps-hidden-uniform": partial(hidden_lamp, light_choice="uniform"),
    "glossy-lights-alone": partial(_over_smoothness, strategy="lights"),
    "glossy-bsdf-alone-roughness": partial(_over_smoothness, strategy="bsdf"),
    "glossy-both-roughness": partial(_over_smoothness, strategy="both"),
    "glossy-bsdf-alone": partial(_over_lamp_size, strategy="bsdf"),
    "glossy-lights-alone-size": partial(_over_lamp_size, strategy="lights"),
    "glossy-both-size": partial(_over_lamp_size, strategy="both"),
    "lamp-near-lights-alone": partial(_large_lamp_near, strategy="lights"),
    "lamp-near-both": partial(_large_lamp_near, strategy="both"),
    "point-light-near-moved": _error_of_moved_point,
    "point-light-near": _error_below,
    "bright-spot": _light_from_a_spot,
}
PICTURES = {
    "caustic": caustics,
    "caustic-point-light": shadow_of_a_ball,
    "point-light-behind-glass": half_covered,
    "lamps-street": street,
    "glossy-roughness": strategies,
    "bright-spot": spots,
}
