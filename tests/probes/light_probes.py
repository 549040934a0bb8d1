"""Lights in Python: samples, densities, choices; one place for their signatures."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from kernel_probes import Inputs, float32
from numpy.typing import NDArray

import renderer
from renderer.kernels.jit import Packed, call, entry_kernel, pack
from renderer.kernels.lanes.functions import splat_mask
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3, store3
from renderer.kernels.records.batch import LightSamples, make_workspace
from renderer.kernels.records.kernel_scene import RECORD, SAMPLE_LIGHT
from renderer.plugins.lights.environment import environment_light
from renderer.plugins.lights.kind import LightKind
from renderer.plugins.sampling.numbers_and_warps import choose_one
from renderer.plugins.shapes.surface import pdf_shape
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.tables.render_mode import mode_for

Array = NDArray[np.float64]
AT_ONCE = 1 << 15  # points


@entry_kernel
def run_sample_lights(lights, work, count):
    """Sample the lights that `work.light_samples` names, with `work.numbers`."""
    for kind in range(lights.methods.shape[0]):
        call(
            lights.methods[kind, SAMPLE_LIGHT],
            lights.methods[kind, RECORD],
            (work.points, work.numbers, work.light_samples, count),
        )


@entry_kernel
def run_pdf_shape(kind, light, prim, position, distance, cosine, pdf):
    for i in range(0, light.size, 16):
        which, met = load_row(light, 0, i), load_row(prim, 0, i)
        r, cos = load_row(distance, 0, i), load_row(cosine, 0, i)
        where, surfaces = load3(position, i), kind.lights.surfaces
        density = pdf_shape(surfaces, kind, which, met, which >= 0, where, r, cos)
        store_row(pdf, 0, i, density)


@entry_kernel
def run_environment_light(kind, position, direction, radiance, pdf):
    for i in range(0, pdf.size, 16):
        at, wi = load3(position, i), load3(direction, i)
        color, density = environment_light(kind.lights, at, wi, splat_mask(True))
        store3(radiance, i, color)
        store_row(pdf, 0, i, density)


@entry_kernel
def run_choose_one(number, count, chosen):
    for i in range(0, number.size, 16):
        which, _ = choose_one(load_row(number, 0, i), count)
        store_row(chosen, 0, i, which)


def sample_lights(
    inputs: Inputs, light: NDArray[np.int32], position: Any, random: Any
) -> LightSamples:
    """Sample the lights (n,) from positions (n, 3), or one, with numbers (3, n)."""
    n = len(light)
    where = np.broadcast_to(position, (n, 3))
    work = make_workspace(capacity=AT_ONCE)
    lights, packed = pack(inputs.record.lights), pack(work)
    parts = []
    for first in range(0, n, AT_ONCE):
        part = slice(first, min(n, first + AT_ONCE))
        count = part.stop - first
        work.points.position[:, :count] = where[part].T
        work.numbers[:3, :count] = random[:, part]
        work.light_samples.light[:count] = light[part]
        run_sample_lights(lights, packed, count)
        parts.append([row[..., :count].copy() for row in work.light_samples])
    return LightSamples(*(np.concatenate(p, axis=-1) for p in zip(*parts, strict=True)))


def light_kinds(inputs: Inputs) -> list[Packed]:
    """Return the records of all kinds of lights, as their kernels are given them."""
    kinds = [p for p in inputs.tables.kept if isinstance(p.record, LightKind)]
    assert [packed.record.index for packed in kinds] == list(range(len(kinds)))
    return kinds


def environment_from(kind: Packed, position: Any, direction: Any) -> tuple[Array, Array]:
    """Return radiance (n, 3) and density (n,) of an environment at a place, from (n, 3)."""
    n = len(direction)
    wi = np.pad(float32(np.asarray(direction).T), ((0, 0), (0, -n % 16)), "edge")
    at = np.broadcast_to(np.asarray(position)[:, None], wi.shape)
    radiance, pdf = np.empty_like(wi), np.empty(wi.shape[1], np.float32)
    run_environment_light(kind, float32(at), wi, radiance, pdf)
    return radiance[:, :n].T.astype(float), pdf[:n].astype(float)


class Sampled(NamedTuple):
    """n directions to a light, float64."""

    wi: Array  # (n, 3)
    radiance: Array  # (n, 3) over the density
    distance: Array  # (n,)
    pdf: Array  # (n,) [1/sr]


class LightProbe:
    """A scene of lights of many kinds, called one light at a time.

    Parameters
    ----------
    shapes, emitters : dict
        Area lights, with the emitter if it is another than that of `radiance`, and other
        lights, by name, as in `load_dict`.
    radiance : tuple of 3 floats
        Of all area lights.
    replay : bool
        Whether lights are sampled as in a replay of Mitsuba.
    """

    def __init__(
        self,
        shapes: dict[str, Any],
        emitters: dict[str, Any],
        radiance: tuple[float, float, float],
        *,
        replay: bool = False,
    ) -> None:
        shine = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
        shining = {name: {"emitter": shine, **shape} for name, shape in shapes.items()}
        camera = {"type": "perspective"}
        content = {"type": "scene", "camera": camera, **shining, **emitters}
        self.scene = renderer.load_dict(content)
        plan = make_plan(self.scene, integrator="path", light_choice="uniform")
        plan = dataclasses.replace(plan, replay=replay)
        self.inputs = Inputs(self.scene, plan, way=mode_for(plan, None))
        self.surfaces = self.inputs.tables.surfaces
        self.names = [*shapes, *emitters]

    def prims(self, name: str) -> NDArray[np.int64]:
        """Return the primitive ids of a light's shape."""
        return np.flatnonzero(self.scene.shape == self.names.index(name))

    def _light(self, name: str, n: int) -> NDArray[np.int32]:
        return np.full(n, self.names.index(name), np.int32)

    def sample(self, name: str, position: Any, random: Any) -> Sampled:
        """Sample a light from one position or n of them with numbers (3, n)."""
        light = self._light(name, np.shape(random)[1])
        s = sample_lights(self.inputs, light, position, random)
        return Sampled(*(a.T.astype(float) for a in (s.wi, s.radiance, s.distance, s.pdf)))

    def density(
        self, name: str, position: Any, prim: Any, distance: Any, cosine: Any
    ) -> Array:
        """Return `pdf_shape` [1/sr] of directions that meet a light.

        Given are the primitive, the distances and |cosines| there, (n,) each.
        """
        n = len(distance)
        pad = (0, -n % 16)
        where = np.pad(float32(np.broadcast_to(position, (n, 3)).T), ((0, 0), pad), "edge")
        r, cos = (np.pad(float32(a), pad, "edge") for a in (distance, cosine))
        pdf = np.empty(n + -n % 16, np.float32)
        met = np.pad(np.broadcast_to(np.int32(prim), n), pad, "edge")
        light = self._light(name, pdf.size)
        kind = light_kinds(self.inputs)[self.inputs.record.lights.kind[light[0]]]
        run_pdf_shape(kind, light, met, where, r, cos, pdf)
        return pdf[:n].astype(float)

    def environment(self, name: str, direction: Any) -> tuple[Array, Array]:
        """Return radiance (n, 3) and density (n,) of an environment from (n, 3)."""
        light = self.names.index(name)
        kind = light_kinds(self.inputs)[self.inputs.record.lights.kind[light]]
        return environment_from(kind, np.zeros(3), direction)

    def choices(self, number: Any) -> NDArray[np.int32]:
        """Return the light that each of 16 k numbers chooses."""
        light = np.empty(len(number), np.int32)
        run_choose_one(float32(number), self.inputs.record.lights.count, light)
        return light


# -------------------------------------------------------- importance, in double precision

LEAST_REACH = 0.01  # [rad]


class Bounds(NamedTuple):
    """A ball that holds the light, and the cone that it shines into.

    It shines in full within the angle `spread` of the axis, then as the cosine of the angle
    from there, and not at all `reach` farther on [rad].
    """

    strength: float  # [W/sr], mean of RGB; at infinity the irradiance
    center: Array
    radius: float
    axis: Array  # at infinity towards the light
    spread: float
    reach: float
    at_infinity: bool = False


def importance(bounds: Bounds, p: Array, n: Array) -> float:
    """Return what a light can give at a point p with normal n.

    Strength / max(d^2, r^2), times the cosines at the light and at the surface, both with
    the sine of the half angle under which the ball is seen added.
    """
    if bounds.at_infinity:
        if bounds.spread > 0.5 * math.pi:
            return bounds.strength
        return bounds.strength * _clipped(float(bounds.axis @ n) + math.sin(bounds.spread))
    to_light = bounds.center - p
    d2 = float(to_light @ to_light)
    reached = max(d2, bounds.radius**2)
    to_light, ball = to_light / math.sqrt(reached), bounds.radius / math.sqrt(reached)
    at_light = math.cos(max(_angle(-float(bounds.axis @ to_light)) - bounds.spread, 0.0))
    at_light = 1.0 if d2 <= bounds.radius**2 else min(at_light + ball, 1.0)
    if at_light <= math.cos(max(bounds.reach, LEAST_REACH)):
        return 0.0
    at_surface = _clipped(float(n @ to_light) + ball)
    return bounds.strength * at_light * at_surface / reached


def _clipped(x: float) -> float:
    return min(max(x, 0.0), 1.0)


def _angle(cosine: float) -> float:
    return math.acos(min(max(cosine, -1.0), 1.0))


def at(x, linear=None):
    matrix = np.eye(4)
    matrix[:3, 3] = x, 0, 0
    if linear is not None:
        matrix[:3, :3] = linear
    return matrix


SPACING = 12.0
AREA_SHAPES = {
    "rectangle": {"type": "rectangle", "to_world": at(0)},
    "disk": {"type": "disk", "to_world": at(SPACING)},
    "sphere": {"type": "sphere", "to_world": at(2 * SPACING)},
    "lamp": {"type": "sphere", "to_world": at(3 * SPACING), "flip_normals": True},
    "cube": {"type": "cube", "to_world": at(4 * SPACING, np.diag([1, 0.5, 0.25]))},
    "cylinder": {"type": "cylinder", "to_world": at(5 * SPACING, np.diag([0.5, 0.5, 2]))},
    "ellipse": {"type": "disk", "to_world": at(6 * SPACING, np.diag([1.5, 0.5, 1]))},
    "mirrored": {"type": "rectangle", "to_world": at(7 * SPACING, np.diag([-1, 1, 1]))},
    "flipped": {"type": "rectangle", "to_world": at(8 * SPACING), "flip_normals": True},
}
TILT = np.array([[1, 0, 0], [0, 0.6, 0.8], [0, -0.8, 0.6]])
OTHERS = {
    "point": {"type": "point", "position": [1.0, 2.0, 3.0]},
    "spot": {
        "type": "spot",
        "to_world": at(2, TILT),
        "cutoff_angle": 40.0,
        "beam_width": 25.0,
    },
    "directional": {"type": "directional", "direction": [1.0, 2.0, -3.0]},
    "constant": {"type": "constant"},
}
