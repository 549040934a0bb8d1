"""Rays that leave a surface: never back into it, never through a neighbour (rows 1 and 2).

The offset follows the rounding of the position, so the same numbers must come out at
every place and scale, with no absolute epsilon to be too large or too small.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import directions, kernel_inputs, look, nearest, unit

import renderer

HITS = 16_384
PLACES = [(0.0, 1.0), (1e3, 1.0), (0.0, 1e-3), (1e4, 1e3), (0.0, 1e-4)]
SHAPES = ("rectangle", "disk", "sphere", "cube", "cylinder")
everywhere = pytest.mark.parametrize(("offset", "scale"), PLACES, ids=str)
every_shape = pytest.mark.parametrize("name", SHAPES)


def turned(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return q * np.linalg.det(q)


def center(k, offset, scale):
    return np.full(3, offset) + scale * 5.0 * np.array([k % 3, k // 3, 0])


def scene(offset, scale, axis_parallel=False):
    """One of each shape, apart from one another; always the same kinds, so one compile."""
    shapes = {}
    for k, name in enumerate(SHAPES):
        matrix = np.eye(4)
        matrix[:3, :3] = scale * (np.eye(3) if axis_parallel else turned(k))
        matrix[:3, 3] = center(k, offset, scale)
        shapes[name] = {"type": name, "to_world": matrix}
    return renderer.load_dict(
        {"type": "scene", "camera": {"type": "perspective"}, **shapes}
    )


def hits_from_outside(inputs, k, offset, scale, seed=0, hits=HITS):
    """Return points of shape k, seen from outside (flat ones from both sides)."""
    rng = np.random.default_rng(seed)
    n = 4 * hits
    middle = center(k, offset, scale)
    origin = middle + scale * rng.uniform(2, 2.4, (n, 1)) * directions(n, rng)
    target = middle + scale * rng.uniform(0, 1, (n, 1)) * directions(n, rng)
    direction = unit(target - origin).astype(np.float32)
    origin = origin.astype(np.float32)
    found = nearest(inputs, origin, direction)
    hit = found.prim >= 0
    seen = look(inputs, origin[hit], direction[hit])
    side = np.sum(seen.normal * seen.wo, axis=1)
    flat = SHAPES[k] in ("rectangle", "disk")
    keep = (seen.shape == k) & ((side > 0) | flat)
    # the direction that a new ray takes: anywhere in the hemisphere the ray came from
    outgoing = directions(keep.sum(), rng)
    normal = seen.normal[keep] * np.sign(side[keep])[:, None]
    outgoing *= np.sign(np.sum(outgoing * normal, axis=1, keepdims=True))
    again = look(
        inputs, origin[hit][keep][:hits], direction[hit][keep][:hits], outgoing[:hits]
    )
    assert len(again.t) > hits / 2
    return again, outgoing[:hits], normal[:hits]


def own_hits(inputs, k, origin, direction, t_max=np.inf):
    found = nearest(inputs, origin, direction, t_max)
    return np.sum((found.prim >= 0) & (inputs.scene.shape[found.prim] == k))


@everywhere
@every_shape
@pytest.mark.parametrize("axis_parallel", [False, True], ids=["turned", "axis-parallel"])
def test_rays_into_the_hemisphere_never_hit_their_own_surface(
    name, offset, scale, axis_parallel
):
    """16384 hits each, all directions down to grazing ones: 0 self hits (row 1)."""
    k = SHAPES.index(name)
    inputs = kernel_inputs(scene(offset, scale, axis_parallel))
    seen, outgoing, _ = hits_from_outside(inputs, k, offset, scale)
    assert own_hits(inputs, k, seen.leaving, outgoing) == 0


@every_shape
def test_without_an_offset_there_is_acne(name):
    """The check itself can fail: rays that start on the surface hit it, some percent."""
    k = SHAPES.index(name)
    inputs = kernel_inputs(scene(1e3, 1.0))
    inputs = inputs.with_settings(rounding_offset=0.0)
    seen, outgoing, _ = hits_from_outside(inputs, k, 1e3, 1.0)
    assert own_hits(inputs, k, seen.leaving, outgoing) > 0.01 * len(outgoing)


@everywhere
@every_shape
def test_shadow_rays_to_visible_lights_are_free(name, offset, scale):
    """0 false occlusions by lights two offsets above the tangent plane (row 1)."""
    k = SHAPES.index(name)
    inputs = kernel_inputs(scene(offset, scale))
    seen, outgoing, normal = hits_from_outside(inputs, k, offset, scale, seed=1)
    rng = np.random.default_rng(2)
    distance = scale * 10 ** rng.uniform(-2, 3, (len(outgoing), 1))
    height = np.sum(outgoing * normal, axis=1, keepdims=True)
    distance = np.maximum(distance, 2 * seen.offset[:, None] / height)
    light = seen.position + distance * outgoing
    to_light = light - seen.leaving
    length = np.linalg.norm(to_light, axis=1)
    free = length * (1 - 1e-3)
    towards = to_light / length[:, None]
    assert own_hits(inputs, k, seen.leaving, towards, free) == 0


@everywhere
@every_shape
def test_positions_are_known_far_better_than_the_offset(name, offset, scale):
    """Their distance from the true surface is a tenth of the offset at most, in float64."""
    k = SHAPES.index(name)
    inputs = kernel_inputs(scene(offset, scale, axis_parallel=True))
    seen, _, _ = hits_from_outside(inputs, k, offset, scale, hits=HITS // 4)
    local = seen.position - center(k, offset, scale).astype(np.float32)
    error = {
        "rectangle": lambda: np.abs(local[:, 2]),
        "disk": lambda: np.abs(local[:, 2]),
        "sphere": lambda: np.abs(np.linalg.norm(local, axis=1) - scale),
        "cube": lambda: np.abs(np.abs(local).max(axis=1) - scale),
        "cylinder": lambda: np.abs(np.linalg.norm(local[:, :2], axis=1) - scale),
    }[name]()
    assert (error / seen.offset).max() < 0.1


@everywhere
def test_the_offset_is_small(offset, scale):
    """At most 6e-5 of sizes and coordinates: 64 units of the sum of edges and corner."""
    inputs = kernel_inputs(scene(offset, scale))
    for k in range(len(SHAPES)):
        seen, _, _ = hits_from_outside(inputs, k, offset, scale, hits=HITS // 4)
        size = np.abs(center(k, offset, scale)).max() + scale
        assert 0 < seen.offset.min() and seen.offset.max() < 6e-5 * size


@everywhere
def test_inside_a_sphere_rays_cross_to_the_other_side(offset, scale):
    """As refraction does: from the inner side t is 2 r cos, and never about 0."""
    k = SHAPES.index("sphere")
    inputs = kernel_inputs(scene(offset, scale))
    rng = np.random.default_rng(3)
    n = HITS
    c = center(k, offset, scale)
    start = c + scale * 2.2 * directions(n, rng)
    towards = unit(c + 0.9 * scale * rng.random((n, 1)) * directions(n, rng) - start)
    entering = look(inputs, start, towards)
    assert (entering.shape == k).all()
    inward = directions(n, rng)
    cosine = -np.sum(inward * entering.normal, axis=1)
    inward, cosine = inward * np.sign(cosine)[:, None], np.abs(cosine)
    again = look(inputs, start, towards, inward)
    found = nearest(inputs, again.leaving, inward)
    assert (inputs.scene.shape[found.prim] == k).all()
    # the offset shortens the chord by offset / cos, rounding of the centre by as much
    error = np.abs(found.t - 2 * scale * cosine)
    assert (error * cosine < 2 * again.offset).all()


# ---------------------------------------------------------------------------- gaps


def gap_scene(gap):
    """Two parallel squares, a sphere in a sphere, and the other kinds far below."""

    def at(x, y, z, size=1.0):
        matrix = np.diag([size, size, size, 1.0])
        matrix[:3, 3] = x, y, z
        return matrix

    shapes = {
        "lower": {"type": "rectangle", "to_world": at(0, 0, 0)},
        "upper": {"type": "rectangle", "to_world": at(0, 0, gap)},
        "outer": {"type": "sphere", "to_world": at(8, 0, 0), "radius": 1 + gap},
        "inner": {"type": "sphere", "to_world": at(8, 0, 0)},
        "cube": {"type": "cube", "to_world": at(0, 0, -9, 0.1)},
        "disk": {"type": "disk", "to_world": at(0, 0, -9, 0.1)},
        "tube": {"type": "cylinder", "to_world": at(0, 0, -9, 0.1)},
    }
    return renderer.load_dict(
        {"type": "scene", "camera": {"type": "perspective"}, **shapes}
    )


def leaks(gap, ray_offset="tight"):
    """The share of rays from the lower square that pass the upper one, straight up."""
    inputs = kernel_inputs(gap_scene(gap), ray_offset)
    rng = np.random.default_rng(4)
    n = 4096
    start = np.column_stack((rng.uniform(-0.9, 0.9, (n, 2)), np.full(n, -1.0)))
    up = np.tile([0.0, 0, 1], (n, 1))
    seen = look(inputs, start, up, up)
    assert (seen.shape == 0).all()
    found = nearest(inputs, seen.leaving, up)
    return np.mean(found.prim < 0)


GAPS = 10.0 ** np.arange(-2, -7.5, -0.5)


def test_the_smallest_gap_that_is_resolved():
    """Squares of edge 2 at the origin: 3.2e-5 apart they are two, 1e-5 apart one (row 2).

    The offset is 64 units of corner + edges = 5, that is 1.9e-5.
    """
    resolved = [gap for gap in GAPS if leaks(gap) == 0]
    assert min(resolved) == pytest.approx(10**-4.5)
    assert resolved == sorted(resolved, reverse=True) == list(GAPS[: len(resolved)])


@pytest.mark.parametrize(("ray_offset", "resolved"), [("tight", True), ("mitsuba", False)])
def test_a_sphere_in_a_shell_of_four_hundred_thousandths(ray_offset, resolved):
    """Radius 1 inside radius 1 + 4e-5 (row 2): light must enter the shell and find it.

    8 away from the origin the coordinates themselves are multiples of 1e-6.
    """
    inputs = kernel_inputs(gap_scene(4e-5), ray_offset)
    n = 4096
    # straight at the centre: the gap is as wide as it is thick
    away = directions(n, np.random.default_rng(5))
    seen = look(inputs, [8.0, 0, 0] + 3 * away, -away, -away)
    assert (seen.shape == 2).all()
    found = nearest(inputs, seen.leaving, -away)
    assert (inputs.scene.shape[found.prim] == 3).all()
    assert (np.mean(found.t < 0.5) == 1) == resolved
