"""What point, spot and directional lights emit in all: flux through closed surfaces.

A light without area has one direction at each point and nothing random, so the sums are
integrals: Gauss-Legendre on surfaces around the light, with edges where a spot's falloff
has kinks. The irradiance at a point is the sample's radiance times the cosine; its integral
over a surface that encloses the light is the power, whatever the surface.
"""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import cell_masses
from light_probes import LightProbe

I = np.array([2.0, 1.0, 0.5])  # noqa: E741  (the intensity, as everybody calls it)
POSITION = np.array([1.0, 2.0, 3.0])
AXIS = np.array([0.48, 0.64, 0.6])
TO_LIGHT = np.array([2.0, -1.0, 2.0]) / 3
SPOTS = {"soft": (40.0, 25.0), "wide": (85.0, 10.0), "hard": (30.0, 30.0)}
WHOLE_TURN = np.array([0.0, 2 * np.pi])


def rgb():
    return {"type": "rgb", "value": list(I)}


def spot(cutoff, beam):
    to_world = np.eye(4)
    to_world[:3, 0], to_world[:3, 1] = [0.8, -0.6, 0], [0.36, 0.48, -0.8]
    to_world[:3, 2], to_world[:3, 3] = AXIS, POSITION
    return {
        "type": "spot",
        "to_world": to_world,
        "cutoff_angle": cutoff,
        "beam_width": beam,
        "intensity": rgb(),
    }


@pytest.fixture(scope="module")
def lights():
    emitters = {
        "point": {"type": "point", "position": list(POSITION), "intensity": rgb()},
        "directional": {
            "type": "directional",
            "direction": list(-TO_LIGHT),
            "irradiance": rgb(),
        },
        "constant": {"type": "constant"},
    }
    emitters |= {name: spot(*angles) for name, angles in SPOTS.items()}
    plate = {"plate": {"type": "rectangle"}}
    return LightProbe(plate, emitters, (1.0, 1.0, 1.0))


def irradiance(lights, name, points, normal):
    """E [W/m^2] of each colour (3, n) on surfaces that face the unit normals (n, 3)."""
    out = lights.sample(name, points, np.zeros((3, len(points))))
    return out.radiance.T * np.sum(out.wi * normal, axis=1)


def flux_through_box(lights, name, low, high):
    """Return the power that enters a box with 64 points along each edge: (3,)."""
    total = np.zeros(3)
    edges = [np.linspace(low[k], high[k], 5) for k in range(3)]
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end, sign in ((low, -1), (high, 1)):
            normal = np.eye(3)[axis] * sign

            def entering(a, b, color, axis=axis, u=u, v=v, end=end, normal=normal):
                points = np.empty((len(a), 3))
                points[:, axis], points[:, u], points[:, v] = end[axis], a, b
                return irradiance(lights, name, points, normal)[color]

            for color in range(3):
                total[color] += cell_masses(
                    lambda a, b, e=entering, c=color: e(a, b, c), edges[u], edges[v]
                ).sum()
    return total


BOXES = [((0, 1, 2), (2, 3, 4)), ((-1, 1.5, 2.8), (1.2, 6, 3.5))]


@pytest.mark.parametrize("box", BOXES, ids=["around", "askew"])
def test_a_point_light_emits_4_pi_i(lights, box):
    """What leaves the box, wherever in it the light is."""
    flux = -flux_through_box(lights, "point", *box)
    np.testing.assert_allclose(flux, 4 * np.pi * I, rtol=3e-6)


def test_a_box_beside_a_point_light_gains_nothing(lights):
    """As much goes out as comes in: the field has no sources but the light."""
    flux = flux_through_box(lights, "point", (3, 2.5, 2), (4, 4, 5))
    assert np.abs(flux).max() < 3e-6


@pytest.mark.parametrize("name", SPOTS)
@pytest.mark.parametrize("radius", [0.1, 1.0, 30.0])
def test_a_spot_emits_the_integral_of_its_falloff(lights, name, radius):
    """Full up to the beam b, linear in angle to the cutoff c [rad]:

    2 pi I (1 - cos b + int_b^c (c - t) / (c - b) sin t dt)
    = 2 pi I (1 - (sin c - sin b) / (c - b)).

    For b = c it is the cone, 2 pi I (1 - cos c). Beyond the cutoff it is dark.
    """
    c, b = np.radians(SPOTS[name])
    side = np.array([0.8, -0.6, 0])
    up = np.cross(AXIS, side)

    def leaving(cosine, turn):
        sine = np.sqrt(1 - cosine**2)
        around = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
        out = cosine[:, None] * AXIS + sine[:, None] * around
        points = POSITION + radius * out
        return -irradiance(lights, name, points, out)[0] * radius**2

    cones = [np.array([np.cos(b), 1.0])]
    if c > b:
        cones.append(np.cos([c, b]))
    power = sum(cell_masses(leaving, cosines, WHOLE_TURN).sum() for cosines in cones)
    cone = np.cos(c) if b == c else (np.sin(c) - np.sin(b)) / (c - b)
    assert power == pytest.approx(2 * np.pi * I[0] * (1 - cone), rel=3e-6)
    dark = leaving(np.linspace(-1, np.cos(c + 1e-4), 100), np.linspace(0, 6, 100))
    np.testing.assert_array_equal(dark, 0)


def test_a_directional_light_gives_e_cos_everywhere(lights):
    """On a plate, E cos times its area; through a closed box, nothing at all."""
    normal = np.array([0.0, 0, 1])

    def on_plate(a, b):
        points = np.stack((a, b, 0 * a), axis=1)
        return irradiance(lights, "directional", points, np.tile(normal, (len(a), 1)))[0]

    edges = np.array([-3.0, 1, 2])
    power = cell_masses(on_plate, edges, edges).sum()
    assert power == pytest.approx(I[0] * TO_LIGHT[2] * 25, rel=1e-6)
    flux = flux_through_box(lights, "directional", (-1, -2, -3), (4, 4, 5))
    assert np.abs(flux).max() < 3e-5  # of 100 that come in


def test_the_environment_gives_pi_l_to_any_plate(lights):
    """The mean of radiance x cosine over a grid of 1024 x 1024 random numbers: pi L."""
    t = (np.arange(1024) + 0.5) / 1024
    x, y = (a.ravel() for a in np.meshgrid(t, t))
    out = lights.sample("constant", POSITION, np.stack((x, y, 0 * x)))
    for normal in (AXIS, TO_LIGHT, [0, 0, -1]):
        mean = (out.radiance[:, 0] * np.maximum(out.wi @ normal, 0)).mean()
        assert mean == pytest.approx(np.pi, rel=2e-5)
