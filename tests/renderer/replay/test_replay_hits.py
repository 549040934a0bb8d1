"""In a replay, what is known of a hit has the same 32 bits as in Mitsuba.

A path inside of a ring multiplies a difference in the last bit by two at each bounce: after
50 it is another path. So positions, both normals and the direction in which a diffuse path
goes on are compared bit by bit, on every shape, plain and in instances.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from replay_probes import seen
from replay_shapes import (
    GROUPED,
    SHAPES,
    in_a_grid,
    in_instances,
    load,
    rays_at,
    write_meshes,
)
from scene_file_samples import mi

ROBUST = '<boolean name="embree_use_robust_intersections" value="true"/>'  # as the harness
EACH = 40  # rays at each shape
QUANTITIES = ("position", "normal", "shading_normal", "direction")

# Mitsuba rounds the radius and the matrices of turned balls and tubes, and of ellipses, at
# each step of their computation; ours are rounded once.
ROUNDED_ONCE = (
    "ellipse, flipped",
    "sphere, turned",
    "sphere, flipped",
    "sphere, mirrored",
    "cylinder",
    "cylinder, flipped",
)
# Where a file has no vertex normals, Mitsuba computes them in single precision.
NO_VERTEX_NORMALS = ("with uv", "without uv", "without uv, flipped", "uv without area")


def hits(ours: Any, theirs: Any, count: int) -> tuple[np.ndarray, dict[str, Any]]:
    """Which of `count` places was hit, and by quantity what both know of it, (n, 3)."""
    k = np.arange(EACH * count) % count
    origin, direction = rays_at(k, 5)
    xy = np.random.default_rng(6).random((2, len(k)), np.float32)
    hit, expected = [], []
    for i in range(len(k)):
        si = theirs.ray_intersect(
            mi.Ray3f(mi.Point3f(origin[i]), mi.Vector3f(direction[i]))
        )
        if si.is_valid():
            sample, _ = si.bsdf().sample(mi.BSDFContext(), si, 0.5, mi.Point2f(xy[:, i]))
            hit.append(i)
            expected.append([si.p, si.n, si.sh_frame.n, si.to_world(sample.wo)])
    found = seen(ours, origin[hit], direction[hit], *xy[:, hit])
    columns = np.array(expected, np.float32).transpose(1, 0, 2)
    mine = (found.position, found.normal, found.shading_normal, found.direction)
    return k[hit], dict(zip(QUANTITIES, zip(mine, columns, strict=True), strict=True))


@pytest.mark.parametrize("content", [in_a_grid, in_instances])
def test_hits_are_the_same_bits(content, tmp_path):
    """All bits agree but on the shapes named above, where the last ones may differ.

    Geometric normals but for their sign: Mitsuba's turn over under a reflection, and
    nothing depends on it. Near a disk's centre dp/du has no direction: one ray of 40.
    """
    write_meshes(tmp_path)
    names = list(SHAPES) if content is in_a_grid else GROUPED
    where, known = hits(*load(tmp_path, ROBUST + content()), len(names))
    assert np.bincount(where, minlength=len(names)).min() >= 10
    for quantity, (mine, expected) in known.items():
        if quantity == "normal":
            mine, expected = np.abs(mine), np.abs(expected)
        same = (mine == expected).all(axis=1)
        apart = np.abs(mine - expected).max(axis=1)
        for k, name in enumerate(names):
            here = where == k
            flat = quantity in ("position", "normal") and name in NO_VERTEX_NORMALS
            if name in ROUNDED_ONCE or (name in NO_VERTEX_NORMALS and not flat):
                assert np.quantile(apart[here], 0.9) < 3e-5, (quantity, name)
            else:
                assert same[here].mean() > 0.96, (quantity, name, apart[here])
