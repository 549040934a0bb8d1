"""Groups and instances: against explicit copies, against brute force, against Mitsuba.

One scene holds a group with every kind of primitive, and a second group, under transforms
that turn, stretch, mirror and slant; all tests of hits ask it, so that it compiles once.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from instances import (
    INSTANCES,
    RAYS,
    accelerators_of,
    content,
    middle,
    rays,
)
from kernel_probes import (
    blocked,
    directions,
    fill,
    kernel_inputs,
    run_surface_points,
    unit,
)
from scene_file_samples import mi, scene_text
from small_meshes import write_meshes

import renderer
from renderer.accelerators.bvh.wide.wide_bvh_build import BOX_BYTES
from renderer.accelerators.instances.instance_streams import END, KIND, LEAF_WORDS
from renderer.accelerators.instances.instances import Instances
from renderer.accelerators.instances.instances_checks import validate_instances
from renderer.errors import SceneError
from renderer.kernels.jit import pack
from renderer.scene.scene import Scene

NAMES = list(INSTANCES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("instances")
    write_meshes(folder)
    (folder / "scene.xml").write_text(scene_text(content()))
    return folder


@pytest.fixture(scope="module")
def scene(folder) -> Scene:
    return renderer.load_file(folder / "scene.xml")


class Hit:
    """All that the kernels say about the nearest hits of some rays; misses have prim -1."""

    def __init__(self, inputs, origin, direction):
        n = len(origin)
        work = inputs.workspace(1024)
        parts = []
        for first in range(0, n, 1024):
            part = slice(first, first + 1024)
            count = fill(work.rays, origin[part], direction[part])
            work.hits.t[:count] = np.inf
            work.hits.prim[:] = -1
            found = run_surface_points(inputs.packed, pack(work), count)
            where, p = work.order[:found], work.points
            rows = [row[:count].copy() for row in work.hits]
            if inputs.scene.placements is None:
                rows[4][:] = -1
            for row in (p.position, p.normal, p.shading_normal, p.uv, p.offset[None]):
                whole = np.zeros((count, len(row)))
                whole[where] = row[:, :found].T
                rows.append(whole)
            parts.append(rows)
        rows = [np.concatenate(same) for same in zip(*parts, strict=True)]
        self.t, self.prim, self.u, self.v, self.instance = rows[:5]
        self.position, self.normal, self.shading_normal, self.uv, self.offset = rows[5:]
        self.hit = self.prim >= 0


def inputs_of(scene, accel="auto"):
    return kernel_inputs(scene, accel=accel)


# ------------------------------------------------------------------------ brute force


def assert_same(tree: Hit, brute: Hit):
    np.testing.assert_array_equal(tree.prim, brute.prim)
    np.testing.assert_array_equal(tree.instance[tree.hit], brute.instance[tree.hit])
    for name in ("t", "u", "v"):
        a, b = (getattr(x, name)[tree.hit].view(np.int32) for x in (tree, brute))
        np.testing.assert_array_equal(a, b, name)


def axis_parallel(n, rng):
    """Origins and directions with zeros of both signs, some on planes of boxes."""
    signs = rng.choice([-1.0, -0.0, 0.0, 1.0], (n, 3))
    signs[(signs == 0).all(axis=1)] = [0.0, -0.0, 1.0]
    target = np.array([middle(k) for k in np.arange(n) % len(INSTANCES)])
    target = target + rng.integers(-4, 5, (n, 3)) * 0.4
    direction = unit(signs)
    return (target - 6 * direction).astype(np.float32), direction.astype(np.float32)


@pytest.mark.parametrize("way", ["near", "inside", "far", "parallel"])
def test_trees_return_what_brute_force_does(scene, way):
    """Bit for bit, with the instance; brute force tests every primitive of every copy.

    The far ones start ten thousand away, outside of the reach that boxes are padded for.
    """
    ways = {
        "near": lambda: rays(1),
        "inside": lambda: rays(2, distance=(0.0, 0.5)),
        "far": lambda: rays(3, distance=(9e3, 1.1e4)),
        "parallel": lambda: axis_parallel(RAYS, np.random.default_rng(4)),
    }
    origin, direction = ways[way]()
    tree, brute = inputs_of(scene), inputs_of(scene, "brute")
    found, truth = Hit(tree, origin, direction), Hit(brute, origin, direction)
    assert_same(found, truth)
    assert set(truth.instance[truth.hit]) == set(range(-1, len(INSTANCES)))

    for accel in ("auto", "brute"):
        instances = accelerators_of(scene, accel).instances
        for share, expected in ((1.0, truth.instance >= 0), (0.99, False)):
            shut = blocked(instances, origin, direction, t_max=truth.t * share)
            np.testing.assert_array_equal(shut, np.broadcast_to(expected, len(shut)))


SQUARE = """v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1
f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1
"""


@pytest.mark.parametrize("distance", [1.0, 30.0, 1e4])
def test_boxes_hold_what_rounding_finds_outside_of_them(folder, distance):
    """Thin slanted squares, rays just outside their corners: the way in loses three digits.

    So many a ray hits a square that it passes in the world, by a thousandth of its size.
    Without their padding the boxes lost 1 to 3 % of the hits; at 10000, beyond the reach
    that they are padded for, rays must go by them.
    """
    (folder / "square.obj").write_text(SQUARE)
    mesh = '<shape type="obj"><string name="filename" value="square.obj"/></shape>'
    rng = np.random.default_rng(20)
    n = RAYS // 4
    for _ in range(3):
        turns = np.linalg.qr(rng.standard_normal((2, 3, 3)))[0]
        linear = turns[0] @ np.diag([1.0, 1e-3, 3.0]) @ turns[1]
        text = f'<shape type="shapegroup" id="g">{mesh}</shape>'
        for x in (0.0, 20.0):
            whole = np.column_stack((linear, [x, 3.0, 1.0])).ravel()
            numbers = " ".join(f"{value:.9g}" for value in whole)
            text += '<shape type="instance"><ref id="g"/><transform name="to_world">'
            text += f'<matrix value="{numbers} 0 0 0 1"/></transform></shape>'
        (folder / "squares.xml").write_text(scene_text(text))
        scene = renderer.load_file(folder / "squares.xml")
        corner = rng.choice([-1.0, 1.0], (n, 3)) * [1, 1, 0]
        corner *= 1 + 10 ** rng.uniform(-7, -2.5, (n, 1))
        target = corner @ linear.T + [0, 3, 1]
        target[:, 0] += 20.0 * rng.integers(0, 2, n)
        origin = (target - distance * directions(n, rng)).astype(np.float32)
        direction = unit(target - origin).astype(np.float32)
        tree, brute = (
            Hit(inputs_of(scene, a), origin, direction) for a in ("auto", "brute")
        )
        assert_same(tree, brute)
        assert 0.02 < brute.hit.mean() < 0.95


def test_no_ray_is_lost_at_the_edges_of_an_instance(folder):
    """From inside of slanted cubes, at edges, diagonals and vertices of their triangles."""
    rng = np.random.default_rng(21)
    linear = np.linalg.qr(rng.standard_normal((3, 3)))[0] @ np.diag([0.7, 1.0, 3.1])
    text = '<shape type="shapegroup" id="g"><shape type="cube"/></shape>'
    for x in (0.0, 20.0):
        numbers = " ".join(f"{a:.9g}" for a in np.c_[linear, [x, 3.0, 1.0]].ravel())
        text += '<shape type="instance"><ref id="g"/><transform name="to_world">'
        text += f'<matrix value="{numbers} 0 0 0 1"/></transform></shape>'
    (folder / "cubes.xml").write_text(scene_text(text))
    scene = renderer.load_file(folder / "cubes.xml")
    shape = scene.description.groups[0].shapes[0]
    vertices = shape.vertices[shape.faces].astype(float)  # (12, 3 vertices, 3)
    n = RAYS // 2
    face, side = rng.integers(0, 12, n), rng.integers(0, 3, n)
    along = rng.random((n, 1)) * rng.integers(0, 2, (n, 1))  # half of them at vertices
    a, b = vertices[face, side], vertices[face, (side + 1) % 3]
    shift = np.array([0.0, 3.0, 1.0]) + 20.0 * rng.integers(0, 2, (n, 1)) * [1, 0, 0]
    origin = np.float32(rng.uniform(-0.4, 0.4, (n, 3)) @ linear.T + shift)
    target = (a + along * (b - a)) @ linear.T + shift
    for accel in ("auto", "brute"):
        found = Hit(inputs_of(scene, accel), origin, unit(target - origin))
        assert found.hit.all()


def test_trees_are_sound(scene):
    """And the check notices a box that is too small and a lost primitive."""
    instances = accelerators_of(scene).instances
    assert isinstance(instances, Instances)
    validate_instances(instances, scene)
    validate_instances(accelerators_of(scene, "brute").instances, scene)
    octets = instances.octets.copy()
    octets[BOX_BYTES + 8] -= 1  # where the first child's box ends along x
    with pytest.raises(ValueError, match=r"node 0.* does not hold"):
        validate_instances(instances._replace(octets=octets), scene)
    leaves = instances.leaves.copy()
    of_triangles = np.flatnonzero(leaves[KIND::LEAF_WORDS] == 0)[0]
    leaves[LEAF_WORDS * of_triangles + END] -= 1
    with pytest.raises(ValueError, match="triangles of group 0"):
        validate_instances(instances._replace(leaves=leaves), scene)
    other = instances.root.copy()
    other[0] = other[-1]
    with pytest.raises(ValueError, match="group 0 has 2 roots"):
        validate_instances(instances._replace(root=other), scene)


def test_rays_that_are_not_finite_miss(scene):
    inputs = inputs_of(scene)
    good = np.array([0.0, 0.0, 10.0]), np.array([0.0, 0.0, -1.0])
    bad = [np.nan, np.inf, -np.inf]
    origin, direction = (np.tile(a, (18, 1)).astype(np.float32) for a in good)
    for k in range(9):
        origin[k, k % 3] = bad[k // 3]
        direction[9 + k, k % 3] = bad[k // 3]
    found = Hit(inputs, origin, direction)
    assert (found.prim[:9] == -1).all() and (found.instance == -1).all()


def test_of_equal_hits_the_first_primitive_and_then_the_first_instance_wins(folder):
    """The same copy three times, and a plain square, of a later id, in the same place."""
    (folder / "square.obj").write_text(SQUARE)
    mesh = '<shape type="obj"><string name="filename" value="square.obj"/></shape>'
    group = f'<shape type="shapegroup" id="g">{mesh}</shape>'
    copy = '<shape type="instance"><ref id="g"/></shape>'
    away = '<shape type="instance"><ref id="g"/><transform name="to_world">'
    away += '<translate x="{}"/></transform></shape>'
    plain = '<shape type="rectangle"/>'
    text = plain + group + away.format(5) + copy + away.format(-5) + copy + copy
    (folder / "ties.xml").write_text(scene_text(text))
    scene = renderer.load_file(folder / "ties.xml")
    x = np.linspace(-0.9, 0.9, 64)
    origin = np.stack((x, x * 0.7, np.full(64, 3.0)), 1).astype(np.float32)
    direction = np.tile(np.float32([0, 0, -1]), (64, 1))
    for accel in ("auto", "brute"):
        found = Hit(inputs_of(scene, accel), origin, direction)
        assert (found.prim < 2).all() and (found.instance == 1).all()
        assert (found.t == 3.0).all()


# --------------------------------------------------------------------- explicit copies


# ----------------------------------------------------------------------------- Mitsuba


@pytest.fixture(scope="module")
def pair(folder, scene):
    """Our hits and Mitsuba's interactions for the same rays, where both hit."""
    reference = mi.load_file(str(folder / "scene.xml"), optimize=False)
    origin, direction = rays(6, 6000)
    mine = Hit(inputs_of(scene), origin, direction)
    theirs = np.full((len(origin), 15), np.nan)
    for i, (o, d) in enumerate(zip(origin.tolist(), direction.tolist(), strict=True)):
        si = reference.ray_intersect(mi.Ray3f(o, d))
        if si.is_valid():
            name = "" if si.instance is None else si.instance.id()
            instance = NAMES.index(name) if name else -1
            numbers = (*si.p, *si.n, *si.sh_frame.n, *si.uv, si.prim_index)
            theirs[i] = (si.t, instance, *numbers, 0.0)
    both = mine.hit & ~np.isnan(theirs[:, 0])
    assert np.mean(mine.hit == ~np.isnan(theirs[:, 0])) > 0.998
    same = both & (mine.instance == theirs[:, 1])
    assert same.sum() > 0.998 * both.sum()
    return mine, theirs, same, scene


@pytest.mark.parametrize("name", NAMES)
def test_surface_points_are_mitsubas(pair, name):
    """Position, both normals, uv and face, under every transform, mirrored ones too.

    A rectangle's geometric normal is left out: Mitsuba makes a mesh of it and differs on
    mirrored ones (test_surface_points.py). One ray in a hundred may graze an edge.
    """
    mine, theirs, same, scene = pair
    same = same & (mine.instance == NAMES.index(name))
    assert same.sum() > 150
    prim = mine.prim[same]
    kind = {k: (prim >= s.first) & (prim < s.end) for k, s in scene.surfaces.items()}

    def off(ours, columns, where=None):
        difference = np.abs(ours[same] - theirs[same][:, columns]).max(axis=1)
        return difference if where is None else difference[where]

    near = mine.t[same] < 40.0
    assert np.mean(off(mine.t[:, None], [0], near) > 1e-4) < 0.01
    assert np.mean(off(mine.position, [2, 3, 4], near) > 3e-5) < 0.01
    flat = kind["rectangles"]
    assert np.mean(off(mine.normal, [5, 6, 7], ~flat) > 3e-5) < 0.01
    assert np.mean(off(mine.shading_normal, [8, 9, 10]) > 3e-5) < 0.01
    assert np.mean(off(mine.uv, [11, 12], kind["triangles"]) > 1e-4) < 0.01
    wrapped = np.abs(mine.uv[same] - theirs[same][:, 11:13])
    wrapped = np.minimum(wrapped, np.abs(wrapped - 1.0)).max(axis=1)
    assert np.mean(wrapped > 1e-3) < 0.02
    faces = scene.face[prim][kind["triangles"]]
    assert np.mean(faces != theirs[same][kind["triangles"], 13]) < 0.01


def test_the_output_variables_number_shapes_and_faces_as_mitsuba_does(folder):
    """`shape_index` is the instance's place among shapes and instances of the file."""
    sensor = (
        '<sensor type="perspective"><float name="fov" value="40"/>'
        '<transform name="to_world">'
        '<lookat origin="7,-20,22" target="7,6,0" up="0,0,1"/></transform>'
        '<sampler type="stratified"><integer name="sample_count" value="1"/>'
        '<boolean name="jitter" value="false"/></sampler>'
        '<film type="hdrfilm"><integer name="width" value="96"/>'
        '<integer name="height" value="72"/><rfilter type="box"/>'
        '<string name="component_format" value="float32"/></film></sensor>'
    )
    aovs = '<integrator type="aov"><string name="aovs" value="s:shape_index,p:prim_index"/>'
    last = '<shape type="cube" id="last"><transform name="to_world">'
    last += '<translate x="3.5" y="3.5" z="1"/></transform></shape>'
    text = scene_text(aovs + "</integrator>" + content() + last, sensor=sensor)
    (folder / "aovs.xml").write_text(text)
    image = renderer.render(renderer.load_file(folder / "aovs.xml"))
    theirs = np.array(mi.render(mi.load_file(str(folder / "aovs.xml"), optimize=False)))
    shape, prim = image.aovs["s"][..., 0], image.aovs["p"][..., 0]
    assert set(np.unique(shape)) == set(range(1, 12))
    assert np.mean(shape != theirs[..., -2]) < 0.003
    assert np.mean(prim != theirs[..., -1]) < 0.01


# -------------------------------------------------------------------------- new rays


@pytest.mark.parametrize(
    ("size", "away", "thin"),
    [
        (1e-3, 0.0, 0.2),
        (1.0, 0.0, 0.2),
        (1e3, 0.0, 0.2),
        (1e-3, 1e3, 0.2),
        (1.0, 1e3, 0.2),
        (1.0, 0.0, 1e-3),
        (1.0, 10.0, 1e-3),
    ],
)
def test_rays_that_leave_an_instance_do_not_meet_it(size, away, thin):
    """A convex body, turned, stretched, mirrored, turned: a ray that leaves is gone.

    The offset is a bound of the rounding of both ways, into the object's space and back;
    of a slanted disc (`thin`) the way in loses three digits, which shows at its rim.
    """
    rng = np.random.default_rng(8)
    stretch = np.diag([1.0, -thin, 3.0]) * size
    turns = np.linalg.qr(rng.standard_normal((2, 3, 3)))[0]
    whole = np.eye(4)
    whole[:3, :3] = turns[0] @ stretch @ turns[1]
    whole[:3, 3] = away * np.array([1.0, -0.6, 0.3])
    numbers = " ".join(f"{x:.9g}" for x in whole.ravel())
    text = (
        '<shape type="shapegroup" id="g"><shape type="sphere"/></shape><shape '
        'type="instance"><ref id="g"/><transform name="to_world">'
        f'<matrix value="{numbers}"/></transform></shape>'
    )
    inputs = kernel_inputs(renderer.load_string(scene_text(text)))
    n = 4000
    # every second ray comes at the rim, where a disc's normals leave least room for errors
    target = 0.9 * unit(rng.standard_normal((n, 3)) * [1.0, thin, 1.0])
    edge_on = np.arange(n)[:, None] % 2 == 1
    direction = np.where(edge_on, -target * [1.0, 0.0, 3.0], rng.standard_normal((n, 3)))
    direction = unit(direction) @ turns[0].T
    target = target @ (turns[0] @ stretch).T + whole[:3, 3]
    origin = (target - 4 * size * direction).astype(np.float32)
    first = Hit(inputs, origin, direction.astype(np.float32))
    hit = first.hit
    assert hit.mean() > 0.95
    normal, going = first.normal[hit], unit(rng.standard_normal((n, 3)))[hit]
    going *= np.sign(np.sum(going * normal, axis=1, keepdims=True))
    start = (first.position + first.offset * first.normal)[hit].astype(np.float32)
    again = Hit(inputs, start, going.astype(np.float32))
    assert not again.hit.any(), again.hit.sum()
    assert first.offset.max() < 2e-5 * (3 * size / thin + away)


# ------------------------------------------------------------------------------ memory


def copies_of_a_mesh(folder, count):
    """A mesh of 32 triangles, `count` times."""
    rng = np.random.default_rng(9)
    places = rng.uniform(-50, 50, (count, 3))
    copies = [
        f'<shape type="instance"><ref id="g"/><transform name="to_world"><translate '
        f'x="{x:.4f}" y="{y:.4f}" z="{z:.4f}"/></transform></shape>'
        for x, y, z in places
    ]
    mesh = '<shape type="obj"><string name="filename" value="smooth.obj"/></shape>'
    text = f'<shape type="shapegroup" id="g">{mesh}</shape>' + "".join(copies)
    path = folder / f"copies{count}.xml"
    path.write_text(scene_text(text))
    return renderer.load_file(path)


@pytest.fixture(scope="module")
def ten_thousand(folder):
    return copies_of_a_mesh(folder, 10_000)


def bytes_of(inputs):
    """The bytes of all arrays in the records that kernels see, views of one memory once."""
    arrays, records = {}, [inputs.record, *(packed.record for packed in inputs.tables.kept)]
    while records:
        for field in records.pop():
            if isinstance(field, np.ndarray):
                arrays[field.ctypes.data] = field.nbytes
            elif isinstance(field, tuple):
                records.append(field)
    return sum(arrays.values())


def test_ten_thousand_copies_cost_two_hundred_bytes_each(folder, ten_thousand):
    """Arrays grow with the mesh, and by transforms and tree nodes for each copy."""
    scenes = [copies_of_a_mesh(folder, 10), ten_thousand]
    few, many = (inputs_of(scene) for scene in scenes)
    assert not accelerators_of(scenes[1]).by_kind
    assert many.tables.surfaces["triangles"].end == 32
    assert bytes_of(many) - bytes_of(few) <= 9_990 * 170
    assert bytes_of(few) < 20_000


# -------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ('<scale x="1e-8"/>', "flattens or slants space"),
        ('<translate x="1e19"/>', "so far away, large or small"),
        ('<scale value="1e-25"/><translate x="1"/>', "so far away, large or small"),
    ],
)
def test_transforms_that_single_precision_cannot_hold(steps, expected):
    text = (
        '<shape type="shapegroup" id="g"><shape type="sphere"/></shape>\n'
        '<shape type="instance"><ref id="g"/><transform name="to_world">'
        f"{steps}</transform></shape>"
    )
    with pytest.raises(SceneError, match=expected) as error:
        renderer.load_string(scene_text(text))
    assert str(error.value).startswith("<string>:3: ")
