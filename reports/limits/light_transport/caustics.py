"""Caustics: light that comes to a diffuse surface through glass, by path tracing alone."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.expected_failures.light import caustic_of_a_point_light
from reports.limits.light_transport.one_point import (
    SIZE,
    estimates,
    scene_at,
    spread_of_a_sample,
)
from reports.limits.row import Row
from reports.limits.screen import on_screen

SPP = 64
DISTANCE = 5.0  # of the lamp from the floor
_FLOOR = '<shape type="rectangle"><bsdf type="diffuse"/></shape>'
_BALL = """<shape type="sphere"><point name="center" value="0,0,1.5"/>
    <bsdf type="dielectric"/></shape>"""
_LAMP = """<shape type="sphere"><point name="center" value="0,0,5"/>
    <float name="radius" value="{radius}"/><emitter type="area"/></shape>"""
_LOOKAT = 'origin="6,0,1" target="0,0,0" up="0,0,1"'


def light_below_lamp(
    distance_over_radius: float, *, ball: bool, spp: int = SPP, size: int = SIZE
) -> NDArray[np.float64]:
    """Return estimates of the light below a spherical lamp, behind a glass ball or not."""
    lamp = _LAMP.format(radius=DISTANCE / distance_over_radius)
    body = _FLOOR + lamp + (_BALL if ball else "")
    return estimates(scene_at(body, _LOOKAT, depth=8, size=size), spp)


def spread_below_lamp(distance_over_radius: float, *, ball: bool) -> float:
    """Return the spread of a single sample of it."""
    return spread_of_a_sample(light_below_lamp(distance_over_radius, ball=ball), SPP)


def light_lost_behind_ball(radius_over_miss: float) -> float:
    """Return the share of a point light's light that path tracing loses on the floor."""
    return max(0.0, 1.0 - caustic_of_a_point_light(1.0 / radius_over_miss))


_WIDE = """<shape type="rectangle"><transform name="to_world"><scale value="3"/>
    </transform><bsdf type="diffuse"/></shape>"""
_VIEW = 'origin="6,0,5" target="0,0,0.6" up="0,0,1"'


def caustics_on_a_floor() -> NDArray[np.uint8]:
    """Show the ball's caustic of lamps of one power and radii of 1/2, 1/16 and 1/128."""
    pictures = []
    for radius in (0.5, 1 / 16, 1 / 128):
        body = _WIDE + _BALL + _LAMP.format(radius=radius)
        scene = scene_at(body, _VIEW, depth=8, size=96, fov=45.0)
        values = estimates(scene, SPP) * (0.5 / radius) ** 2
        pictures.append(values.reshape(96, 96))
    return on_screen(pictures, exposure=15.0)


def shadow_of_a_ball() -> NDArray[np.uint8]:
    """Show the ball under a lamp of radius 1/2, and under a point light."""
    lamps = (_LAMP.format(radius=0.5), _POINT)
    pictures = []
    for lamp, power in zip(lamps, (np.pi / 4, 1.0), strict=True):
        scene = scene_at(_WIDE + _BALL + lamp, _VIEW, depth=8, size=96, fov=45.0)
        values = estimates(scene, 256, integrator="path") / power
        pictures.append(values.reshape(96, 96))
    return on_screen(pictures, exposure=20.0)


_PANE = """<shape type="rectangle"><transform name="to_world"><scale value="9"/>
    <translate z="{z}"/></transform><bsdf type="thindielectric"/></shape>"""
_POINT = '<emitter type="point"><point name="position" value="0,0,5"/></emitter>'


_GREY = 0.5 / np.pi  # radiance of the floor over what falls on it


def light_lost_behind_panes(panes: float, *, radius: float) -> float:
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
    glass = "".join(_PANE.format(z=1 + 0.5 * k) for k in range(count))
    lamp, given = _POINT, 1.0
    if radius:
        lamp, given = _LAMP.format(radius=radius), np.pi * radius**2
    scene = scene_at(_FLOOR + glass + lamp, _LOOKAT, depth=16)
    reflected = (0.5043 / 2.5049) ** 2  # bk7 (1.5046) and air (1.000277)
    passed = (1 - reflected) / (1 + (2 * count - 1) * reflected) if count else 1.0
    seen = float(np.mean(estimates(scene, 256, integrator="path")))
    return abs(1.0 - seen / (_GREY * given / DISTANCE**2 * passed))


ROWS = (
    Row(
        name="caustic-lamp-radius",
        method="Path tracing below a glass ball",
        stress="lamp's distance over its radius",
        measure=partial(spread_below_lamp, ball=True),
        quantity="error",
        unit="standard deviation of a sample over the mean",
        strengths=(5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0),
        tolerance=6.0,
        holds_at=30.0,
        fails_at=200.0,
        why="Glass stops shadow rays, so the lamp is found by chance alone, and its "
        "share of the directions falls with the square of its radius.",
        instead="A larger lamp, or light traced from the lamp (photon maps, bidirectional "
        "paths), which this renderer does not have.",
        source="measured here; [Veach1997, section 8.3]",
        picture=caustics_on_a_floor,
        caption="Lamps of one power at a distance of 10, 80 and 640 radii: the caustic "
        "gathers in ever fewer pixels, and is gone.",
    ),
    Row(
        name="lamp-radius-without-glass",
        method="Path tracing below the same lamp, without the ball",
        stress="lamp's distance over its radius",
        measure=partial(spread_below_lamp, ball=False),
        quantity="error",
        unit="standard deviation of a sample over the mean",
        strengths=(5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0),
        tolerance=0.1,
        holds_at=640.0,
        fails_at=None,
        why="The lamp is asked for light itself, in proportion to the solid angle that it "
        "fills.",
        instead="This is the method to use.",
        source="measured here",
    ),
    Row(
        name="caustic-point-light",
        method="Path tracing of a point light past a glass ball",
        stress="ball's radius over its distance from the straight line to the lamp",
        measure=light_lost_behind_ball,
        quantity="error",
        unit="of the light lost, at least",
        strengths=(0.5, 0.7, 0.9, 0.99, 1.01, 1.1, 2.0, 10.0),
        tolerance=0.01,
        holds_at=0.99,
        fails_at=1.01,
        why="No path meets a point by chance and no shadow ray passes glass: behind the "
        "ball there is exactly nothing, where it should be brightest.",
        instead="A small sphere with the same power, and many samples.",
        source="[Veach1997, section 8.3]; measured here",
        picture=shadow_of_a_ball,
        caption="A lamp of radius 1/2, and a point light of its power: the caustic below "
        "the ball is missing.",
    ),
    Row(
        name="point-light-behind-glass",
        method="Path tracing of a point light behind flat panes",
        stress="panes of glass in front of it",
        measure=partial(light_lost_behind_panes, radius=0.0),
        quantity="error",
        unit="of the light lost",
        strengths=(0.0, 1.0, 2.0, 4.0),
        tolerance=0.01,
        holds_at=0.0,
        fails_at=1.0,
        why="A pane passes 92 % of the light, a shadow ray through it nothing: the "
        "picture is black, and no number of samples tells.",
        instead="A lamp with an extent: the next row.",
        source="measured here",
    ),
    Row(
        name="large-lamp-behind-glass",
        method="Path tracing of a large lamp behind flat panes",
        stress="panes of glass in front of it",
        measure=partial(light_lost_behind_panes, radius=2.0),
        quantity="error",
        unit="of the light",
        strengths=(0.0, 1.0, 2.0, 4.0),
        tolerance=0.03,  # six standard errors of 2.6 * 10^5 paths behind four panes
        holds_at=4.0,
        fails_at=None,
        why="Paths that the floor sends up by chance meet the lamp through the panes.",
        instead="This is the method to use; a smaller lamp needs more samples.",
        source="[Stokes1862] (what panes pass); measured here",
    ),
)
