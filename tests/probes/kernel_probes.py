"""Kernels made callable from Python, one entry for each question, shared by the tests.

A kernel compiles once for each kind of record it is given, and that is where the time of
these tests goes; so the tests ask through the few functions here, with packed records, as
the renderer does.
"""

from __future__ import annotations

import copy
import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numba import typeof

from renderer.accelerators.build import build_accelerator
from renderer.accelerators.dispatch import TRAVERSALS
from renderer.integrators.stages.intersect import intersect
from renderer.integrators.stages.materials import look_up_textures
from renderer.integrators.stages.surface import (
    append_hits,
    leave_surface,
    load_constants,
    surface_points,
)
from renderer.kernels.jit import (
    Packed,
    call,
    compile_method,
    entry_kernel,
    kernel,
    pack,
)
from renderer.kernels.lanes.functions import first_lanes
from renderer.kernels.lanes.vectors import load3, store3
from renderer.kernels.records.batch import (
    CAPACITY,
    Rays,
    SampleKey,
    ShadowRays,
    Workspace,
    make_workspace,
)
from renderer.kernels.records.kernel_scene import ANY
from renderer.plugins.shapes import flat
from renderer.plugins.shapes.cylinder import CylinderSurfaces
from renderer.plugins.shapes.disk import DiskSurfaces
from renderer.plugins.shapes.rectangle import RectangleSurfaces
from renderer.plugins.shapes.sphere import SphereSurfaces
from renderer.plugins.shapes.triangle_tables import TriangleSurfaces, triangles_of
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import Plan, offset_rule
from renderer.rendering.tables.kernel_record import KernelInputs
from renderer.rendering.tables.render_mode import RenderMode, Variant
from renderer.scene.scene import Scene

KINDS = ("triangles", "rectangles", "disks", "spheres", "cylinders")
FIRST_ID = 5  # not 0, so that a column number taken for a primitive id shows


# --------------------------------------------------------------------------- samples


@kernel
def key_of(pixel):
    """The key of one sample of each of 16 pixels."""
    return SampleKey(pixel, pixel ^ pixel)


# ------------------------------------------------------------------------ primitives


def float32(rows: Any) -> np.ndarray:
    return np.ascontiguousarray(rows, np.float32)


def triangles(points: Any) -> TriangleSurfaces:
    """Triangles from (n, 3 vertices, 3)."""
    return triangles_of(np.asarray(points, np.float32), FIRST_ID)


def rectangles(corner: Any, edge1: Any, edge2: Any) -> RectangleSurfaces:
    """Parallelograms from three (n, 3)."""
    columns = [float32(np.asarray(a).T) for a in (corner, edge1, edge2)]
    return RectangleSurfaces(FIRST_ID, FIRST_ID + len(corner), flat.places(*columns))


def disks(center: Any, edge1: Any, edge2: Any) -> DiskSurfaces:
    """Disks from three (n, 3)."""
    columns = [float32(np.asarray(a).T) for a in (center, edge1, edge2)]
    return DiskSurfaces(FIRST_ID, FIRST_ID + len(center), flat.places(*columns))


def frames(axis: Any) -> np.ndarray:
    """Rows x, y, z (9, n) of right-handed frames around unit vectors (n, 3)."""
    z = np.asarray(axis, np.float64)
    helper = np.where(np.abs(z[:, :1]) < 0.8, [[1.0, 0, 0]], [[0, 1.0, 0]])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return float32(np.concatenate((x, np.cross(z, x), z), axis=1).T)


def spheres(center: Any, radius: Any) -> SphereSurfaces:
    """Spheres from (n, 3) and (n,)."""
    center = np.asarray(center)
    frame = frames(np.tile([0.0, 0.0, 1.0], (len(center), 1)))
    return SphereSurfaces(
        FIRST_ID, FIRST_ID + len(center), float32(center.T), float32(radius), frame
    )


def cylinders(base: Any, axis: Any, radius: Any, height: Any) -> CylinderSurfaces:
    """Cylinders from (n, 3), unit (n, 3), (n,), (n,)."""
    base = np.asarray(base)
    end = FIRST_ID + len(base)
    return CylinderSurfaces(
        FIRST_ID, end, float32(base.T), float32(radius), float32(height), frames(axis)
    )


def accelerator(kind: str, surfaces: Any, name: str, reach: float = 0.0) -> Any:
    order = np.arange(surfaces.end - surfaces.first)
    return build_accelerator(kind, surfaces, order, name, reach)


# ------------------------------------------------------------------------------ hits


class Found(NamedTuple):
    """The nearest hit of each ray; t is that of the call where prim is -1."""

    t: np.ndarray
    prim: np.ndarray
    u: np.ndarray
    v: np.ndarray


@entry_kernel
def call_closest_hit(method, record, rays, hits, first, count, tally):
    call(method, record, (rays, hits, first, count, tally))


@entry_kernel
def call_any_hit(method, record, shadow_rays, count, tally):
    call(method, record, (shadow_rays, count, tally))


def called(entry: Any, kernel: Any, accel: Any, *arguments: Any) -> None:
    """Call a structure's kernel by its address, as the renderer's stages do.

    So it is compiled once, and not again within an entry of its own.
    """
    packed = pack(accel)
    given = [
        argument.numba_type if isinstance(argument, Packed) else typeof(argument)
        for argument in arguments
    ]
    method = compile_method(kernel, packed, *given)
    entry(method.address, method.record, *arguments)


def trace(
    accel: Any, work: Workspace, first: int, count: int, coherent: bool, tally: Any
) -> None:
    """Update the hits of `count` rays of a workspace with those in an accelerator."""
    ways = TRAVERSALS[type(accel)]
    kernel = ways.closest_hit_coherent if coherent else ways.closest_hit
    rays, hits = pack(work.rays), pack(work.hits)
    called(call_closest_hit, kernel, accel, rays, hits, first, count, tally)


def workspace(count: int, channels: int = 3) -> Workspace:
    return make_workspace(ray_capacity=count, capacity=count, channels=channels)


def fill(record: Rays | ShadowRays, origin: Any, direction: Any) -> int:
    """Write rays given as (n, 3), either of which may be a single (3,); return n."""
    with np.errstate(over="ignore"):
        o, d = np.broadcast_arrays(float32(origin), float32(direction))
    record.origin[:, : len(o)] = o.T
    record.direction[:, : len(d)] = d.T
    return len(o)


def ray_count(origin: Any, direction: Any) -> int:
    return np.broadcast_shapes(np.shape(origin), np.shape(direction))[0]


def closest(
    accel: Any,
    origin: Any,
    direction: Any,
    *,
    t_max: Any = np.inf,
    coherent: bool = False,
    tally: Any = None,
) -> Found:
    """Trace rays (n, 3); `coherent` takes the traversal by packets where there is one.

    Given a tally (`renderer.kernels.records.batch`), the twin that counts runs.
    """
    work = workspace(ray_count(origin, direction))
    n = fill(work.rays, origin, direction)
    work.hits.t[:n] = t_max
    work.hits.prim[:] = -1
    trace(accel, work, 0, n, coherent, tally)
    return Found(*(row[:n] for row in work.hits[:4]))


def blocked(
    accel: Any,
    origin: Any,
    direction: Any,
    *,
    t_max: Any = np.inf,
    coherent: bool = False,
    before: Any = False,
    tally: Any = None,
) -> np.ndarray:
    """Whether shadow rays (n, 3) meet anything before t_max, or were blocked `before`."""
    work = workspace(ray_count(origin, direction))
    n = fill(work.shadow_rays, origin, direction)
    work.shadow_rays.blocked[:n] = before
    work.shadow_rays.t_max[:n] = t_max
    ways = TRAVERSALS[type(accel)]
    kernel = ways.any_hit_coherent if coherent else ways.any_hit
    called(call_any_hit, kernel, accel, pack(work.shadow_rays), n, tally)
    return work.shadow_rays.blocked[:n] != 0


# ------------------------------------------------------------------- surface points


class Seen(NamedTuple):
    """The surface points of n rays that all hit; vectors are (n, 3) float64."""

    t: np.ndarray
    shape: np.ndarray
    prim: np.ndarray
    position: np.ndarray
    normal: np.ndarray  # geometric, after flip_normals
    shading_normal: np.ndarray
    uv: np.ndarray  # (n, 2)
    offset: np.ndarray
    wo: np.ndarray
    leaving: np.ndarray  # where a ray starts that leaves along `outgoing`


class Inputs:
    """What the kernels get of a scene; addresses hold as long as this lives.

    Parameters
    ----------
    scene, plan, accel, seed, way
        As `KernelInputs` takes them.
    """

    def __init__(
        self,
        scene: Scene,
        plan: Plan,
        accel: str = "brute",
        seed: int = 0,
        way: Variant | None = None,
    ) -> None:
        self.scene, self.plan, self.way = scene, plan, way or RenderMode()
        self.tables = KernelInputs(scene, plan, accel, seed, self.way)
        self.record = self.tables.record
        self.packed = pack(self.record)

    def changed(self, **fields: Any) -> Inputs:
        """Return the same with other fields of the record."""
        other = copy.copy(self)
        other.record = self.record._replace(**fields)
        other.packed = pack(other.record)
        return other

    def with_settings(self, **settings: Any) -> Inputs:
        return self.changed(settings=self.record.settings._replace(**settings))

    def workspace(self, capacity: int = CAPACITY, rays: int | None = None) -> Workspace:
        bsdfs = self.record.bsdfs
        return make_workspace(
            ray_capacity=rays or capacity,
            capacity=capacity,
            kinds=len(bsdfs.methods),
            parameters=len(bsdfs.values),
            previous_points=self.way.previous_points,
        )


def first_hit_plan(scene: Scene) -> Plan:
    """A plan for first hits, but with rays that are traced one by one as well."""
    return dataclasses.replace(make_plan(scene, integrator="aov"), max_depth=2)


def kernel_inputs(scene: Scene, ray_offset: str = "tight", accel: str = "brute") -> Inputs:
    """What the kernels get for first hits; the kinds of shapes decide what compiles."""
    rounding, fixed, _ = offset_rule(ray_offset)
    inputs = Inputs(scene, first_hit_plan(scene), accel)
    return inputs.with_settings(rounding_offset=rounding, fixed_offset=fixed)


@entry_kernel
def run_intersect(groups, rays, hits, count):
    intersect(groups, rays, hits, np.int64(0), count, False, None)


@entry_kernel
def run_surface_points(scene, work, count):
    """Points of all hits among the first `count` rays; their number."""
    none = np.int64(0)
    intersect(scene.groups, work.rays, work.hits, none, count, False, None)
    rays, hits, order, points = work.rays, work.hits, work.order, work.points
    found = append_hits(scene, rays, hits, none, count, ANY, order, points, none)
    surface_points(scene, rays, hits, order, found, points)
    return found


@entry_kernel
def run_leave_surface(points, count, direction, origin):
    for i in range(0, count, 16):
        store3(origin, i, leave_surface(points, i, load3(direction, i)))


def nearest(inputs: Inputs, origin: Any, direction: Any, t_max: Any = np.inf) -> Found:
    """The nearest hit among all kinds of primitives of rays (n, 3)."""
    work = workspace(ray_count(origin, direction))
    n = fill(work.rays, origin, direction)
    work.hits.t[:n] = t_max
    work.hits.prim[:] = -1
    run_intersect(inputs.record.groups, pack(work.rays), pack(work.hits), n)
    return Found(*(row[:n] for row in work.hits[:4]))


def look(inputs: Inputs, origin: Any, direction: Any, outgoing: Any = None) -> Seen:
    """Surface points of rays (n, 3) that must all hit something.

    New rays leave in the directions `outgoing` (n, 3); None goes straight on.
    """
    parts = []
    for first in range(0, len(origin), CAPACITY):
        part = slice(first, first + CAPACITY)
        work = inputs.workspace()
        n = fill(work.rays, origin[part], direction[part])
        work.hits.t[:n] = np.inf
        work.hits.prim[:] = -1
        assert run_surface_points(inputs.packed, pack(work), n) == n, "a ray missed"
        p = work.points
        going = np.zeros_like(p.wo)
        going[:, :n] = float32(direction[part] if outgoing is None else outgoing[part]).T
        leaving = np.zeros_like(p.wo)
        run_leave_surface(pack(p), n, going, leaving)
        rows = (p.t, p.shape, p.prim, p.position, p.normal, p.shading_normal)
        rows = (*rows, p.uv, p.offset, p.wo, leaving)
        parts.append([row[..., :n].T for row in rows])
    whole = [np.concatenate(rows) for rows in zip(*parts, strict=True)]
    return Seen(*(a.astype(float) if a.dtype == np.float32 else a for a in whole))


# ----------------------------------------------------------------------- directions


def unit(vectors: Any) -> np.ndarray:
    v = np.asarray(vectors, np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def directions(n: int, rng: np.random.Generator) -> np.ndarray:
    """Uniformly distributed unit vectors (n, 3)."""
    return unit(rng.standard_normal((n, 3)))


def soup(
    kind: str, n: int, rng: np.random.Generator, *, size: float = 0.1, center: float = 0.0
) -> Any:
    """Random primitives of a kind, about `size` large, in a cube of edge 2."""
    c = center + rng.uniform(-1, 1, (n, 3))
    a, b = (size * rng.random((n, 1)) * directions(n, rng) for _ in range(2))
    if kind == "triangles":
        return triangles(np.stack((c, c + a, c + b), axis=1))
    if kind == "rectangles":
        return rectangles(c, a, b)
    if kind == "disks":
        return disks(c, a, b)
    if kind == "spheres":
        return spheres(c, size * rng.random(n))
    return cylinders(c, unit(a), size * rng.random(n), 3 * size * rng.random(n))


# ------------------------------------------------------------------------ statistics


def chi_square_z(counts: Any, expected: Any = None) -> float:
    """How many sigma a chi-square of counts (equal probabilities, or `expected`) is off.

    By Wilson and Hilferty's cube root, good to a percent of a sigma from ten cells on.
    One-sided: 4.5 has a false alarm rate of 3.4e-6.
    """
    counts = np.asarray(counts, float).ravel()
    mean = counts.mean() if expected is None else np.asarray(expected, float).ravel()
    k = counts.size - 1
    ratio = np.sum((counts - mean) ** 2 / mean) / k
    return float((np.cbrt(ratio) - (1 - 2 / (9 * k))) / np.sqrt(2 / (9 * k)))


def mean_z(values: Any, expected: float) -> float:
    """How many standard errors the mean of independent values is off."""
    values = np.asarray(values, float)
    return float((values.mean() - expected) / (values.std() / np.sqrt(values.size)))


@entry_kernel
def run_parameters(bsdfs, points, count):
    """Load the parameters of the BSDFs that `points.bsdf` names."""
    none = np.int64(0)
    for i in range(0, count, 16):
        load_constants(bsdfs, none, points, i, first_lanes(count - i))
    look_up_textures(bsdfs, none, points, none, count)
