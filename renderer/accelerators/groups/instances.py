"""Groups and instances: a tree over the instances, and below it one tree for each group.

The lecture's objects that hold objects: a ray that meets the box of an instance goes on
in the object's own space, where the group's accelerator waits, stored once however many
instances there are. The direction is not normalised there, so t means the same in both
spaces. Of equal t the smallest primitive id wins, then the smallest instance id.

Rays go one by one: in the space of its own object each takes another way.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh import (
    STACK,
    blocked_below,
    nearest_below,
    origin_margins,
    ray_enters,
)
from renderer.accelerators.rays.single_ray import RayHit
from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.affine import affine_at, times
from renderer.kernels.lanes.functions import fabs
from renderer.kernels.lanes.local import local_f32, local_i32
from renderer.kernels.lanes.vectors import column
from renderer.kernels.records.kernel_scene import Placements
from renderer.kernels.records.tally import BOXES, NODES, add_to, note_stack

_INFINITY = np.float32(np.inf)


class Forest(NamedTuple):
    """The primitives of one kind in all groups: one tree for each group, side by side."""

    trees: Any  # a Bvh whose arrays hold all trees
    root: NDArray[np.int32]  # (groups,) node, -1: the group has none of this kind


class Instances(NamedTuple):
    """A tree over the boxes of the instances, and the groups that they are copies of."""

    bounds: NDArray[np.float32]  # (nodes, 6) lower x y z, upper x y z, in the world
    child: NDArray[np.int32]  # (nodes,) first of two children, or first instance
    count: NDArray[np.int32]  # (nodes,) 0 for inner nodes, else instances of the leaf
    # Boxes are padded for rays that start with |x| + |y| + |z| <= reach. Others begin at
    # `every`, a leaf without bounds that holds all instances.
    reach: float
    every: int
    placements: Placements
    triangles: Forest | None  # None: no group has this kind
    rectangles: Forest | None
    disks: Forest | None
    spheres: Forest | None
    cylinders: Forest | None
    implicits: Forest | None
    sdf_cells: Forest | None


class PlacedHit(NamedTuple):
    """The nearest hit so far of one ray."""

    t: Any
    prim: Any  # primitive id, -1: none yet
    u: Any
    v: Any
    instance: Any  # instance id, -1: the primitive is in none


@kernel
def _start(instances, origin, direction):
    """Return the node that a ray begins at, -1 for rays that are not finite."""
    far = fabs(origin.x) + fabs(origin.y) + fabs(origin.z)
    fast = fabs(direction.x) + fabs(direction.y) + fabs(direction.z)
    if not (far < _INFINITY and fast < _INFINITY):
        return np.int32(-1)
    return np.int32(0) if far <= instances.reach else np.int32(instances.every)


@kernel
def _into_object(placements, k, origin, direction):
    """Return a ray in the space of instance k."""
    m = affine_at(placements.to_object, k)
    return times(m, origin - m.at), times(m, direction)


# ------------------------------------------------------------------------- nearest hit


@method_kernel
def closest_hit_instances(instances, rays, hits, first, count, tally):
    """Update `hits` of rays first to first + count - 1; the last of all kinds to do so."""
    for i in range(first, first + count):
        hit = PlacedHit(hits.t[i], hits.prim[i], hits.u[i], hits.v[i], np.int32(-1))
        origin = column(rays.origin, i)
        direction = column(rays.direction, i)
        hit = _nearest_instance(instances, origin, direction, hit, tally, i)
        hits.t[i] = hit.t
        hits.prim[i] = hit.prim
        hits.u[i] = hit.u
        hits.v[i] = hit.v
        hits.instance[i] = hit.instance


@kernel
def _nearest_instance(instances, origin, direction, hit, tally, i):
    """Return the nearest hit of one ray among all instances, from front to back."""
    bounds = instances.bounds
    inverse = np.float32(1.0) / direction
    low, high = origin_margins(origin)
    stack = local_i32(STACK)
    entries = local_f32(STACK)
    stack[0] = _start(instances, origin, direction)
    entries[0] = np.float32(0.0)
    depth = 0 if stack[0] < 0 else 1
    while depth > 0:
        note_stack(tally, i, depth)
        depth -= 1
        if entries[depth] > hit.t:
            continue
        node = stack[depth]
        add_to(tally, NODES, i, 1)
        child = instances.child[node]
        if instances.count[node] > 0:
            for k in range(child, child + instances.count[node]):
                hit = _nearest_in(instances, k, origin, direction, hit, tally, i)
            continue
        near = child
        far = child + 1
        enter_near = ray_enters(bounds, near, low, high, inverse, hit.t)
        enter_far = ray_enters(bounds, far, low, high, inverse, hit.t)
        add_to(tally, BOXES, i, 2)
        if enter_far < enter_near:
            near, far = far, near
            enter_near, enter_far = enter_far, enter_near
        if enter_far < _INFINITY:
            stack[depth] = far
            entries[depth] = enter_far
            depth += 1
        if enter_near < _INFINITY:
            stack[depth] = near
            entries[depth] = enter_near
            depth += 1
    return hit


@kernel
def _nearest_in(instances, k, origin, direction, hit, tally, i):
    """Return the nearer of `hit` and that in instance k."""
    group = instances.placements.group[k]
    o, d = _into_object(instances.placements, k, origin, direction)
    # none yet, so that equal hits in two instances both come back
    x = RayHit(hit.t, np.int32(-1), hit.u, hit.v)
    x = _nearest_of_kind(instances.triangles, group, o, d, x, tally, i)
    x = _nearest_of_kind(instances.rectangles, group, o, d, x, tally, i)
    x = _nearest_of_kind(instances.disks, group, o, d, x, tally, i)
    x = _nearest_of_kind(instances.spheres, group, o, d, x, tally, i)
    x = _nearest_of_kind(instances.cylinders, group, o, d, x, tally, i)
    x = _nearest_of_kind(instances.implicits, group, o, d, x, tally, i)
    x = _nearest_of_kind(instances.sdf_cells, group, o, d, x, tally, i)
    if x.prim < 0:
        return hit
    wins = x.t < hit.t or hit.prim < 0 or x.prim < hit.prim
    if wins or (x.prim == hit.prim and k < hit.instance):
        return PlacedHit(x.t, x.prim, x.u, x.v, np.int32(k))
    return hit


@kernel
def _nearest_of_kind(forest, group, origin, direction, hit, tally, i):
    if forest is None:
        return hit
    root = forest.root[group]
    if root < 0:
        return hit
    return nearest_below(forest.trees, root, origin, direction, hit, tally, i)


# ----------------------------------------------------------------------------- any hit


@method_kernel
def any_hit_instances(instances, shadow_rays, count, tally):
    """Set `blocked` of the first `count` shadow rays."""
    for i in range(count):
        if shadow_rays.blocked[i] != 0:
            continue
        origin = column(shadow_rays.origin, i)
        direction = column(shadow_rays.direction, i)
        if _blocked(instances, origin, direction, shadow_rays.t_max[i], tally, i):
            shadow_rays.blocked[i] = 1


@kernel
def _blocked(instances, origin, direction, t_max, tally, i):
    """Return whether one ray meets an instance up to t_max."""
    bounds = instances.bounds
    inverse = np.float32(1.0) / direction
    low, high = origin_margins(origin)
    stack = local_i32(STACK)
    stack[0] = _start(instances, origin, direction)
    depth = 0 if stack[0] < 0 else 1
    while depth > 0:
        note_stack(tally, i, depth)
        depth -= 1
        node = stack[depth]
        add_to(tally, BOXES, i, 1)
        if ray_enters(bounds, node, low, high, inverse, t_max) == _INFINITY:
            continue
        add_to(tally, NODES, i, 1)
        child = instances.child[node]
        if instances.count[node] == 0:
            stack[depth] = child
            stack[depth + 1] = child + 1
            depth += 2
            continue
        for k in range(child, child + instances.count[node]):
            if _blocked_in(instances, k, origin, direction, t_max, tally, i):
                return True
    return False


@kernel
def _blocked_in(instances, k, origin, direction, t_max, tally, i):
    group = instances.placements.group[k]
    o, d = _into_object(instances.placements, k, origin, direction)
    return (
        _blocked_by_kind(instances.triangles, group, o, d, t_max, tally, i)
        or _blocked_by_kind(instances.rectangles, group, o, d, t_max, tally, i)
        or _blocked_by_kind(instances.disks, group, o, d, t_max, tally, i)
        or _blocked_by_kind(instances.spheres, group, o, d, t_max, tally, i)
        or _blocked_by_kind(instances.cylinders, group, o, d, t_max, tally, i)
        or _blocked_by_kind(instances.implicits, group, o, d, t_max, tally, i)
        or _blocked_by_kind(instances.sdf_cells, group, o, d, t_max, tally, i)
    )


@kernel
def _blocked_by_kind(forest, group, origin, direction, t_max, tally, i):
    if forest is None:
        return False
    root = forest.root[group]
    if root < 0:
        return False
    return blocked_below(forest.trees, root, origin, direction, t_max, tally, i)
