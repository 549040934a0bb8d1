"""Ray against triangle: both methods of the lecture, against each other and float64."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import directions, float32, triangles

from renderer.accelerators.build import primitive_group
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3
from renderer.plugins.shapes import triangle_tables
from renderer.plugins.shapes.extents import primitive_bounds
from renderer.plugins.shapes.primitives import ROUNDING, primitives_from
from renderer.plugins.shapes.registry import SHAPES
from renderer.plugins.shapes.triangle import hit_triangle, hit_triangle_moeller_trumbore
from renderer.process import worker_pool
from renderer.scene_file.description import Diffuse, Mesh
from renderer.scene_file.meshes.mesh import smooth_normals

N = 16_384


@entry_kernel
def run_both(group, origin, direction, t_max, out):
    """Lane k is triangle k against ray k; out[method] has rows hit, t, u, v."""
    for i in range(0, t_max.size, 16):
        triangle = primitives_from(group, i)
        o, d, end = load3(origin, i), load3(direction, i), load_row(t_max, 0, i)
        method = 0
        for x in (
            hit_triangle(triangle, o, d, end),
            hit_triangle_moeller_trumbore(triangle, o, d, end),
        ):
            store_row(out[method], 0, i, select(x.hit, splat_f32(1.0), splat_f32(0.0)))
            store_row(out[method], 1, i, x.t)
            store_row(out[method], 2, i, x.u)
            store_row(out[method], 3, i, x.v)
            method += 1


class Result:
    """What one method found: `hit`, and t, u, v as float64."""

    def __init__(self, rows):
        self.hit = rows[0] != 0
        self.t, self.u, self.v = rows[1:].astype(float)


def both(p, origin, direction, t_max=np.inf):
    """Triangles (n, 3, 3) against rays (n, 3): results of the two methods."""
    n = len(p)
    m = n + -n % 16
    rays = (np.broadcast_to(a, (n, 3)) for a in (origin, direction))
    padded = [np.pad(float32(a), ((0, m - n), (0, 0))).T.copy() for a in rays]
    out = np.zeros((2, 4, m), np.float32)
    ends = np.pad(np.broadcast_to(np.float32(t_max), n), (0, m - n))
    group = primitive_group("triangles", triangles(p), np.arange(n))
    run_both(pack(group), *padded, np.ascontiguousarray(ends), out)
    return [Result(rows[:, :n]) for rows in out]


def in_float64(p, origin, direction):
    """Return (t, u, v) with the plane by solving [e1 e2 -d] (u, v, t) = o - p1."""
    p = np.asarray(p, np.float32).astype(float)
    o, d = (np.asarray(a, np.float32).astype(float) for a in (origin, direction))
    matrix = np.stack((p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], -d), axis=2)
    u, v, t = np.linalg.solve(matrix, (o - p[:, 0])[..., None])[..., 0].T
    return t, u, v


def random_rays(n, seed, spread=1.0):
    """Random triangles and rays towards points of their planes, half of them inside."""
    rng = np.random.default_rng(seed)
    p = rng.standard_normal((n, 3, 3)).astype(np.float32)
    u, v = rng.uniform(-0.2, 1.0, (2, n, 1))
    target = p[:, 0] + u * (p[:, 1] - p[:, 0]) + v * (p[:, 2] - p[:, 0])
    d = directions(n, rng)
    return p, target - spread * rng.uniform(0.1, 4, (n, 1)) * d, d.astype(np.float32)


def well_shaped(p, d):
    """|cos| of the angle at which a ray meets its triangle's plane, times its shape's."""
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    lengths = np.linalg.norm(e1, axis=1) * np.linalg.norm(e2, axis=1)
    return np.abs(np.sum(np.cross(e1, e2) * d, axis=1)) / lengths


def test_both_methods_against_float64():
    """Where determinant / (|e1||e2|) > 0.05, so that rounding grows at most 20-fold."""
    p, o, d = random_rays(N, 0)
    t, u, v = in_float64(p, o, d)
    good = well_shaped(p, d) > 0.05
    margin = np.minimum.reduce([u, v, 1 - u - v])
    clear = good & (np.abs(margin) > 1e-4)
    inside = (margin > 0) & (t > 0)
    assert 0.2 < inside[clear].mean() < 0.8 and clear.mean() > 0.8
    for found in both(p, o, d):
        np.testing.assert_array_equal(found.hit[clear], inside[clear])
        hit = found.hit & good
        np.testing.assert_allclose(found.t[hit], t[hit], rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(found.u[hit], u[hit], atol=5e-5)
        np.testing.assert_allclose(found.v[hit], v[hit], atol=5e-5)
        # typical, not worst: a few units in the last place
        assert np.median(np.abs(found.t[hit] / t[hit] - 1)) < 3e-7


@pytest.mark.parametrize("method", [0, 1], ids=["plane", "moeller_trumbore"])
def test_edges_and_vertices_belong_to_the_triangle(method):
    """Exact numbers: u = 0, v = 0, u + v = 1 are hits, one step outside is none."""
    unit_triangle = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]
    inside = [
        (0, 0),
        (1, 0),
        (0, 1),
        (0.5, 0),
        (0, 0.5),
        (0.5, 0.5),
        (0.25, 0.75),
        (0.25, 0.5),
    ]
    step = 2.0**-23
    outside = [
        (-step, 0.5),
        (0.5, -step),
        (0.5 + step, 0.5),
        (1 + step, 0),
        (0, -step),
        (-1, 2),
    ]
    points = np.array(inside + outside)
    o = np.column_stack((points, np.full(len(points), 2.0)))
    found = both([unit_triangle] * len(points), o, [0.0, 0.0, -1.0])[method]
    np.testing.assert_array_equal(found.hit, [True] * len(inside) + [False] * len(outside))
    np.testing.assert_array_equal(found.t[found.hit], 2)
    np.testing.assert_array_equal(np.stack((found.u, found.v), 1)[found.hit], inside)


@pytest.mark.parametrize("method", [0, 1], ids=["plane", "moeller_trumbore"])
@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_both_sides_are_hit_and_what_lies_behind_is_not(method, towards):
    triangle = [[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]] * 3
    o = np.array([[0.25, 0.25, 3.0], [0.25, 0.25, -3.0], [0.25, 0.25, 0.0]])
    found = both(triangle, o, [0.0, 0.0, towards])[method]
    np.testing.assert_array_equal(found.hit, [towards < 0, towards > 0, False])


@pytest.mark.parametrize("method", [0, 1], ids=["plane", "moeller_trumbore"])
def test_parallel_rays_miss(method):
    """In the plane, through the triangle or past it, and above the plane."""
    rng = np.random.default_rng(2)
    n = 1024
    angle = rng.uniform(0, 2 * np.pi, n)
    d = np.stack((np.cos(angle), np.sin(angle), np.zeros(n)), 1)
    o = np.stack((*rng.uniform(-1, 1, (2, n)), rng.choice([0.0, -0.0, 1e-6, 1.0], n)), 1)
    found = both([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]] * n, o, d)[method]
    assert not found.hit.any()


def test_degenerate_triangles_are_never_hit():
    """Points and collinear corners, axis-parallel and not, from any side (row 14).

    The plane method has it from the stored normal, which is exactly 0. Moeller-Trumbore
    computes the determinant anew for each ray, and what rounding leaves of a zero is
    taken for a triangle: the method that is known to fail here, and not the renderer's.
    """
    rng = np.random.default_rng(3)
    n = 4096
    a = rng.integers(-4, 5, (n, 3)).astype(float)
    b = a + rng.integers(-3, 4, (n, 3))
    k = rng.integers(-2, 4, (n, 1))
    c = a + k * (b - a)  # exact in float32, so the area is exactly 0
    p = np.stack((a, b, c), 1)
    target = a + rng.random((n, 1)) * (b - a)
    d = directions(n, rng)
    phantoms = 0
    for o in (target - 2 * d, target, a):
        plane, trumbore = both(p, o, d)
        assert not plane.hit.any()
        phantoms += trumbore.hit.sum()
    assert phantoms > 0


@pytest.mark.parametrize("exponent", [-20, -13, 13, 20])
def test_hits_do_not_depend_on_the_scale(exponent):
    """Scaled by a power of two, 10^-6 to 10^6, t scales and u, v stay, bit for bit.

    A fixed bound on the determinant fails here: edges of 10^-4 give 10^-8 (row 14).
    """
    p, o, d = random_rays(N, 4)
    scale = 2.0**exponent
    for before, after in zip(
        both(p, o, d), both(p * np.float32(scale), o * scale, d), strict=True
    ):
        np.testing.assert_array_equal(after.hit, before.hit)
        hit = before.hit
        assert hit.any()
        np.testing.assert_array_equal(after.t[hit], before.t[hit] * scale)
        np.testing.assert_array_equal(after.u[hit], before.u[hit])
        np.testing.assert_array_equal(after.v[hit], before.v[hit])


@pytest.mark.parametrize("method", [0, 1], ids=["plane", "moeller_trumbore"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_miss(method, value):
    """In every component of origin and direction, and NaN as the end (row 9)."""
    p, o, d = random_rays(64, 6)
    end = np.full(64, np.inf)
    for k in range(6):
        (o if k < 3 else d)[k::8, k % 3] = value
    end[6::8] = np.nan
    end[7::8] = -np.inf
    assert not both(p, o, d, end)[method].hit.any()


def test_the_end_of_the_ray_is_inclusive():
    p, o, d = random_rays(1024, 7)
    for method, found in enumerate(both(p, o, d)):
        t = found.t.astype(np.float32)
        at_end = both(p, o, d, t)[method].hit
        np.testing.assert_array_equal(at_end, found.hit)
        before = np.nextafter(t, np.float32(-np.inf))
        assert not both(p, o, d, before)[method].hit.any()


def test_tables_hold_what_numpy_computes(monkeypatch):
    """Bit by bit, also in parts: a smooth mesh with uv next to a faceted, flipped one."""
    monkeypatch.setattr(worker_pool, "PART", 7)
    monkeypatch.setattr(worker_pool, "default_threads", lambda: 3)
    rng = np.random.default_rng(5)
    points, turned = (rng.normal(size=(30, 3)).astype(np.float32) for _ in range(2))
    faces = np.array([rng.permutation(30)[:3] for _ in range(40)], np.int32)
    uvs = rng.random((30, 2)).astype(np.float32)
    common = {"bsdf": Diffuse(), "vertices": points, "faces": faces}
    meshes = [
        Mesh(**common, normals=turned, uvs=uvs),
        Mesh(**common, flip_normals=True),
    ]
    table = triangle_tables.surfaces(meshes, 100)
    assert (table.first, table.end) == (100, 180)

    a, b, c = np.tile(points[faces], (2, 1, 1)).transpose(1, 2, 0)  # (3, n) each
    cross = np.cross((b - a).T.astype(float), (c - a).T.astype(float))
    unit = (cross / np.linalg.norm(cross, axis=1, keepdims=True)).T.astype(np.float32)
    edges = points[faces].astype(float)
    exact = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    flat = -exact / np.linalg.norm(exact, axis=1, keepdims=True)
    given = np.concatenate((turned[faces].reshape(-1, 9), np.tile(flat, 3)))
    corners = uvs[faces].reshape(-1, 6), np.tile([0, 0, 1, 0, 0, 1], (40, 1))
    np.testing.assert_array_equal(table.places, np.concatenate((a, b - a, c - a, unit)))
    np.testing.assert_array_equal(table.ends, np.concatenate((b, c)))
    np.testing.assert_array_equal(table.normals.T, given.astype(np.float32))
    np.testing.assert_array_equal(table.uvs.T, np.concatenate(corners).astype(np.float32))

    order = rng.permutation(80)
    group = SHAPES["triangles"].group(table, order)
    sums = [np.abs(part[:, order]).sum(axis=0) for part in (a, b - a, c - a)]
    normal, size = cross.T.astype(np.float32)[:, order], sums[1] + sums[2]
    derived = np.abs(normal).sum(axis=0), size, size * (sums[0] + size)
    rows = table.places[:9, order], normal, table.ends[:, order], derived
    np.testing.assert_array_equal(group.rows[:, :80], np.concatenate(rows))
    np.testing.assert_array_equal(group.id[:80], order + 100)

    ends = np.array((a, a + (b - a), a + (c - a)))
    low, high = ends.min(axis=0), ends.max(axis=0)
    slack = ROUNDING * np.abs((low, high)).max(axis=(0, 1))
    expected = low - slack, high + slack
    np.testing.assert_array_equal(primitive_bounds("triangles", table), expected)


def test_the_normals_of_a_mesh_do_not_depend_on_threads(monkeypatch):
    rng = np.random.default_rng(6)
    points = rng.normal(size=(50, 3)).astype(np.float32)
    faces = np.array([rng.permutation(50)[:3] for _ in range(90)], np.int32)
    whole = smooth_normals(points, faces)
    monkeypatch.setattr(worker_pool, "PART", 7)
    monkeypatch.setattr(worker_pool, "default_threads", lambda: 3)
    np.testing.assert_array_equal(smooth_normals(points, faces), whole)
