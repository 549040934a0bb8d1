"""Curves: every hit against slow truths, no gaps, no hits where a ray starts.

The truths: a linear curve is all points that are no farther from a point of the axis than
the radius there, which a search finds in double precision, as that distance is convex along
a segment. A B-spline is a fine mesh of its circles, whose hit Newton's method makes exact.
"""

from __future__ import annotations

from itertools import pairwise

import kernel_probes
import numpy as np
import pytest
from agreement import assert_same_hits
from kernel_probes import accelerator, closest, directions, kernel_inputs, look, unit

import renderer
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.functions import first_lanes
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import load3, store3
from renderer.plugins.shapes.bspline_pieces import segment_polynomials
from renderer.plugins.shapes.registry import SHAPES
from renderer.plugins.shapes.uv import uv_derivatives
from renderer.scene_file.description import BsplineCurve, Diffuse, LinearCurve


def rows(text, width):
    return np.array(text.split(), float).reshape(-1, width)


LINEAR = rows("0 0 0 .2  1 0 0 .3  1 1 .5 .1", 4)
SPLINE = rows("-1 0 0 .2  0 1 .2 .25  1 0 .4 .15  2 1 0 .3  3 0 0 .2", 4)
HAIR = SPLINE * [1, 1, 1, 0.02]
ZERO = np.zeros(1, np.int64)
KINDS = {"linear_segments": LinearCurve, "bspline_pieces": BsplineCurve}
every_kind = pytest.mark.parametrize("kind", KINDS)


def table(kind, *curves):
    starts = np.cumsum([0, *(len(c) for c in curves[:-1])])
    points = np.concatenate([np.float32(c) for c in curves])
    shape = KINDS[kind](bsdf=Diffuse(), points=points, starts=starts)
    return SHAPES[kind].surfaces([shape], 0)


def rays(points, n, seed, spread=0.3):
    """Rays from around a curve to points next to it."""
    rng = np.random.default_rng(seed)
    c, r = points[:, :3], points[:, 3].max()
    origin = np.float32(c.mean(axis=0) + 4.0 * directions(n, rng))
    k = rng.integers(0, len(c) - 1, n)
    to = c[k] + rng.random((n, 1)) * (c[k + 1] - c[k])
    to = to + spread * r * rng.normal(size=(n, 3))
    return origin, np.float32(unit(to - origin))


def hits(kind, surfaces, origin, direction):
    return closest(accelerator(kind, surfaces, "brute"), origin, direction)


def depth(points, p):
    """Return the distance of points (n, 3) from the surface, and where on the axis."""
    best, where = np.full(len(p), np.inf), np.zeros(len(p))
    for k, (a, b) in enumerate(pairwise(points)):

        def apart(w, a=a, b=b):
            at = a + w[:, None] * (b - a)
            return np.linalg.norm(p - at[:, :3], axis=1) - at[:, 3]

        low, high = np.zeros(len(p)), np.ones(len(p))
        for _ in range(60):
            left, right = low + (high - low) / 3, high - (high - low) / 3
            lower = apart(left) < apart(right)
            low, high = np.where(lower, low, left), np.where(lower, right, high)
        found = apart(low)
        where = np.where(found < best, k + low, where)
        best = np.minimum(found, best)
    return best, where


def test_a_linear_curve_is_what_its_balls_sweep():
    points = np.float32(LINEAR).astype(float)
    origin, direction = rays(LINEAR, 400, 1, 0.8)
    found = hits("linear_segments", table("linear_segments", LINEAR), origin, direction)
    o, d = origin.astype(float), direction.astype(float)
    t = np.linspace(2.0, 6.0, 1001)
    along = (o[:, None] + t[:, None] * d[:, None]).reshape(-1, 3)
    inside = (depth(points, along)[0] < 0.0).reshape(len(o), -1)
    hit = found.prim >= 0
    assert 0.2 < hit.mean() < 0.95
    sure, first = inside.any(axis=1), t[inside.argmax(axis=1)]
    assert (found.t <= first)[sure].all()
    assert (found.t > first - 0.0041)[sure].mean() > 0.99  # sampled too coarsely
    apart, where = depth(points, o[hit] + found.t[hit, None] * d[hit])
    assert abs(apart).max() < 2e-6
    np.testing.assert_allclose(found.prim[hit] + found.v[hit], where, atol=2e-3)


def test_equal_radii_make_a_capsule_and_swallowed_balls_no_cone():
    """Answers known on paper: side, caps, joint, and a ball inside of the next."""
    capsule = table("linear_segments", [[-1, 0, 0, 0.5], [1, 0, 0, 0.5]])
    o = rows("0 0 3  .3 3 0  -4 0 0  4 .3 0  0 .6 3  0 0 0  .9 0 .4", 3)
    d = rows("0 0 -1  0 -1 0  1 0 0  -1 0 0  0 0 -1  0 0 1  1 0 0", 3)
    found = hits("linear_segments", capsule, o, d)
    expected = [2.5, 2.5, 2.5, 4 - 1.4, np.inf, np.inf, np.inf]
    np.testing.assert_allclose(found.t, expected, rtol=1e-6)
    swallowed = table("linear_segments", [[0, 0, 0, 0.1], [0.2, 0, 0, 1.0]])
    found = hits("linear_segments", swallowed, np.array([[-3.0, 0, 0]]), np.eye(3)[:1])
    assert found.t == pytest.approx(3 - 0.8)
    corner = table("linear_segments", [[0, 0, 0, 0.2], [1, 0, 0, 0.2], [1, 1, 0, 0.2]])
    found = hits("linear_segments", corner, rows("3 -2 0", 3), unit([[-1.0, 1, 0]]))
    assert found.t == pytest.approx(np.sqrt(8) - 0.2)
    straight = table("linear_segments", [[k, 0, 0, 0.2] for k in range(4)])
    rng = np.random.default_rng(2)  # from inside of one segment, on into others: nothing
    inside = np.array([1.5, 0, 0]) + rng.uniform(-0.1, 0.1, (2000, 3))
    assert (hits("linear_segments", straight, inside, directions(2000, rng)).prim < 0).all()


def spline(points, s):
    """Return the point and the radius (n, 4) at s (n,) of a curve, and the derivative."""
    k = np.clip(s.astype(int), 0, len(points) - 4)
    c = segment_polynomials(
        BsplineCurve(bsdf=Diffuse(), points=np.float32(points), starts=ZERO)
    )
    w, c = (s - k)[:, None], c[k]
    value = c[:, 0] + w * (c[:, 1] + w * (c[:, 2] + w * c[:, 3]))
    return value, c[:, 1] + w * (2 * c[:, 2] + w * 3 * c[:, 3])


def tube(points, steps, around):
    """Return the triangles (n, 3, 3) between circles of the tube, and their s."""
    s = np.linspace(0, len(points) - 3, steps + 1)
    c, dc = spline(points, s)
    axis = unit(dc[:, :3])
    x = unit(np.cross(axis, [0.3, 0.2, 1.0]))
    angle = np.linspace(0, 2 * np.pi, around + 1)[:, None, None]
    ring = c[:, :3] + c[:, 3:] * (np.cos(angle) * x + np.sin(angle) * np.cross(axis, x))
    a, b, e, f = ring[:-1, :-1], ring[1:, :-1], ring[:-1, 1:], ring[1:, 1:]
    both = np.stack([np.stack([a, b, e], 2), np.stack([b, f, e], 2)])
    middles = np.broadcast_to((s[1:] + s[:-1]) / 2, both.shape[:3])
    return both.reshape(-1, 3, 3), middles.ravel()


def exact_hits(points, origin, direction, first, s):
    """Improve t and s by Newton's method; return what is left of both equations too."""
    o, d = origin.astype(float), direction.astype(float)
    t, e = first.astype(float), 1e-5

    def residual(t, s):
        c, dc = spline(points, s)
        q = o + t[:, None] * d - c[:, :3]
        across = (q * dc[:, :3]).sum(axis=1)
        return np.stack([across, (q * q).sum(axis=1) - c[:, 3] ** 2], 1)

    for _ in range(12):
        f = residual(t, s)
        by_t = residual(t + e, s) - residual(t - e, s)
        by_s = residual(t, s + e) - residual(t, s - e)
        step = np.linalg.solve(np.stack([by_t, by_s], 2), 2 * e * f[..., None])[..., 0]
        t, s = t - step[:, 0], np.clip(s - step[:, 1], 0.0, len(points) - 3)
    return t, s, abs(residual(t, s)).max(axis=1)


@pytest.mark.parametrize("points", [SPLINE, HAIR], ids=["fat", "thin"])
def test_a_spline_is_the_tube_of_its_circles(points):
    """Rays that meet the mesh first from outside, and do not graze it."""
    faces, middles = tube(points, 600, 48)
    origin, direction = rays(spline(points, np.linspace(0.02, 1.98, 50))[0], 4000, 3, 0.6)
    mesh = accelerator("triangles", kernel_probes.triangles(faces), "wide")
    found = closest(mesh, origin, direction)
    face = np.maximum(found.prim - kernel_probes.FIRST_ID, 0)
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    facing = -(unit(normals)[face] * direction).sum(axis=1)
    t, s = found.t, middles[face]
    sure = (found.prim >= 0) & (facing > 0.2) & (s > 0.01) & (s < 1.99)
    assert sure.sum() > 1000
    mine = hits("bspline_pieces", table("bspline_pieces", points), origin, direction)
    assert (mine.prim[sure] >= 0).all()
    exact, s, left = exact_hits(points, origin[sure], direction[sure], t[sure], s[sure])
    good = left < 1e-9
    assert good.mean() > 0.99  # but for those next to an open end
    difference = abs(mine.t[sure] - exact)[good]
    assert (difference < 1e-5).mean() > 0.999, np.sort(difference)[-9:]


def test_a_straight_spline_is_an_open_tube():
    straight = table("bspline_pieces", [[x, 0, 0, 0.5] for x in (-2, -1, 1, 2)])
    o = rows("0 0 3  .3 3 0  -4 .1 0  0 0 0  0 .51 3  0 0 .5", 3)
    d = rows("0 0 -1  0 -1 0  1 0 0  0 0 1  0 0 -1  0 0 1", 3)
    found = hits("bspline_pieces", straight, o, d)
    np.testing.assert_allclose(found.t, [2.5, 2.5, *[np.inf] * 4], rtol=1e-6)


@pytest.mark.parametrize("scale", [1.0, 0.01])
@every_kind
def test_no_ray_to_the_axis_finds_a_gap(kind, scale):
    """Across many joints, at random and exactly at them; from far and near."""
    rng = np.random.default_rng(4)
    points = SPLINE * [1, 1, 1, scale]
    tree = accelerator(kind, table(kind, points), "wide")
    s = np.concatenate([rng.uniform(0.05, 1.8, 20_000), np.linspace(0.125, 1.75, 27)])
    if kind == "bspline_pieces":
        to, along = (a[:, :3] for a in spline(points, s))
    else:
        k = s.astype(int)
        along = points[k + 1, :3] - points[k, :3]
        to = points[k, :3] + (s - k)[:, None] * along
    for away in (2.5, 100.0):
        across = unit(unit(np.cross(along, directions(len(to), rng))) + 0.4 * unit(along))
        origin = np.float32(to + away * across)
        assert (closest(tree, origin, np.float32(unit(to - origin))).prim >= 0).all()


@pytest.mark.parametrize("name", ["wide", "boxes", "bvh-median", "kd-sah"])
@every_kind
def test_every_structure_finds_the_same_hits(name, kind):
    rng = np.random.default_rng(5)
    curves = rng.normal(size=(12, 7, 4)).cumsum(axis=1) * [0.3, 0.3, 0.3, 0]
    curves[:, :, 3] = 0.08
    origin, direction = rays(np.concatenate(curves), 3000, 6, 1.0)
    truth = assert_same_hits(name, kind, table(kind, *curves), origin, direction)
    assert 0.05 < (truth.prim >= 0).mean() < 0.95


@every_kind
def test_degenerate_curves_are_met_nowhere_or_finitely(kind):
    """Points that are equal, radii of 0, curves that turn back on themselves."""
    still, back = rows("0 0 0 .1", 4), rows("0 0 0 .1  1 0 0 .1", 4)
    for c in (0 * still.repeat(5, 0), still.repeat(5, 0), np.tile(back, (3, 1))):
        origin, direction = rays(rows("0 0 0 .2  1 0 0 .2", 4), 500, 7)
        found = hits(kind, table(kind, c), origin, direction)
        met = found.prim >= 0
        assert np.isfinite(found.t[met]).all() and np.isfinite(found.v[met]).all()
        assert c.any() or not met.any()


@entry_kernel
def derive(shapes, prim, position, du, dv):
    for i in range(0, prim.size, 16):
        k, p = load_row(prim, 0, i), load3(position, i)
        a, b = uv_derivatives(shapes, k, first_lanes(16), p)
        store3(du, i, a)
        store3(dv, i, b)


def turn_by_v(points, scale):
    """Return the part of dp/dv around the curve over that along it, at 256 points."""
    curve = rows(points, 4) * np.float32(scale)
    surfaces = table("bspline_pieces", curve)
    shape = BsplineCurve(bsdf=Diffuse(), points=curve, starts=np.zeros(1, np.int64))
    shapes = pack(SHAPES["bspline_pieces"].derivatives_of(surfaces, [shape]))
    rng = np.random.default_rng(1)
    prim = rng.integers(0, surfaces.end, 256).astype(np.int32)
    powers = surfaces.numbers[:, prim].astype(float).reshape(4, 4, -1)
    s = rng.random(256) ** np.arange(4)[:, None]
    c = np.einsum("kcn,kn->nc", powers, s)
    slope = np.einsum("kcn,kn->nc", powers[1:], np.arange(1, 4)[:, None] * s[:3])
    axis = unit(slope[:, :3])
    out = unit(np.cross(axis, rng.normal(size=(256, 3))))
    position = np.ascontiguousarray((c[:, :3] + c[:, 3:] * out).T, np.float32)
    du, dv = np.zeros((2, 3, 256), np.float32)
    derive(shapes, prim, position, du, dv)
    around = (dv.T * np.cross(axis, out)).sum(axis=1)
    return around / (dv.T * axis).sum(axis=1)


@pytest.mark.parametrize("scale", [1e-6, 1e-4, 1e-2, 1.0, 1e4, 1e8])
def test_a_circle_turns_with_a_bent_curve_alone_whatever_its_size(scale):
    """A straight curve, askew and of uneven steps, and one with a torsion."""
    straight = "  ".join(
        f"{0.3 * x} {0.5 * x} {0.7 * x} 0.05" for x in (-1, 0, 1.3, 2.1, 3.7, 4.1)
    )
    assert np.abs(turn_by_v(straight, scale)).max() < 1e-5
    bent = "-1 0 0 .02  0 1 .2 .02  1 0 .4 .02  2 1 0 .02  3 0 0 .02"
    turns = np.abs(turn_by_v(bent, 1.0))
    np.testing.assert_allclose(np.abs(turn_by_v(bent, scale)), turns, rtol=2e-2, atol=1e-4)
    assert np.median(turns) > 1e-3


@every_kind
def test_a_ray_that_leaves_does_not_meet_where_it_starts(kind, tmp_path):
    """Nor does one that goes in."""
    path = tmp_path / "curve.txt"
    path.write_text("\n".join(f"{k} 0 0 0.3" for k in range(6)))
    curve = {"type": KINDS[kind].__name__.lower(), "filename": str(path)}
    content = {"type": "scene", "camera": {"type": "perspective"}, "curve": curve}
    inputs = kernel_inputs(renderer.load_dict(content))
    origin, direction = rays(rows("1 0 0 .3  4 0 0 .3", 4), 8000, 9)
    surfaces = inputs.scene.surfaces[kind]
    hit = hits(kind, surfaces, origin, direction).prim >= 0
    outgoing = directions(hit.sum(), np.random.default_rng(8))
    seen = look(inputs, origin[hit], direction[hit], outgoing)
    assert ((seen.normal * seen.wo).sum(axis=1) > 0).all()
    assert (hits(kind, surfaces, seen.leaving, outgoing).prim < 0).all()
