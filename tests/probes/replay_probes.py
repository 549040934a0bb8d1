"""Kernels that replay Mitsuba's choices, made callable from Python for the tests.

Compiled once for each kind of record they are given, see `kernel_probes`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from kernel_probes import Inputs, fill, float32, run_surface_points
from light_probes import light_kinds, sample_lights

from renderer.integrators.stages.surface import frame_at
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.functions import first_lanes
from renderer.kernels.lanes.memory import gather_row, load_row, store_row, store_where
from renderer.kernels.lanes.vectors import load3, store3
from renderer.kernels.records.batch import CAPACITY, Workspace
from renderer.plugins.bsdfs.diffuse import DIFFUSE
from renderer.plugins.bsdfs.kind import BsdfMethods, Numbers, sample_bsdf
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.lights.area import AreaLights
from renderer.plugins.sampling.numbers_and_warps import (
    choose_one,
    seen_from,
    to_local,
    to_world,
)
from renderer.plugins.shapes.surface import pdf_shape
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.tables.render_mode import mode_for
from renderer.replay.directions import AsMitsuba
from renderer.scene.scene import Scene


def replay_inputs(scene: Scene) -> Inputs:
    """What the kernels get for a replay of Mitsuba's path integrator."""
    plan = make_plan(scene, integrator="path", light_choice="uniform")
    plan = dataclasses.replace(plan, replay=True)
    return Inputs(scene, plan, way=mode_for(plan, None))


def _points_at(inputs: Inputs, origin: Any, direction: Any) -> tuple[Workspace, int]:
    """A workspace with the points that rays (n, 3) meet, and n; all must hit."""
    work = inputs.workspace()
    n = fill(work.rays, origin, direction)
    work.rays.previous[:] = work.rays.origin
    work.hits.t[:n] = np.inf
    work.hits.prim[:] = -1
    assert run_surface_points(inputs.packed, pack(work), n) == n, "a ray missed"
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
def run_choose(number, count, light, rest):
    for i in range(0, number.size, 16):
        chosen, left = choose_one(load_row(number, 0, i), count)
        store_row(light, 0, i, chosen)
        store_row(rest, 0, i, left)


def ask(inputs: Inputs, position: Any, x: Any, y: Any) -> Asked:
    """Ask one light of all from points (n, 3) with numbers x and y (n,).

    As in a replay x chooses the light, and what is left of it is the sample's own.
    """
    n = len(x)
    number = np.pad(float32(x), (0, -n % 16), "edge")
    light, rest = np.empty(number.size, np.int32), np.empty(number.size, np.float32)
    count = inputs.record.lights.count
    run_choose(number, count, light, rest)
    random = np.stack((rest[:n], float32(y), float32(y)))
    s = sample_lights(inputs, light[:n], float32(position), random)
    probability = np.float32(1.0 / count)
    rows = (s.wi.T, s.distance, s.pdf * probability, s.radiance.T / probability)
    return Asked(light[:n], *(a.astype(float) for a in rows))


@entry_kernel
def run_density(kind, shapes, points, count, density):
    """Write the density of those points that are on lights of a kind."""
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        light = gather_row(shapes.light, 0, load_row(points.shape, 0, i), valid)
        lamp = valid & (light >= 0)
        mine = lamp & (gather_row(kind.kind, 0, light, lamp) == kind.index)
        position, distance, cosine = seen_from(kind.arithmetic, points, i)
        prim, surfaces = load_row(points.prim, 0, i), kind.lights.surfaces
        pdf = pdf_shape(surfaces, kind, light, prim, mine, position, distance, cosine)
        store_where(density, 0, i, pdf, mine)


def density_towards(inputs: Inputs, origin: Any, direction: Any) -> np.ndarray:
    """Densities [1/sr] of light samples in directions (n, 3) that all hit a light."""
    shapes, parts = pack(inputs.scene.shapes), []
    for first in range(0, len(origin), CAPACITY):
        part = slice(first, first + CAPACITY)
        work, n = _points_at(inputs, origin[part], direction[part])
        density = np.full(CAPACITY, np.nan, np.float32)
        for kind in light_kinds(inputs):
            if isinstance(kind.record.lights, AreaLights):
                run_density(kind, shapes, pack(work.points), n, density)
        parts.append(density[:n].astype(float))
    return np.concatenate(parts)


# ---------------------------------------------------------------------------- directions


@entry_kernel
def run_directions(bsdf, points, count, x, y, direction):
    """Directions that diffuse hits go on in, x and y by hit."""
    for i in range(0, count, 16):
        frame = frame_at(bsdf, points, i)
        wo, u, v = load3(points.wo, i), load_row(x, 0, i), load_row(y, 0, i)
        parameters = parameters_at(bsdf.form, points, i)
        numbers = Numbers(u, v, v, bsdf.arithmetic)
        chosen = sample_bsdf(parameters, to_local(frame, wo), numbers)
        wi = to_world(bsdf.arithmetic, frame, chosen.wi)
        store3(direction, i, wi)


def scattered(inputs: Inputs, origin: Any, direction: Any, x: Any, y: Any) -> Any:
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


def seen(inputs: Inputs, origin: Any, direction: Any, x: Any, y: Any) -> Seen:
    """What up to `CAPACITY` rays (n, 3) hit, and where they go on; all must hit."""
    work, n = _points_at(inputs, origin, direction)
    numbers = [np.pad(float32(a), (0, -n % 16), "edge") for a in (x, y)]
    out = np.empty((3, n + -n % 16), np.float32)
    points, bsdf = work.points, pack(BsdfMethods(DIFFUSE.form(), AsMitsuba(0.0)))
    run_directions(bsdf, pack(points), n, *numbers, out)
    rows = (points.position, points.normal, points.shading_normal, points.uv, out)
    return Seen(*(row[:, :n].T.copy() for row in rows))
