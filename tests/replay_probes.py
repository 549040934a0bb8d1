"""Kernels that replay Mitsuba's choices, made callable from Python for the tests.

Compiled once for each kind of record they are given, see `kernel_probes`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from kernel_probes import fill, float32
from renderer.kernel_inputs import kernel_scene
from renderer.kinds.lights.choose import choose_light, light_probability, sample_light
from renderer.kinds.lights.triangles import density_normal

from renderer.jit import entry_kernel
from renderer.kinds.bsdfs.diffuse import sample_diffuse
from renderer.kinds.lights.area import pdf_area_light
from renderer.lanes.functions import fabs, first_lanes
from renderer.lanes.memory import gather_row, load_row, store_row
from renderer.lanes.vectors import dot, load3, select3, store3
from renderer.records.batch import CAPACITY, Workspace, make_workspace
from renderer.records.kernel_scene import ANY, KernelScene
from renderer.rendering.planning.plan import make_plan
from renderer.scene.scene import Scene
from renderer.stages.intersect import collect, intersect
from renderer.stages.shading_frame import tangents_of
from renderer.stages.surface import surface_points


def replay_inputs(scene: Scene) -> KernelScene:
    """What the kernels get for a replay of Mitsuba's path integrator."""
    plan = dataclasses.replace(make_plan(scene, integrator="path"), replay=True)
    return kernel_scene(scene, plan, "brute", 0)


def _at_rays(inputs: KernelScene, origin: Any, direction: Any) -> tuple[Workspace, int]:
    """A workspace with rays (n, 3) that wait to be traced, and n."""
    work = make_workspace(
        ray_capacity=CAPACITY,
        shadow_capacity=16,
        channels=3,
        depths=1,
        instances=inputs.accelerators.instances is not None,
        replay=True,
    )
    n = fill(work.rays, origin, direction)
    work.hits.t[:n] = np.inf
    work.hits.prim[:] = -1
    return work, n


# -------------------------------------------------------------------------------- lights


class Asked(NamedTuple):
    """Light samples of n points; colours and vectors are (n, 3), all float64."""

    light: np.ndarray
    wi: np.ndarray
    distance: np.ndarray
    pdf: np.ndarray  # of the direction and of the choice together; 0: no density
    weight: np.ndarray  # radiance over the density


@entry_kernel
def run_ask(lights, surfaces, position, x, y, light, wi, distance, pdf, radiance):
    probability = light_probability(lights, None)
    for i in range(0, x.size, 16):
        u, v = load_row(x, 0, i), load_row(y, 0, i)
        which, u = choose_light(lights, None, 1, 0, u, u)
        s = sample_light(lights, surfaces, which, load3(position, i), u, v, v)
        store_row(light, 0, i, which)
        store3(wi, i, s.wi)
        store_row(distance, 0, i, s.distance)
        store_row(pdf, 0, i, s.pdf * probability)
        store3(radiance, i, s.radiance * (1.0 / probability))


def ask(inputs: KernelScene, position: Any, x: Any, y: Any) -> Asked:
    """Ask one light of all from points (n, 3) with numbers x and y (n,)."""
    n = len(x)
    room = n + -n % 16
    p = np.zeros((3, room), np.float32)
    p[:, :n] = float32(position).T
    numbers = [np.pad(float32(a), (0, room - n), "edge") for a in (x, y)]
    light = np.empty(room, np.int32)
    wi, radiance = (np.empty((3, room), np.float32) for _ in range(2))
    distance, pdf = (np.empty(room, np.float32) for _ in range(2))
    run_ask(
        inputs.lights,
        inputs.surfaces,
        p,
        *numbers,
        light,
        wi,
        distance,
        pdf,
        radiance,
    )
    rows = (light, wi.T, distance, pdf, radiance.T)
    return Asked(light[:n], *(a[:n].astype(float) for a in rows[1:]))


@entry_kernel
def run_density(scene, areas, work, count, density):
    intersect(scene.accelerators, work.rays, work.hits, 0, count, False, None)
    found = collect(scene.stages, work.hits, 0, count, ANY, work.order, 0)
    points = work.points
    surface_points(scene, work.rays, work.hits, work.order, found, points)
    for i in range(0, found, 16):
        valid = first_lanes(found - i)
        light = gather_row(scene.shapes.light, 0, load_row(points.shape, 0, i), valid)
        wo, t = load3(points.wo, i), load_row(points.t, 0, i)
        flat, smooth = load3(points.normal, i), load3(points.shading_normal, i)
        light_pdf = pdf_area_light(
            areas,
            scene.surfaces,
            light,
            load_row(points.prim, 0, i),
            valid & (light >= 0),
            load3(points.position, i) + wo * t,
            t,
            fabs(dot(wo, density_normal(areas.replay, flat, smooth))),
        )
        store_row(density, 0, i, light_pdf)
    return found


def density_towards(inputs: KernelScene, origin: Any, direction: Any) -> np.ndarray:
    """Densities [1/sr] of light samples in directions (n, 3) that all hit a light."""
    parts = []
    for first in range(0, len(origin), CAPACITY):
        part = slice(first, first + CAPACITY)
        work, n = _at_rays(inputs, origin[part], direction[part])
        density = np.empty(CAPACITY, np.float32)
        found = run_density(inputs, inputs.lights.areas, work, n, density)
        assert found == n, "a ray missed"
        parts.append(density[:n].astype(float))
    return np.concatenate(parts)


# ---------------------------------------------------------------------------- directions


@entry_kernel
def run_scatter(scene, work, count, x, y, direction):
    """Directions that diffuse hits go on in, x and y by hit; the number of hits."""
    intersect(scene.accelerators, work.rays, work.hits, 0, count, False, None)
    found = collect(scene.stages, work.hits, 0, count, ANY, work.order, 0)
    points = work.points
    surface_points(scene, work.rays, work.hits, work.order, found, points)
    for i in range(0, found, 16):
        normal = load3(points.shading_normal, i)
        s, t = tangents_of(points.tangent, i, normal)
        front = dot(load3(points.wo, i), normal) > 0.0
        normal = select3(front, normal, -normal)
        wi, _ = sample_diffuse(
            scene.settings.replay, s, t, normal, load_row(x, 0, i), load_row(y, 0, i)
        )
        store3(direction, i, wi)
    return found


def scattered(inputs: KernelScene, origin: Any, direction: Any, x: Any, y: Any) -> Any:
    """Directions (n, 3) in which rays (n, 3) go on from what they hit; all must hit."""
    parts = []
    for first in range(0, len(origin), CAPACITY):
        part = slice(first, first + CAPACITY)
        found = seen(inputs, origin[part], direction[part], x[part], y[part])
        parts.append(found.direction.astype(float))
    return np.concatenate(parts)


class Seen(NamedTuple):
    """What a replay knows of hits, and where diffuse paths go on; float32, (n, 3)."""

    position: np.ndarray
    normal: np.ndarray
    shading_normal: np.ndarray
    uv: np.ndarray  # (n, 2)
    direction: np.ndarray


def seen(inputs: KernelScene, origin: Any, direction: Any, x: Any, y: Any) -> Seen:
    """What up to `CAPACITY` rays (n, 3) hit, and where they go on; all must hit."""
    work, n = _at_rays(inputs, origin, direction)
    numbers = [np.pad(float32(a), (0, -n % 16), "edge") for a in (x, y)]
    out = np.empty((3, n + -n % 16), np.float32)
    assert run_scatter(inputs, work, n, *numbers, out) == n, "a ray missed"
    points = work.points
    rows = (points.position, points.normal, points.shading_normal, points.uv, out)
    return Seen(*(row[:, :n].T.copy() for row in rows))
