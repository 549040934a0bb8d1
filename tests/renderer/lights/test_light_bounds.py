"""What is known of a light before any point asks it: by hand, and never too little.

A bound that is too small where a light shines makes noise without a limit, or a bias if a
probability becomes negative.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from kernel_probes import unit
from light_probes import AREA_SHAPES, OTHERS, TILT, Bounds, LightProbe, at, importance

from renderer.scene.light_tables import light_bounds

SLIDE = Path(__file__).parents[2] / "plugins" / "slide.png"
L = (3.0, 1.0, 0.5)  # mean 1.5
RGB = {"type": "rgb", "value": list(L)}
ANGLES = [(40, 25), (30, 30), (89, 1), (100, 5), (120, 100), (180, 10), (180, 180)]
SPOTS = {
    f"spot {cutoff} {beam}": {
        "type": "spot",
        "to_world": at(2, TILT),
        "cutoff_angle": float(cutoff),
        "beam_width": float(beam),
        "intensity": RGB,
    }
    for cutoff, beam in ANGLES
}
EMITTERS = {
    "point": OTHERS["point"] | {"intensity": RGB},
    **SPOTS,
    "slide": SPOTS["spot 40 25"] | {"texture": {"type": "bitmap", "filename": str(SLIDE)}},
    "projector": {"type": "projector", "to_world": at(-1, TILT), "fov": 70.0},
    "directional": OTHERS["directional"] | {"irradiance": RGB},
    "constant": {"type": "constant", "radiance": RGB},
}
NAMES = [*AREA_SHAPES, *EMITTERS]


@pytest.fixture(scope="module")
def probe():
    return LightProbe(AREA_SHAPES, EMITTERS, L)


@pytest.fixture(scope="module")
def bounds(probe):
    return dict(zip(NAMES, light_bounds(probe.scene), strict=True))


def slow(bounds) -> Bounds:
    """Return them as the slow formula of importance takes them."""
    return Bounds(
        bounds.strength,
        np.asarray(bounds.center, float),
        max(bounds.radius, 1e-9),
        np.asarray(bounds.axis, float),
        bounds.spread,
        bounds.reach,
        bounds.at_infinity,
    )


AXIS = TILT[:, 2]
DOWN = unit(np.array([1.0, 2.0, -3.0]))
ALL, HALF = math.pi, math.pi / 2
# center, radius, strength, axis, spread, reach [deg]; None: whatever it is
BY_HAND = {
    "point": ((1, 2, 3), 0.0, 1.5, None, 180.0, 0.0),
    "spot 40 25": ((2, 0, 0), 0.0, 1.5, AXIS, 25.0, 15.0),
    "spot 30 30": ((2, 0, 0), 0.0, 1.5, AXIS, 30.0, 0.0),
    "spot 89 1": ((2, 0, 0), 0.0, 1.5, AXIS, 1.0, 88.0),
    # no cosine reaches farther than 90 degrees: full where the fading would need more
    "spot 100 5": ((2, 0, 0), 0.0, 1.5, AXIS, 10.0, 90.0),
    "spot 180 10": ((2, 0, 0), 0.0, 1.5, AXIS, 90.0, 90.0),
    "spot 120 100": ((2, 0, 0), 0.0, 1.5, AXIS, 100.0, 20.0),
    "directional": ((0, 0, 0), 0.0, 1.5, -DOWN, 0.0, 0.0),
    "constant": ((0, 0, 0), 0.0, 1.5 * ALL, None, 180.0, 0.0),
    "rectangle": ((0, 0, 0), math.sqrt(2), 1.5 * 4, (0, 0, 1), 0.0, 90.0),
    "flipped": ((96, 0, 0), math.sqrt(2), 1.5 * 4, (0, 0, -1), 0.0, 90.0),
    "disk": ((12, 0, 0), math.sqrt(2), 1.5 * ALL, (0, 0, 1), 0.0, 90.0),
    "sphere": ((24, 0, 0), 1.0, 1.5 * ALL, None, 180.0, 90.0),
    "lamp": ((36, 0, 0), 1.0, 1.5 * ALL, None, 180.0, 90.0),
    # of a closed shape a fourth of its area is seen in the mean
    "cube": ((48, 0, 0), math.sqrt(1.3125), 1.5 * 7 / 4, None, 180.0, 90.0),
    "cylinder": ((60, 0, 1), math.sqrt(1.25), 1.5 * HALF, None, 180.0, 90.0),
    "ellipse": ((72, 0, 0), math.sqrt(2.5), 1.5 * 0.75 * ALL, (0, 0, 1), 0.0, 90.0),
    "mirrored": ((84, 0, 0), math.sqrt(2), 1.5 * 4, (0, 0, 1), 0.0, 90.0),
}


@pytest.mark.parametrize("name", BY_HAND)
def test_bounds_by_hand(bounds, name):
    """Colours and angles that all differ, and axes that are none of the world's."""
    found = bounds[name]
    center, radius, strength, axis, spread, reach = BY_HAND[name]
    np.testing.assert_allclose(found.center, center, atol=1e-6, err_msg=f"{name}: center")
    if name == "cylinder":  # from the middle to the rim, or a little more
        assert radius <= found.radius <= 1.5, f"{name}: radius {found.radius}"
    else:
        assert found.radius == pytest.approx(radius, rel=1e-6), f"{name}: radius"
    if strength is not None:
        assert found.strength == pytest.approx(strength, rel=1e-6), f"{name}: strength"
    if axis is not None:
        np.testing.assert_allclose(found.axis, axis, atol=1e-6, err_msg=f"{name}: axis")
    degrees = math.degrees(found.spread), math.degrees(found.reach)
    assert degrees == pytest.approx((spread, reach), abs=1e-4), f"{name}: spread, reach"
    assert found.at_infinity == (name in ("directional", "constant"))


@pytest.mark.parametrize("name", NAMES)
def test_a_light_that_shines_somewhere_is_chosen_there(probe, bounds, name):
    """At random places all around, near and far: what gives light has an importance.

    Of lights without an area it is never less than what they give to a surface that faces
    them, but for textures, of which the mean is known.
    """
    rng = np.random.default_rng(5)
    center = np.asarray(bounds[name].center, float)
    away = unit(rng.normal(size=(2000, 3))) * rng.uniform(0.1, 6.0, (2000, 1))
    wi, radiance, _, pdf = probe.sample(name, center + away, rng.random((3, 2000)))
    given = radiance.mean(axis=1) * (1.0 if name in EMITTERS else pdf)
    lit = np.flatnonzero(given > 1e-4 * given.max())
    assert lit.size > 20, f"{name} shines at {lit.size} of 2000 places"
    known = slow(bounds[name])
    found = np.array([importance(known, center + away[k], wi[k]) for k in lit])
    assert found.min() > 0.0, f"{name} gives light where its importance is {found.min()}"
    if name not in (*AREA_SHAPES, "slide", "projector", "constant"):
        worst = (given[lit] / found).max()
        assert worst < 1.0 + 1e-5, f"{name} gives {worst} times its importance"
