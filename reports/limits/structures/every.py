"""What holds for brute force, and for every structure alike."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import BUILDERS, build_accelerator
from renderer.textbook.cell_tree import CellTree
from reports.accelerator_trials.meshes import displaced_icosphere, triangle_surfaces
from reports.accelerator_trials.rays import random_rays
from reports.limits.our_hits import nearest_hits
from reports.limits.row import Row
from reports.limits.structures.work import UNIT, work_of_a_ray

BALL = displaced_icosphere(4)  # 320 triangles
REACH = 4.0  # |x| + |y| + |z| of the farthest ray: structures grow boxes by rounding there


def _brute(triangles: float) -> float:
    mesh = displaced_icosphere(max(1, round(np.sqrt(triangles / 20.0))))
    return work_of_a_ray("brute", mesh, random_rays(mesh, 64))


def on_planes() -> NDArray[np.float32]:
    """Return points (n, 3) that lie exactly on three planes of a structure over the ball.

    Points where three planes of the octree and of the k-d tree would cross, and lower
    corners of the BVH's boxes; and last the point for which structures over rays from here
    are the same ones.
    """
    surfaces = triangle_surfaces(BALL)
    order = np.arange(BALL.triangles)
    octree, bvh, tree = (
        build_accelerator("triangles", surfaces, order, name, REACH)
        for name in ("octree", "bvh", "kd-sah")
    )
    last = np.array([(REACH, 0.0, 0.0)], np.float32)
    return np.concatenate((_crossings(octree), bvh.bounds[:, :3], _crossings(tree), last))


def _crossings(tree: CellTree) -> NDArray[np.float32]:
    """Return points (n, 3) where a plane across x, one across y and one across z meet."""
    offsets = [tree.plane[tree.plane[:, axis] == 1.0, 3] for axis in range(3)]
    fewest = min(map(len, offsets))
    return np.stack([offset[:fewest] for offset in offsets], axis=1)


def _differ(zeros: float) -> float:
    """Return the share of rays that any structure answers otherwise than brute force.

    Rays along the axes and diagonals, with so many components 0 or -0.
    """
    signs = [d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)]
    chosen = np.array([d for d in signs if d.count(0.0) == int(zeros)])
    chosen = np.concatenate((chosen, np.where(chosen == 0.0, -0.0, chosen)))
    places = on_planes()
    direction = np.repeat(chosen, len(places), axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = np.tile(places, (len(chosen), 1))
    surfaces = triangle_surfaces(BALL)
    t, prim = nearest_hits("triangles", surfaces, origin, direction)
    other = np.zeros(len(t), bool)
    for name in BUILDERS:
        found_t, found = nearest_hits("triangles", surfaces, origin, direction, name)
        other |= (found != prim) | ((prim >= 0) & (found_t != t))
    return float(other.mean())


ROWS = (
    Row(
        name="brute-force",
        method="Brute force",
        stress="triangles",
        measure=_brute,
        quantity="cost",
        unit=UNIT,
        strengths=(20.0, 80.0, 320.0, 1280.0, 5120.0, 20480.0),
        tolerance=300.0,
        holds_at=180.0,
        fails_at=500.0,
        why="Every ray tests every triangle.",
        instead="Any structure; below some dozens of triangles nothing is faster.",
        source="measured here",
    ),
    Row(
        name="axis-parallel-rays",
        method="Every structure against brute force",
        stress="components of the direction that are 0 or -0",
        measure=_differ,
        quantity="error",
        unit="of rays that one of them answers otherwise",
        strengths=(0.0, 1.0, 2.0),
        tolerance=0.0,
        holds_at=2.0,
        fails_at=None,
        why="0 * inf counts as inside of a slab, and at equal t the smaller id wins.",
        instead="Nothing.",
        source="[Williams2005]; measured here",
        slow=True,
    ),
)
