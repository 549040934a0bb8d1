"""Refitting: the same tree around moved primitives, with the same hits as brute force."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import (
    FIRST_ID,
    KINDS,
    accelerator,
    closest,
    directions,
    soup,
    triangles,
)

from renderer.accelerators.build import primitive_group
from renderer.accelerators.bvh.bvh import build_bvh
from renderer.accelerators.bvh.bvh_refit import leaf_order, refit_bvh
from renderer.accelerators.bvh.bvh_tree import BvhTree, bvh_cost, validate_bvh
from renderer.plugins.shapes.extents import extents_of
from renderer.plugins.shapes.flat import replaced
from renderer.plugins.shapes.triangle_tables import TriangleSurfaces

RAYS = 2000
N = 400


def build(kind, surfaces):
    """Return the tree over all of a kind."""
    columns = np.arange(surfaces.end - surfaces.first)
    return build_bvh(
        extents_of(kind, surfaces, columns),
        lambda order: primitive_group(kind, surfaces, order),
    )


def refit(bvh, kind, surfaces):
    """Return the tree, proven, around other primitives of the same kind and number."""
    extents = extents_of(kind, surfaces, np.arange(surfaces.end - surfaces.first))
    fitted = refit_bvh(
        bvh, extents, lambda order: primitive_group(kind, surfaces, order), FIRST_ID
    )
    validate_bvh(as_tree(fitted), extents.lower, extents.upper)
    return fitted


def as_tree(bvh):
    return BvhTree(bvh.bounds, bvh.child, bvh.count, leaf_order(bvh, FIRST_ID))


def triangles_from(corner, edge1, edge2):
    """Return triangles from three (3, n)."""
    return triangles(np.stack((corner, corner + edge1, corner + edge2)).transpose(2, 0, 1))


def moved(surfaces, where):
    """Move corners, centres or bases (3, n) by a function; edges and radii stay."""
    if isinstance(surfaces, TriangleSurfaces):
        return triangles_from(where(surfaces.corner), surfaces.edge1, surfaces.edge2)
    field = next(f for f in ("corner", "center", "base") if hasattr(surfaces, f))
    there = np.ascontiguousarray(where(getattr(surfaces, field)), np.float32)
    if field == "corner":
        return replaced(surfaces, corner=there)
    return surfaces._replace(**{field: there})


@pytest.mark.parametrize("kind", KINDS)
def test_what_has_not_moved_is_the_same_tree(kind):
    """The builder's own boxes, bit for bit: they were the tightest already."""
    surfaces = soup(kind, N, np.random.default_rng(0))
    bvh = build(kind, surfaces)
    fitted = refit(bvh, kind, surfaces)
    for field in ("bounds", "child", "count"):
        np.testing.assert_array_equal(getattr(fitted, field), getattr(bvh, field))
    for one, other in zip(fitted.primitives, bvh.primitives, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kind", KINDS)
def test_what_has_moved_is_hit_where_it_is(kind):
    """A wave, then primitives that change places: t, id, u and v of brute force."""
    rng = np.random.default_rng(1)
    surfaces = soup(kind, N, rng, size=0.3)
    bvh = build(kind, surfaces)
    shuffled = rng.permutation(N)
    for where in (lambda p: p + 0.3 * np.sin(4 * p[[1, 2, 0]]), lambda p: p[:, shuffled]):
        there = moved(surfaces, where)
        origin, direction = rng.uniform(-1.5, 1.5, (RAYS, 3)), directions(RAYS, rng)
        truth = closest(accelerator(kind, there, "brute"), origin, direction)
        found = closest(refit(bvh, kind, there), origin, direction)
        assert 0.01 < np.mean(truth.prim >= 0) < 1
        np.testing.assert_array_equal(found.prim, truth.prim)
        hit = truth.prim >= 0
        for got, expected in zip(found, truth, strict=True):
            np.testing.assert_array_equal(got[hit], expected[hit])
        before = closest(accelerator(kind, surfaces, "brute"), origin, direction)
        assert not np.array_equal(before.prim, truth.prim)  # or nothing has been shown


def test_moving_all_alike_keeps_the_cost():
    """Rotated by a right angle and shifted, boxes are congruent, and so is the tree.

    By multiples of a power of two, so that only the padding of boxes, 32 units in the last
    place of coordinates, differs.
    """
    surfaces = soup("triangles", N, np.random.default_rng(2))
    parts = (surfaces.corner, surfaces.edge1, surfaces.edge2)
    corner, edge1, edge2 = (part[[1, 2, 0]] for part in parts)
    turned = triangles_from(corner + 4.0, edge1, edge2)
    bvh = build("triangles", surfaces)
    cost = bvh_cost(as_tree(bvh))
    assert bvh_cost(as_tree(refit(bvh, "triangles", turned))) == pytest.approx(
        cost, rel=1e-3
    )


def test_parted_neighbours_raise_the_cost():
    """In random places, every inner box comes to span nearly all; a rebuild does not."""
    rng = np.random.default_rng(3)
    surfaces = soup("triangles", N, rng)
    bvh = build("triangles", surfaces)
    scrambled = moved(surfaces, lambda p: p[:, rng.permutation(N)])
    refitted = bvh_cost(as_tree(refit(bvh, "triangles", scrambled)))
    rebuilt = bvh_cost(as_tree(build("triangles", scrambled)))
    assert rebuilt == pytest.approx(bvh_cost(as_tree(bvh)), rel=0.1)
    assert refitted > 3 * rebuilt


def test_one_primitive():
    bvh = build("spheres", soup("spheres", 1, np.random.default_rng(4)))
    refit(bvh, "spheres", soup("spheres", 1, np.random.default_rng(5)))


@pytest.mark.parametrize(("n", "first"), [(N - 1, FIRST_ID), (N + 1, FIRST_ID), (N, 0)])
def test_another_mesh_is_refused(n, first):
    """The kernel would read beyond the boxes that it is given."""
    bvh = build("triangles", soup("triangles", N, np.random.default_rng(6)))
    other = soup("triangles", n, np.random.default_rng(7))
    extents = extents_of("triangles", other, np.arange(n))
    with pytest.raises(ValueError, match="those that moved are"):
        refit_bvh(bvh, extents, lambda order: None, first)
