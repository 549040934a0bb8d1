"""Ray against sphere and open cylinder: far away, from inside, through open ends."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import (
    FIRST_ID,
    accelerator,
    closest,
    cylinders,
    directions,
    float32,
    spheres,
    unit,
)

N = 100_000


def hit_one(kind, surfaces, origin, direction, t_max=np.inf):
    return closest(accelerator(kind, surfaces, "brute"), origin, direction, t_max=t_max)


def unit_sphere():
    return spheres([[0.0, 0.0, 0.0]], [1.0])


def rays_at_sphere(distance, seed=0, n=N):
    """Rays from `distance` that meet the unit sphere up to 0.99 off its centre."""
    rng = np.random.default_rng(seed)
    away = directions(n, rng)
    target = 0.99 * rng.random((n, 1)) ** 0.5 * unit(np.cross(away, directions(n, rng)))
    origin = float32(target + distance * away)
    return origin, float32(unit(target - origin))


def true_roots(origin, direction, center=0.0, radius=1.0):
    """Both roots in float64, for the very float32 rays that the kernel gets."""
    f, d = origin.astype(float) - center, direction.astype(float)
    a, b = np.sum(d * d, 1), -np.sum(f * d, 1)
    nearest = f + d * (b / a)[:, None]
    root = np.sqrt(a * (radius**2 - np.sum(nearest * nearest, 1)))
    return (b - root) / a, (b + root) / a


# the ray's own rounding moves it by half a unit of the distance, and so does ours
@pytest.mark.parametrize(
    ("distance", "error"), [(1e1, 5e-6), (1e2, 4e-5), (1e3, 5e-4), (1e4, 5e-3)]
)
def test_no_ray_misses_a_sphere_from_afar(distance, error):
    """0 missed at any distance, and t right to a few units in its last place (row 16)."""
    origin, direction = rays_at_sphere(distance)
    found = hit_one("spheres", unit_sphere(), origin, direction)
    assert (found.prim == FIRST_ID).all()
    near, _ = true_roots(origin, direction)
    difference = np.abs(found.t - near)
    assert difference.max() < error
    assert np.median(difference) < np.spacing(np.float32(distance))


def test_from_inside_the_far_root_counts():
    rng = np.random.default_rng(1)
    origin = float32(0.9 * rng.random((N, 1)) * directions(N, rng))
    direction = float32(directions(N, rng))
    found = hit_one("spheres", unit_sphere(), origin, direction)
    assert (found.prim == FIRST_ID).all()
    _, far = true_roots(origin, direction)
    np.testing.assert_allclose(found.t, far, rtol=2e-6)


def test_from_a_point_of_the_sphere():
    """Exactly on it: outward no hit, inward t = 2 r cos (row 17).

    The root is that of r^2 less the squared distance of ray and centre, known to 1e-7:
    so is t to 1e-7 / cos, and to 1e-6 of itself away from grazing.
    """
    rng = np.random.default_rng(2)
    poles = np.concatenate((np.eye(3), -np.eye(3)))[rng.integers(0, 6, N)]
    direction = float32(directions(N, rng))
    cosine = np.sum(-poles * direction.astype(float), axis=1)
    found = hit_one("spheres", spheres([[0.0] * 3], [2.0]), 2 * poles, direction)
    clear = np.abs(cosine) > 1e-3
    np.testing.assert_array_equal(found.prim[clear] >= 0, cosine[clear] > 0)
    inward = clear & (cosine > 0)
    expected = 4 * cosine / np.sum(direction.astype(float) ** 2, axis=1)
    error = np.abs(found.t - expected)
    assert (error * cosine)[inward].max() < 1e-6
    steep = cosine > 0.7
    assert (error / expected)[steep].max() < 1e-6


def test_a_ray_beside_the_sphere_misses():
    rng = np.random.default_rng(3)
    away = directions(N, rng)
    beside = unit(np.cross(away, directions(N, rng))) * rng.uniform(1.0001, 3, (N, 1))
    found = hit_one("spheres", unit_sphere(), beside + 5 * away, -away)
    assert (found.prim == -1).all()


@pytest.mark.parametrize("exponent", [-20, 20])
def test_spheres_scale(exponent):
    """By powers of two, 10^-6 to 10^6, bit for bit."""
    scale = 2.0**exponent
    rng = np.random.default_rng(4)
    origin, direction = (
        rng.uniform(-2, 2, (4096, 3)).astype(np.float32),
        directions(4096, rng),
    )
    before = hit_one("spheres", spheres([[0.25, 0.5, 0]], [0.75]), origin, direction)
    small = spheres([[0.25 * scale, 0.5 * scale, 0]], [0.75 * scale])
    after = hit_one("spheres", small, origin * scale, direction)
    np.testing.assert_array_equal(after.prim, before.prim)
    np.testing.assert_array_equal(after.t, before.t * np.float32(scale))
    assert 0 < np.mean(before.prim >= 0) < 1


# ------------------------------------------------------------------------- cylinders


def true_cylinder(surfaces, origin, direction):
    """(hit, t, height fraction, how clear) in float64 for cylinder 0."""
    base, axis = surfaces.base[:, 0].astype(float), surfaces.frame[6:9, 0].astype(float)
    radius, height = float(surfaces.radius[0]), float(surfaces.height[0])
    f, d = origin.astype(float) - base, direction.astype(float)
    f_axis, d_axis = f @ axis, d @ axis
    p, q = f - f_axis[:, None] * axis, d - d_axis[:, None] * axis
    a, b = np.sum(q * q, 1), -np.sum(p * q, 1)
    nearest = p + q * (b / a)[:, None]
    discriminant = radius**2 - np.sum(nearest * nearest, 1)
    root = np.sqrt(np.maximum(a * discriminant, 0))
    roots = np.stack(((b - root) / a, (b + root) / a))
    heights = (f_axis + roots * d_axis) / height
    valid = (roots > 0) & (heights >= 0) & (heights <= 1) & (discriminant >= 0)
    hit = valid.any(axis=0)
    first = np.argmax(valid, axis=0)
    k = np.arange(len(f))
    # near none of the borders between hit and miss
    clear = (np.abs(discriminant) > 1e-3 * radius**2) & (
        np.minimum(np.abs(heights), np.abs(heights - 1)).min(axis=0) > 1e-4
    )
    return hit, roots[first, k], heights[first, k], clear & (np.abs(roots).min(0) > 1e-4)


@pytest.mark.parametrize("axis", [[0, 0, 1], [1, 0, 0], [1, 2, 3], [-3, 1, 1e-4]])
def test_cylinders_against_float64(axis):
    """From everywhere: outside, inside, through the open ends."""
    rng = np.random.default_rng(5)
    n = 20_000
    surfaces = cylinders([[0.3, -0.2, 0.1]], unit([axis]), [0.5], [1.5])
    origin = float32(rng.uniform(-1.5, 1.5, (n, 3)))
    target = np.array([0.3, -0.2, 0.5]) + rng.uniform(-0.5, 0.5, (n, 3))
    direction = float32(unit(target - origin))
    hit, t, height, clear = true_cylinder(surfaces, origin, direction)
    found = hit_one("cylinders", surfaces, origin, direction)
    np.testing.assert_array_equal((found.prim >= 0)[clear], hit[clear])
    both = clear & hit
    assert 0.3 < both.mean() < 0.95 and clear.mean() > 0.9
    np.testing.assert_allclose(found.t[both], t[both], rtol=3e-5, atol=3e-6)
    np.testing.assert_allclose(found.v[both], height[both], atol=3e-5)


def test_rays_along_the_axis_pass_through():
    """Inside, outside and in the wall itself: an open tube has nothing to hit."""
    for axis in ([0, 0, 1], [0, 1, 0], [1, 2, 2]):
        a = unit([axis])
        surfaces = cylinders([[0.0] * 3], a, [1.0], [1.0])
        frame = surfaces.frame[:, 0].astype(float).reshape(3, 3)
        # next to the wall only: in it, rounding decides
        radii = np.array([0.0, 0.5, 0.99, 1.01, 2.0])
        origin = radii[:, None] * frame[0] - 2 * frame[2]
        for sign in (1.0, -1.0):
            found = hit_one("cylinders", surfaces, sign * origin, sign * frame[2])
            assert (found.prim == -1).all()


def test_through_an_open_end_the_far_wall_is_hit():
    """Known by hand: radius 1, height 1, a ray at 45 degrees into the upper end."""
    surfaces = cylinders([[0.0] * 3], [[0.0, 0, 1]], [1.0], [1.0])
    origin = np.array([[0.5, 0, 1.25], [-3.0, 0, 0.5], [0, 0, 0.5], [0.5, 0, 3.0]])
    direction = unit([[1.0, 0, -1], [1, 0, 0], [0, 1, 0], [1, 0, -1]])
    found = hit_one("cylinders", surfaces, origin, direction)
    np.testing.assert_array_equal(found.prim, [FIRST_ID] * 3 + [-1])
    np.testing.assert_allclose(found.t[:3], [np.sqrt(0.5), 2, 1], rtol=1e-6)
    np.testing.assert_allclose(found.v[:3], [0.75, 0.5, 0.5], rtol=1e-6)


@pytest.mark.parametrize("distance", [1e2, 1e3, 1e4])
def test_no_ray_misses_a_cylinder_from_afar(distance):
    """The sphere's cancellation in two dimensions; rays across the axis."""
    rng = np.random.default_rng(6)
    n = 20_000
    angle = rng.uniform(0, 2 * np.pi, n)
    away = np.stack((np.cos(angle), np.sin(angle), rng.uniform(-0.2, 0.2, n)), 1)
    across = np.stack((-np.sin(angle), np.cos(angle), np.zeros(n)), 1)
    target = rng.uniform(-0.95, 0.95, (n, 1)) * across
    origin = float32(target + distance * away)
    direction = float32(unit(target - origin))
    surfaces = cylinders([[0.0, 0, -5]], [[0.0, 0, 1]], [1.0], [10.0])
    found = hit_one("cylinders", surfaces, origin, direction)
    assert (found.prim == FIRST_ID).all()
    _, t, _, _ = true_cylinder(surfaces, origin, direction)
    assert np.abs(found.t - t).max() < 40 * np.spacing(np.float32(distance))
