"""Build one accelerator for each kind of primitive of a scene."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh import build_bvh
from renderer.accelerators.bvh.bvh_build import build_tree
from renderer.accelerators.bvh.wide_bvh import build_wide
from renderer.accelerators.choice import (
    USUAL_RAYS,
    RayCounts,
    choose_structure,
    choose_structures,
)
from renderer.accelerators.instances.instances_build import build_instances, build_nodes
from renderer.accelerators.non_occluders import find_non_occluders
from renderer.accelerators.rays.boxes import build_boxes, build_brute_force
from renderer.errors import SceneError
from renderer.kernels.records.kernel_scene import EMIT
from renderer.plugins.shapes.extents import (
    Extents,
    Hulls,
    PrimitiveGroup,
    extents_of,
)
from renderer.plugins.shapes.registry import SHAPES
from renderer.plugins.shapes.triangle_tables import triangles_of
from renderer.process.names import ACCELERATORS
from renderer.scene.scene import Scene
from renderer.textbook.bsp import build_bsp
from renderer.textbook.bvh import build_box_tree
from renderer.textbook.clustered_grids import build_clustered_grids
from renderer.textbook.kd_tree import CHEAPEST, MEDIAN, MIDDLE, build_kd_tree
from renderer.textbook.nested_grids import build_nested_grids
from renderer.textbook.octree import build_octree
from renderer.textbook.uniform_grid import build_uniform_grid

# name -> build function
BUILDERS: dict[str, Callable[[Extents, PrimitiveGroup], Any]] = {
    "brute": build_brute_force,
    "boxes": build_boxes,
    "bvh": build_bvh,
    "bvh-median": functools.partial(build_bvh, rule="median"),
    "bvh-middle": functools.partial(
        build_box_tree, build_tree=functools.partial(build_tree, rule="middle")
    ),
    "wide": build_wide,
    "bsp": build_bsp,
    "grid": build_uniform_grid,
    "grid-without-mailboxes": functools.partial(build_uniform_grid, mailboxed=None),
    "grid-nested": build_nested_grids,
    "grid-clusters": build_clustered_grids,
    "kd-middle": functools.partial(build_kd_tree, rule=MIDDLE),
    "kd-median": functools.partial(build_kd_tree, rule=MEDIAN),
    "kd-sah": functools.partial(build_kd_tree, rule=CHEAPEST),
    "octree": build_octree,
}


def primitive_group(kind: str, surfaces: Any, order: NDArray[np.int64]) -> Any:
    """Return the group of a kind's primitives in the given order (column numbers)."""
    return SHAPES[kind].group(surfaces, order)


def build_accelerator(
    kind: str, surfaces: Any, order: NDArray[np.int64], name: str, reach: float = 0.0
) -> Any:
    """Build the accelerator `name` over the given columns of one kind of primitive.

    `reach` is the largest |x| + |y| + |z| of a ray origin in the world.
    """

    def group(columns: NDArray[np.int64]) -> Any:
        return primitive_group(kind, surfaces, order[columns])

    chosen = choose_structure(kind, surfaces, len(order), name).name
    return BUILDERS[chosen](extents_of(kind, surfaces, order, reach), group)


def compile_builders(scene: Scene, name: str, rays: RayCounts = USUAL_RAYS) -> float:
    """Compile what `build_accelerators` will call; return the seconds it took."""
    started = time.perf_counter()
    for chosen in {c.name for c in choose_structures(scene, name, rays).values()}:
        _compile_builder(chosen)
    if scene.placements is not None:
        _compile_builder_of_instances()
    return time.perf_counter() - started


@functools.cache
def _compile_builder(name: str) -> None:
    """Build over a single point, once per process."""
    BUILDERS[name](_one_point(), _points)


@functools.cache
def _compile_builder_of_instances() -> None:
    build_nodes(build_tree(np.zeros((3, 1)), np.zeros((3, 1))))


def _one_point() -> Extents:
    zero = np.zeros((3, 1), np.float32)
    hulls = Hulls(np.zeros((3, 4, 1), np.float32), np.zeros(1, np.float32), zero)
    return Extents(zero, zero, 1.0, 1e-6, lambda: hulls)


def _points(columns: NDArray[np.int64]) -> Any:
    points = triangles_of(np.zeros((1, 3, 3), np.float32))
    return SHAPES["triangles"].group(points, columns * 0)


class Accelerators(NamedTuple):
    """The accelerators of a scene."""

    by_kind: dict[str, Any]  # by kind of primitive, for the kinds in the scene
    instances: Any  # `instances.instances.Instances`, traced last; or None


class LeftOut(NamedTuple):
    """Primitives that some rays must not hit, or can never hit."""

    name: Any  # key under which the scene caches what is built without them
    mask: NDArray[np.bool_]  # (primitives,) by id
    whole: Accelerators  # of all primitives; reused for kinds that lose none


def build_accelerators(
    scene: Scene,
    name: str,
    rays: RayCounts = USUAL_RAYS,
    left_out: LeftOut | None = None,
) -> Accelerators:
    """Build for all kinds of primitive in the scene, and for its instances.

    The scene caches the result for the next call.

    Parameters
    ----------
    scene : Scene
        The primitives.
    name : str
        One of `renderer.process.names.ACCELERATORS`. `auto` takes the fastest by the cost
        model. Instances and their groups always have trees of eight, except under
        `brute` and for groups of a few primitives.
    rays : RayCounts
        Expected numbers of rays, for `auto`.
    left_out : LeftOut, optional
        Primitives to build without. Instances are always kept.

    Raises
    ------
    SceneError
        If there is no accelerator of that name.
    """
    if name not in ACCELERATORS:
        raise SceneError(
            f"accelerator {name!r} is unknown; there are: {', '.join(ACCELERATORS)}"
        )
    built: dict[str, Any] = {}
    reach = _reach(scene)
    choices = choose_structures(scene, name, rays)
    for kind, surfaces in scene.surfaces.items():
        order = np.arange(scene.starts[kind][0])
        if left_out is not None:
            kept = ~left_out.mask[surfaces.first + order]
            if kept.all() and kind in left_out.whole.by_kind:
                built[kind] = left_out.whole.by_kind[kind]
                continue
            order = order[kept]
        if len(order):
            chosen = choices[kind].name
            built[kind] = scene.once(
                (kind, chosen, left_out and left_out.name),
                build_accelerator,
                *(kind, surfaces, order, chosen, reach),
            )
    if left_out is not None:
        return Accelerators(built, left_out.whole.instances)
    brute = name == "brute"
    build = functools.partial(build_instances, brute=brute)
    instances = scene.once(("instances", brute), build, scene, primitive_group, reach)
    return Accelerators(built, instances)


def accelerators_of_camera(
    scene: Scene, name: str, rays: RayCounts, whole: Accelerators
) -> Accelerators:
    """Return the accelerators for a camera that does not see area lights."""
    emitting = (scene.stages & EMIT) != 0
    return build_accelerators(scene, name, rays, LeftOut("emitters", emitting, whole))


def accelerators_of_lamps(
    scene: Scene, name: str, rays: RayCounts, whole: Accelerators
) -> Accelerators:
    """Return accelerators over the area lights only."""
    left_out = LeftOut("all but emitters", (scene.stages & EMIT) == 0, whole)
    return build_accelerators(scene, name, rays, left_out)


def accelerators_of_panes(
    scene: Scene, name: str, rays: RayCounts, whole: Accelerators
) -> Accelerators:
    """Return accelerators over the panes only."""
    left_out = LeftOut("all but panes", scene.shapes.pane[scene.shape] == 0, whole)
    return build_accelerators(scene, name, rays, left_out)


def accelerators_of_shadow_rays(
    scene: Scene,
    name: str,
    rays: RayCounts,
    whole: Accelerators,
    lights: NDArray[np.int32],
    offsets: tuple[float, float],
) -> Accelerators:
    """Return the accelerators for shadow rays, see `find_non_occluders`."""
    mask = find_non_occluders(scene, name, rays, lights, offsets)
    ids = tuple(np.flatnonzero(mask).tolist())
    return build_accelerators(scene, name, rays, LeftOut(ids, mask, whole))


def _reach(scene: Scene) -> float:
    """Return the largest |x| + |y| + |z| of a ray origin in this scene."""
    corner = np.abs(scene.bounds).max(axis=0)
    eye = np.abs(scene.description.camera.to_world[:3, 3])
    return float(max(corner.sum(), eye.sum()))
