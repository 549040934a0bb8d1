"""Ray against parallelogram and disk (ellipse), against float64 and at their borders."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import (
    FIRST_ID,
    accelerator,
    closest,
    directions,
    disks,
    float32,
    rectangles,
)

from renderer.kernels.jit import entry_kernel
from renderer.plugins.shapes.flat import PlaneHit, divided

N = 16_384
MAKE = {"rectangles": rectangles, "disks": disks}
both = pytest.mark.parametrize("kind", MAKE)


def inside_by(kind, u, v):
    """How far (u, v) is inside; negative outside."""
    if kind == "disks":
        return 1 - np.hypot(u, v)
    return np.minimum.reduce([u, v, 1 - u, 1 - v])


def shapes(seed, n=40):
    """Corners and edges of slanted shapes, none of them narrow."""
    rng = np.random.default_rng(seed)
    e1, e2 = directions(n, rng), directions(n, rng)
    wide = np.linalg.norm(np.cross(e1, e2), axis=1) > 0.3
    c = rng.uniform(-1, 1, (n, 3))
    sizes = rng.uniform(0.2, 2, (2, n, 1))
    return c[wide], (e1 * sizes[0])[wide], (e2 * sizes[1])[wide]


def trace(kind, c, e1, e2, origin, direction):
    surfaces = MAKE[kind](c[None], e1[None], e2[None])
    return surfaces, closest(accelerator(kind, surfaces, "brute"), origin, direction)


def in_float64(surfaces, origin, direction):
    c, e1, e2 = (
        getattr(surfaces, f)[:, 0].astype(float) for f in ("corner", "edge1", "edge2")
    )
    o, d = origin.astype(float), direction.astype(float)
    matrix = np.empty((len(o), 3, 3))
    matrix[:, :, 0], matrix[:, :, 1], matrix[:, :, 2] = e1, e2, -d
    u, v, t = np.linalg.solve(matrix, (o - c)[..., None])[..., 0].T
    normal = np.cross(e1, e2)
    return t, u, v, np.abs(d @ normal) / np.linalg.norm(normal)


@both
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_random_rays_against_float64(kind, scale):
    """t, u, v and which shape is hit, at all but grazing angles and off the border."""
    rng = np.random.default_rng(1)
    hits = 0
    for c, e1, e2 in zip(*shapes(0), strict=True):
        n = 1000
        u, v = rng.uniform(-1.3, 1.3, (2, n, 1))
        d = float32(directions(n, rng))
        o = float32(scale * (c + u * e1 + v * e2 - rng.uniform(-1, 3, (n, 1)) * d))
        surfaces, found = trace(kind, scale * c, scale * e1, scale * e2, o, d)
        t, u, v, cosine = in_float64(surfaces, o, d)
        clear = (cosine > 0.05) & (np.abs(inside_by(kind, u, v)) > 1e-3)
        clear &= np.abs(t) > 1e-4 * scale
        expected = (inside_by(kind, u, v) > 0) & (t > 0)
        np.testing.assert_array_equal((found.prim == FIRST_ID)[clear], expected[clear])
        good = clear & expected
        hits += good.sum()
        np.testing.assert_allclose(
            found.t[good] / scale, t[good] / scale, rtol=1e-4, atol=2e-5
        )
        np.testing.assert_allclose(found.u[good], u[good], atol=3e-4)
        np.testing.assert_allclose(found.v[good], v[good], atol=3e-4)
    assert hits > 3000


def test_the_border_of_a_rectangle_belongs_to_it():
    step = 2.0**-23
    inside = [
        (0, 0),
        (1, 0),
        (0, 1),
        (1, 1),
        (0.5, 0),
        (1, 0.5),
        (0.5, 1),
        (0, 0.5),
        (0.75, 0.75),
    ]
    outside = [
        (-step, 0.5),
        (1 + step, 0.5),
        (0.5, -step),
        (0.5, 1 + step),
        (2, 2),
        (-1, -1),
    ]
    points = np.array(inside + outside)
    origin = np.column_stack((points, np.full(len(points), 3.0)))
    _, found = trace(
        "rectangles", np.zeros(3), np.eye(3)[0], np.eye(3)[1], origin, [0.0, 0, -1]
    )
    np.testing.assert_array_equal(
        found.prim >= 0, [True] * len(inside) + [False] * len(outside)
    )
    hit = found.prim >= 0
    np.testing.assert_array_equal(np.stack((found.u, found.v), 1)[hit], inside)


def test_the_border_of_a_disk_belongs_to_it():
    step = 2.0**-23
    points = np.array(
        [(1, 0), (0, -1), (-1, 0), (0, 0), (1 + step, 0), (0.75, 0.75), (-1, 2**-10)]
    )
    origin = np.column_stack((points, np.full(len(points), 3.0)))
    _, found = trace("disks", np.zeros(3), np.eye(3)[0], np.eye(3)[1], origin, [0.0, 0, -1])
    np.testing.assert_array_equal(found.prim >= 0, [True] * 4 + [False] * 3)


@both
def test_rays_in_the_plane_miss(kind):
    """Exactly in it, or above it and parallel."""
    rng = np.random.default_rng(2)
    angle = rng.uniform(0, 2 * np.pi, N)
    d = np.stack((np.cos(angle), np.sin(angle), np.zeros(N)), 1)
    o = np.stack((*rng.uniform(-1, 1, (2, N)), rng.choice([0.0, -0.0, 1e-6, 1.0], N)), 1)
    _, found = trace(kind, np.zeros(3), np.eye(3)[0], np.eye(3)[1], o, d)
    assert (found.prim == -1).all()


@both
def test_from_the_plane_itself_there_is_no_hit(kind):
    """t = 0 does not count: else every ray would hit where it starts."""
    rng = np.random.default_rng(3)
    o = np.stack((*rng.random((2, N)), np.zeros(N)), 1) * 0.7
    _, found = trace(kind, np.zeros(3), np.eye(3)[0], np.eye(3)[1], o, directions(N, rng))
    assert (found.prim == -1).all()


@both
@pytest.mark.parametrize("exponent", [-30, -20, 20, 30])
def test_scaling_by_a_power_of_two_changes_no_bit(kind, exponent):
    """From 10^-9 to 10^9."""
    rng = np.random.default_rng(4)
    c, e1, e2 = (a[0].astype(np.float32) for a in shapes(5))
    d = float32(directions(N, rng))
    o = float32(c + rng.uniform(-1, 1, (N, 1)) * e1 + rng.uniform(-1, 1, (N, 1)) * e2 - d)
    scale = np.float32(2.0**exponent)
    _, before = trace(kind, c, e1, e2, o, d)
    _, after = trace(kind, c * scale, e1 * scale, e2 * scale, o * scale, d)
    np.testing.assert_array_equal(after.prim, before.prim)
    hit = before.prim >= 0
    assert 0.1 < hit.mean() < 0.9
    np.testing.assert_array_equal(after.t[hit], before.t[hit] * scale)
    np.testing.assert_array_equal(after.u[hit], before.u[hit])
    np.testing.assert_array_equal(after.v[hit], before.v[hit])


@both
def test_a_shape_without_area_is_never_hit(kind):
    rng = np.random.default_rng(6)
    d = directions(N, rng)
    for e1, e2 in (
        ([0.0, 0, 0], [0.0, 0, 0]),
        ([1.0, 2, 3], [2.0, 4, 6]),
        ([1.0, 0, 0], [0.0] * 3),
    ):
        target = rng.random((N, 1)) * np.array(e1)
        _, found = trace(kind, np.zeros(3), np.array(e1), np.array(e2), target - 2 * d, d)
        assert (found.prim == -1).all()


@entry_kernel
def _divided(scale, t, t_max, out):
    found = divided(PlaneHit(scale, t, scale, scale), True, t_max)
    out[0], out[1] = 1.0 if found.hit else 0.0, found.t


@pytest.mark.parametrize(
    ("scale", "t", "hit"),
    [
        (1e-20, 1.0, True),
        (1e-38, 3.0, True),  # 3e38, where float32 ends
        (1e-38, 4.0, False),
        (1e-45, 1.0, False),  # its inverse is infinite
        (0.0, 1.0, False),
    ],
)
def test_a_hit_is_at_a_finite_distance(scale: float, t: float, hit: bool) -> None:
    """Planes of tiny triangles: a ray without an end has t_max = inf, and t reaches it."""
    out = np.zeros(2)
    _divided(np.float32(scale), np.float32(t), np.float32(np.inf), out)
    assert (out[0] == 1.0, np.isfinite(out[1])) == (hit, hit)
