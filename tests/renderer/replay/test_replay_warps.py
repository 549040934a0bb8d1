"""The same random numbers make the same light samples and directions as in Mitsuba.

Each test gives our kernels and Mitsuba 3.9.1 (scalar_rgb) the same numbers (x, y), among
them 0 and the largest float32 below 1, and compares what comes out, sample by sample. No
statistics: a sine for a cosine, x for y, or another frame is a difference of order one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernel_probes import Inputs, directions, unit
from light_probes import light_kinds
from replay_probes import Asked, ask, density_towards, replay_inputs, scattered
from replay_shapes import (
    BOTH_SIDES,
    GREY,
    GROUPED,
    SHAPES,
    in_a_grid,
    in_instances,
    load,
    place,
    rays_at,
    shape,
    write_meshes,
)
from scene_file_samples import mi
from scene_xml import props

import renderer
from renderer.plugins.lights.area import AreaLights

LAST = np.float32(1 - 2.0**-23)  # the largest that Mitsuba draws


def numbers(n: int, seed: int) -> np.ndarray:
    """(2, n) float32 in [0, 1) as Mitsuba draws them; the extremes among them."""
    rng = np.random.default_rng(seed)
    xy = (rng.integers(0, 1 << 23, (2, n)) * 2.0**-23).astype(np.float32)
    special = np.array([0.0, 0.5, LAST, 2.0**-23], np.float32)
    xy[:, :16] = np.array(np.meshgrid(special, special)).reshape(2, 16)
    return xy


def tables(inputs: Inputs) -> list[Any]:
    """The table of each kind of light."""
    return [kind.record.lights for kind in light_kinds(inputs)]


# -------------------------------------------------------------------- diffuse directions


def check_directions(ours: Any, theirs: Any, count: int, seed: int) -> np.ndarray:
    """Compare where rays at `count` places go on; return how often each was seen."""
    k = np.arange(160 * count) % count
    origin, direction = rays_at(k, seed)
    xy = numbers(len(k), seed)
    context = mi.BSDFContext()
    hits, expected, cosine = [], [], []
    for i in range(len(k)):
        ray = mi.Ray3f(mi.Point3f(origin[i]), mi.Vector3f(direction[i]))
        si = theirs.ray_intersect(ray)
        if not si.is_valid():
            continue
        sample, _ = si.bsdf().sample(context, si, 0.5, mi.Point2f(xy[:, i]))
        hits.append(i)
        cosine.append(sample.wo[2])  # negative behind
        expected.append(np.array(si.to_world(sample.wo)))
    chosen = scattered(ours, origin[hits], direction[hits], *xy[:, hits])
    error = np.linalg.norm(chosen - np.array(expected), axis=1) * np.abs(cosine)
    where = k[hits]
    largest = np.array([np.quantile(error[where == i], 0.95) for i in range(count)])
    assert largest.max() < 3e-5, largest
    assert error.max() < 1e-2, where[error.argmax()]
    sides = [np.bincount(where[np.sign(cosine) == s], minlength=count) for s in (1, -1)]
    return np.array(sides)


def test_directions_from_diffuse_surfaces(tmp_path):
    """The frame is Mitsuba's on every shape, from both sides, flipped and mirrored.

    All shapes are two-sided and stand in a grid; rays at them come from all around. Errors
    are taken times the cosine, as z is the root of a difference and loses digits near the
    horizon. dp/du loses them at the centres of disks and the poles of spheres: 5 % may be
    worse than 3e-5, none worse than 1e-2. A wrong frame is wrong by 1 nearly everywhere.
    """
    write_meshes(tmp_path)
    seen = check_directions(*load(tmp_path, in_a_grid()), len(SHAPES), 1)
    assert seen.min() >= 10, seen


def test_directions_are_the_same_bits(tmp_path):
    """On flat triangles under a rotation: normal, frame, warp and the turn to the world."""
    write_meshes(tmp_path)
    flat = props(face_normals=True)
    content = shape("with uv", 0, BOTH_SIDES + flat) + shape(
        "without uv", 1, BOTH_SIDES + flat
    )
    ours, theirs = load(tmp_path, content)
    k = np.arange(1000) % 2
    origin, direction = rays_at(k, 12)
    xy = numbers(len(k), 13)
    hits, expected = [], []
    for i in range(len(k)):
        ray = mi.Ray3f(mi.Point3f(origin[i]), mi.Vector3f(direction[i]))
        si = theirs.ray_intersect(ray)
        if si.is_valid():
            sample, _ = si.bsdf().sample(mi.BSDFContext(), si, 0.5, mi.Point2f(xy[:, i]))
            hits.append(i)
            expected.append(np.array(si.to_world(sample.wo)))
    chosen = scattered(ours, origin[hits], direction[hits], *xy[:, hits])
    assert len(hits) > 500
    np.testing.assert_array_equal(chosen, np.array(expected, float))


def test_directions_from_instances(tmp_path):
    """There, dp/du goes by the matrix and the normal by its inverse transpose."""
    write_meshes(tmp_path)
    seen = check_directions(*load(tmp_path, in_instances()), len(GROUPED), 2)
    assert seen.min() >= 5, seen


# -------------------------------------------------------------------------------- lights

LIGHTS = {
    "point": '<emitter type="point"><point name="position" x="1" y="2" z="3"/>'
    '<rgb name="intensity" value="3, 2, 1"/></emitter>',
    "spot": '<emitter type="spot"><rgb name="intensity" value="1, 2, 3"/>'
    '<float name="cutoff_angle" value="70"/><transform name="to_world">'
    '<lookat origin="9, 3, 2" target="8, 9, 3" up="0, 0, 1"/></transform></emitter>',
    "directional": '<emitter type="directional"><vector name="direction" '
    'x="1" y="2" z="-3"/><rgb name="irradiance" value="1, 2, 4"/></emitter>',
    "constant": '<emitter type="constant"><rgb name="radiance" value=".1, .2, .4"/>'
    "</emitter>",
}


def area_light(k: int) -> str:
    red = 0.5 + k
    return f'<emitter type="area"><rgb name="radiance" value="{red}, 1, .5"/></emitter>'


def mixed_scene(names: list[str]) -> str:
    """Lights of all kinds between dark shapes, in an order that no kind dominates."""
    content = ""
    others = list(LIGHTS.values())
    for k, name in enumerate(names):
        content += shape(name, k, area_light(k))
        if k % 4 == 1:
            content += shape("cube", 40 + k, GREY)
        if k == 6:  # unseen, and without a place in the order
            group = shape("cube", None, GREY)
            content += f'<shape type="shapegroup" id="unused">{group}</shape>'
        if k % 5 == 2:
            content += others.pop()
    return content + "".join(others)


SHINING = list(SHAPES)


@pytest.fixture(scope="module")
def lit(tmp_path_factory) -> tuple[Any, Any]:
    folder = tmp_path_factory.mktemp("lit")
    write_meshes(folder)
    return load(folder, mixed_scene(SHINING))


def points_asking(n: int, seed: int) -> np.ndarray:
    """Near the shapes, some of them inside, and far away; not on a surface."""
    rng = np.random.default_rng(seed)
    centre = np.array([place(i) for i in rng.integers(0, len(SHINING), n)])
    reach = rng.choice([0.4, 2.5, 20.0], (n, 1))
    return (centre + reach * rng.uniform(-1, 1, (n, 3))).astype(np.float32)


def mitsuba_asks(theirs: Any, position: np.ndarray, xy: np.ndarray) -> Asked:
    """`sample_emitter_direction` without its shadow ray."""
    it = mi.SurfaceInteraction3f()
    emitters = theirs.emitters()
    rows = []
    for p, sample in zip(position.tolist(), xy.T.tolist(), strict=True):
        it.p = p
        ds, weight = theirs.sample_emitter_direction(it, sample, False)
        pdf = 0.0 if ds.delta else ds.pdf
        light = emitters.index(ds.emitter)
        rows.append((light, np.array(ds.d), ds.dist, pdf, np.array(weight)))
    return Asked(*(np.array(column) for column in zip(*rows, strict=True)))


def check_samples(ours: Any, theirs: Any, position: np.ndarray, xy: np.ndarray) -> Asked:
    """Compare light samples; return ours where they carry something.

    Within 1e-5, but for 3 % of them: directions to points near the middle of a sphere's
    cap, whose sine Mitsuba takes as the root of a difference; weights and densities where
    the cosine at the light is small. At the rim of a cap (the last x) the sign of that
    cosine is rounding.
    """
    found, expected = ask(ours, position, *xy), mitsuba_asks(theirs, position, xy)
    np.testing.assert_array_equal(found.light, expected.light)
    carries = found.weight.max(axis=1) > 0
    differ = carries != (expected.weight.max(axis=1) > 0)
    assert not differ[xy[0] < LAST].any()
    carries &= ~differ
    found, expected = (Asked(*(a[carries] for a in asked)) for asked in (found, expected))
    # how far the environment is is ours to say
    near = np.array([isinstance(table, AreaLights) for table in tables(ours)])
    near = near[ours.record.lights.kind[found.light]]
    pairs = zip(found, expected, strict=True)
    _, wi, distance, pdf, weight = ((a - b, np.maximum(np.abs(b), 1e-30)) for a, b in pairs)
    errors = {
        "wi": np.linalg.norm(wi[0], axis=1),
        "distance": np.abs(distance[0] / distance[1])[near],
        "pdf": np.abs(pdf[0] / pdf[1]),
        "weight": np.abs(weight[0] / weight[1]).max(axis=1),
    }
    for name, error in errors.items():
        assert np.quantile(error, 0.97) < 1e-5, name
        assert error.max() < (5e-4 if name in ("wi", "distance") else 1e-2), name
    return found


def test_light_samples(lit):
    """Lights of all kinds on all shapes: the same light, point, density and weight."""
    ours, theirs = lit
    n = 250 * ours.record.lights.count
    found = check_samples(ours, theirs, points_asking(n, 4), numbers(n, 3))
    assert np.bincount(found.light, minlength=ours.record.lights.count).min() >= 1


def test_on_the_surface_of_a_lamp(lit):
    """All within 1500 roundings of an inward sphere counts as inside of it.

    Heights are in radii. Outward spheres are not compared there: Mitsuba finds the point on
    them by a sine that is the root of a difference, so its directions are off by 1e-4 at a
    height of 0.02, by 1e-3 at 1e-3, and mean nothing at 1e-4. Ours keep their digits.
    """
    ours, theirs = lit
    k = SHINING.index("sphere, flipped")
    radiance = np.array([colour(ours, i)[0] for i in range(ours.record.lights.count)])
    light = int(np.flatnonzero(radiance == np.float32(0.5 + k))[0])
    n = 128
    rng = np.random.default_rng(11)
    for height in (-1e-3, -9.3e-5, -8.6e-5, 0.0, 8.6e-5):
        position = (place(k) + (1 + height) * directions(n, rng)).astype(np.float32)
        xy = rng.random((2, n), np.float32)
        xy[0] = (light + 0.01 + 0.98 * xy[0]) / ours.record.lights.count
        found = check_samples(ours, theirs, position, xy)
        assert set(found.light) == {light}
        assert len(found.light) == n


def test_one_light_alone(tmp_path):
    """With one light no part of x is used up: all of it goes to the light's sample."""
    write_meshes(tmp_path)
    ours, theirs = load(tmp_path, shape("with uv", 0, area_light(0)))
    n = 400
    position = np.random.default_rng(5).uniform(-3, 3, (n, 3)).astype(np.float32)
    found = check_samples(ours, theirs, position, numbers(n, 6))
    assert len(found.light) > 40


def test_densities_at_hits(lit):
    """What MIS asks where a path finds a light by itself, inside of spheres too."""
    ours, theirs = lit
    n = 4000
    rng = np.random.default_rng(7)
    origin = points_asking(n, 8)
    target = np.array([place(i) for i in rng.integers(0, len(SHINING), n)])
    direction = unit(target + rng.uniform(-1, 1, (n, 3)) - origin).astype(np.float32)
    it = mi.SurfaceInteraction3f()
    hits, expected, cosine = [], [], []
    for i in range(n):
        it.p = origin[i].tolist()
        si = theirs.ray_intersect(mi.Ray3f(it.p, mi.Vector3f(direction[i])))
        if not si.is_valid() or si.emitter(theirs) is None or si.wi[2] <= 0:
            continue
        if si.t < 0.1:  # distances of points at 30 are known to 4e-6
            continue
        ds = mi.DirectionSample3f(theirs, si, it)
        hits.append(i)
        expected.append(si.emitter(theirs).pdf_direction(it, ds))
        cosine.append(si.wi[2])
    assert len(hits) > 1000
    found = density_towards(ours, origin[hits], direction[hits])
    error = np.abs(found / expected - 1) * cosine
    assert np.quantile(error, 0.97) < 1e-5
    assert error.max() < 3e-4


def test_which_triangle_of_a_large_mesh(tmp_path):
    """The search in cumulated areas, and what is left of y, rounded as Mitsuba does it.

    3000 triangles whose areas differ by up to 1e4. What is left is (y - below) / share: a
    rounding of `below` alone would move it by 3000 times 6e-8.
    """
    rng = np.random.default_rng(9)
    count = 3000
    centre = rng.uniform(-5, 5, (count, 1, 3))
    size = 10.0 ** rng.uniform(-2, 0, (count, 1, 1))
    vertices = (centre + size * rng.standard_normal((count, 3, 3))).reshape(-1, 3)
    text = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in vertices)
    text += "".join(f"f {k} {k + 1} {k + 2}\n" for k in range(1, 3 * count, 3))
    (tmp_path / "mesh.obj").write_text(text)
    name = props(filename="mesh.obj")
    flat = props(face_normals=True)
    content = f'<shape type="obj">{name}{flat}{area_light(0)}</shape>'
    ours, theirs = load(tmp_path, content)
    n = 4000
    position = rng.uniform(-50, 50, (n, 3)).astype(np.float32)
    xy = numbers(n, 10)
    found, expected = ask(ours, position, *xy), mitsuba_asks(theirs, position, xy)
    points = [asked.wi * asked.distance[:, None] for asked in (found, expected)]
    error = np.linalg.norm(points[0] - points[1], axis=1)
    assert error.max() < 3e-5  # rounding of coordinates up to 55


def test_vertices_are_the_same_bits(lit):
    """Meshes under transforms: what decides which triangle, and frames, has no rounding."""
    ours, theirs = lit
    meshes = [mesh for mesh in theirs.shapes() if mesh.is_mesh()]
    triangles = ours.tables.surfaces["triangles"]
    corners = []
    for mesh in meshes:
        parameters = mi.traverse(mesh)
        if "vertex_positions" in parameters:
            vertices = np.array(parameters["vertex_positions"], np.float32).reshape(-1, 3)
            corners.append(vertices[np.array(parameters["faces"]).reshape(-1, 3)])
    corner = np.concatenate(corners)
    np.testing.assert_array_equal(triangles.corner.T, corner[:, 0])
    np.testing.assert_array_equal(triangles.edge1.T, corner[:, 1] - corner[:, 0])
    np.testing.assert_array_equal(triangles.edge2.T, corner[:, 2] - corner[:, 0])


VALUES = ("intensity.value", "irradiance.value", "radiance.value")


def colour(inputs: Inputs, i: int) -> np.ndarray:
    """What light i sends out, from the table that it is in."""
    table = tables(inputs)[inputs.record.lights.kind[i]]
    table = getattr(table, "own", table)  # what a replay rounds
    names = ("intensity", "irradiance", "radiance")
    (row,) = [getattr(table, name) for name in names if name in table._fields]
    return row[:3, i if row.shape[1] > 1 else 0]  # a sky's table has it alone


def from_dictionary() -> tuple[Any, Any]:
    """Names whose alphabetical order is not that of the dictionary."""
    point = {"type": "point", "intensity": {"type": "rgb", "value": [1, 2, 3]}}
    radiance = {"type": "rgb", "value": [4, 5, 6]}
    cube = {"type": "cube", "emitter": {"type": "area", "radiance": radiance}}
    ball = {**cube, "type": "sphere"}
    whole = {"type": "scene", "z": cube, "m": point, "a": ball, "a10": point, "a2": cube}
    whole["camera"] = {"type": "perspective"}
    return replay_inputs(renderer.load_dict(whole)), mi.load_dict(whole, optimize=False)


def test_lights_are_in_the_order_of_the_file(lit):
    """Area lights stand at their shapes, among the others; also in a dictionary."""
    for ours, theirs in (lit, from_dictionary()):
        emitters = theirs.emitters()
        assert ours.record.lights.count == len(emitters)
        for i, emitter in enumerate(emitters):
            parameters = mi.traverse(emitter)
            name = next(key for key in parameters.keys() if key.endswith(VALUES))
            np.testing.assert_allclose(parameters[name], colour(ours, i), rtol=1e-6)
