"""Rays that leave a surface, in the 44 cases of Mitsuba's tests of its ray offset.

Those are eleven shapes at four places and sizes (its test_ray_offset, first test): a shape
is hit from four sizes away, rays leave into the hemisphere above each hit, and none may
meet anything nearer than a thousandth of the shape. Four of the shapes are not among this
renderer's; a similar one stands in for each, and its name says so.
"""

from __future__ import annotations

import functools
import tempfile
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.our_renderer.single_stages import locate_step, next_hit_step
from renderer.integrators.stages.surface import leave_surface
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.vectors import load3, store3
from renderer.kernels.records.batch import CAPACITY, make_workspace
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.tables.kernel_record import KernelInputs
from renderer.rendering.tables.render_mode import RenderMode
from reports.bench.steps import Step
from reports.trials.meshes import displaced_icosphere
from reports.trials.rays import directions

PLACES = ((0.0, 1.0), (1e3, 1.0), (0.0, 1e-3), (1e4, 1e3))  # (along each axis, size)
SHAPES = (
    "sphere",
    "cube",
    "cylinder",
    "disk",
    "rectangle",
    "instance",
    "sdfgrid",
    "triangles for ellipsoidsmesh",
    "implicit for ellipsoids",
    "implicit tube for linearcurve",
    "triangle tube for bsplinecurve",
)
OPEN = ("cylinder", "triangle tube for bsplinecurve", "implicit tube for linearcurve")
CASES = tuple((shape, *place) for shape in SHAPES for place in PLACES)
RAYS = 1 << 14  # of a case in a turn
AIM = len(CASES) * RAYS * 100  # rays that are sent at the shapes
NEAR = 1e-3  # of the shape: a hit nearer than this is the ray's own surface

Floats = NDArray[np.float64]


@entry_kernel
def leave_step(points, count, direction, origin):  # type: ignore[no-untyped-def]
    """Put into `origin` where rays start that leave the points along `direction`."""
    for i in range(0, count, 16):
        store3(origin, i, leave_surface(points, i, load3(direction, i)))


def self_hit_steps(
    done: int, deadline: float, cases: tuple[Any, ...] = CASES, rays: int = RAYS
) -> Generator[Step]:
    """Try case after case from ray number `done` on; `deadline` is of `time.monotonic`."""
    number = done // rays
    while time.monotonic() < deadline:
        turn, which = divmod(number, len(cases))
        shape, offset, size = cases[which]
        left, near = _tried(shape, offset, size, turn, rays)
        case = f"{shape} of size {size:g} at {offset:g}"
        fault = (f"{case}, turn {turn}: {near} of {left} rays hit their own surface",)
        yield Step(
            rays,
            {"rays that left a surface": left, "self hits": near, f"left: {shape}": left},
            faults=fault if near else (),
        )
        number += 1


def _tried(shape: str, offset: float, size: float, turn: int, rays: int) -> tuple[int, int]:
    """Return how many rays left the shape, and how many of them met it at once."""
    rng = np.random.default_rng([16, turn])
    inputs = _inputs(shape, offset, size)
    center = np.full(3, offset)
    start = center + 4.0 * size * directions(rays, rng)
    inner = size * 0.8 * np.cbrt(rng.random((rays, 1))) * directions(rays, rng)
    going = center + inner - start
    going /= np.linalg.norm(going, axis=1, keepdims=True)
    outgoing = directions(rays, rng)
    trial = _Trial(inputs)
    left = near = 0
    for first in range(0, rays, CAPACITY):
        part = slice(first, first + CAPACITY)
        more = trial.distances(start[part], going[part], outgoing[part], shape in OPEN)
        left += len(more)
        near += int((more < NEAR * size).sum())
    return left, near


class _Trial:
    """Room for a batch of rays; made and packed once, which costs as much as a batch."""

    def __init__(self, inputs: KernelInputs) -> None:
        bsdfs = inputs.record.bsdfs
        self._record = pack(inputs.record)
        self._work = make_workspace(
            ray_capacity=CAPACITY,
            capacity=CAPACITY,
            kinds=len(bsdfs.methods),
            parameters=len(bsdfs.values),
            previous_points=False,
        )
        self._packed = pack(self._work)
        self._packed_points = pack(self._work.points)

    def distances(
        self, start: Floats, going: Floats, outgoing: Floats, front: bool
    ) -> NDArray[np.float32]:
        """Return how far the rays get that leave where rays hit; infinity is no hit."""
        hits, points = self._work.hits, self._work.points
        hit = hits.prim[: self._traced(start, going)] >= 0
        n = self._traced(start[hit], going[hit])
        locate_step(self._record, self._packed, n)
        normal = points.normal[:, :n].T.astype(float)
        seen = (normal * points.wo[:, :n].T).sum(axis=1)
        above = (outgoing[hit] * normal).sum(axis=1) * seen
        away = outgoing[hit] * np.sign(above)[:, None]
        direction, origin = np.zeros_like(points.wo), np.zeros_like(points.wo)
        direction[:, :n] = away.T
        leave_step(self._packed_points, n, direction, origin)
        keep = seen > 0 if front else np.ones(n, bool)
        count = self._traced(origin[:, :n].T[keep], away[keep])
        return np.where(hits.prim[:count] >= 0, hits.t[:count], np.inf)

    def _traced(self, origin: Any, direction: Any) -> int:
        """Find the nearest hits of rays; return how many rays these are."""
        rays = self._work.rays
        rays.origin[:, : len(origin)] = np.asarray(origin, np.float32).T
        rays.direction[:, : len(origin)] = np.asarray(direction, np.float32).T
        next_hit_step(self._record, self._packed, len(origin))
        return len(origin)


@functools.cache
def _inputs(shape: str, offset: float, size: float) -> KernelInputs:
    """Return what the kernels get of the shape; addresses hold as long as it lives."""
    placed = renderer.translate([offset] * 3) @ renderer.scale(size)
    with tempfile.TemporaryDirectory() as folder:
        shapes = _shapes(shape, placed, Path(folder) / "mesh.obj")
        scene = renderer.load_dict(
            {"type": "scene", "camera": {"type": "perspective"}, **shapes}
        )
    return KernelInputs(scene, make_plan(scene, integrator="path"), "bvh", 0, RenderMode())


def _shapes(name: str, placed: Floats, mesh: Path) -> dict[str, Any]:
    """Return a shape of about unit size as `load_dict` takes it, placed.

    A mesh is written to the file that is given.
    """
    given: dict[str, Any] = {"type": name}
    shapes = {}
    if name == "instance":
        placed = placed @ renderer.rotate([1, 1, 0], 30)
        given["group"] = {"type": "ref", "id": "group"}
        shapes["group"] = {"type": "shapegroup", "id": "group", "cube": {"type": "cube"}}
    elif name == "sdfgrid":  # the level of a plane through the middle of the grid
        placed = placed @ renderer.translate([-0.5] * 3)
        z = np.linspace(-0.5, 0.5, 33, dtype=np.float32)[1::2]
        given["grid"] = np.broadcast_to(z[:, None, None, None], (16, 16, 16, 1))
    elif name == "cylinder":  # along x
        placed = placed @ renderer.translate([-0.5, 0, 0]) @ renderer.rotate([0, 1, 0], 90)
    elif name.startswith("implicit"):
        ball = "ellipsoids" in name
        given["type"] = "implicit"
        given["expression"] = "x*x + y*y + z*z - 1" if ball else "y*y + z*z - 0.25"
        given["bounds_min"], given["bounds_max"] = [-1.1] * 3, [1.1] * 3
    elif name.startswith("triangle"):
        mesh.write_text(_tube() if "tube" in name else _ball())
        given |= {"type": "obj", "filename": str(mesh)}
    return {**shapes, "shape": {**given, "to_world": placed}}


def _ball() -> str:
    mesh = displaced_icosphere(4)
    points = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    return _obj(points, mesh.faces)


def _tube() -> str:
    """Return an open tube of radius 1 around the x axis, 24 faces around."""
    k = np.arange(24)
    ring = np.stack((0.0 * k, np.cos(k * np.pi / 12), np.sin(k * np.pi / 12)), axis=1)
    after, half = (k + 1) % 24, np.array([1.5, 0.0, 0.0])
    faces = [np.stack((k, after + 24, k + 24), 1), np.stack((k, after, after + 24), 1)]
    return _obj(np.concatenate((ring - half, ring + half)), np.vstack(faces))


def _obj(points: Any, faces: Any) -> str:
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*point) for point in points]
    lines += ["f {} {} {}".format(*face) for face in faces + 1]
    return "\n".join(lines) + "\n"
