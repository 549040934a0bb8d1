"""Scenes that an accelerator was not made for; what is measured is counted, not timed."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import BUILDERS, build_accelerator, primitive_group
from renderer.accelerators.bvh.bvh import build_bvh
from renderer.accelerators.bvh.bvh_refit import refit_bvh
from renderer.kernels.records.batch import NODES, PRIMITIVES
from renderer.plugins.shapes.extents import extents_of
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.volume_fits import VOLUMES
from reports.studies.limits.probes import (
    Shown,
    counted,
    directions,
    nearest_hits,
    soup_mesh,
    unit,
    work_maps,
    work_of_a_ray,
)
from reports.studies.moving_scene import MOTIONS, moved
from reports.trials.meshes import (
    StudyMesh,
    View,
    displaced_icosphere,
    teapot_in_a_stadium,
    triangle_surfaces,
)
from reports.trials.rays import (
    RayBatches,
    camera_rays,
    in_batches,
    random_rays,
)
from reports.trials.tracing import make_query, tallied

Corners = NDArray[np.float64]  # (n, 3 corners, 3)

# ----------------------------------------------------------------- the teapot in a stadium

OFF_CENTRE = 0.03  # of the width: in the middle four cells of the grid share the ball


def stadium(width: float) -> StudyMesh:
    """Return a ball of 4000 triangles that fills the picture, on a field so wide."""
    mesh = teapot_in_a_stadium(41, width)
    vertices = mesh.vertices.copy()
    vertices[-4:, :2] += np.float32(OFF_CENTRE * width)  # the field, below the same ball
    return replace(mesh, vertices=vertices, view=mesh.view._replace(fov=20.0))


def _stadium(width: float, name: str) -> float:
    return work_of_a_ray(name, stadium(width))


def stadium_maps() -> Shown:
    """Show the work of each pixel: the grid in stadiums 2, 10 and 100 wide, the BVH."""
    seen = ("grid", 2.0), ("grid", 10.0), ("grid", 100.0), ("bvh", 100.0)
    return work_maps([(name, stadium(width)) for name, width in seen])


# ---------------------------------------------------------- triangles that no cut separates


def _brute(triangles: float, name: str) -> float:
    mesh = displaced_icosphere(max(1, round(np.sqrt(triangles / 20.0))))
    return work_of_a_ray(name, mesh, random_rays(mesh, 64))


def _at(targets: Corners, seed: int) -> RayBatches:
    """Return rays at points (n, 3) from all sides, 3 away."""
    rng = np.random.default_rng(seed)
    target = targets[rng.integers(0, len(targets), 256)]
    away = directions(len(target), rng)
    return in_batches(target + 3.0 * away, -away, np.inf)


def _coincident(count: float, name: str) -> float:
    """Return the work of rays at `count` triangles at one place, others around them."""
    rng = np.random.default_rng(20)
    one = 0.1 * rng.uniform(-1.0, 1.0, (1, 3, 3))
    around = rng.uniform(-1.0, 1.0, (64, 1, 3)) + 0.1 * rng.uniform(-1, 1, (64, 3, 3))
    corners = np.concatenate((np.repeat(one, int(count), axis=0), around))
    return work_of_a_ray(name, soup_mesh(corners), _at(one.mean(axis=1), 21))


def _line(count: float, name: str) -> float:
    """Return the work of rays at a diagonal row of `count` small triangles."""
    n = int(count)
    rng = np.random.default_rng(22)
    place = np.linspace(-1.0, 1.0, n)[:, None, None] * np.ones(3)
    corners = place + (1.0 / n) * rng.uniform(-1.0, 1.0, (n, 3, 3))
    return work_of_a_ray(name, soup_mesh(corners), _at(corners.mean(axis=1), 23))


NEEDLES = 1000


def _needles(length: float) -> Corners:
    """Return needles `length` times their mean distance long."""
    rng = np.random.default_rng(24)
    spacing = NEEDLES ** (-1.0 / 3.0)
    middle = rng.random((NEEDLES, 3))
    # diagonal, so that boxes of the axes fit them worst
    signs = rng.choice((-1.0, 1.0), (NEEDLES, 3))
    along = unit(signs + 0.2 * rng.standard_normal((NEEDLES, 3)))
    across = unit(np.cross(along, directions(NEEDLES, rng)))
    half = 0.5 * length * spacing * along
    return np.stack((middle - half, middle + half, middle + 0.02 * spacing * across), 1)


def _needle_work(length: float, name: str) -> float:
    middle = np.random.default_rng(24).random((NEEDLES, 3))
    return work_of_a_ray(name, soup_mesh(_needles(length)), _at(middle, 25))


def needle_maps() -> Shown:
    """Show the work of each pixel in the BVH, for needles of three lengths."""
    view = View((2.4, 1.7, 2.1), (0.5, 0.5, 0.5), (0.0, 1.0, 0.0), 40.0, (0.0, 0.0, 0.0))
    return work_maps([("bvh", soup_mesh(_needles(x), view)) for x in (1.0, 10.0, 100.0)])


def _halves(count: float, name: str) -> float:
    """Return the work of rays at the smallest of triangles at 1, 1/2, 1/4 and so on."""
    n = int(count)
    rng = np.random.default_rng(60)
    size = 2.0 ** -np.arange(n)[:, None, None]
    corners = size * (np.ones(3) + 0.3 * rng.uniform(-1.0, 1.0, (n, 3, 3)))
    target = np.repeat(corners[-1:].mean(axis=1), 256, axis=0)
    away = directions(len(target), rng)
    rays = in_batches(target + 2.0 * away, -away, np.inf)
    return work_of_a_ray(name, soup_mesh(corners), rays)


# ------------------------------------------------------------------ a wall on the first cut


def wall(side: int, place: float) -> Corners:
    """Return a wall at x = place of 2 side^2 triangles, and dust around it.

    Two tiny triangles in opposite corners pin the bounds to [-1, 1]^3, so that the first
    cut is at 0: dust alone would leave it wherever its outermost grains are.
    """
    y, z = (grid.ravel() for grid in np.mgrid[0:side, 0:side] * (2.0 / side) - 1.0)
    step = 2.0 / side
    a, b, c, d = (
        np.stack((np.full_like(y, place), y + p * step, z + q * step), axis=1)
        for p, q in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    quads = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    rng = np.random.default_rng(40)
    dust = rng.uniform(-0.99, 0.99, (side * side, 1, 3)) + 0.01 * rng.uniform(
        -1.0, 1.0, (side * side, 3, 3)
    )
    pin = 1.0 - 1e-4 * (1.0 - np.eye(3))
    return np.concatenate((quads, dust, (pin, -pin)))


def _wall(triangles: float, name: str) -> float:
    """Return the work of a ray with the wall at 0, over that with the wall next to it."""
    side = max(1, round(np.sqrt(triangles / 2.0)))
    rng = np.random.default_rng(41)
    origin = rng.uniform(-0.9, 0.9, (512, 3))
    rays = in_batches(origin, directions(len(origin), rng), np.inf)
    on, beyond = (
        work_of_a_ray(name, soup_mesh(wall(side, place)), rays) for place in (0.0, 0.0371)
    )
    return on / beyond


# ------------------------------------------------------------ mailboxes, packets, refitting


def _tests_of_one(cells: float, name: str) -> float:
    """Return how many triangles a ray tests that stays within rounding of a large one.

    Dust far above the triangle gives the grid about so many cells a side.
    """
    n = int(cells) ** 3
    rng = np.random.default_rng(30)
    large = np.array([[(-1.0, -1.0, -1.0), (1.0, -1.0, -1.0), (0.0, 1.0, -1.0)]])
    dust = rng.uniform(-1.0, 1.0, (n // 4, 1, 3)) * (1.0, 1.0, 0.05) + (0.0, 0.0, 0.95)
    corners = np.concatenate((large, dust + 1e-4 * rng.uniform(-1, 1, (n // 4, 3, 3))))
    y = rng.uniform(-0.9, 0.0, 256)
    origin = np.stack((np.full(256, -1.5), y, np.full(256, -0.9999)), axis=1)
    rays = in_batches(origin, np.broadcast_to((1.0, 0.0, 0.0), (256, 3)), np.inf)
    return float(counted(name, soup_mesh(corners), rays)[PRIMITIVES].mean())


def _packet_cost(spread: float) -> float:
    """Return the nodes a ray's packet visits, over those that it would visit alone."""
    ball = displaced_icosphere(16)  # 5120 triangles
    origin, direction, _ = camera_rays(ball.view, 32, 32).rows()
    rng = np.random.default_rng(50)
    # towards other points of the ball, and from other places
    target = origin + 3.5 * direction + spread * rng.standard_normal(origin.shape)
    start = origin + spread * rng.standard_normal(origin.shape)
    rays = in_batches(start, unit(target - start), np.inf)
    together, alone = (
        counted("bvh", ball, rays, coherent=one)[NODES].mean() for one in (True, False)
    )
    return float(together / alone)


def _refitted(per_cent: float, motion: Any) -> float:
    """Return the nodes a ray visits in the refitted tree, over those in a new one."""
    rest = moved(displaced_icosphere(7), motion, 0.0)  # 980 triangles
    mesh = moved(rest, motion, per_cent / 100.0)

    def extents(of: StudyMesh) -> Any:
        return extents_of("triangles", triangle_surfaces(of), np.arange(of.triangles))

    def built(of: StudyMesh) -> Any:
        surfaces = triangle_surfaces(of)
        return build_bvh(
            extents(of), lambda order: primitive_group("triangles", surfaces, order)
        )

    surfaces = triangle_surfaces(mesh)
    refitted = refit_bvh(
        built(rest),
        extents(mesh),
        lambda order: primitive_group("triangles", surfaces, order),
    )
    query = make_query("random", random_rays(mesh, 1024))
    old, new = (
        float(tallied(tree, query, query.batches)[NODES].mean())
        for tree in (refitted, built(mesh))
    )
    return old / new


# ------------------------------------------------------------------------ bounding volumes


def _let_through(aspect: float, name: str) -> float:
    """Return the random lines that meet the volume for each that meets the rod.

    Convex bodies are met in proportion to their surface areas (Cauchy).
    """
    radius = 0.5 / aspect
    along = np.full(3, 3.0**-0.5)
    x = unit(np.array([[1.0, -1.0, 0.0]]))[0]
    turn = 2.0 * np.pi * np.arange(64) / 64
    ring = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * np.cross(along, x)
    ends = [radius * ring + side * 0.5 * along for side in (-1.0, 1.0)]
    points = np.ascontiguousarray(np.concatenate(ends).T)
    volume = VOLUMES[name]
    area = volume.area(volume.fit(points, 0.0))
    return area / (2.0 * np.pi * radius * (radius + 1.0))


# ------------------------------------------------------ every structure against brute force

BALL = displaced_icosphere(4)  # 320 triangles
REACH = 4.0  # |x| + |y| + |z| of the farthest ray: structures grow boxes by rounding there


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


_STADIUM = "grid grid-nested grid-clusters octree bsp kd-middle kd-median kd-sah bvh wide"
_CUT = "bvh", "kd-sah", "grid", "octree"
_MOTIONS = zip(("wave", "twist", "mixing"), MOTIONS.values(), strict=True)

MEASURES = {
    **{f"stadium-{name}": partial(_stadium, name=name) for name in _STADIUM.split()},
    "brute-force": partial(_brute, name="brute"),
    "brute-force-bvh": partial(_brute, name="bvh"),
    **{f"coincident-{name}": partial(_coincident, name=name) for name in _CUT},
    **{f"line-{name}": partial(_line, name=name) for name in _CUT},
    **{f"needles-{name}": partial(_needle_work, name=name) for name in _CUT},
    **{f"halves-{one}": partial(_halves, name=one) for one in ("bvh", "kd-sah", "octree")},
    **{
        f"wall-{name}": partial(_wall, name=name)
        for name in ("kd-middle", "octree", "kd-sah", "bvh")
    },
    "mailboxes-grid": partial(_tests_of_one, name="grid"),
    "mailboxes-grid-without-mailboxes": partial(
        _tests_of_one, name="grid-without-mailboxes"
    ),
    "packets-incoherent": _packet_cost,
    **{f"refit-{name}": partial(_refitted, motion=move) for name, move in _MOTIONS},
    **{
        f"volume-{name}": partial(_let_through, name=name)
        for name in ("sphere", "AABB", "14-DOP", "OBB")
    },
    "axis-parallel-rays": _differ,
}
PICTURES = {"stadium": stadium_maps, "needles": needle_maps}
