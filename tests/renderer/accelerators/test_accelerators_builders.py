"""Builders end on anything, in bounded memory and depth, and rays still hit what is there.

Failure mode 13 of the project's list, and the issue's "bad input": coincident triangles,
equal centroids, everything in a line. What has no area or is not finite never gets here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import (
    assert_agrees,
    assert_same,
    brute_force,
    every_name,
    extents_for,
    proved,
    ways_of,
)
from kernel_probes import (
    FIRST_ID,
    KINDS,
    accelerator,
    blocked,
    closest,
    directions,
    float32,
    soup,
    triangles,
)
from soups import awkward_rays

import renderer
from renderer.accelerators.build import BUILDERS, build_accelerators
from renderer.accelerators.validate import validate
from renderer.kernels.records.batch import STACK, make_tally

BYTES = 1024  # for a primitive and its share of the structure; the worst measured is 289
WAITING = 128  # nodes on a stack; the worst measured is 98


def arrays_of(record: Any) -> list[np.ndarray]:
    """All arrays of a record and of the records in it."""
    if isinstance(record, np.ndarray):
        return [record]
    fields = record if isinstance(record, tuple) else ()
    return [a for field in fields for a in arrays_of(field)]


def bytes_of(record: Any) -> int:
    return sum(a.nbytes for a in arrays_of(record))


# ------------------------------------------------------------------------- the registry


@every_name
def test_the_same_primitives_give_the_same_structure(name):
    """Bit for bit, so that an image does not depend on which thread built what when."""
    surfaces = soup("triangles", 3000, np.random.default_rng(1), size=0.2)
    first, again = (accelerator("triangles", surfaces, name, 9.0) for _ in range(2))
    one, other = arrays_of(first), arrays_of(again)
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.view(np.uint8), b.view(np.uint8))


@every_name
@pytest.mark.parametrize("kind", KINDS)
def test_every_structure_proves_itself_over_every_kind(name, kind):
    """Also far from the world's origin, and for rays from afar, which widen all cells."""
    for center, reach in ((0.0, 0.0), (0.0, 100.0), (1e3, 0.0), (1e3, 1e5)):
        surfaces = soup(kind, 400, np.random.default_rng(2), size=0.3, center=center)
        assert bytes_of(proved(name, kind, surfaces, reach)) < 400 * BYTES + 2**20


@every_name
def test_a_proof_sees_a_primitive_that_is_lost(name):
    """Extents of one primitive more, or of others: the check can fail (row 13)."""
    rng = np.random.default_rng(3)
    held, other = (soup("triangles", n, rng, size=0.2) for n in (200, 201))
    accel = accelerator("triangles", held, name)
    validate(accel, extents_for("triangles", held))
    with pytest.raises(ValueError):
        validate(accel, extents_for("triangles", other))


# -------------------------------------------------------------------- what ends builders


def coincident(n):
    """All in one place; one ray in three meets them."""
    return np.tile([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0.5]]], (n, 1, 1))


def equal_centroids(n):
    """Boxes within boxes: no plane divides the centres, and all sizes differ."""
    half = np.geomspace(1e-3, 10, n)[:, None, None]
    return half * np.array([[-1.0, -1, -1], [1, 1, -1], [0, 0, 1]])


def in_a_line(n):
    """Triangles side by side along x, equally spaced."""
    one = np.array([[0.0, 0, 0], [0.7, 0, 0.1], [0, 0.9, 0.2]])
    return one + np.arange(n)[:, None, None] * np.array([1.0, 0, 0])


def in_a_line_ever_farther(n):
    """Along a diagonal at distances that grow by a factor: no middle divides them well."""
    along = np.geomspace(1e-6, 1e6, n)[:, None, None]
    return along * (1 + 0.3 / n * np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]))


def in_two_heaps(n):
    """Half in one point and half in another, far away."""
    return coincident(n) + 1e4 * (np.arange(n) % 2)[:, None, None]


def stripes(n):
    """Parallel strips through the whole box: every cell across meets all of them."""
    y = np.linspace(0, 1, n)[:, None]
    start = np.concatenate((np.full_like(y, -1.0), y, 0.3 * y), 1)
    along, across = np.array([2.0, 0, 0]), np.array([0.0, 1 / n, 1e-3])
    return np.stack((start, start + along, start + across), 1)


HEAPS = (
    coincident,
    equal_centroids,
    in_a_line,
    in_a_line_ever_farther,
    in_two_heaps,
    stripes,
)


def rays_for(points, n, rng):
    """Rays at random ones of some triangles, and awkward ones."""
    surfaces = triangles(points[:: max(len(points) // 1000, 1)])
    origin, direction = awkward_rays(extents_for("triangles", surfaces), n, rng)
    return origin, direction, float(np.abs(surfaces.corner).sum(axis=0).max()) + 10


def check_heap(name, make, count, rays):
    """Build, prove, bound bytes and stack, compare with brute force."""
    points = float32(make(count))
    surfaces = triangles(points)
    origin, direction, reach = rays_for(points, rays, np.random.default_rng(4))
    accel = proved(name, "triangles", surfaces, reach)
    assert bytes_of(accel) < count * BYTES + 2**20
    truth = brute_force("triangles", surfaces, origin, direction)
    assert (truth.prim >= 0).any()
    label = f"{name}, {make.__name__}"
    assert_agrees(accel, truth, origin, direction, np.inf, label)
    for coherent in ways_of(accel):
        tally = make_tally(len(origin))
        found = closest(accel, origin, direction, coherent=coherent, tally=tally)
        assert_same(found, truth, label)
        assert tally[STACK].max() < WAITING
    if make is coincident:
        assert (truth.prim[truth.prim >= 0] == FIRST_ID).all()


@every_name
@pytest.mark.parametrize("make", HEAPS, ids=lambda make: make.__name__)
def test_ten_thousand_in_a_heap(name, make):
    # a grid in each cell: the proof of all of them takes 14 s, see the slow test below
    small = name == "grid-nested" and make is equal_centroids
    check_heap(name, make, 2_000 if small else 10_000, 5)


@pytest.mark.slow
@every_name
def test_a_million_in_a_line(name):
    check_heap(name, in_a_line, 1_000_000, 2)


@every_name
@pytest.mark.parametrize("n", [1, 2, 3, 7, 8, 9, 15, 16, 17, 33])
def test_few_primitives(name, n):
    """Around the sizes of blocks and leaves."""
    rng = np.random.default_rng(n)
    surfaces = soup("triangles", n, rng, size=1.0)
    origin, direction = rng.uniform(-1.5, 1.5, (500, 3)), directions(500, rng)
    truth = brute_force("triangles", surfaces, origin, direction)
    accel = proved(name, "triangles", surfaces, 5.0)
    assert_agrees(accel, truth, origin, direction, np.inf, name)
    assert blocked(accel, origin, direction).sum() == (truth.prim >= 0).sum()


# ---------------------------------------------------------------- what never gets so far

MESH = """v 0 0 0
v 1 0 0
v 0 1 0
v 2 0 0
v 3 0 0
v 0 0 1
f 1 2 3
f 1 2 4
f 2 2 3
f 1 4 5
f 1 2 6
"""


def test_degenerate_triangles_never_reach_a_builder(tmp_path, monkeypatch):
    """Of five triangles three have no area: the log says so, and two are built over."""
    path = tmp_path / "mesh.obj"
    path.write_text(MESH)
    scene = renderer.load_dict(
        {
            "type": "scene",
            "sensor": {"type": "perspective"},
            "mesh": {"type": "obj", "filename": str(path)},
        }
    )
    assert "dropped 3 degenerate of 5 triangles" in scene.description.warnings[0]
    build, given = BUILDERS["brute"], []

    def watched(extents, group):
        given.append(extents)
        return build(extents, group)

    monkeypatch.setitem(BUILDERS, "brute", watched)
    build_accelerators(scene, "brute")
    (extents,) = given
    assert extents.lower.shape == (3, 2)
    for field in (extents.lower, extents.upper, extents.points, extents.radius):
        assert np.isfinite(field).all()
    np.testing.assert_allclose(np.linalg.norm(extents.normal, axis=0), 1, rtol=1e-6)


def test_a_scene_is_built_once_for_all_its_renders(monkeypatch):
    """Whatever changes between them, but the structure."""
    built: list[str] = []

    def noting(name, builder):
        def build(*arguments):
            built.append(name)
            return builder(*arguments)

        return build

    for name, builder in BUILDERS.items():
        monkeypatch.setitem(BUILDERS, name, noting(name, builder))
    path = Path(__file__).parents[3] / "scenes" / "cornell-box" / "scene.xml"
    scene = renderer.load_file(path, width=16, height=16)

    renderer.render(scene, spp=1, accel="wide")
    built.clear()
    for choices in ({}, {"seed": 5}, {"spp": 2}, {"integrator": "direct"}):
        again = renderer.render(scene, **{"spp": 1, "accel": "wide", **choices})
        assert built == []
    fresh = renderer.load_file(path, width=16, height=16)
    first = renderer.render(fresh, spp=1, accel="wide", integrator="direct")
    assert set(built) == {"wide"}
    np.testing.assert_array_equal(again.pixels, first.pixels)
