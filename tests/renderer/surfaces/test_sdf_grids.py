"""Grids of signed distances: every hit, from both sides, with Mitsuba's normals.

What is compared with: a saddle, which lies between the points of any grid, the numbers
between the points themselves, sampled densely by NumPy, roots of cubics by NumPy, and
Mitsuba's own shape.
"""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from plugins.make_grids import grid_file, places, torus, waves
from scene_file_samples import error_of, ours
from scene_xml import props

mi.set_variant("scalar_rgb")

import renderer  # noqa: E402
from renderer.errors import SceneError  # noqa: E402
from renderer.kernels.jit import entry_kernel  # noqa: E402
from renderer.kernels.lanes.vectors import vec3  # noqa: E402
from renderer.plugins.shapes.sdf_cells import Cubic, first_root_of  # noqa: E402
from renderer.plugins.shapes.sdfgrid import (  # noqa: E402
    SDF_CELLS,
    hit_cell,
    occupied,
    point_of_cell,
    surfaces,
)
from renderer.scene_file import read_dict  # noqa: E402
from renderer.scene_file.description import Diffuse, SdfGrid  # noqa: E402
from renderer.scene_file.meshes.grid_file import read_grid  # noqa: E402

PLUGINS = Path(__file__).parents[2] / "plugins"

PLACED = np.array([[0.8, -0.5, 0, 2], [0.6, 1.5, 0.2, -1], [0, 0, -2, 1], [0, 0, 0, 1.0]])
GRIDS = {"torus": torus(13, 9, 11), "waves": waves(10, 12, 10)}


@entry_kernel
def run_first_root(coefficients, s):
    for i in range(s.size):
        c = coefficients[i]
        s[i] = first_root_of(Cubic(c[0], c[1], c[2], c[3]))


@entry_kernel
def run_hits(cells, origin, direction, t, cell):
    for i in range(t.size):
        o = vec3(origin[i, 0], origin[i, 1], origin[i, 2])
        d = vec3(direction[i, 0], direction[i, 1], direction[i, 2])
        for k in range(cells.grid.size):
            here = hit_cell(cells, k, o, d, t[i])
            if here < t[i]:
                t[i], cell[i] = here, k


@entry_kernel
def run_points(cells, cell, met, out):
    for i in range(cell.size):
        p = vec3(met[i, 0], met[i, 1], met[i, 2])
        for j, a in enumerate(point_of_cell(cells, cell[i], p)):
            out[j, i, 0], out[j, i, 1], out[j, i, 2] = a.x, a.y, a.z


def cells_of(distances, to_world=None, smooth=True):
    shape = SdfGrid(
        bsdf=Diffuse(),
        to_world=np.eye(4) if to_world is None else to_world,
        distances=np.ascontiguousarray(distances, np.float32),
        smooth=smooth,
    )
    return surfaces([shape], 0)


def hits(cells, origin, direction, t_max=np.inf):
    """Return t, and cells, of the first hit of each ray, infinite and -1 for none."""
    t = np.full(len(origin), t_max, np.float32)
    cell = np.full(len(origin), -1)
    run_hits(cells, np.float32(origin), np.float32(direction), t, cell)
    return np.where(cell < 0, np.inf, t), cell


def points(cells, cell, met):
    out = np.zeros((3, len(cell), 3))
    run_points(cells, cell, np.float32(met), out)
    return out


def between(distances, p):
    """Return the number at points (..., 3) of [0, 1]^3 by NumPy, in double precision."""
    most = np.array(distances.shape[::-1]) - 1
    q = p * most
    lower = np.clip(np.floor(q).astype(int), 0, most - 1)
    u, total = q - lower, 0.0
    for corner in np.ndindex(2, 2, 2):
        x, y, z = np.moveaxis(lower + corner, -1, 0)
        total += np.prod(np.where(corner, u, 1 - u), axis=-1) * distances[z, y, x]
    return total


def rays(n, seed, inside=False):
    """Return rays through [0, 1]^3, as float32 has them, from around it or from within."""
    rng = np.random.default_rng(seed)
    origin = rng.normal(size=(n, 3))
    origin = 0.5 + 2.0 * origin / np.linalg.norm(origin, axis=1, keepdims=True)
    direction = rng.random((n, 3)) - origin
    if inside:
        origin = rng.random((n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.float32(origin).astype(float), np.float32(direction).astype(float)


def moved(to_world, origin, direction):
    return origin @ to_world[:3, :3].T + to_world[:3, 3], direction @ to_world[:3, :3].T


# ------------------------------------------------------------------------------- roots


def test_the_first_root_of_cubics_is_numpys():
    """Of all kinds: three roots, pairs 1e-6 apart, degrees that are lower."""
    rng = np.random.default_rng(1)
    roots = rng.uniform(-0.5, 1.5, (4000, 3))
    roots[::4, 1] = roots[::4, 0] + 1e-6
    near = abs(roots[:, 2] - roots[:, 0]) < 0.02  # three in one place are all but lost
    roots[near, 2] += 0.1
    c = np.array([np.poly(r)[::-1] for r in roots]) * rng.choice([-1, 1], (4000, 1))
    expected = np.where((roots >= 0) & (roots <= 1), roots, np.inf).min(axis=1)
    found = np.zeros(4000)
    run_first_root(c, found)
    assert np.array_equal(np.isinf(found), np.isinf(expected))
    there = np.isfinite(expected)
    off = abs(found[there] - expected[there])
    assert np.median(off) < 1e-15
    assert off.max() < 1e-7  # of pairs: rounding / (1e-6 * 0.02), for coefficients of 3
    lower = np.array([[-1.0, 2, 0, 0], [-1, 0, 4, 0], [1, 2, 0, 0], [1, 0, 0, -8.0]])
    found = np.zeros(4)
    run_first_root(lower, found)
    np.testing.assert_allclose(found, [0.5, 0.5, np.inf, 0.5])


def test_what_grazes_is_met_inside_and_missed_outside():
    """1 - 4 (s - 1/2)^2 and its like: two roots 1e-5 apart, one, and none by 1e-10."""
    e = np.array([1e-10, 0.0, -1e-10])
    found = np.zeros(3)
    run_first_root(np.stack([1 - e, *(np.full(3, c) for c in (-4.0, 4.0, 0.0))], 1), found)
    assert found[:2] == pytest.approx(0.5, abs=1e-5)
    assert np.isinf(found[2])


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("name", GRIDS)
def test_no_hit_is_missed_and_none_is_invented(name, inside):
    """Against the first change of sign among 2,000 places along each ray; placed askew."""
    grid = np.float32(GRIDS[name])
    origin, direction = rays(150, 2, inside)
    t, _ = hits(cells_of(grid, PLACED), *moved(PLACED, origin, direction))
    places_on = np.linspace(0.0, 4.0, 2001)
    p = origin[:, None] + places_on[:, None] * direction[:, None]
    f = between(grid.astype(float), p)
    f[((p < 0) | (p > 1)).any(axis=-1)] = np.nan
    changes = f[:, 1:] * f[:, :-1] < 0
    first = np.where(changes.any(axis=1), places_on[changes.argmax(axis=1)], np.inf)
    hit, sure = np.isfinite(t), np.isfinite(first)
    assert 30 < hit.sum() < 150
    assert hit[sure].all()
    assert (t[sure] < first[sure] + 2.001e-3).all()
    assert abs(between(grid, origin[hit] + t[hit, None] * direction[hit])).max() < 2e-6
    # sampled places can overlook two hits next to each other, and where the grid ends
    assert (t[sure] > first[sure] - 1e-5).mean() > 0.98
    assert (hit & ~sure).mean() < 0.03


def test_a_ball_has_no_hole():
    """From its middle, along edges and through corners of cells, and at random."""
    x, y, z = places(9, 9, 9)
    cells = cells_of(np.sqrt((x - 0.5) ** 2 + (y - 0.5) ** 2 + (z - 0.5) ** 2) - 0.3)
    grid = np.array(np.meshgrid(*[np.arange(-4, 5)] * 3)).reshape(3, -1).T
    lines = grid[np.abs(grid).max(axis=1) > 0] / 4.0
    rng = np.random.default_rng(4)
    direction = np.concatenate([lines, rng.normal(size=(3000, 3))])
    for origin in ((0.5, 0.5, 0.5), (0.5, 0.5625, 0.375)):
        t, _ = hits(cells, np.tile(origin, (len(direction), 1)), direction)
        radius = np.linalg.norm(origin + t[:, None] * direction - 0.5, axis=1)
        # between points 1/8 apart a distance is at most (1/8)^2 / 8 * 2 / r too large
        assert 0.3 - (1 / 64) / 8 * 2 / 0.2 < radius.min() <= radius.max() < 0.3 + 1e-6


def test_a_hit_is_after_the_start_and_before_the_end():
    cells = cells_of(places(3, 3, 3)[2] - 0.4)
    o, d = np.array([[0.3, 0.2, -1.0]]), np.array([[0.0, 0.0, 1.0]])
    assert hits(cells, o, d)[0] == pytest.approx(1.4)
    assert np.isinf(hits(cells, o, d, 1.3999)[0])
    assert np.isinf(hits(cells, o, -d)[0])
    assert np.isinf(hits(cells, o + 1.4001 * d, d)[0])
    assert hits(cells, o + 1.5 * d, -d)[0] == pytest.approx(0.1, abs=1e-6)
    assert np.isinf(hits(cells, o, d * 0)[0])


def test_cells_without_a_surface_are_none():
    """A corner of 0 is enough, eight are not; the order is Mitsuba's."""
    grid = np.ones((3, 3, 4), np.float32)
    assert not len(occupied(grid))
    grid[0, 2, 3] = 0.0
    assert occupied(grid).tolist() == [[0, 1, 2]]
    grid[0, 0, 0] = -1.0
    assert occupied(grid).tolist() == [[0, 0, 0], [0, 1, 2]]
    assert not len(occupied(0 * grid))


def test_bump_maps_find_that_it_has_no_u_and_v():
    cells = cells_of(torus(13, 9, 11))
    flat = SDF_CELLS.derivatives_of(cells, [])
    assert flat.along_u.shape == flat.along_v.shape == (3, cells.end)
    assert not flat.along_u.any()
    assert not flat.along_v.any()


# --------------------------------------------------------------------------- as Mitsuba


@pytest.mark.parametrize("normals", ["analytic", "smooth"])
@pytest.mark.parametrize("name", ["torus", "waves"])
def test_hits_and_normals_are_mitsubas(name, normals):
    """Where the surface leaves the grid, too, at whose upper ends Mitsuba bends normals."""
    grid = np.float32({"torus": torus(13, 9, 13), "waves": waves(10, 12, 10)}[name])
    to_world = np.diag([2.0, 1.0, 1.5, 1.0])
    to_world[:3, 3] = -1.0, 0.5, 0.0
    shape = {
        "type": "sdfgrid",
        "grid": mi.TensorXf(grid[..., None]),
        "normals": normals,
        "to_world": mi.ScalarTransform4f(to_world),
    }
    theirs = mi.load_dict({"type": "scene", "shape": shape})
    origin, direction = moved(to_world, *rays(400, 5))
    cells = cells_of(grid, to_world, normals == "smooth")
    t, cell = hits(cells, origin, direction)
    hit = cell >= 0
    met = np.float32(origin + np.where(hit, t, 0.0)[:, None] * direction)
    position, normal, shading = points(cells, cell[hit], met[hit])
    found = [
        theirs.ray_intersect(mi.Ray3f(o, d))
        for o, d in zip(origin.tolist(), direction.tolist(), strict=True)
    ]
    assert sum(si.is_valid() != h for si, h in zip(found, hit, strict=True)) == 0
    found = [si for si in found if si.is_valid()]
    assert len(found) > 150
    np.testing.assert_allclose(t[hit], [si.t for si in found], rtol=1e-5)
    assert [si.prim_index for si in found] == cell[hit].tolist()
    for mine, rows in (
        (position, [si.p for si in found]),
        (normal, [si.n for si in found]),
        (shading, [si.sh_frame.n for si in found]),
    ):
        np.testing.assert_allclose(mine, np.array(rows), atol=1e-4)
        assert np.median(abs(mine - np.array(rows))) < 3e-7


# ------------------------------------------------------------------------------ pictures


def scene(shape, **more):
    to_world = np.diag([-1.0, 1.0, -1.0, 1.0])
    to_world[:3, 3] = 0.5, 0.5, 3.0
    film = {"type": "hdrfilm", "width": 24, "height": 24, "rfilter": {"type": "box"}}
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4},
        "sensor": {"type": "perspective", "to_world": to_world, "fov": 30.0, "film": film},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.3}},
        "shape": shape,
        **more,
    }


@pytest.mark.slow
def test_every_structure_shows_the_same():
    """Two grids of different sizes in one scene."""
    shapes = {
        "shape": {"type": "sdfgrid", "grid": np.float32(torus(13, 9, 11))[..., None]},
        "other": {"type": "sdfgrid", "grid": np.float32(waves(6, 5, 4))[..., None]},
    }
    content = renderer.load_dict(scene(**shapes))
    expected = renderer.render(content, spp=4, accel="brute").pixels
    assert expected.std() > 0.01
    for accel in ("auto", "wide", "bvh-median", "kd-sah", "grid", "octree"):
        assert np.array_equal(renderer.render(content, spp=4, accel=accel).pixels, expected)


# -------------------------------------------------------------------------------- reading


def test_the_files_of_the_plugin_scene_are_what_is_written_here():
    for name, grid in (("torus", torus(13, 9, 13)), ("waves", waves(12, 12, 12))):
        found = read_grid(PLUGINS / "grids" / f"{name}.vol")
        np.testing.assert_allclose(found, grid, atol=1e-6)


def test_a_dictionary_holds_the_grid_that_a_file_has(tmp_path):
    grid = np.float32(torus(4, 5, 6))
    path = tmp_path / "torus.vol"
    path.write_bytes(grid_file(grid) + b"and more")
    text = (
        f'<shape type="sdfgrid"><string name="filename" value="{path}"/>'
        '<string name="normals" value="analytic"/></shape>'
    )
    described = ours(text, folder=tmp_path)
    of_file = described.shapes[0]
    assert not of_file.smooth
    assert np.array_equal(of_file.distances, grid)
    for tensor in (grid[..., None], mi.TensorXf(grid[..., None])):
        of_dict = read_dict(scene({"type": "sdfgrid", "grid": tensor})).shapes[0]
        assert of_dict.smooth
        assert np.array_equal(of_dict.distances, grid)


@pytest.mark.parametrize(
    ("grid", "to_world", "message"),
    [
        (torus(5, 5, 6), np.eye(4), "takes the sizes along x and z (5 and 6 points) for"),
        (torus(5, 5, 5), PLACED, "cuts off parts where to_world does more than scale"),
        (torus(5, 5, 5), np.diag([1.0, -1, 1, 1]), "cuts off parts where to_world does"),
        (torus(5, 5, 5), np.diag([1.0, 2, 3, 1]), None),
    ],
)
def test_what_mitsuba_shows_of_it_less_is_said(grid, to_world, message):
    shape = {"type": "sdfgrid", "grid": grid[..., None], "to_world": to_world}
    warnings = read_dict(scene(shape)).warnings
    assert len(warnings) == (message is not None)
    assert message is None or message in warnings[0]


GOOD = torus(4, 5, 6)
NAN, FAR = GOOD.copy(), 1.0 + abs(GOOD)
NAN[2, 1, 0] = np.nan
FAULTS = [
    (b"", "has 0 bytes; the header of a grid has 48"),
    (grid_file(GOOD)[:47], "has 47 bytes; the header of a grid has 48"),
    (grid_file(GOOD, mark=b"VOX"), "begins with b'VOX' and version 3; a grid begins with"),
    (grid_file(GOOD, version=2), "begins with b'VOL' and version 2; a grid begins with"),
    (grid_file(GOOD, kind=3), "has numbers of type 3; possible is 1, float32"),
    (grid_file(np.stack([GOOD] * 3, axis=-1)), "has 3 channels; a shape's grid has 1"),
    (grid_file(GOOD, nx=1), "has 1 x 5 x 6 points; possible are 2 or more along an axis"),
    (grid_file(GOOD, nz=-5), "has 4 x 5 x -5 points"),
    (grid_file(GOOD)[:-1], "promises 4 x 5 x 6 points of 1 numbers; there are 119"),
    (grid_file(GOOD, nx=2**31 - 1, ny=2**31 - 1), "promises 2147483647 x 2147483647 x 6"),
    (grid_file(NAN), "has nan at x 0, y 1, z 2; expected finite numbers"),
    (grid_file(FAR), "found a grid without a surface, expected a cell with numbers of"),
]


@pytest.mark.parametrize(("content", "message"), FAULTS, ids=range(len(FAULTS)))
def test_a_fault_of_a_file_is_one_line(tmp_path, content, message):
    path = tmp_path / "bad.vol"
    path.write_bytes(content)
    text = f'<shape type="sdfgrid"><string name="filename" value="{path}"/></shape>'
    found = error_of(text, folder=tmp_path)
    assert message in found
    assert ":2: " in found or "line 2" in found


FILE = props(filename="x.vol")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", 'property "filename": found nothing, expected the path of a .vol file'),
        (FILE, 'the grid "x.vol"'),
        (FILE + props(grid=1.0), "found one together with a file, expected"),
        (props(grid=1.0), "found a value of type float, expected an arr"),
        (FILE + '<emitter type="area"/>', "cannot emit: its area is not known"),
    ],
)
def test_what_is_wrong_is_one_line(content, message):
    assert message in error_of(f'<shape type="sdfgrid">{content}</shape>')


@pytest.mark.parametrize(
    ("grid", "more", "message"),
    [
        (GOOD, {}, r'"grid": found one of shape \(6, 5, 4\), expected an array of shape'),
        (np.ones((2, 2, 2, 3)), {}, r"found one of shape \(2, 2, 2, 3\)"),
        (np.ones((2, 1, 2, 1)), {}, r"found one of shape \(2, 1, 2, 1\)"),
        (NAN[..., None], {}, "found nan at x 0, y 1, z 2, expected finite numbers"),
        (1e300 * GOOD[..., None], {}, "found inf at|found -inf at"),
        (FAR[..., None], {}, "found a grid without a surface"),
        (GOOD[..., None].astype(str), {}, "found a ndarray|found an ndarray"),
        (GOOD[..., None], {"normals": "flat"}, 'found "flat", expected one of analytic'),
        (GOOD[..., None], {"flip_normals": True}, 'has no property "flip_normals"'),
        (GOOD[..., None], {"to_world": np.diag([1e19, 1, 1, 1])}, "reach farther than"),
    ],
)
def test_a_wrong_dictionary_is_one_line(grid, more, message):
    with pytest.raises(SceneError, match=message) as found:
        read_dict(scene({"type": "sdfgrid", "grid": grid, **more}))
    assert "\n" not in str(found.value)
