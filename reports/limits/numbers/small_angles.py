"""Small angles: the cone of a far lamp, and the angle between two directions."""

from __future__ import annotations

import numpy as np

import renderer
from reports.limits.row import Row
from reports.limits.vectors import directions, dot, single, unit

_LAMP = """<scene version="3.0.0">
<integrator type="direct"/>
<sensor type="perspective"><float name="fov" value="0.01"/>
    <transform name="to_world">
        <lookat origin="3,0,3" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="1"/><integer name="height" value="1"/>
        <string name="component_format" value="float32"/><rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="16"/></sampler></sensor>
<shape type="rectangle"><bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf>
    </shape>
<shape type="sphere"><point name="center" x="0" y="0" z="{distance}"/>
    <emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>
</scene>"""


def _naive_cone(distance: float) -> float:
    """Return the error of 1 - cos of a unit sphere's half angle, as it is written."""
    sine = np.float32(1) / np.float32(distance)
    found = np.float32(1) - np.sqrt(np.float32(1) - sine * sine)
    s = 1.0 / distance
    truth = s * s / (1.0 + np.sqrt(1.0 - s * s))
    return float(abs(found / truth - 1.0))


def _lamp(distance: float) -> float:
    """Return the error of the light that a floor gets from a sphere right above it."""
    text = _LAMP.format(distance=distance, radiance=distance**2)
    pixel = float(renderer.render(renderer.load_string(text)).pixels.mean())
    return abs(pixel - 1.0)  # L (r / d)^2


def _angle(strength: float, by_arccos: bool) -> float:
    """Return the largest relative error of angles of 1 / strength, in float32."""
    rng = np.random.default_rng(15)
    first = directions(1024, rng)
    across = unit(np.cross(first, directions(1024, rng)))
    a, b = single(first), single(unit(first + np.tan(1.0 / strength) * across))
    if by_arccos:
        found = np.arccos(np.clip(dot(a, b), -1.0, 1.0))
    else:
        found = np.float32(2) * np.arcsin(np.sqrt(dot(b - a, b - a)) / np.float32(2))
    return float(np.abs(found * strength - 1.0).max())


_DISTANCES = (1e1, 3e1, 1e2, 3e2, 1e3, 1e4, 1e5)
_ANGLES = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6)

ROWS = (
    Row(
        name="cone-naive",
        method="1 - cos of a lamp's cone, as it is written",
        stress="distance over radius of a sphere lamp",
        measure=_naive_cone,
        quantity="error",
        unit="of the solid angle",
        strengths=_DISTANCES,
        tolerance=1e-2,
        holds_at=1e2,
        fails_at=3e3,
        why="The cosine is near 1, where float32 numbers are 6e-8 apart; at 6000 radii "
        "nothing is left.",
        instead="sin^2 / (1 + cos): the next row.",
        source="measured here",
    ),
    Row(
        name="cone-ours",
        method="Light of a sphere lamp, as this renderer samples it",
        stress="distance over radius of a sphere lamp",
        measure=_lamp,
        quantity="error",
        unit="of the light on a floor below",
        strengths=_DISTANCES,
        tolerance=1e-2,
        holds_at=1e5,
        fails_at=None,
        why="sin^2 / (1 + cos) has no difference of like numbers.",
        instead="Nothing.",
        source="measured here",
    ),
    Row(
        name="angle-by-arccos",
        method="Angle between directions by arccos(a . b), float32",
        stress="1 / angle",
        measure=lambda strength: _angle(strength, by_arccos=True),
        quantity="error",
        unit="of the angle, the worst of 1024",
        strengths=_ANGLES,
        tolerance=1e-2,
        holds_at=1e2,
        fails_at=1e4,
        why="The cosine is flat at 0: its last place is an angle of 3e-4.",
        instead="2 arcsin(|a - b| / 2): the next row.",
        source="measured here",
    ),
    Row(
        name="angle-by-chord",
        method="Angle between directions by 2 arcsin(|a - b| / 2), float32",
        stress="1 / angle",
        measure=lambda strength: _angle(strength, by_arccos=False),
        quantity="error",
        unit="of the angle, the worst of 1024",
        strengths=_ANGLES,
        tolerance=1e-2,
        holds_at=1e4,
        fails_at=1e6,
        why="The chord is as long as the angle; what is left is the rounding of the "
        "directions.",
        instead="Nothing.",
        source="measured here",
    ),
)
