"""Near a point light, where 1 / r^2 has no bound."""

from __future__ import annotations

import numpy as np

import renderer
from reports.limits.light_transport.one_point import (
    estimates,
    scene_at,
    spread_of_a_sample,
)
from reports.limits.row import Row

SPP = 256
_POINT = '<emitter type="point"><point name="position" value="{place}"/></emitter>'
_WHITE = '<bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf>'


def error_below(one_over_height: float) -> float:
    """Return how far from I / (pi h^2) a white floor below a point light is, relatively."""
    height = 1.0 / one_over_height
    body = f'<shape type="rectangle">{_WHITE}</shape>'
    body += _POINT.format(place=f"0,0,{height!r}")
    # straight from above: a point does not stand in its own light
    lookat = 'origin="0,0,0.06" target="0,0,0" up="0,1,0"'
    scene = scene_at(body, lookat, size=1, fov=1e-5)
    image = renderer.render(scene, spp=1)
    return abs(float(image.pixels[0, 0, 0]) * np.pi * height**2 - 1.0)


def error_of_moved_point(one_over_height: float, *, moved: float = 1e-3) -> float:
    """Return the same for a formula that takes the distance from the moved point."""
    height, start = np.float32(1.0 / one_over_height), np.float32(moved)
    with np.errstate(divide="ignore"):
        return float(abs((height / (height - start)) ** 2 - np.float32(1.0)))


def light_from_a_bright_spot(one_over_distance: float) -> float:
    """Return the spread of a sample of light that comes by way of a lit spot of a wall.

    The lamp is at this distance from the wall, the floor 1 away; its light is half that
    of the lamp however near it is.
    """
    wall = f"""<shape type="rectangle"><transform name="to_world"><scale value="9"/>
        <rotate y="1" angle="90"/><translate x="-1"/></transform>{_WHITE}</shape>"""
    floor = f'<shape type="rectangle">{_WHITE}</shape>'
    lamp = _POINT.format(place=f"{-1 + 1 / one_over_distance!r},0,1")
    scene = scene_at(
        floor + wall + lamp, 'origin="3,0,3" target="0,0,0" up="0,0,1"', depth=3
    )
    return spread_of_a_sample(estimates(scene, SPP), SPP)


_HEIGHTS = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)

ROWS = (
    Row(
        name="point-light-near-moved",
        method="1 / r^2 from where the shadow ray starts, 1e-3 off (NumPy, float32)",
        stress="1 / height of a point light",
        measure=error_of_moved_point,
        quantity="error",
        unit="of the light",
        strengths=_HEIGHTS,
        tolerance=0.05,
        holds_at=10.0,
        fails_at=100.0,
        why="The start of the ray is nearer to the lamp than the point is, and 1 / r^2 "
        "squares the difference; below 1e-3 the lamp is behind it.",
        instead="Light, BSDF and distance at the point itself; only the shadow ray is "
        "moved, by some rounding errors.",
        source="measured here",
    ),
    Row(
        name="point-light-near",
        method="1 / r^2 from the point, and a shadow ray a little off it",
        stress="1 / height of a point light",
        measure=error_below,
        quantity="error",
        unit="of the light",
        strengths=_HEIGHTS,
        tolerance=0.01,
        holds_at=1e6,
        fails_at=None,
        why="A ray that starts behind the lamp looks back and ends before its surface, so "
        "that the lamp is seen even then.",
        instead="This is the method to use.",
        source="measured here",
    ),
    Row(
        name="bright-spot",
        method="Path tracing of light by way of a wall",
        stress="1 / distance of a point light from the wall",
        measure=light_from_a_bright_spot,
        quantity="error",
        unit="standard deviation of a sample over the mean",
        strengths=(1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
        tolerance=3.0,
        holds_at=4.0,
        fails_at=32.0,
        why="Half of the lamp's light comes from a spot as wide as its distance, found by "
        "chance and then as bright as 1 / r^2 makes it.",
        instead="A lamp with an extent and some distance from walls; clamping would be a "
        "bias.",
        source="[Keller1997] (the same bound on virtual lights); measured here",
    ),
)
