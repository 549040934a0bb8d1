"""Position, normals and uv of every shape against Mitsuba's `ray_intersect`, ray by ray.

One scene holds each kind of shape several times: turned, stretched, mirrored, flipped. The
rays are random; only those next to a silhouette or an edge may differ.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import directions, kernel_inputs, look, nearest, unit
from scene_file_samples import mi, scene_text
from scene_xml import props
from small_meshes import write_meshes

import renderer

SPACING = 6.0
PER_SHAPE = 600


def matrix(seed, *, mirror=False, stretch=(1.0, 1.0, 1.0), slant=0.0):
    """A random rotation after stretching, shearing and mirroring, as text."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    q *= np.linalg.det(q)
    local = np.diag(stretch) @ np.array([[1, slant, 0], [0, 1, 0], [0, 0, 1]])
    if mirror:
        local = local @ np.diag([-1, 1, 1])
    whole = np.eye(4)
    whole[:3, :3] = q @ local
    return f'<matrix value="{" ".join(f"{x:.9g}" for x in whole.ravel())}"/>'


FLIP = props(flip_normals=True)
FACES = props(face_normals=True)
MESH = '<string name="filename" value="{}.obj"/>'
WIDE = (1.5, 0.6, 1.0)

SHAPES = {
    "smooth mesh": ("obj", MESH.format("smooth"), matrix(1)),
    "smooth mesh, mirrored": ("obj", MESH.format("smooth"), matrix(2, mirror=True)),
    "smooth mesh, flipped": ("obj", MESH.format("smooth") + FLIP, matrix(3)),
    "smooth mesh, face normals": ("obj", MESH.format("smooth") + FACES, matrix(4)),
    "plain mesh, stretched": ("obj", MESH.format("plain"), matrix(5, stretch=WIDE)),
    "plain mesh, flipped": ("obj", MESH.format("plain") + FLIP + FACES, matrix(6)),
    "cube": ("cube", "", matrix(7, stretch=WIDE)),
    "cube, mirrored": ("cube", "", matrix(8, mirror=True)),
    "cube, flipped": ("cube", FLIP, matrix(9)),
    "rectangle": ("rectangle", "", matrix(10, stretch=WIDE)),
    "rectangle, mirrored": ("rectangle", "", matrix(11, mirror=True)),
    "rectangle, flipped": ("rectangle", FLIP, matrix(12)),
    "rectangle, mirrored, flipped": ("rectangle", FLIP, matrix(13, mirror=True)),
    "disk": ("disk", "", matrix(14)),
    "disk, stretched": ("disk", "", matrix(15, stretch=WIDE)),
    "disk, mirrored": ("disk", "", matrix(16, mirror=True)),
    "disk, flipped": ("disk", FLIP, matrix(17)),
    "sphere": ("sphere", props(radius=1.3), matrix(18)),
    "sphere, mirrored": ("sphere", "", matrix(19, mirror=True)),
    "sphere, flipped": ("sphere", FLIP, matrix(20)),
    "sphere, mirrored, flipped": ("sphere", FLIP, matrix(21, mirror=True)),
    "cylinder": (
        "cylinder",
        '<point name="p0" value="0.3,-0.8,0"/><point name="p1" value="0,1,0.5"/>'
        '<float name="radius" value="0.7"/>',
        matrix(22),
    ),
    "cylinder, mirrored": ("cylinder", "", matrix(23, mirror=True)),
    "cylinder, flipped": ("cylinder", FLIP, matrix(24)),
}
NAMES = list(SHAPES)


def place(k):
    return SPACING * np.array([k % 5, k // 5, 0])


def content():
    shapes = []
    for k, (plugin, inside, turned) in enumerate(SHAPES.values()):
        x, y, z = place(k)
        shapes.append(
            f'<shape type="{plugin}" id="{k}">{inside}<transform name="to_world">{turned}'
            f'<translate x="{x}" y="{y}" z="{z}"/></transform></shape>'
        )
    return "\n".join(shapes)


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Our points and Mitsuba's interactions for the same rays, by columns."""
    folder = tmp_path_factory.mktemp("surfaces")
    write_meshes(folder)
    path = folder / "scene.xml"
    path.write_text(scene_text(content()))
    inputs = kernel_inputs(renderer.load_file(path))
    reference = mi.load_file(str(path), optimize=False)

    rng = np.random.default_rng(31)
    k = np.repeat(np.arange(len(SHAPES)), PER_SHAPE)
    middle = np.array([place(i) for i in k])
    origin = (middle + rng.uniform(2, 3, (k.size, 1)) * directions(k.size, rng)).astype(
        np.float32
    )
    target = middle + rng.uniform(0, 1.2, (k.size, 1)) * directions(k.size, rng)
    direction = unit(target - origin).astype(np.float32)
    hit = nearest(inputs, origin, direction).prim >= 0
    seen = look(inputs, origin[hit], direction[hit])
    theirs = []
    for o, d in zip(origin[hit].tolist(), direction[hit].tolist(), strict=True):
        si = reference.ray_intersect(mi.Ray3f(o, d))
        shape = int(si.shape.id()) if si.is_valid() else -1
        theirs.append((si.t, shape, *si.p, *si.n, *si.sh_frame.n, *si.uv))
    missed_too = [
        not reference.ray_intersect(mi.Ray3f(o, d)).is_valid()
        for o, d in zip(origin[~hit].tolist(), direction[~hit].tolist(), strict=True)
    ]
    # a silhouette runs through a few rays, not more
    assert np.mean(missed_too) > 0.998 and hit.mean() > 0.3
    theirs = np.array(theirs, float)
    same = theirs[:, 1] == seen.shape
    assert same.mean() > 0.998
    return type(seen)(*(a[same] for a in seen)), theirs[same]


def compare(pair, name, ours, theirs, atol):
    """Differences within atol, but for one ray in a hundred, grazing or at an edge."""
    mine = pair[0].shape == NAMES.index(name)
    assert mine.sum() > 50
    difference = np.abs(ours[mine] - theirs[mine])
    difference = difference.reshape(mine.sum(), -1).max(axis=1)
    assert np.mean(difference > atol) <= 0.01, np.sort(difference)[::-1][:9]


every_shape = pytest.mark.parametrize("name", NAMES)


@every_shape
def test_positions_and_distances(pair, name):
    compare(pair, name, pair[0].t, pair[1][:, 0], 2e-5)
    compare(pair, name, pair[0].position, pair[1][:, 2:5], 2e-5)


@every_shape
def test_geometric_normals(pair, name):
    """A mirrored rectangle: Mitsuba makes two triangles of it and turns this normal around.

    Ours is the image of the local +z (docs/conventions.md), as the shading normal is in
    both; only the output variable `geo_normal` can tell.
    """
    np.testing.assert_allclose(np.linalg.norm(pair[0].normal, axis=1), 1, rtol=3e-7)
    sign = -1 if name.startswith("rectangle, mirrored") else 1
    compare(pair, name, pair[0].normal, sign * pair[1][:, 5:8], 1e-5)


@every_shape
def test_shading_normals(pair, name):
    np.testing.assert_allclose(np.linalg.norm(pair[0].shading_normal, axis=1), 1, rtol=3e-7)
    compare(pair, name, pair[0].shading_normal, pair[1][:, 8:11], 1e-5)


@every_shape
def test_uv(pair, name):
    """To 2e-5 of a turn; at the seam 0 and 1 are the same, and at poles u is anything."""
    ours, theirs = pair[0].uv.copy(), pair[1][:, 11:13].copy()
    plugin = SHAPES[name][0]
    if plugin in ("disk", "sphere", "cylinder"):
        turning = 1 if plugin == "disk" else 0
        difference = ours[:, turning] - theirs[:, turning]
        ours[:, turning] -= np.round(difference)
        if plugin == "sphere":  # near the poles the longitude is known to 1 / sin only
            sine = np.sin(np.pi * theirs[:, 1])
            ours[:, 0], theirs[:, 0] = ours[:, 0] * sine, theirs[:, 0] * sine
        if plugin == "disk":
            ours[:, 1], theirs[:, 1] = (a[:, 1] * theirs[:, 0] for a in (ours, theirs))
    compare(pair, name, ours, theirs, 3e-5)


def test_the_normal_is_that_of_the_surface_whatever_side_it_is_seen_from(pair):
    """Both sides occur: nothing turns normals towards the viewer."""
    for name in ("rectangle", "disk", "cylinder", "plain mesh, flipped"):
        mine = pair[0].shape == NAMES.index(name)
        front = np.sum(pair[0].wo * pair[0].normal, axis=1)[mine] > 0
        assert 0.1 < front.mean() < 0.9


def test_wo_points_back_along_the_ray(pair):
    seen, theirs = pair
    back = seen.position + seen.wo * seen.t[:, None]
    assert np.abs(np.linalg.norm(seen.wo, axis=1) - 1).max() < 3e-7
    # the origin again, which Mitsuba's position and distance give too
    expected = theirs[:, 2:5] + seen.wo * theirs[:, :1]
    np.testing.assert_allclose(back, expected, atol=5e-5)
