"""Lights of any flat outline, in any place: Lambert's sum over edges, cut at the horizon.

Row F of docs/ground_truth.md, next to the triangles of test_closed_forms.py: lights of
several triangles, lights that stand through the floor, and Howell's factor for a square
that stands upright.
"""

from __future__ import annotations

import numpy as np
import pytest
from form_factors import SMALL, lambert_irradiance, under_light
from small_scenes import assert_mean, diffuse, rectangle, sensor

RHO = 0.5
CAMERA = sensor((0, 0, 0.01), (0, 0, 0), up=(0, 1, 0), **SMALL)


def above_horizon(corners):
    """Cut a polygon at z = 0 and keep what is above [Sutherland1974]."""
    kept = []
    for p, q in zip(corners, [*corners[1:], corners[0]], strict=True):
        p, q = np.array(p, float), np.array(q, float)
        if p[2] > 0:
            kept.append(p)
        if (p[2] > 0) != (q[2] > 0):
            kept.append(p + (q - p) * p[2] / (p[2] - q[2]))
    return kept


def mesh(corners, path):
    """Return a flat polygon as a fan of triangles that shines towards the origin."""
    corners = [np.array(c, float) for c in corners]
    if np.dot(np.cross(corners[1] - corners[0], corners[2] - corners[0]), corners[0]) > 0:
        corners = corners[::-1]
    lines = ["v {:.9g} {:.9g} {:.9g}\n".format(*c) for c in corners]
    lines += [f"f 1 {k} {k + 1}\n" for k in range(2, len(corners))]
    path.write_text("".join(lines))
    return {"type": "obj", "filename": str(path)}


def regular(count, radius, center, axis):
    """Return a regular polygon around `center`, across `axis`."""
    axis = np.array(axis, float) / np.linalg.norm(axis)
    x = np.cross(axis, (0.3, 0.8, 0.5))
    x /= np.linalg.norm(x)
    turn = 2 * np.pi * np.arange(count) / count
    return [center + radius * (np.cos(a) * x + np.sin(a) * np.cross(axis, x)) for a in turn]


LIGHTS = {
    "a wide pentagon": regular(5, 1.5, (0.2, -0.3, 1.0), (0.1, 0.2, 1)),
    "a far heptagon": regular(7, 2.0, (4, 3, 5), (4, 3, 5)),
    "a steep hexagon": regular(6, 0.4, (0.5, 0.1, 0.5), (1, 0.3, 0.2)),
    "half under the floor": regular(8, 1.0, (0.8, 0, 0), (1, 0, 0.2)),
    "a corner above it": [(1, -2, -1), (1.5, 2, -1), (1.2, 0.1, 0.5)],
}


@pytest.mark.parametrize("name", LIGHTS)
def test_a_light_of_several_triangles(name, tmp_path):
    """E = L / 2 sum Theta_i Gamma_i . n over the edges above the horizon [Lambert1760].

    Light from below the surface does not count, also when samples are drawn there.
    """
    corners = LIGHTS[name]
    content = under_light(CAMERA, mesh(corners, tmp_path / "light.obj"), tmp_path)
    expected = RHO * lambert_irradiance(above_horizon(corners)) / np.pi
    assert_mean(content, expected, within=5e-3)


@pytest.mark.parametrize("sunk", [0.0, 0.5], ids=["standing", "half sunk"])
@pytest.mark.parametrize(("distance", "half"), [(1.0, 1.0), (0.25, 2.0)])
def test_an_upright_square(distance, half, sunk, tmp_path):
    """F = (atan(1/y) - y / sqrt(x^2 + y^2) atan(1 / sqrt(x^2 + y^2))) / 2 pi (Howell).

    The factor of a rectangle b x h, at right angles to the element, at distance d from
    its lower corner: x = h / b, y = d / b; twice that for both sides. Half sunk, it is as
    high above the floor as below it.
    """
    height = 2 * half * (1 - sunk)
    light = rectangle(
        (distance, 0, height - half), (0, -half, 0), (0, 0, half), diffuse(0.0)
    )
    x, y = height / half, distance / half
    far = np.hypot(x, y)
    factor = 2 * (np.arctan(1 / y) - y / far * np.arctan(1 / far)) / (2 * np.pi)
    corners = [(distance, s * half, h) for s, h in ((-1, 0), (1, 0), (1, height))]
    corners.append((distance, -half, height))
    assert factor == pytest.approx(lambert_irradiance(corners) / np.pi, rel=1e-9)
    assert_mean(under_light(CAMERA, light, tmp_path), RHO * factor, within=3e-3)
